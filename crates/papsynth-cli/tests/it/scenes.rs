//! Scenes written, edited and rendered.

use std::fs;

use serde_json::Value;

use crate::support::{Bench, TINY};

/// Size, colour type, bit depth and samples of a PNG.
fn pixels(bench: &Bench, name: &str) -> (png::OutputInfo, Vec<u8>) {
    let file = std::io::BufReader::new(fs::File::open(bench.path(name)).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut samples = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut samples).unwrap();
    (info, samples)
}

#[test]
fn an_unchanged_scene_gives_the_same_pixels() {
    let bench = Bench::new("scenes");
    for (name, more, image) in [
        ("plain", "", "images"),
        ("colour", "--set light.kind=colour --set camera.bits=8", "images"),
        ("stack", "--set focus.planes=3 --set focus.step_um=1.5", "all-in-focus"),
    ] {
        let run = format!("generate --out {name} --frames 2 --seed 11 --scenes {more} {TINY}");
        bench.good(&run);
        for index in 0..2 {
            let scene = format!("{name}/scenes/{index:06}.json");
            bench.good(&format!("render {name}/recipe.toml --model {name}/model.json --scene {scene} --out again.png"));
            let original = format!("{name}/{image}/{index:06}.png");
            assert!(pixels(&bench, "again.png") == pixels(&bench, &original), "{name} {index}");
        }
        // Scenes belong to the data set: they are verified and repaired.
        bench.good(&format!("verify {name} --frames 2"));
        let path = bench.path(&format!("{name}/scenes/000001.json"));
        let good = fs::read(&path).unwrap();
        fs::write(&path, b"{}").unwrap();
        assert_eq!(bench.run(&format!("verify {name} --frames 2")).code, 2);
        bench.good(&run);
        assert!(fs::read(&path).unwrap() == good);
    }
}

#[test]
fn an_edited_scene_is_rendered_and_an_invalid_one_is_rejected_by_object_and_field() {
    let bench = Bench::new("edited-scenes");
    bench.good(&format!("generate --out set --frames 1 --scenes {TINY}"));
    let text = fs::read_to_string(bench.path("set/scenes/000000.json")).unwrap();
    let mut scene: Value = serde_json::from_str(&text).unwrap();
    let mut render = |field: &str, to: Value| {
        let before = scene["objects"][0][field].clone();
        scene["objects"][0][field] = to;
        fs::write(bench.path("edited.json"), scene.to_string()).unwrap();
        scene["objects"][0][field] = before;
        bench.run("render set/recipe.toml --scene edited.json --out edited.png")
    };
    assert_eq!(render("centre_um", vec![4.0, 4.0].into()).code, 0);
    assert!(pixels(&bench, "edited.png") != pixels(&bench, "set/images/000000.png"));
    for (field, to, said) in [
        ("depth_um", Value::from("deep"), "objects[0] (id 1): depth_um: expected a number, found \"deep\""),
        ("centre_um", vec![1e300, 0.0].into(), "objects[0] (id 1): centre_um: 1e300 is out of range"),
        ("colour", "red".into(), "objects[0] (id 1): unknown field `colour`"),
        ("id", Value::Null, "objects[0] (id null)"),
    ] {
        let run = render(field, to);
        assert!(run.code == 2 && run.err.contains(said), "{field}: {}", run.err);
    }
}
