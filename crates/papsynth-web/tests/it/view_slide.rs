//! Tests of the viewer of slides against the engine.

#![cfg(feature = "zarr")]

use std::fs;
use std::sync::atomic::AtomicBool;

use crate::support::Scratch;
use crate::support::view::{Pixels, SEED, assembled, get, half, json as ask};
use papsynth::model::Model;
use papsynth::truth::Group;
use papsynth::{Engine, Inputs, Threads};
use papsynth_dataset::slide::{SlideInfo, SlideRun, SlideSet};
use papsynth_dataset::{Check, Task};
use papsynth_web::Viewer;
use serde_json::json;

#[test]
fn an_incomplete_slide_is_shown() {
    let scratch = Scratch::new("slide");
    let path = scratch.join("slide");
    let mut recipe = papsynth::recipe::Recipe::default();
    (recipe.scan.width_px, recipe.scan.height_px, recipe.scan.frame_px) = (1300, 700, 512);
    recipe.scan.deposit.radius_um = 60_000.0.into();
    let model = Model::builtin();
    let engine = Engine::new(&recipe, &model, &Inputs::default()).unwrap();
    let slide = engine.slide(SEED, 0).unwrap();
    let info = SlideInfo { recipe: &recipe, model: &model, seed: SEED, shard_px: 512, objects_parquet: false };
    let set = SlideSet::create_or_resume(&path, &slide, &info).unwrap();
    let stop = AtomicBool::new(false);
    let make = |share: Task| {
        let run = SlideRun { task: share, threads: Threads::All, check: Check::Sizes, stop: &stop };
        assert!(!set.generate(&slide, &run, &|_| ()).unwrap());
    };
    make(Task { index: 1, total: 2 });
    let mut view = Viewer::open(&path).unwrap();
    assert_eq!(view.kind(), "slide");
    let image = ask(&mut view, "/image/0");
    assert_eq!((&image["levels"], &image["tile"]), (&json!(1), &json!(512)), "the upper levels come last");
    // Every other shard is missing, and with it the margins of the others.
    for layer in ["tile/0/0", "label/0/nucleus"] {
        let status = |view: &mut Viewer, name: &str| get(view, &format!("/{layer}/0/{name}.png")).status;
        assert_eq!(status(&mut view, "0-0"), 404, "{layer}");
        assert_eq!(status(&mut view, "0-1"), 200, "{layer}");
        assert_eq!(status(&mut view, "1-0"), 200, "{layer}");
    }
    assert_eq!(get(&mut view, "/at/0/5/5").status, 404);
    make(Task::ALL);
    set.finish(Check::Sizes).unwrap();
    let image = ask(&mut view, "/image/0");
    assert_eq!(image["levels"], json!(3));
    assert_eq!(ask(&mut view, "/info")["images"], 1);
    let whole = slide.picture([0, 0], [1300, 700], Threads::All).unwrap();
    let bytes = whole.planes[0].grey.iter().map(|&grey| u8::try_from(grey).unwrap()).collect();
    let mut expected = Pixels { width: 1300, height: 700, channels: 1, bytes };
    for level in 0..3 {
        assert!(assembled(&mut view, &image, "tile/0/0", level) == expected, "{level}");
        expected = half(&expected);
    }
    for (group, labels) in Group::ALL.into_iter().zip(&whole.labels) {
        for level in 0..3 {
            let step = 1 << level;
            let found = assembled(&mut view, &image, &format!("label/0/{}", group.name()), level);
            let id = |x: usize, y: usize| labels.ids[y * step * 1300 + x * step];
            for (y, x) in (0..found.height).flat_map(|y| (0..found.width).map(move |x| (y, x))) {
                let four = [[x.wrapping_sub(1), y], [x + 1, y], [x, y.wrapping_sub(1)], [x, y + 1]];
                let is_edge = four.iter().any(|&[i, j]| i < found.width && j < found.height && id(i, j) != id(x, y));
                let opacity = found.at(x, y)[3];
                assert_eq!([opacity > 0, opacity == 255], [id(x, y) > 0, id(x, y) > 0 && is_edge], "{level} {x} {y}");
            }
        }
        let at = labels.ids.iter().position(|id| *id > 0).unwrap();
        let under = ask(&mut view, &format!("/at/0/{}/{}", at % 1300, at / 1300));
        let objects = under["objects"].as_array().unwrap();
        assert!(objects.iter().any(|o| o["id"] == labels.ids[at] && o["group"] == group.name()), "{under}");
    }
    for target in
        ["/tile/0/1/0/0-0.png", "/tile/0/0/3/0-0.png", "/tile/0/0/0/2-0.png", "/tile/1/0/0/0-0.png", "/at/0/1300/0"]
    {
        assert_eq!(get(&mut view, target).status, 404, "{target}");
    }
    // A damaged shard is reported; the next one is shown.
    let shard = path.join("slide.ome.zarr/0/c/0/0");
    let bytes = fs::read(&shard).unwrap();
    for broken in [&bytes[..bytes.len() / 2], b""] {
        fs::write(&shard, broken).unwrap();
        assert_eq!(get(&mut view, "/tile/0/0/0/0-0.png").status, 500);
        assert_eq!(get(&mut view, "/tile/0/0/0/0-1.png").status, 200);
    }
}
