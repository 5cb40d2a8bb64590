//! `papsynth judge` on synthetic fields.

#[allow(dead_code, reason = "each test uses a part")]
use std::fs;

use crate::support::Bench;

/// Small fields with nuclei, one per slide.
const FIELD: &str = "--set field.width_px=420 --set field.height_px=320 --set field.pixel_um=0.33 --set slide.fields_per_slide=1 --quiet";
const CELLS: &str = "--set cells.intermediate.count=5 --set cells.superficial.count=2 \
    --set cells.parabasal.count=0 --set cells.metaplastic.count=0";

fn generate(bench: &Bench, out: &str, words: &str) {
    bench.good(&format!("generate --out {out} --frames 8 {FIELD} {words}"));
}

fn json(bench: &Bench, name: &str) -> serde_json::Value {
    serde_json::from_slice(&fs::read(bench.path(name)).unwrap()).unwrap()
}

/// Grey levels of a PNG of 8 bits, and its width.
fn read(bench: &Bench, name: &str) -> (Vec<u8>, u32) {
    let file = std::io::BufReader::new(fs::File::open(bench.path(name)).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut grey = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut grey).unwrap();
    (grey, info.width)
}

/// A folder of images, computed from those of a data set.
fn copies(bench: &Bench, from: &str, to: &str, of: impl Fn(&[u8], usize, usize) -> u8) {
    fs::create_dir_all(bench.path(to)).unwrap();
    for index in 0..8 {
        let (grey, width) = read(bench, &format!("{from}/images/{index:06}.png"));
        let height = u32::try_from(grey.len()).unwrap() / width;
        bench.grey_png(&format!("{to}/{index}.png"), width, height, |x, y| {
            of(&grey, width as usize, (y * width + x) as usize)
        });
    }
}

