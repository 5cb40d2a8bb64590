//! Tests of the viewer of data sets against the frames that were written.

use std::collections::BTreeMap;
use std::fs;

use crate::support::Scratch;
use crate::support::view::{Pixels, assembled, get, half, json as ask, recipe, write};
use papsynth::Frame;
use papsynth::truth::{Group, LabelMap};
use papsynth_dataset::Format;
use papsynth_web::{Request, Site, Viewer};
use serde_json::{Value, json};

const STACK: &str = "[focus]\nplanes = 3\nstep_um = 2.0\n";

/// Returns a plane as 8-bit values.
fn expected(frame: &Frame, plane: usize) -> Pixels {
    let (view, plane) = (frame.finished.scene.view, &frame.planes[plane]);
    let white = (1_u32 << frame.finished.scene.camera.bits) - 1;
    let bytes = plane.grey.iter().map(|&grey| u8::try_from((u32::from(grey) * 255 + white / 2) / white).unwrap());
    Pixels { width: view.width, height: view.height, channels: plane.channels, bytes: bytes.collect() }
}

#[test]
fn tiles_are_the_pixels_of_every_plane_in_every_format() {
    let cases = [
        ("folder", vec![Format::Folder], "", 0),
        ("stack", vec![Format::Folder], STACK, 3),
        ("tar", vec![Format::Webdataset], STACK, 3),
        ("tiff", vec![Format::OmeTiff], STACK, 3),
        ("flat", vec![Format::Cellpose], "", 0),
        ("colour", vec![Format::Stardist], "[light]\nkind = \"colour\"\n", 0),
        ("deep", vec![Format::Folder], "[camera]\nbits = 12\n", 0),
    ];
    for (name, formats, settings, planes) in cases {
        let scratch = Scratch::new(&format!("tiles-{name}"));
        // More frames than the cache holds, where that is cheap.
        let count = if name == "folder" { 5 } else { 2 };
        let frames = write(&scratch.join("set"), &recipe(settings), &formats, count);
        let mut view = Viewer::open(&scratch.join("set")).unwrap();
        let info = ask(&mut view, "/info");
        assert_eq!(
            info,
            json!({ "title": "set", "kind": "data set", "images": count, "groups": ["cytoplasm", "nucleus", "debris"] })
        );
        for number in (0..frames.len()).chain([0]) {
            let image = ask(&mut view, &format!("/image/{number}"));
            assert_eq!((&image["width"], &image["levels"], &image["tile"]), (&json!(300), &json!(2), &json!(256)));
            let planes_um: Vec<f64> = serde_json::from_value(image["planes_um"].clone()).unwrap();
            assert_eq!(planes_um, frames[number].finished.scene.planes_um, "{name}");
            for plane in (0..planes.max(1)).rev() {
                let whole = assembled(&mut view, &image, &format!("tile/{number}/{plane}"), 0);
                assert!(whole == expected(&frames[number], plane), "{name} {number} {plane}");
                let next = assembled(&mut view, &image, &format!("tile/{number}/{plane}"), 1);
                assert!(next == half(&whole), "{name} {number} {plane}");
            }
            assert_eq!(get(&mut view, &format!("/tile/{number}/{}/0/0-0.png", planes.max(1))).status, 404);
        }
    }
}

#[test]
fn a_stack_without_planes_is_one_image() {
    let scratch = Scratch::new("sharp");
    let frames = write(&scratch.join("set"), &recipe(STACK), &[Format::YoloSeg], 1);
    let mut view = Viewer::open(&scratch.join("set")).unwrap();
    let image = ask(&mut view, "/image/0");
    assert_eq!(image["planes_um"], json!([]));
    let whole = assembled(&mut view, &image, "tile/0/0", 0);
    let sharp = &frames[0].finished.all_in_focus;
    let far = whole.bytes.iter().zip(sharp).filter(|(byte, sharp)| (f32::from(**byte) - **sharp).abs() > 0.51).count();
    assert_eq!(far, 0);
    assert_eq!(get(&mut view, "/tile/0/1/0/0-0.png").status, 404);
}

/// Checks opacity and colour of every label pixel against a direct implementation.
fn check_labels(found: &Pixels, ids: &LabelMap, step: usize, colours: &mut BTreeMap<u32, Vec<u8>>) {
    let id = |x: usize, y: usize| ids.ids[y * step * ids.width + x * step];
    for (y, x) in (0..found.height).flat_map(|y| (0..found.width).map(move |x| (y, x))) {
        let (pixel, own) = (found.at(x, y), id(x, y));
        if own == 0 {
            assert_eq!(pixel, [0; 4], "{x} {y}");
            continue;
        }
        assert_eq!(colours.entry(own).or_insert_with(|| pixel[..3].to_vec()), &pixel[..3], "{x} {y}");
        let four = [[x.wrapping_sub(1), y], [x + 1, y], [x, y.wrapping_sub(1)], [x, y + 1]];
        let is_edge = four.iter().any(|&[x, y]| x < found.width && y < found.height && id(x, y) != own);
        assert_eq!(pixel[3] == 255, is_edge, "{x} {y}");
        assert!(pixel[3] > 0, "{x} {y}");
    }
}

