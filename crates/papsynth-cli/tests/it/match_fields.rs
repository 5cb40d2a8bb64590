//! `papsynth match` on synthetic fields, with few simulations.

#[allow(dead_code, reason = "each test uses a part")]
use std::fs;

use crate::support::Bench;

/// Large pixels: many cells in a small image.
const FIELD: &str = "--set field.width_px=340 --set field.height_px=260 --set field.pixel_um=0.5 --set slide.fields_per_slide=1 \
    --set cells.intermediate.count=5 --set cells.superficial.count=2 --set cells.parabasal.count=0 \
    --set cells.metaplastic.count=0 --quiet";

#[test]
fn the_recipe_of_a_match_generates_fields() {
    let bench = Bench::new("match-finds");
    bench.good(&format!(
        "generate --out real --frames 3 --seed 3 --set background.level=0.8 --set background.texture=0.004 {FIELD}"
    ));
    let outcome = bench
        .good("match real --out mine.toml --report mine.json --page mine.html --simulations 60 --seed 1 --threads 2");
    assert!(outcome.out.starts_with("3 fields, "), "{}", outcome.out);
    let suggested = "\nmine.toml: recipe written; `papsynth preview mine.toml` shows one of its fields\n";
    assert!(outcome.out.ends_with(suggested), "{}", outcome.out);
    assert!(outcome.err.contains("of 290, about") && outcome.err.contains("290 of 290"), "{}", outcome.err);
    let toml = fs::read_to_string(bench.path("mine.toml")).unwrap();
    assert!(toml.starts_with("# Matched to 3 fields with ") && toml.contains("# measured: "), "{toml}");
    let report: serde_json::Value = serde_json::from_slice(&fs::read(bench.path("mine.json")).unwrap()).unwrap();
    assert_eq!(report["match_report"], 1);
    let answers = report["fit"]["parameters"].as_array().unwrap();
    let level = answers.iter().find(|a| a["parameter"] == "level").unwrap();
    assert!((level["value"].as_f64().unwrap() - 0.8).abs() < 0.03, "{level}");
    assert!(report["fit"]["distance"]["after"].as_f64().unwrap() > 0.0);
    assert_eq!(toml.matches("[[conditions]]").count(), 3, "{toml}");
    let page = fs::read_to_string(bench.path("mine.html")).unwrap();
    assert!(page.contains("<h2>Tests</h2>") && page.contains("data:image/png"), "{}", page.len());
    bench.good("generate mine.toml --out fields --frames 1 --quiet");
    assert_eq!(bench.files("fields").keys().filter(|name| name.starts_with("images/")).count(), 1);

    // Older outputs are replaced, other files are not.
    fs::write(bench.path("mine.toml"), "# Matched to nothing\n").unwrap();
    fs::write(bench.path("notes.json"), "{}").unwrap();
    let outcome = bench.run("match real --out mine.toml --report notes.json --simulations 60");
    assert!(outcome.code != 0 && outcome.err.contains("notes.json"), "{}", outcome.err);
    assert_eq!(fs::read_to_string(bench.path("notes.json")).unwrap(), "{}");
}

#[test]
fn invalid_input_of_a_match_is_rejected_at_once() {
    let bench = Bench::new("match-refuses");
    for folder in ["empty", "tiny", "constant", "noise", "one", "text", "two"] {
        fs::create_dir_all(bench.path(folder)).unwrap();
    }
    for name in ["a", "b"] {
        let noise = |x: u32, y: u32| u8::try_from(200 + (x * 7919 + y * 104_729) % 13).unwrap();
        bench.grey_png(&format!("tiny/{name}.png"), 3, 2, |x, y| u8::try_from(100 + x + y).unwrap());
        bench.grey_png(&format!("constant/{name}.png"), 160, 120, |_, _| 180);
        bench.grey_png(&format!("noise/{name}.png"), 160, 120, noise);
    }
    bench.grey_png("one/a.png", 160, 120, |_, _| 180);
    fs::write(bench.path("text/a.png"), "no picture").unwrap();
    bench.grey_png("two/a.png", 160, 120, |x, y| u8::try_from(200 + (x * 7919 + y * 104_729) % 13).unwrap());
    bench.grey_png("two/b.png", 120, 160, |x, y| u8::try_from(200 + (x * 7919 + y * 104_729) % 13).unwrap());
    fs::write(bench.path("taken.toml"), "version = 1\n").unwrap();
    for (words, says) in [
        ("match nowhere --pixel-um 0.33 --out a.toml", "nowhere"),
        ("match empty --pixel-um 0.33 --out a.toml", "empty"),
        ("match tiny --pixel-um 0.33 --out a.toml", "a"),
        ("match constant --pixel-um 0.33 --out a.toml", "constant"),
        ("match noise --pixel-um 0.33 --out a.toml", "nuclei"),
        ("match text --pixel-um 0.33 --out a.toml", "a.png"),
        ("match two --pixel-um 0.33 --out a.toml", "120 x 160"),
        ("match one --pixel-um 0.33 --out a.toml", "1 field for a match; expected 2 or more"),
        ("match noise --pixel-um 0.33 --refine 2 --out a.toml", "expected 4 or more"),
        ("match noise --pixel-um 0.33 --nuclei masks --out a.toml", "has no masks"),
        ("match noise --pixel-um 0.33 --set stain.field_nucleus=-1 --out a.toml", "stain.field_nucleus"),
        ("match noise --pixel-um 0.33 --out a.toml --page a.toml", "--page a.toml"),
        ("match noise --out a.toml", "--pixel-um"),
        ("match noise --pixel-um 0.33 --out taken.toml", "taken.toml"),
        ("match noise --pixel-um 0.33 --out two", "is a folder"),
        ("match noise --pixel-um 0.33 --out taken.toml/a.toml", "taken.toml"),
        ("match noise --pixel-um 0.33 --out a.toml --report a.toml", "--report a.toml"),
        ("match noise --pixel-um 0.33 --group N --out a.toml", "no field of group N"),
        ("match noise --pixel-um 9 --out a.toml", "micrometres"),
        ("match noise --pixel-um 0.33 --simulations 3 --out a.toml", "expected an integer from 60 to"),
        ("match noise --pixel-um 0.33 --simulations 60 --quick --out a.toml", "--quick"),
    ] {
        let outcome = bench.run(words);
        assert!(outcome.code != 0 && outcome.out.is_empty(), "{words}: {}", outcome.out);
        assert!(outcome.err.contains(says) && !outcome.err.contains("panicked"), "{words}: {}", outcome.err);
        assert!(!bench.path("a.toml").exists(), "{words}");
    }
    assert_eq!(fs::read_to_string(bench.path("taken.toml")).unwrap(), "version = 1\n");
}
