//! Exit codes, messages and files of the program.

#[allow(dead_code, reason = "each test uses a part")]
use crate::support;
use std::collections::BTreeMap;
use std::fs;

use crate::support::{Bench, TINY};

/// Invalid recipes, each with a part of the expected message.
const HOSTILE: [(&str, &str); 74] = [
    ("", "the recipe is empty"),
    ("\n\n# nothing but a comment\n", "the recipe is empty"),
    ("[field]\nwidth_px = nan", "field.width_px: NaN"),
    ("[field]\nwidth_px = +inf", "field.width_px"),
    ("[field]\nwidth_px = -inf", "field.width_px"),
    ("[field]\nwidth_px = 1e400", "recipe.toml:2:12"),
    ("[field]\nwidth_px = -1376", "field.width_px: -1376 is out of range: expected 16 to 32768"),
    ("[field]\nwidth_px = 0", "field.width_px: 0 is out of range: expected 16 to 32768"),
    ("[field]\nwidth_px = -0.0", "field.width_px"),
    ("[field]\nwidth_px = 1e300", "field.width_px"),
    ("[field]\nwidth_px = 18446744073709551615", "field.width_px"),
    ("[field]\nwidth_px = 99999999999999999999999999999999999999999999", "field.width_px"),
    ("[field]\nwidth_px = 32768\nheight_px = 32769", "field.height_px"),
    ("[field]\nwidth_px = \"1376\"", "field.width_px: expected a number, found a string"),
    ("[field]\nwidth_px = true", "field.width_px: expected a number, found a boolean"),
    ("[field]\nwidth_px = [1376]", "field.width_px: expected a number, found an array"),
    ("[field]\nwidth_px = 1979-05-27", "field.width_px"),
    ("[field]\nwidth_px = {}", "field.width_px"),
    ("[field]\nwidht_px = 1376", "did you mean `width_px`?"),
    ("[field]\nWIDTH_PX = 1376", "did you mean `width_px`?"),
    ("[feild]\nwidth_px = 1376", "did you mean `field`?"),
    ("[field]\nsigma_xy_um = 1", "it is a key of `optics`"),
    ("field = 3", "field: expected a table, found an integer"),
    ("field = []", "field: expected a table, found an array"),
    ("[[field]]\nwidth_px = 3", "field"),
    ("[field]\npixel_um = 0", "field.pixel_um: 0 is out of range"),
    ("[field]\npixel_um = 1e-320", "field.pixel_um"),
    ("[focus]\nplanes = 100000", "focus.planes: 100000 is out of range: expected 1 to 1024"),
    ("[focus]\nstep_um = 0", "focus.step_um"),
    ("[focus]\nplanes = { uniform = [3, 1] }", "focus.planes: `uniform = [3, 1]` has its bounds swapped"),
    ("[focus]\nplanes = { uniform = [1, nan] }", "focus.planes: expected two finite numbers in `uniform`"),
    ("[focus]\nplanes = { uniform = [1] }", "recipe.toml:2"),
    ("[focus]\nplanes = { uniform = [1, 2], normal = [1, 2] }", "recipe.toml:2"),
    ("[focus]\nplanes = { choice = [] }", "focus.planes: expected at least one number in `choice`"),
    ("[focus]\nplanes = { gauss = [1, 2] }", "unknown key `focus.planes.gauss`"),
    ("[focus]\nplanes = { normal = [3, -1] }", "focus.planes"),
    ("[focus]\nplanes = { log_normal = [0, 1] }", "focus.planes"),
    ("[focus]\nplanes = { log_normal = [3, 1e308] }", "focus.planes"),
    ("[focus]\nplanes = { normal = [3, 1], min = 50 }", "focus.planes"),
    ("[focus]\nplanes = { normal = [3, 1], min = nan }", "focus.planes"),
    ("[focus]\nplanes = { min = 3 }", "focus.planes"),
    ("[optics]\nkind = \"gaussian\"\nsigma_xy_um = -1", "optics.sigma_xy_um: -1 is out of range: expected 0 to 20"),
    ("[optics]\nna = 0.5", "missing field `kind`"),
    ("[optics]\nkind = \"bright-field\"\nna = 1.2", "optics.na: 1.2 is above `optics.immersion_index` = 1"),
    ("[optics]\nkind = \"bright-field\"\nslab_um = 0", "optics.slab_um: 0 is out of range: expected 0.1 to 10"),
    ("[optics]\nkind = \"bright-field\"\noversampling = 1.5", "optics.oversampling: 1.5 is not an integer"),
    ("[optics]\nkind = \"bright-field\"\nsigma_xy_um = 1", "sigma_xy_um"),
    (
        "[light]\nkind = \"monochrome\"\nwavelength_um = 0",
        "light.wavelength_um: 0 is out of range: expected 0.4 to 0.7",
    ),
    ("[light]\nkind = \"colour\"\n[optics]\nkind = \"gaussian\"", "light.kind: colour needs"),
    ("[camera]\noffset_dn = 255", "camera.offset_dn: 255 is not below half the 8-bit range"),
    ("[camera]\nbits = 12\njpeg_quality = 90", "camera.jpeg_quality: 90 needs 8 bits"),
    ("[camera]\nread_noise_rms_e = 3", "camera.read_noise_rms_e: 3 does not fit"),
    ("[stain.nucleus]\nhaematein = -1", "stain.nucleus.haematein: -1 is out of range: expected 0 to 100"),
    ("[cells.intermediate.tints]\ncyanophilic = 0\neosinophilic = 0", "cells.intermediate.tints: all tints are 0"),
    ("[camera]\nbits = 7", "camera.bits: 7 is out of range: expected 8 to 16"),
    ("[camera]\nbits = 17", "camera.bits"),
    ("[camera]\noffset_dn = 200", "camera.offset_dn"),
    ("[camera]\nphoton_noise = \"poison\"", "camera.photon_noise: unknown value \"poison\""),
    ("[background]\nlevel = 0.02\ntexture = 0.4", "background.texture"),
    ("[background.illumination]\nkind = \"quadratic\"\nexponent = 1", "background.illumination.exponent"),
    ("[layout]\nkind = \"cluster\"", "did you mean `clusters`?"),
    ("[layout]\nkind = \"density-map\"", "missing field `path`"),
    ("[layout]\ncount = 3", "layout"),
    ("[layout]\nkind = \"density-map\"\npath = \"no-such-file.png\"", "no-such-file.png"),
    ("[layout]\nkind = \"density-map\"\npath = \"/\"", "recipe.toml:3"),
    ("[cells.intermediat]\ncount = 3", "did you mean `intermediate`?"),
    ("[cells.intermediate]\ncount = 1e9", "cells.intermediate.count: 1000000000 is out of range: expected 0 to 100000"),
    ("[cells.intermediate]\nsize = 0", "cells.intermediate.size: 0 is out of range: expected 0.1 to 10"),
    ("cells = \"many\"", "cells: expected a table, found a string"),
    ("[nucleus]\npatch_um = 0.6", "nucleus.overlap_um"),
    ("version = 2\nfuture = true", "version 2 is not supported: this program reads version 1"),
    ("version = -1", "version -1"),
    ("[field]\nwidth_px = 3\nwidth_px = 4", "recipe.toml:3:1"),
    ("[field\nwidth_px = 3", "recipe.toml:1"),
];