#[test]
fn fields_of_another_seed_pass_and_different_fields_do_not() {
    let bench = Bench::new("judge-kinds");
    for (name, seed) in [("a", 1), ("b", 2), ("c", 3), ("d", 4)] {
        generate(&bench, name, &format!("--seed {seed} {CELLS}"));
    }
    // Each test has a false positive rate of 5 %; two in six tests occur once in thirty runs.
    let mut wrong = 0;
    for pair in ["a b", "c d"] {
        let outcome = bench.good(&format!("judge {pair} --out same --quick"));
        let tests = outcome.out.lines().filter(|line| !line.contains(" synthetic fields: "));
        wrong += tests.filter(|line| line.ends_with(": distinguishable")).count();
        assert!(outcome.out.contains("8 real fields and 8 synthetic fields: "), "{}", outcome.out);
        assert!(outcome.out.ends_with("same: report.html, report.json\n"), "{}", outcome.out);
        assert!(wrong <= 1, "{}", outcome.out);
    }
    let report = json(&bench, "same/report.json");
    assert_eq!(report["judge_report"], 1);
    assert_eq!(report["measurement"]["nuclei_from"], "masks");
    assert_eq!(report["measurement"]["pixel_um"], 0.33);
    let names: Vec<&str> =
        report["two_sample"].as_array().unwrap().iter().map(|t| t["name"].as_str().unwrap()).collect();
    assert!(names.contains(&"nuclei") && names.contains(&"patches"), "{names:?}");

    // Uniform noise, blurred fields, and nuclei of another grade.
    copies(&bench, "a", "noise", |_, _, i| {
        u8::try_from((i as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 56).unwrap()
    });
    let blurred = |grey: &[u8], width: usize, i: usize| {
        let near = [i, i.saturating_sub(1), i + 1, i.saturating_sub(width), i + width];
        let values: Vec<u32> = near.iter().filter_map(|n| grey.get(*n)).map(|v| u32::from(*v)).collect();
        u8::try_from(values.iter().sum::<u32>() / u32::try_from(values.len()).unwrap()).unwrap()
    };
    copies(&bench, "a", "blurred", blurred);
    generate(
        &bench,
        "high",
        "--seed 2 --preset high-grade --set cells.high-grade.count=7 --set cells.intermediate.count=0",
    );
    for (other, test, verdict) in [
        ("noise", "patches", "distinguishable"),
        ("blurred", "patches", "distinguishable"),
        ("high", "nuclei", "distinguishable"),
    ] {
        let outcome = bench.good(&format!("judge a {other} --out {other}-report --quick"));
        let line = outcome.out.lines().find(|line| line.starts_with(test)).unwrap();
        assert!(line.ends_with(&format!(": {verdict}")), "{other}: {}", outcome.out);
        assert!(outcome.out.contains("synthetic fields: distinguishable"), "{other}: {}", outcome.out);
    }
}

#[test]
fn folders_may_hold_points_masks_groups_and_other_pixels() {
    let bench = Bench::new("judge-folders");
    generate(&bench, "a", &format!("--seed 1 {CELLS}"));
    copies(&bench, "a", "slides", |grey, _, i| grey[i]);
    // Without nuclei, they are found automatically; the pixel size is that of the other side.
    let searched = bench.good("judge slides a --out searched --quick");
    assert_eq!(json(&bench, "searched/report.json")["measurement"]["nuclei_from"], "search");
    assert!(searched.out.contains("nuclei"), "{}", searched.out);
    for index in 0..8 {
        fs::write(bench.path(&format!("slides/{index}.csv")), "y,x\n100,120.5\n").unwrap();
    }
    let groups: String = (0..8).map(|i| format!("{i},{}\n", if i < 3 { "N" } else { "H" })).collect();
    fs::write(bench.path("slides/frames.csv"), format!("frame,grade\n{groups}")).unwrap();
    bench.good("judge slides a --out points --quick --group N --pixel-um 0.25");
    let report = json(&bench, "points/report.json");
    assert_eq!(report["measurement"]["nuclei_from"], "points");
    assert_eq!(report["measurement"]["pixel_um"], 0.33);
    assert_eq!(report["fields"][0], serde_json::json!(["0", "1", "2"]));
    assert_eq!(report["fields"][1].as_array().unwrap().len(), 8);
    bench.good("judge slides a --out points --quick --nuclei search");
    assert_eq!(json(&bench, "points/report.json")["measurement"]["nuclei_from"], "search");
    fs::create_dir(bench.path("slides/masks")).unwrap();
    for index in 0..8 {
        bench.grey_png(&format!("slides/masks/{index}.png"), 420, 320, |x, y| {
            if x % 60 < 15 && y % 60 < 15 { 255 } else { 0 }
        });
    }
    bench.good("judge slides a --out masks --quick");
    assert_eq!(json(&bench, "masks/report.json")["measurement"]["nuclei_from"], "masks");
}

#[test]
fn the_report_does_not_depend_on_threads() {
    let bench = Bench::new("judge-threads");
    generate(&bench, "a", &format!("--seed 1 {CELLS}"));
    generate(&bench, "b", &format!("--seed 2 {CELLS}"));
    bench.good("judge a b --out one --quick --threads 1 --seed 7");
    bench.good("judge a b --out three --quick --threads 3 --seed 7");
    assert!(bench.files("one") == bench.files("three"));
    assert_eq!(bench.files("one").keys().collect::<Vec<_>>(), ["report.html", "report.json"]);
}

#[test]
fn invalid_input_of_a_judge_is_rejected_and_no_file_is_written() {
    let bench = Bench::new("judge-refused");
    for name in ["few", "flat", "broken", "sizes/masks", "good", "empty"] {
        fs::create_dir_all(bench.path(name)).unwrap();
    }
    let speckled = |x: u32, y: u32| 200 + u8::try_from((x * 7 + y * 3) % 31).unwrap();
    bench.grey_png("few/a.png", 64, 48, speckled);
    for name in ["a", "b", "c"] {
        bench.grey_png(&format!("good/{name}.png"), 64, 48, speckled);
        bench.grey_png(&format!("flat/{name}.png"), 64, 48, |_, _| 200);
        bench.grey_png(&format!("sizes/{name}.png"), 64, 48, speckled);
        bench.grey_png(&format!("sizes/masks/{name}.png"), 64, 40, |_, _| 0);
        bench.grey_png(&format!("broken/{name}.png"), 64, 48, speckled);
    }
    let broken = fs::read(bench.path("broken/b.png")).unwrap();
    fs::write(bench.path("broken/b.png"), &broken[..broken.len() / 2]).unwrap();
    fs::create_dir_all(bench.path("grades")).unwrap();
    for name in ["a", "b"] {
        bench.grey_png(&format!("grades/{name}.png"), 64, 48, speckled);
    }
    fs::write(bench.path("grades/frames.csv"), "frame,grade\na,N\nb,N\n").unwrap();
    fs::create_dir_all(bench.path("points")).unwrap();
    for name in ["a", "b"] {
        bench.grey_png(&format!("points/{name}.png"), 64, 48, speckled);
        // x before y.
        fs::write(bench.path(&format!("points/{name}.csv")), "60,20\n55,12\n").unwrap();
    }
    bench.good(&format!("generate --out damaged --frames 2 {FIELD} {CELLS}"));
    fs::write(bench.path("damaged/images/000001.png"), "x").unwrap();
    for (words, wanted) in [
        ("judge good empty --pixel-um 0.3", "empty: contains no PNG, JPEG or TIFF file"),
        ("judge good missing --pixel-um 0.3", "missing: there is no such folder"),
        ("judge broken/b.png good", "b.png: is not a folder; expected a folder of images"),
        ("judge good good", "neither folder records its pixel size"),
        ("judge few good --pixel-um 0.3", "few: 1 field; expected at least 2"),
        ("judge good flat --pixel-um 0.3", "is constant"),
        ("judge sizes sizes --pixel-um 0.3", "the mask is 64 x 40 pixels, the image 64 x 48"),
        ("judge good broken --pixel-um 0.3", "b.png"),
        ("judge grades good --pixel-um 0.3 --group H", "grades: no field of group H"),
        ("judge good good --pixel-um 0.3 --group Z", "good: no field of group Z"),
        ("judge points good --pixel-um 0.3", "2 of 2 points are outside the image of 64 x 48 pixels"),
        ("judge good damaged --pixel-um 0.3", "shard 1 is damaged"),
        ("judge good good --pixel-um 0.3 --nuclei masks", "--nuclei masks: "),
        ("judge good good --pixel-um 0", "expected 0.05 to 4 micrometres"),
    ] {
        let outcome = bench.run(&format!("{words} --out report"));
        assert_eq!(outcome.code, 2, "{words}: {}", outcome.err);
        let text: String = outcome.err.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(text.contains(wanted), "{words}: {text}");
        assert!(!bench.path("report").exists(), "{words}");
    }
    // Other files are not replaced.
    fs::create_dir(bench.path("mine")).unwrap();
    fs::write(bench.path("mine/report.html"), "my own page").unwrap();
    let outcome = bench.run("judge good good --pixel-um 0.3 --out mine");
    assert_eq!(outcome.code, 2);
    assert_eq!(bench.files("mine").len(), 1);
    fs::write(bench.path("file"), "").unwrap();
    assert!(bench.run("judge good good --pixel-um 0.3 --out file").err.contains("expected a folder"));
}