#[test]
fn labels_and_objects_at_a_pixel_match_the_ground_truth() {
    let scratch = Scratch::new("labels");
    let frames = write(&scratch.join("set"), &recipe(STACK), &[Format::Webdataset], 3);
    let mut view = Viewer::open(&scratch.join("set")).unwrap();
    let mut counts = [0_usize; 4];
    for (number, frame) in frames.iter().enumerate() {
        let truth = &frame.finished.truth;
        let image = ask(&mut view, &format!("/image/{number}"));
        let mut colours = BTreeMap::new();
        for group in Group::ALL {
            for level in 0..2 {
                let layer = format!("label/{number}/{}", group.name());
                let found = assembled(&mut view, &image, &layer, level);
                check_labels(&found, &truth.labels(group), 1 << level, &mut colours);
            }
        }
        assert!(colours.len() > 3, "{}", colours.len());
        for (x, y) in (0..truth.height).step_by(17).flat_map(|y| (0..truth.width).step_by(13).map(move |x| (x, y))) {
            let answer = ask(&mut view, &format!("/at/{number}/{x}/{y}"));
            let pixel = y * truth.width + x;
            let holds = |mask: &papsynth::truth::Mask| mask.pixels(truth.width).any(|own| own == pixel);
            let due: Vec<_> = truth.objects.iter().filter(|object| holds(&object.amodal)).collect();
            let objects = answer["objects"].as_array().unwrap();
            assert_eq!(objects.len(), due.len(), "{x} {y}");
            counts[due.len().min(3)] += 1;
            let mut before = f64::INFINITY;
            for object in objects {
                let own = due
                    .iter()
                    .find(|own| object["id"] == own.id && object["part"] == serde_json::to_value(own.part).unwrap());
                let own = own.unwrap();
                assert_eq!(object["class"], own.class.as_str());
                assert_eq!(object["visible"], holds(&own.visible));
                let depth = object["depth_um"].as_f64().unwrap();
                assert!((depth - own.depth_um).abs() < 1e-9 && depth <= before);
                assert_eq!(object["defocus_um"].as_array().unwrap().len(), 3);
                before = depth;
            }
        }
    }
    assert!(counts[1..].iter().all(|count| *count > 0), "{counts:?}");
}

#[test]
fn every_request_gets_a_reply() {
    let scratch = Scratch::new("targets");
    write(&scratch.join("set"), &recipe(STACK), &[Format::Folder], 1);
    let mut view = Viewer::open(&scratch.join("set")).unwrap();
    let huge = "9".repeat(16_000);
    let deep = "/tile".repeat(3000);
    for target in [
        "",
        "/x",
        "//",
        "/.",
        "/..",
        "/../manifest.json",
        "/manifest.json",
        "/info/",
        "/info?x",
        "/INFO",
        "/view.js/..",
        "*",
        "/image",
        "/image/",
        "/image/1",
        "/image/-1",
        "/image/+0",
        "/image/0x0",
        "/image/ 0",
        "/image/0/..",
        "/image/999999999",
        "/image/18446744073709551616",
        "/image/\u{662}",
        "/image/0\0",
        "/image/%30",
        "/tile/0/0/0",
        "/tile/0/0/0/0-0",
        "/tile/0/0/0/0-0.PNG",
        "/tile/0/0/0/-0.png",
        "/tile/0/0/0/0-.png",
        "/tile/0/0/0/.png",
        "/tile/0/0/0/0-2.png",
        "/tile/0/0/0/2-0.png",
        "/tile/0/0/2/0-0.png",
        "/tile/0/0/1/1-0.png",
        "/tile/0/3/0/0-0.png",
        "/tile/0/0/64/0-0.png",
        "/tile/0/0/999999999/0-0.png",
        "/tile/0/0/0/999999999-999999999.png",
        "/tile/1/0/0/0-0.png",
        "/tile/0/999999999/0/0-0.png",
        "/tile/0/-1/0/0-0.png",
        "/tile/../../0/0-0.png",
        "/tile/0/0/0/..%2f0-0.png",
        "/tile/0/0/0/0-0-0.png",
        "/tile/0/0/0/0-0.png/",
        "/tile/0/0/0/0-0.png?",
        "/tile/0/0/0/1e3-0.png",
        "/label/0/cell/0/0-0.png",
        "/label/0//0/0-0.png",
        "/label/0/../0/0-0.png",
        "/label/0/nucleus/2/0-0.png",
        "/label/0/nucleus/0/0-2.png",
        "/label/1/nucleus/0/0-0.png",
        "/label/0/Nucleus/0/0-0.png",
        "/label/0/nucleus/0/0-0.png.png",
        "/at/0/300/0",
        "/at/0/0/270",
        "/at/0/-1/0",
        "/at/0/0",
        "/at/0/0/0/0",
        "/at/1/0/0",
        "/at/0/1.5/0",
        "/at/0/NaN/0",
        "/at/0/999999999/999999999",
        &format!("/image/{huge}"),
        &format!("/at/0/{huge}/0"),
        &deep,
        "/\u{e9}\u{20ac}",
    ] {
        let reply = get(&mut view, target);
        let shown = target.chars().take(50).collect::<String>();
        assert!(matches!(reply.status, 400 | 404), "{shown}: {}", reply.status);
        let said: Value = serde_json::from_slice(&reply.body).unwrap();
        assert!(said["error"].as_str().is_some_and(|message| !message.is_empty() && message.len() < 200), "{shown}");
    }
    for method in ["POST", "PUT", "DELETE", "HEAD", "OPTIONS", "", "get"] {
        let reply = view.reply(&Request { method, target: "/info", ..Request::default() });
        assert_eq!((reply.status, reply.allow), (405, Some("GET")), "{method}");
    }
    assert_eq!(get(&mut view, "/tile/0/2/0/1-1.png").status, 200);
}