#[test]
fn invalid_recipes_are_rejected_with_the_field_and_no_file_is_written() {
    let bench = Bench::new("hostile");
    let mut wrong = Vec::new();
    for (text, named) in HOSTILE {
        fs::write(bench.path("recipe.toml"), text).unwrap();
        let run = bench.run("generate recipe.toml --out out --frames 1");
        if run.code != 2 || !run.err.contains(named) || !run.err.contains("recipe.toml") || bench.path("out").exists() {
            wrong.push(format!("--- {text:?}: expected 2 and {named:?}, got {}\n{}", run.code, run.err));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn binary_files_and_large_files_are_rejected() {
    let bench = Bench::new("garbage");
    let garbage: Vec<u8> = (0..4096_u32).map(|i| (i * 193 + 7).to_le_bytes()[0]).collect();
    let deep = format!("[field]\nwidth_px = {}1{}", "[".repeat(50_000), "]".repeat(50_000));
    let dotted = format!("{}b = 1", "a.".repeat(50_000));
    let long = format!("[field]\nwidth_px = \"{}\"", "x".repeat(1_000_000));
    let cases: [(&[u8], &str); 7] = [
        (&garbage, "recipe.toml:1: not valid UTF-8 at byte"),
        (&[0xff, 0xfe, 0x00], "not valid UTF-8 at byte 0"),
        (&[0; 64], "recipe.toml:1"),
        (deep.as_bytes(), "recipe.toml:2"),
        (dotted.as_bytes(), "recipe.toml: recursion limit"),
        (long.as_bytes(), "field.width_px"),
        (&[b'#'; (1 << 20) + 1], "larger than 1048576 bytes"),
    ];
    for (bytes, named) in cases {
        fs::write(bench.path("recipe.toml"), bytes).unwrap();
        let run = bench.run("generate recipe.toml --out out --frames 1");
        assert_eq!(run.code, 2, "{}", run.err);
        assert!(run.err.contains(named), "{named}: {}", run.err);
        assert!(run.err.len() < 10_000, "{} bytes of message", run.err.len());
        assert!(!bench.path("out").exists());
    }
}

#[test]
fn wrong_usage_has_exit_code_2() {
    let bench = Bench::new("usage");
    for words in [
        "",
        "paint",
        "generate --out out",
        "generate --out out --frames 0",
        "generate --out out --frames -1",
        "generate --out out --range 3..3",
        "generate --out out --range 5",
        "generate --out out --frames 1 --threads 0",
        "generate --out out --frames 1 --seed -1",
        "generate --out out --frames 1 --shard 0/2",
        "generate --out out --frames 1 --preset lcb",
        "generate --out out --frames 1 --set field.width_px",
        "generate --out out --frames 1 --set field.width_px=wide",
        "generate --out out --frames 1 --set nothing=3",
        "generate --out out --frames 1 --model no-such-model.json",
        "generate no-such-recipe.toml --out out --frames 1",
        "generate . --out out --frames 1",
        "inspect no-such-folder",
        "inspect .",
        "learn --class x --pixel-um 0.25 --out out",
        "learn --class intermediate --nuclei no-such-folder --pixel-um 0.25 --out out",
        "learn --class intermediate --outlines no-such-file.csv --pixel-um 0.25 --out out",
        "learn --class new --outlines no-such-file.csv --pixel-um 0.25 --out out",
        "learn --class intermediate --outlines x.csv --pixel-um 0 --out out",
    ] {
        let run = bench.run(words);
        assert_eq!(run.code, 2, "{words}: {}", run.err);
        assert!(!run.err.is_empty(), "{words}");
        assert!(!bench.path("out").exists(), "{words}");
    }
    assert!(bench.run("generate --out out --frames 1 --preset lcb").err.contains("lbc"));
    assert!(
        bench
            .run("learn --class intermedate --outlines x.csv --pixel-um 1 --out o")
            .err
            .contains("did you mean `intermediate`")
    );
}

#[test]
fn help_version_schema_and_completions_are_printed() {
    let bench = Bench::new("help");
    assert!(bench.good("--version").out.starts_with("papsynth "));
    for verb in ["init", "generate", "preview", "learn", "inspect", "schema", "completions", "man"] {
        assert!(bench.good(&format!("{verb} --help")).out.contains("Example"), "{verb}");
    }
    let schema: serde_json::Value = serde_json::from_str(&bench.good("schema").out).unwrap();
    assert!(schema["properties"]["optics"].is_object());
    for shell in ["bash", "zsh", "fish"] {
        assert!(bench.good(&format!("completions {shell}")).out.contains("papsynth"));
    }
}

#[cfg(feature = "completions")]
#[test]
fn every_subcommand_has_a_manual_page() {
    let bench = Bench::new("man");
    bench.good("man --out pages");
    let page = |name: &str| fs::read_to_string(bench.path("pages").join(name)).unwrap();
    for name in ["papsynth.1", "papsynth-generate.1", "papsynth-slide-make.1"] {
        let (page, title) = (page(name), name.trim_end_matches(".1"));
        assert!(page.contains(&format!(".TH {title} 1")), "{page}");
        assert!(page.contains(".SH EXAMPLE") && !page.contains(".SH EXTRA"), "{page}");
    }
    bench.good("man --out pages");
    fs::write(bench.path("pages/papsynth-init.1"), "mine").unwrap();
    let again = bench.run("man --out pages");
    assert!(again.code == 2 && again.err.contains("papsynth-init.1"), "{}", again.err);
    assert_eq!(page("papsynth-init.1"), "mine");
}

#[test]
fn every_preset_prints_a_recipe_that_reads_back() {
    let bench = Bench::new("init");
    let list = bench.good("init --list").out;
    for preset in papsynth::recipe::Preset::ALL {
        assert!(list.contains(preset.name()));
        let text = bench.good(&format!("init --preset {}", preset.name())).out;
        assert_eq!(toml::from_str::<papsynth::recipe::Recipe>(&text).unwrap(), preset.recipe());
    }
    let changed = bench.good("init --preset empty --set cells.lsil.count=3").out;
    let changed: toml::Table = changed.parse().unwrap();
    assert_eq!(changed["cells"]["lsil"]["count"].as_integer(), Some(3));
    assert_eq!(bench.run("init --set optics.na=7").code, 2);
    assert!(bench.good("init --out mine.toml").out.contains("written; `papsynth preview mine.toml` shows"));
    fs::write(bench.path("mine.toml"), "edited").unwrap();
    let again = bench.run("init --out mine.toml");
    assert!(again.code == 2 && again.err.contains("--force"), "{}", again.err);
    assert_eq!(fs::read_to_string(bench.path("mine.toml")).unwrap(), "edited");
    bench.good("init --out mine.toml --force");
    assert_ne!(fs::read_to_string(bench.path("mine.toml")).unwrap(), "edited");
}

#[test]
fn a_closed_pipe_is_not_an_error() {
    let bench = Bench::new("pipe");
    for verb in ["schema", "init", "completions bash", "--help"] {
        assert_eq!(bench.run_into_closed_pipe(verb), Some(0), "{verb}");
    }
}

#[test]
fn the_bytes_do_not_depend_on_threads_ranges_or_order() {
    let bench = Bench::new("bytes");
    bench.good(&format!("generate --out one --frames 4 --threads 1 {TINY}"));
    let expected = bench.files("one");
    assert!(expected.keys().any(|name| name.starts_with("images/")), "{:?}", expected.keys());
    for threads in [2, 8] {
        let out = format!("threads-{threads}");
        bench.good(&format!("generate --out {out} --frames 4 --threads {threads} {TINY}"));
        assert_eq!(bench.files(&out), expected, "{threads} threads");
    }
    for range in ["3..4", "0..1", "1..3"] {
        bench.good(&format!("generate --out ranges --range {range} --threads 2 {TINY}"));
    }
    assert_eq!(bench.files("ranges"), expected);
    // Another seed gives other images.
    bench.good(&format!("generate --out other --frames 1 --seed 1 {TINY}"));
    assert_ne!(bench.files("other")["images/000000.png"], expected["images/000000.png"]);
}

#[test]
fn a_second_run_writes_only_missing_frames() {
    let bench = Bench::new("resume");
    let command = format!("generate --out out --frames 3 {TINY}");
    bench.good(&command);
    let (before, times) = (bench.files("out"), bench.times("out"));
    fs::remove_file(bench.path("out/images/000001.png")).unwrap();
    fs::write(bench.path("out/images/.leftover.tmp"), "half").ok();
    let run = bench.good(&command);
    assert!(run.out.contains("1 frame written, 2 already present"), "{}", run.out);
    let mut after = bench.files("out");
    after.retain(|name, _| before.contains_key(name));
    assert_eq!(after, before);
    let touched: Vec<String> = bench
        .times("out")
        .into_iter()
        .filter(|(name, time)| times.get(name) != Some(time))
        .map(|(name, _)| name)
        .collect();
    assert!(touched.iter().all(|name| !name.contains("000000") && !name.contains("000002")), "{touched:?}");
}

#[test]
fn other_folders_and_other_data_sets_are_not_changed() {
    let bench = Bench::new("strange");
    fs::create_dir(bench.path("photos")).unwrap();
    fs::write(bench.path("photos/cat.txt"), "meow").unwrap();
    let run = bench.run(&format!("generate --out photos --frames 1 {TINY}"));
    assert_eq!(run.code, 2, "{}", run.err);
    assert!(run.err.contains("photos"), "{}", run.err);
    assert_eq!(bench.files("photos").len(), 1);
    fs::write(bench.path("file"), "a file").unwrap();
    assert_eq!(bench.run(&format!("generate --out file --frames 1 {TINY}")).code, 2);
    bench.good(&format!("generate --out out --frames 1 {TINY}"));
    let before = bench.files("out");
    for other in ["--seed 5", "--set optics.na=0.5"] {
        let run = bench.run(&format!("generate --out out --frames 1 {TINY} {other}"));
        assert_eq!(run.code, 2, "{other}: {}", run.err);
        assert_eq!(bench.files("out"), before, "{other}");
    }
}

#[test]
fn invalid_layouts_are_rejected_before_a_file_is_written() {
    let bench = Bench::new("layout");
    let tiny = TINY.replace("--set layout.kind=uniform", "");
    bench.grey_png("black.png", 8, 8, |_, _| 0);
    bench.grey_png("left.png", 8, 8, |x, _| if x < 4 { 255 } else { 0 });
    fs::write(bench.path("truncated.png"), &fs::read(bench.path("left.png")).unwrap()[..40]).unwrap();
    for (file, named) in [("black.png", "black.png"), ("truncated.png", "truncated"), ("none.png", "none.png")] {
        fs::write(bench.path("recipe.toml"), format!("[layout]\nkind = \"density-map\"\npath = \"{file}\"\n")).unwrap();
        let run = bench.run(&format!("generate recipe.toml --out out --frames 1 {tiny}"));
        assert_eq!(run.code, 2, "{}", run.err);
        assert!(run.err.contains(named) && run.err.contains("recipe.toml:3"), "{}", run.err);
        assert!(!bench.path("out").exists());
    }
    // The path is relative to the recipe, not to the working folder.
    fs::create_dir(bench.path("deep")).unwrap();
    fs::rename(bench.path("left.png"), bench.path("deep/left.png")).unwrap();
    fs::write(bench.path("deep/recipe.toml"), "[layout]\nkind = \"density-map\"\npath = \"left.png\"\n").unwrap();
    bench.good(&format!("generate deep/recipe.toml --out out --frames 1 {tiny}"));
}

#[test]
fn data_sets_with_a_map_are_complete_and_keep_it() {
    let bench = Bench::new("maps");
    let tiny = TINY.replace("--set layout.kind=uniform", "");
    bench.grey_png("left.png", 8, 8, |x, _| if x < 4 { 255 } else { 0 });
    for kind in ["density-map", "labels"] {
        fs::write(bench.path("recipe.toml"), format!("[layout]\nkind = \"{kind}\"\npath = \"left.png\"\n")).unwrap();
        let generate = |out: &str, more: &str| {
            bench.good(&format!("generate recipe.toml --out {kind}-{out} --frames 2 {more} {tiny}"));
        };
        generate("whole", "");
        bench.good(&format!("verify {kind}-whole"));
        generate("tasks", "--task 0/2");
        generate("tasks", "--task 1/2");
        bench.good(&format!("merge {kind}-tasks --frames 2"));
        bench.good(&format!("verify {kind}-tasks"));
        // An earlier merge of tasks left out the map.
        let manifest = bench.path(&format!("{kind}-tasks/manifest.json"));
        let text = fs::read_to_string(&manifest).unwrap();
        let without: Vec<&str> = text.lines().filter(|line| !line.contains("layout-")).collect();
        assert!(without.len() + 1 == text.lines().count(), "{text}");
        fs::write(&manifest, without.join("\n") + "\n").unwrap();
        assert_eq!(bench.run(&format!("verify {kind}-tasks")).code, 2);
        bench.good(&format!("clean {kind}-tasks --untracked"));
        bench.good(&format!("merge {kind}-tasks --frames 2"));
        assert_eq!(fs::read_to_string(&manifest).unwrap(), text);
        bench.good(&format!("convert {kind}-tasks --out {kind}-converted --format cellpose"));
        bench.good(&format!("verify {kind}-converted"));
    }
}

#[cfg(unix)]
#[test]
fn write_errors_have_exit_code_74() {
    let bench = Bench::new("full");
    let run = bench.run(&format!("preview --out /dev/full/preview.png {TINY}"));
    assert!(run.code == 2 || run.code == 74, "{}", run.err);
    // No user can create files below /proc.
    let run = bench.run(&format!("generate --out /proc/papsynth-out --frames 1 {TINY}"));
    assert_eq!(run.code, 74, "{}", run.err);
    assert!(run.err.contains("/proc/papsynth-out"), "{}", run.err);
}

#[test]
fn json_events_are_start_frames_and_done() {
    let bench = Bench::new("json");
    let run = bench.good(&format!("generate --out out --frames 2 --json {TINY}"));
    let events: Vec<serde_json::Value> = run.out.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let names: Vec<_> = events.iter().map(|event| event["event"].as_str().unwrap()).collect();
    assert_eq!(names, ["start", "frame", "frame", "done"]);
    assert_eq!(events[0]["frames"], 2);
    assert_eq!((&events[2]["done"], &events[2]["total"], &events[2]["eta_s"]), (&2.into(), &2.into(), &0.into()));
    assert_eq!((&events[3]["written"], &events[3]["present"]), (&2.into(), &0.into()));
    assert_eq!(run.err, "");
    let run = bench.run("generate --out out2 --frames 2 --json --set field.width_px=-1");
    assert_eq!(run.code, 2);
    let error: serde_json::Value = serde_json::from_str(run.out.trim()).unwrap();
    assert_eq!((error["event"].as_str(), error["exit"].as_i64()), (Some("error"), Some(2)));
    assert_eq!(error["location"]["file"], "--set");
    assert!(error["message"].as_str().unwrap().contains("field.width_px"));
}

#[test]
fn a_profile_adds_up_to_the_run_time_and_does_not_change_the_output() {
    let bench = Bench::new("profile");
    let run = bench.good(&format!("generate --out out --frames 2 --threads 1 --json --profile {TINY}"));
    let event: serde_json::Value = serde_json::from_str(run.out.lines().last().unwrap()).unwrap();
    assert_eq!(event["event"], "profile");
    let stages = event["stages"].as_array().unwrap();
    let spent: f64 = stages.iter().map(|stage| stage["ms_per_frame"].as_f64().unwrap()).sum();
    // Stages of one thread do not overlap.
    assert!(spent > 0.0 && spent * event["frames_per_s"].as_f64().unwrap() <= 1000.0, "{event}");
    assert!(["pixels_per_s", "objects_per_s"].iter().all(|rate| event[rate].as_f64().unwrap() > 0.0), "{event}");
    let run = bench.good(&format!("generate --out told --frames 2 --profile {TINY}"));
    let named = |name: &str| run.out.lines().any(|line| line.starts_with(name));
    assert!(stages.iter().all(|stage| named(stage["stage"].as_str().unwrap())), "{}", run.out);
    assert!(named("all stages") && run.out.contains("per second on"), "{}", run.out);
    bench.good(&format!("generate --out plain --frames 2 {TINY}"));
    assert_eq!(bench.files("told"), bench.files("plain"));
}

#[test]
fn quiet_prints_nothing_and_progress_lines_name_frames() {
    let bench = Bench::new("quiet");
    let run = bench.good(&format!("generate --out out --frames 1 --quiet {TINY}"));
    assert_eq!((run.out.as_str(), run.err.as_str()), ("", ""));
    let run = bench.good(&format!("generate --out lines --frames 2 {TINY}"));
    assert!(run.err.contains("frame 0: ") && run.err.contains("(2 of 2)"), "{}", run.err);
    assert!(run.out.contains("lines: 2 frames written"), "{}", run.out);
}

#[test]
fn inspect_lists_contents_and_damage() {
    let bench = Bench::new("inspect");
    bench.good(&format!("generate --out out --range 1..3 {TINY}"));
    let table = bench.good("inspect out").out;
    for part in ["96 x 80 px", "seed", "missing     0", "intermediate"] {
        assert!(table.contains(part), "{part}: {table}");
    }
    let json: serde_json::Value = serde_json::from_str(&bench.good("inspect out --json").out).unwrap();
    assert_eq!(json["frames"], 2);
    // A flipped bit does not change the size.
    let image = bench.path("out/images/000002.png");
    let mut bytes = fs::read(&image).unwrap();
    let last = bytes.len() - 20;
    bytes[last] ^= 1;
    fs::write(&image, bytes).unwrap();
    bench.good("inspect out");
    let run = bench.run("inspect out --verify");
    assert_eq!(run.code, 2);
    assert!(
        run.out.contains("damaged     images/000002.png") && run.err.contains("out: damaged: 1 shard"),
        "{}{}",
        run.out,
        run.err
    );
}

#[test]
fn preview_writes_one_image() {
    let bench = Bench::new("preview");
    let run = bench.good(&format!("preview --out look.png {TINY}"));
    assert!(run.out.contains("look.png: 96 x 80 px"), "{}", run.out);
    let (_, hash) = run.out.split_once("SHA-256 of the grey levels: ").unwrap();
    assert_eq!(hash.trim().len(), 64, "{}", run.out);
    let reader = png::Decoder::new(std::io::BufReader::new(fs::File::open(bench.path("look.png")).unwrap()));
    let info = reader.read_info().unwrap();
    assert_eq!(info.info().size(), (96 * 2 + 8, 80));
    assert_eq!(bench.files(".").keys().collect::<Vec<_>>(), ["look.png"]);
    bench.good(&format!("preview --out look.png {TINY}"));
}

#[test]
fn only_older_outputs_are_replaced_without_force() {
    let bench = Bench::new("replace");
    fs::write(bench.path("mine.toml"), bench.good("init").out).unwrap();
    let before = bench.files(".");
    for command in [
        format!("preview mine.toml --out mine.toml {TINY}"),
        "learn --class intermediate --pixel-um 0.25 --outlines mine.toml --out mine.toml".to_owned(),
    ] {
        let run = bench.run(&command);
        assert!(run.code == 2 && run.err.contains("mine.toml: the file exists and is not"), "{}", run.err);
        assert_eq!(bench.files("."), before);
    }
    // An image of the user, and a model-like file of another program.
    bench.grey_png("photo.png", 8, 8, |_, _| 7);
    fs::write(bench.path("other.json"), "{\"version\":1,\"name\":\"other\"}").unwrap();
    fs::write(bench.path("cells.csv"), support::outlines(12, 100, 80.0)).unwrap();
    let before = bench.files(".");
    let tile = format!("slide tile --at 0,0 --size 16,16 --out photo.png {TINY}");
    for command in [
        format!("preview --out photo.png {TINY}"),
        tile.clone(),
        "learn --class intermediate --pixel-um 0.25 --outlines cells.csv --out other.json".to_owned(),
    ] {
        let run = bench.run(&command);
        assert!(run.code == 2 && run.err.contains("--force"), "{command}: {}", run.err);
        assert_eq!(bench.files("."), before);
    }
    bench.good(&format!("{tile} --force"));
    bench.good(&tile);
    bench.good(&format!("preview --out photo.png {TINY}"));
}

#[test]
fn control_characters_are_not_printed_and_long_lines_are_shortened() {
    let bench = Bench::new("control");
    fs::write(bench.path("recipe.toml"), "[field]\n\"\\u001b[31mred\" = 1\n").unwrap();
    let run = bench.run("preview recipe.toml");
    assert!(run.code == 2 && run.err.contains("\\u{1b}[31mred"), "{}", run.err);
    let name = "no\u{1b}[2J.toml";
    let run = bench.run(&format!("preview {name}"));
    assert!(run.code == 2 && !run.err.contains('\u{1b}'), "{:?}", run.err);
    let run = bench.run("preview --ind\u{1b}[2J=1");
    assert!(run.code == 2 && !run.err.contains('\u{1b}'), "{:?}", run.err);
    fs::write(bench.path("model.toml"), format!("version = 1\nx = [{}\n", "1,".repeat(500_000))).unwrap();
    let run = bench.run("preview --model model.toml");
    assert!(run.code == 2 && run.err.contains("model.toml:") && run.err.len() < 1000, "{}", run.err);
}

/// A full disk in memory; skipped where the system does not allow to mount one.
#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_leaves_no_part_of_a_single_file() {
    const SCRIPT: &str = r#"
        mkdir disk && mount -t tmpfs -o size=8k tmpfs disk || { echo 'no disk'; exit 0; }
        echo old > disk/old.toml
        "$1" init --out disk/new.toml 2> message; echo "new $?"
        "$1" init --out disk/old.toml --force 2>> message; echo "old $?"
        ls -A disk; cat disk/old.toml
        umount disk
    "#;
    let bench = Bench::new("full-disk-init");
    let Some(printed) = bench.script_as_root(SCRIPT, "").filter(|printed| !printed.contains("no disk")) else {
        eprintln!("skipped: this system does not allow to mount a small disk");
        return;
    };
    assert_eq!(printed, "new 74\nold 74\nold.toml\nold\n");
    let message = fs::read_to_string(bench.path("message")).unwrap();
    assert!(message.contains("disk/new.toml") && message.contains("No space left"), "{message}");
}

#[test]
fn a_density_map_is_stored_and_part_of_the_recipe() {
    let bench = Bench::new("map");
    let map = |side: usize| {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 2, 1);
        encoder.set_color(png::ColorType::Grayscale);
        let pixels = if side == 0 { [255, 0] } else { [0, 255] };
        encoder.write_header().unwrap().write_image_data(&pixels).unwrap();
        fs::write(bench.path("map.png"), bytes).unwrap();
    };
    map(0);
    let command =
        format!("generate --out out --frames 1 {TINY} --set layout.kind=density-map --set layout.path=map.png");
    bench.good(&command);
    let made = bench.files("out");
    let kept = made.keys().find(|name| name.starts_with("layout-")).expect("the map is stored");
    assert!(kept.ends_with(".png"));
    fs::remove_file(bench.path("map.png")).unwrap();
    bench.good("generate out/recipe.toml --out again --frames 1");
    assert_eq!(bench.files("again"), made, "the folder holds all inputs");
    map(1);
    let run = bench.run(&command);
    assert!(run.code == 2 && run.err.contains("another recipe"), "{}", run.err);
    assert_eq!(bench.files("out"), made);
}

#[test]
fn sizes_and_names_of_outputs_that_cannot_be_are_explained() {
    let bench = Bench::new("impossible");
    for (words, expected) in [
        ("slide tile --at 0,0 --size 0,0 --out tile.png", "a width and a height of at least 1"),
        ("generate --out out --frames 1 --max-memory 1", "the limit is 1 B (--max-memory)"),
        ("preview --out sub/", "sub/: is a folder; expected the name of a file"),
        ("submit slurm --tasks 2 -- --bogus", "error: unexpected argument '--bogus'"),
    ] {
        let run = bench.run(words);
        assert!(run.code == 2 && run.err.contains(expected), "{words}: {}", run.err);
        assert!(!run.err.contains("error: error"), "{}", run.err);
    }
    assert!(bench.files(".").is_empty());
}

#[test]
fn all_cells_can_be_set_at_once() {
    let bench = Bench::new("no-cells");
    bench.good(&format!("generate --out out --frames 1 {TINY} --set cells={{}} --set debris.speckles.count=3"));
    let table = fs::read_to_string(bench.path("out/objects.csv")).unwrap();
    assert!(!table.contains(",nucleus,") && table.contains("speckle"), "{table}");
}

#[cfg(unix)]
#[test]
fn ctrl_c_leaves_complete_files_and_the_same_command_continues() {
    let bench = Bench::new("interrupt");
    let command = format!("generate --out out --frames 400 --threads 2 {TINY}");
    let run = bench.interrupt_after_first_line(&format!("{command} --json"));
    assert_eq!(run.code, 130, "{}{}", run.out, run.err);
    assert!(run.out.contains("\"exit\":130") && run.out.contains("run the same command again"), "{}", run.out);
    let left: BTreeMap<_, _> = bench.files("out");
    assert!(left.keys().all(|name| !name.contains(".tmp") && !name.contains(".part")), "{:?}", left.keys());
    let whole = left.keys().filter(|name| name.starts_with("images/")).count();
    assert!(whole < 400);
    bench.good("inspect out --verify");
    // Present files do not change.
    bench.good(&format!("{command} --quiet").replace("400", &whole.max(1).to_string()));
    let after = bench.files("out");
    for (name, content) in left.iter().filter(|(name, _)| name.starts_with("images/")) {
        assert_eq!(after.get(name), Some(content), "{name}");
    }
}
