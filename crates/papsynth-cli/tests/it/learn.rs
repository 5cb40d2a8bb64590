//! `papsynth learn`: models of classes and of the texture of cytoplasm, and their use.

use std::fs;

use crate::support::{self, Bench, TINY};

#[test]
fn a_class_is_learned_from_outlines_and_used() {
    let bench = Bench::new("learn");
    fs::write(bench.path("cells.csv"), support::outlines(12, 100, 80.0)).unwrap();
    let run =
        bench.good("learn --class wobbly --like intermediate --outlines cells.csv --pixel-um 0.25 --out model.json");
    assert!(run.out.contains("class `wobbly`") && run.out.contains("12 outlines of cells"), "{}", run.out);
    let model = papsynth::model::Model::from_json(&fs::read_to_string(bench.path("model.json")).unwrap()).unwrap();
    assert!(model.classes.contains_key("wobbly"));
    assert!(model.provenance.iter().any(|p| p.class == "wobbly" && p.count == 12 && p.source == "cells.csv"));
    bench.good(&format!("generate --model model.json --out out --frames 1 {TINY} --set cells.wobbly.count=1"));
    // A model of another version is refused by name.
    let text = fs::read_to_string(bench.path("model.json")).unwrap().replacen("\"version\":1", "\"version\":9", 1);
    fs::write(bench.path("future.json"), text).unwrap();
    let run = bench.run(&format!("generate --model future.json --out out2 --frames 1 {TINY}"));
    assert_eq!(run.code, 2);
    assert!(run.err.contains("future.json") && run.err.contains('9'), "{}", run.err);
    // Broken outlines are named by their line.
    fs::write(bench.path("bad.csv"), "outline,k,x_px,y_px\n1,0,0,0\n1,1,nan,0\n").unwrap();
    let run = bench.run("learn --class intermediate --outlines bad.csv --pixel-um 0.25 --out no.json");
    assert_eq!(run.code, 2);
    assert!(run.err.contains("bad.csv") && run.err.contains("line 3"), "{}", run.err);
    assert!(!bench.path("no.json").exists());
}

#[test]
fn the_texture_of_cytoplasm_is_learned_from_fields_and_used() {
    let bench = Bench::new("learn-cytoplasm");
    fs::create_dir_all(bench.path("fields")).unwrap();
    // A large pale sheet with coarse grains on an empty slide.
    let grain = |x: u32, y: u32| u8::try_from(((x / 2) * 7919 + (y / 2) * 104_729 + (x / 2) * (y / 2)) % 17).unwrap();
    for name in ["fields/a.png", "fields/b.png"] {
        bench.grey_png(
            name,
            420,
            300,
            |x, y| if x > 90 && y > 10 { 165 + grain(x, y) } else { 228 + (grain(y, x) / 8) },
        );
    }
    let run = bench.good("learn --cytoplasm fields --pixel-um 0.33 --out model.json");
    assert!(run.out.contains("texture of cytoplasm from 2 fields"), "{}", run.out);
    let model = papsynth::model::Model::from_json(&fs::read_to_string(bench.path("model.json")).unwrap()).unwrap();
    assert!(model.provenance.iter().any(|p| p.what == "texture of cytoplasm" && p.source == "fields"));
    assert_ne!(model.cytoplasm_texture, papsynth::model::Model::builtin().cytoplasm_texture);
    bench.good(&format!("generate --model model.json --out out --frames 1 {TINY}"));
    // Fields without cytoplasm, and a pixel size without texture, are errors.
    fs::create_dir_all(bench.path("empty")).unwrap();
    bench.grey_png("empty/a.png", 300, 300, |x, y| 228 + grain(x, y) / 8);
    let run = bench.run("learn --cytoplasm empty --pixel-um 0.33 --out no.json");
    assert_eq!(run.code, 2);
    assert!(run.err.contains("0 areas of cytoplasm"), "{}", run.err);
    let run = bench.run("learn --cytoplasm fields --pixel-um 0.9 --out no.json");
    assert!(run.code == 2 && run.err.contains("expected 0.2 to 0.5"), "{}", run.err);
    assert!(!bench.path("no.json").exists());
}

#[test]
fn a_class_is_learned_from_nuclei_and_label_images() {
    let bench = Bench::new("learn-images");
    for folder in ["nuclei/images", "nuclei/masks", "labels"] {
        fs::create_dir_all(bench.path(folder)).unwrap();
    }
    for i in 0..6_u32 {
        // Ellipses of different sizes, darker and speckled inside.
        let (a, b) = (9.0 + f64::from(i % 3), 7.0 + f64::from(i % 2));
        let inside = |x: u32, y: u32, scale: f64| {
            let (dx, dy) = (f64::from(x) - 24.0, f64::from(y) - 24.0);
            (dx / (a * scale)) * (dx / (a * scale)) + (dy / (b * scale)) * (dy / (b * scale)) <= 1.0
        };
        let speckle = |x: u32, y: u32| u8::try_from((x * 7919 + y * 104_729 + i * 31) % 13).unwrap();
        bench.grey_png(&format!("nuclei/images/{i}.png"), 48, 48, |x, y| {
            if inside(x, y, 1.0) { 90 + speckle(x, y) } else { 200 + speckle(y, x) / 4 }
        });
        bench.grey_png(&format!("nuclei/masks/{i}.png"), 48, 48, |x, y| if inside(x, y, 1.0) { 255 } else { 0 });
        bench.grey_png(&format!("labels/{i}.png"), 48, 48, |x, y| if inside(x, y, 1.8) { 255 } else { 0 });
    }
    let learn = "learn --class intermediate --pixel-um 0.25 --labels labels --out";
    let run = bench.good(&format!("{learn} a.json --nuclei nuclei"));
    assert!(run.out.contains("6 images of nuclei, 6 outlines of cells"), "{}", run.out);
    bench.good(&format!("{learn} b.json --nuclei nuclei/images --masks nuclei/masks --source nuclei"));
    bench.good(&format!("{learn} c.json --nuclei nuclei --numbers-only"));
    let model = |name: &str| papsynth::model::Model::from_json(&fs::read_to_string(bench.path(name)).unwrap()).unwrap();
    let donors = |name: &str| model(name).classes["intermediate"].nucleus.donors.len();
    assert_eq!((donors("a.json"), donors("b.json"), donors("c.json")), (6, 6, 0));
    // A mask that does not match its image.
    bench.grey_png("nuclei/masks/3.png", 40, 48, |_, _| 255);
    for nuclei in ["--nuclei nuclei", "--nuclei nuclei/images --masks nuclei/masks"] {
        let run = bench.run(&format!("{learn} no.json {nuclei}"));
        assert_eq!(run.code, 2, "{}", run.err);
        assert!(run.err.contains("3.png"), "{}", run.err);
    }
    fs::remove_file(bench.path("nuclei/masks/3.png")).unwrap();
    for nuclei in ["--nuclei nuclei", "--nuclei nuclei/images --masks nuclei/masks"] {
        let run = bench.run(&format!("{learn} no.json {nuclei}"));
        assert_eq!(run.code, 2, "{}", run.err);
        assert!(run.err.contains("no mask of the same name"), "{}", run.err);
    }
    assert!(!bench.path("no.json").exists());
}