#[test]
fn a_damaged_file_is_reported_and_others_are_shown() {
    let scratch = Scratch::new("damaged");
    let set = scratch.join("set");
    write(&set, &recipe(""), &[Format::Folder], 6);
    let files = [
        (0, "images/000000.png", "/tile/0/0/0/0-0.png"),
        (1, "images/000001.png", "/tile/1/0/0/0-0.png"),
        (2, "shards/000002.coco.json", "/label/2/nucleus/0/0-0.png"),
        (3, "shards/000003.coco.json", "/at/3/5/5"),
        (4, "shards/000004.json", "/image/4"),
    ];
    for (number, name, target) in files {
        let path = set.join(name);
        let bytes = fs::read(&path).unwrap_or_else(|error| panic!("{name}: {error}"));
        let mut view = Viewer::open(&set).unwrap();
        let kept = [&bytes[..bytes.len() / 2], b"", b"{}", &[0xff; 99]];
        for broken in kept {
            fs::write(&path, broken).unwrap();
            let reply = get(&mut view, target);
            let said = String::from_utf8(reply.body.to_vec()).unwrap();
            assert!(
                reply.status == 500 && said.contains(name.rsplit('/').next().unwrap()),
                "{name}: {} {said}",
                reply.status
            );
            assert_eq!(get(&mut view, "/tile/5/0/0/0-0.png").status, 200);
            assert_eq!(get(&mut view, "/info").status, 200);
        }
        fs::write(&path, &bytes).unwrap();
        assert_eq!(get(&mut view, target).status, 200, "{name} {number} mended");
    }
    // The image of another frame, with another size.
    let mut narrow = recipe("");
    narrow.field.width_px = 200.0.into();
    write(&scratch.join("small"), &narrow, &[Format::Folder], 1);
    fs::copy(scratch.join("small/images/000000.png"), set.join("images/000001.png")).unwrap();
    let mut view = Viewer::open(&set).unwrap();
    let reply = get(&mut view, "/tile/1/0/0/0-0.png");
    assert!(reply.status == 500 && String::from_utf8_lossy(&reply.body).contains("200 x 270"), "{reply:?}");
}

#[test]
fn the_page_loads_nothing_from_other_servers() {
    let scratch = Scratch::new("page");
    write(&scratch.join("set"), &recipe(""), &[Format::Folder], 1);
    let mut view = Viewer::open(&scratch.join("set")).unwrap();
    for (target, content_type) in [
        ("/", "text/html"),
        ("/base.css", "text/css"),
        ("/base.js", "text/javascript"),
        ("/view.css", "text/css"),
        ("/tiles.js", "text/javascript"),
        ("/view.js", "text/javascript"),
    ] {
        let reply = get(&mut view, target);
        assert!(reply.status == 200 && reply.content_type.starts_with(content_type));
        let text = String::from_utf8(reply.body.to_vec()).unwrap();
        for word in ["http://", "https://", "//cdn", "@import", "url(", "eval(", "innerHTML", " style="] {
            assert!(!text.contains(word), "{target}: {word}");
        }
    }
}

#[test]
fn a_folder_without_data_set_is_reported() {
    let scratch = Scratch::new("stranger");
    let error = |name: &str| Viewer::open(&scratch.join(name)).err().unwrap();
    assert!(error("missing").to_string().contains("no such folder"));
    fs::create_dir(scratch.join("empty")).unwrap();
    assert!(error("empty").to_string().contains("neither a data set nor a slide"));
    fs::create_dir(scratch.join("broken")).unwrap();
    fs::write(scratch.join("broken/manifest.json"), "{").unwrap();
    assert!(error("broken").to_string().contains("manifest.json"));
    fs::create_dir(scratch.join("slide")).unwrap();
    fs::write(scratch.join("slide/slide.json"), "{").unwrap();
    let said = error("slide").to_string();
    let due = if cfg!(feature = "zarr") { "slide.json" } else { "--features zarr" };
    assert!(said.contains(due), "{said}");
    assert!(!error("slide").is_io());
}
