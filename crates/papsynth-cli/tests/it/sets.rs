//! Data sets: tasks, schedulers, killed runs, conversion, verification.

#[allow(dead_code, reason = "each test uses a part")]
use std::fs;
use std::io::{BufRead, BufReader};

use crate::support::{Bench, TINY};

/// The root hash that `papsynth verify` prints.
fn root(bench: &Bench, folder: &str, frames: u64) -> String {
    let run = bench.good(&format!("verify {folder} --frames {frames}"));
    run.out.lines().find_map(|line| line.strip_prefix("root ")).expect("a complete data set has a root").to_owned()
}

#[test]
fn tasks_write_the_files_of_one_run_and_merge_requires_all_shards() {
    let bench = Bench::new("shares");
    let frames = format!("--frames 7 --format webdataset,cellpose --frames-per-shard 2 {TINY}");
    bench.good(&format!("generate --out one {frames}"));
    let whole = root(&bench, "one", 7);
    for task in ["3/4", "0/4", "2/4"] {
        let run = bench.good(&format!("generate --out parts {frames} --task {task}"));
        assert!(run.out.contains("papsynth merge parts --frames 7"), "{}", run.out);
    }
    let run = bench.run("merge parts --frames 7");
    assert!(run.code == 2 && run.err.contains("1 shard is missing or damaged: 1"), "{}", run.err);
    assert_eq!(bench.good("status parts --frames 7 --missing").out, "1\n");
    assert_eq!(bench.good("status parts --frames 7 --missing --tasks 4").out, "1\n");
    assert!(bench.good("status parts --frames 7").out.contains("3 of 4 shards present (75.0 %)"));
    let run = bench.run_with(&format!("generate --out parts {frames} --task auto/4"), &[("JOB_COMPLETION_INDEX", "1")]);
    assert_eq!(run.code, 0, "{}", run.err);
    // This change does not change the size.
    let path = bench.path("parts/webdataset/000000.tar");
    let good = fs::read(&path).unwrap();
    let mut bytes = good.clone();
    bytes[700] ^= 1;
    fs::write(&path, &bytes).unwrap();
    let run = bench.run("merge parts --frames 7 --verify");
    assert!(run.code == 2 && run.err.contains("1 shard is missing or damaged: 0"), "{}", run.err);
    fs::write(&path, &good).unwrap();
    bench.good("merge parts --frames 7 --verify");
    assert!(bench.good("status parts --frames 7").out.ends_with("finished\n"));
    assert_eq!(root(&bench, "parts", 7), whole);
    assert_eq!(bench.files("one"), bench.files("parts"));
    let run = bench.run(&format!("generate --out parts {frames} --task auto"));
    assert!(run.code == 2 && run.err.contains("SLURM_ARRAY_TASK_ID"), "{}", run.err);
}

#[test]
fn files_that_are_left_out_are_not_written_and_not_missed() {
    let bench = Bench::new("without");
    bench.good(&format!("generate --out all --frames 3 {TINY}"));
    let without = "--without noise-free,layers,semantic,contact-sheet";
    let frames = format!("--frames 3 {without} {TINY}");
    let run = bench.good(&format!("generate --out some --task 1/2 {frames}"));
    assert!(run.out.contains("papsynth merge some --frames 3"), "{}", run.out);
    // The second run resumes and merges.
    let run = bench.good(&format!("generate --out some {frames}"));
    assert!(!run.out.contains("contact-sheet.png"), "{}", run.out);
    root(&bench, "some", 3);
    let run = bench.good("merge some --frames 3 --verify");
    assert!(!run.out.contains("contact-sheet.png"), "{}", run.out);
    let (all, some) = (bench.files("all"), bench.files("some"));
    let left_out = |name: &str| {
        ["noise-free/", "labels/layers/", "labels/semantic/", "contact-sheet.png"].iter().any(|it| name.starts_with(it))
    };
    assert_eq!(some.keys().collect::<Vec<_>>(), all.keys().filter(|name| !left_out(name)).collect::<Vec<_>>());
    let records_the_layout =
        |name: &str| name.starts_with("shards/") || ["README.md", "manifest.json", "croissant.json"].contains(&name);
    for (name, bytes) in some.iter().filter(|(name, _)| !records_the_layout(name) || name.ends_with(".coco.json")) {
        assert_eq!(*bytes, all[name], "{name}");
    }
    let card = String::from_utf8(some["README.md"].clone()).unwrap();
    assert!(
        card.contains("| `images/, preview/, labels/` |") && card.contains("without noise-free, layers, semantic"),
        "{card}"
    );
    // A missing file that is not left out is found.
    fs::remove_file(bench.path("some/labels/debris/000001.tif")).unwrap();
    assert!(bench.run("verify some").out.contains("labels/debris/000001.tif"));
    bench.good(&format!("generate --out some --verify {frames}"));
    root(&bench, "some", 3);
    // Another choice is another layout.
    let run = bench.run(&format!("generate --out some --frames 3 {TINY}"));
    assert!(
        run.code == 2 && run.err.contains("with --without noise-free,layers,semantic,contact-sheet; choose"),
        "{}",
        run.err
    );
    for (options, expected) in [
        ("--without noise", "noise-free"),
        ("--without noise-free --format cellpose", "cellpose does not contain it"),
        ("--without labels --format folder,cellpose", "`cellpose` needs label images"),
    ] {
        let run = bench.run(&format!("generate --out none --frames 1 {options} {TINY}"));
        assert!(run.code == 2 && run.err.contains(expected), "{}", run.err);
    }
    // Noise-free images can be left out of a conversion.
    let run = bench.run("convert some --out converted --format folder");
    assert!(run.code == 2 && run.err.contains("--without noise-free"), "{}", run.err);
    bench.good("convert some --out converted --format folder --without noise-free");
    root(&bench, "converted", 3);
    assert!(!bench.path("converted/noise-free").exists() && bench.path("converted/labels/layers/000002.tif").exists());
}

#[test]
fn four_processes_may_write_the_same_shards() {
    let bench = Bench::new("writers");
    let frames = format!("--frames 6 --format folder,webdataset --frames-per-shard 2 {TINY}");
    bench.good(&format!("generate --out one {frames}"));
    let children: Vec<_> = (0..4).map(|_| bench.spawn(&format!("generate --quiet --out four {frames}"))).collect();
    for mut child in children {
        assert!(child.wait().unwrap().success());
    }
    bench.good("merge four --frames 6");
    assert_eq!(root(&bench, "four", 6), root(&bench, "one", 6));
}

/// Kills runs at random times, 15 or `PAPSYNTH_KILLS` times: no file is lost, corrupt or duplicated.
#[cfg(unix)]
#[test]
fn the_next_run_completes_a_killed_run() {
    let bench = Bench::new("kills");
    let frames = format!("--quiet --threads 2 --frames 6 --format folder,webdataset --frames-per-shard 2 {TINY}");
    #[expect(clippy::disallowed_methods, reason = "times of kills depend on the duration of a run")]
    let start = std::time::Instant::now();
    bench.good(&format!("generate --out whole {frames}"));
    let whole = u64::try_from(start.elapsed().as_micros()).unwrap();
    let expected = root(&bench, "whole", 6);
    let kills: u64 = std::env::var("PAPSYNTH_KILLS").ok().and_then(|n| n.parse().ok()).unwrap_or(15);
    let mut state = 20_261_122_u64;
    let (mut killed, mut rounds) = (0, 0);
    while killed < kills {
        rounds += 1;
        loop {
            let mut child = bench.spawn(&format!("generate --out out {frames}"));
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            std::thread::sleep(std::time::Duration::from_micros((state >> 33) % (whole * 5 / 4).max(1)));
            let ended = child.try_wait().unwrap();
            child.kill().unwrap();
            let _ = child.wait();
            if ended.is_some_and(|status| status.success()) {
                break;
            }
            assert!(ended.is_none(), "a run succeeds unless it is killed");
            killed += 1;
            // Every file with its final name is complete; the folder may not exist yet.
            let left = if bench.path("out").exists() { bench.files("out") } else { Default::default() };
            for (name, bytes) in left {
                let good = fs::read(bench.path("whole").join(&name));
                let changes = ["manifest.json", "splits.csv", "README.md", "croissant.json", "contact-sheet.png"];
                let is_whole = good.is_ok_and(|good| good == bytes) || changes.contains(&name.as_str());
                assert!(is_whole || name.ends_with(".tmp"), "{name} after {killed} kills");
            }
            if killed >= kills {
                bench.good(&format!("generate --out out {frames}"));
                break;
            }
        }
        bench.good("clean out");
        assert_eq!(root(&bench, "out", 6), expected, "round {rounds}");
        fs::remove_dir_all(bench.path("out")).unwrap();
    }
    eprintln!("{killed} kills in {rounds} rounds");
}

/// A full disk in memory; skipped where the system does not allow to mount one.
#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_leaves_no_partial_files_and_the_run_continues_when_there_is_space() {
    const SCRIPT: &str = r#"
        program=$1; shift
        mkdir disk && mount -t tmpfs -o size=160k tmpfs disk || { echo 'no disk'; exit 0; }
        "$program" generate --out disk/out "$@" 2> message; echo "first $?"
        (cd disk/out && find . -type f) | while read -r name; do
            case $name in
                *.tmp) echo "left $name" ;;
                ./manifest.json) ;;
                *) cmp -s "disk/out/$name" "whole/$name" || echo "partial $name" ;;
            esac
        done
        mount -o remount,size=64m disk
        "$program" generate --out disk/out "$@"; echo "second $?"
        "$program" verify disk/out --frames 6
        umount disk
    "#;
    let bench = Bench::new("full-disk");
    for format in ["folder", "webdataset,cellpose,qupath --frames-per-shard 2"] {
        let words = format!("--quiet --threads 2 --frames 6 --format {format} {TINY}");
        bench.good(&format!("generate --out whole {words}"));
        let Some(said) = bench.script_as_root(SCRIPT, &words).filter(|said| !said.contains("no disk")) else {
            eprintln!("skipped: this system does not allow to mount a small disk");
            return;
        };
        assert!(said.contains("first 74\n"), "{said}");
        let message = fs::read_to_string(bench.path("message")).unwrap();
        assert!(message.contains("No space left") && message.contains("disk/out"), "{message}");
        assert!(!said.contains("partial") && !said.contains("left "), "{said}");
        assert!(said.contains("second 0\n"), "{said}");
        assert!(said.contains(&format!("root {}", root(&bench, "whole", 6))), "{said}");
        fs::remove_dir_all(bench.path("whole")).unwrap();
        fs::remove_dir(bench.path("disk")).unwrap();
    }
}

#[test]
fn damage_is_found_and_repaired() {
    let bench = Bench::new("mend");
    let command = format!("generate --out out --frames 3 {TINY}");
    bench.good(&command);
    let before = bench.files("out");
    let path = bench.path("out/labels/nucleus/000001.tif");
    let mut bytes = fs::read(&path).unwrap();
    bytes[200] ^= 4;
    fs::write(&path, bytes).unwrap();
    fs::write(bench.path("out/mine.txt"), "mine").unwrap();
    let run = bench.run("verify out --json");
    assert_eq!(run.code, 2);
    let verdict: serde_json::Value = serde_json::from_str(&run.out).unwrap();
    assert_eq!(verdict["findings"][0]["path"], "labels/nucleus/000001.tif");
    assert_eq!(verdict["findings"][1]["fix"], "clean-untracked");
    bench.good(&format!("{command} --verify"));
    let run = bench.run("verify out");
    let hint = "`papsynth clean out --untracked` would delete the untracked files";
    assert!(run.code == 2 && run.err.contains(hint) && !run.err.contains("--verify"), "{}", run.err);
    let text = "mine.txt\nout: would remove 0 temporary files and 1 untracked file\n";
    assert_eq!(bench.good("clean out --untracked --dry-run").out, format!("would remove {text}"));
    assert_eq!(bench.files("out").len(), before.len() + 1);
    let text = "mine.txt\nout: removed 0 temporary files and 1 untracked file\n";
    assert_eq!(bench.good("clean out --untracked").out, format!("removed {text}"));
    assert_eq!(bench.files("out"), before);
    root(&bench, "out", 3);
}

#[test]
fn an_unfinished_data_set_is_completed_by_the_same_command() {
    let bench = Bench::new("unfinished");
    let command = format!("generate --out out --frames 3 {TINY}");
    bench.good(&format!("{command} --task 0/2"));
    fs::write(bench.path("out/images/.000001.png.0123456789abcdef.tmp"), "half").unwrap();
    fs::write(bench.path("out/images/000001.png"), "no record yet").unwrap();
    let run = bench.run("verify out");
    assert!(run.code == 2 && run.err.contains("run the same `papsynth generate` command again"), "{}", run.err);
    assert!(run.err.contains("`papsynth clean out` removes temporary files"), "{}", run.err);
    assert!(!run.err.contains("--untracked"), "{}", run.err);
    fs::rename(bench.path("out/model.json"), bench.path("model.json")).unwrap();
    let run = bench.run("verify out");
    assert!(run.out.contains("model.json: missing\n"), "{}", run.out);
    bench.good(&command);
    root(&bench, "out", 3);
}

#[test]
fn a_data_set_of_a_range_is_complete() {
    let bench = Bench::new("range");
    bench.good(&format!("generate --out rng --range 3..5 {TINY}"));
    let run = bench.good("verify rng");
    assert!(run.out.contains("no problems found, 2 frames"), "{}", run.out);
    assert!(run.err.contains("frames that were not generated: 0-2"), "{}", run.err);
    assert!(bench.good("status rng").out.ends_with("finished\n"));
    // --frames requires all frames from 0, and a lost record is still found.
    assert!(bench.run("verify rng --frames 5").out.contains("missing: frames 0–2"));
    fs::remove_file(bench.path("rng/shards/000004.json")).unwrap();
    let run = bench.run("verify rng");
    assert!(run.code == 2 && run.out.contains("missing"), "{}", run.out);
    bench.good(&format!("generate --out rng --range 3..5 {TINY} --quiet"));
    bench.good(&format!("generate --out rng --range 7..8 {TINY} --quiet"));
    let run = bench.good("verify rng");
    assert!(run.err.contains("frames that were not generated: 0-2,5-6"), "{}", run.err);
    assert!(bench.good("status rng").out.contains("missing shards: 5-6"));
}

#[test]
fn the_changed_option_or_setting_is_named() {
    let bench = Bench::new("changed");
    let command = format!("generate --out out --frames 1 {TINY}");
    bench.good(&command);
    for (more, expected) in [
        ("--scenes", "was written without --scenes; choose another folder, or leave it out"),
        ("--set light.kind=colour", "`light.kind` is \"monochrome\" in the existing recipe"),
    ] {
        let run = bench.run(&format!("{command} {more}"));
        assert!(run.code == 2 && run.err.contains(expected), "{}", run.err);
    }
}

#[test]
fn frames_are_added_in_the_formats_of_the_data_set() {
    let bench = Bench::new("added");
    bench.good(&format!("generate --out out --frames 2 --format cellpose --frames-per-shard 2 {TINY}"));
    bench.good(&format!("generate --out out --range 20000..20001 {TINY} --quiet"));
    assert!(bench.good("inspect out").out.contains("frames      3\n"));
    // A new data set of a range above 10000 is in shards of 256 frames.
    let range = format!("generate --out other --range 20000..20002 {TINY}");
    let run = bench.run(&range);
    assert!(run.code == 2 && run.err.contains("or use --format folder, or --frames-per-shard 1"), "{}", run.err);
    bench.good(&format!("{range} --format folder"));
    bench.good(&range);
}

#[test]
fn a_folder_that_does_not_exist_is_named() {
    let bench = Bench::new("no-folder");
    fs::write(bench.path("file"), "x").unwrap();
    fs::create_dir(bench.path("empty")).unwrap();
    for (dir, expected) in
        [("none", "none: no such folder"), ("file", "file: is a file"), ("empty", "empty: contains no data set")]
    {
        for words in ["verify", "status", "inspect", "clean", "merge --frames 1"] {
            let run = bench.run(&format!("{words} {dir}"));
            assert!(run.code == 2 && run.err.contains(expected), "{words} {dir}: {}", run.err);
        }
    }
}

#[test]
fn conversion_changes_only_the_format() {
    let bench = Bench::new("convert");
    bench.good(&format!("generate --out out --frames 3 {TINY}"));
    bench.good(&format!("generate --out direct --frames 3 --format stardist,qupath --flatten drop {TINY}"));
    bench.good("convert out --out converted --format qupath,stardist --flatten drop");
    assert_eq!(bench.files("direct"), bench.files("converted"));
    let run = bench.run("convert out --out converted --format yolo-seg");
    assert!(run.code == 2 && run.err.contains("with --format stardist,qupath, not yolo-seg"), "{}", run.err);
    assert_eq!(bench.run("convert out --out other").code, 2);
    assert_eq!(bench.run("convert none --out other --format cellpose").code, 2);
}

#[test]
#[cfg(not(feature = "zarr"))]
fn a_format_of_another_build_is_rejected_before_a_file_is_written() {
    let bench = Bench::new("another-build");
    let run = bench.run("generate --out out --frames 1 --format folder,ome-zarr");
    assert!(run.code == 2 && run.err.contains("needs a build of papsynth with `--features zarr`"), "{}", run.err);
    assert!(!bench.path("out").exists());
    assert!(bench.good("generate --help").out.contains("needs a build with --features zarr"));
}

#[test]
#[cfg(not(feature = "parquet"))]
fn parquet_of_another_build_is_rejected_before_a_file_is_written() {
    let bench = Bench::new("without-parquet");
    let run = bench.run("generate --out out --frames 1 --format huggingface");
    assert!(run.code == 2 && run.err.contains("needs a build of papsynth with `--features parquet`"), "{}", run.err);
    assert!(!bench.path("out").exists());
    // Help lines are wrapped.
    let help = bench.good("generate --help").out;
    let words: Vec<&str> = help.split_whitespace().collect();
    assert!(words.join(" ").contains("(needs a build with --features parquet)"), "{help}");
}

#[test]
#[cfg(feature = "zarr")]
fn zarr_groups_are_written_verified_and_converted() {
    let bench = Bench::new("zarr");
    bench.good(&format!("generate --out out --frames 2 {TINY}"));
    bench.good(&format!("generate --out direct --frames 2 --format ome-zarr {TINY}"));
    bench.good("convert out --out converted --format ome-zarr");
    assert_eq!(bench.files("direct"), bench.files("converted"));
    root(&bench, "direct", 2);
    bench.good("convert direct --out flat --format cellpose");
    bench.good("convert out --out flat-too --format cellpose");
    assert_eq!(bench.files("flat"), bench.files("flat-too"));
    let lost = bench.path("direct/ome-zarr/000001.ome.zarr/0/c/0/0");
    fs::remove_file(lost).unwrap();
    let run = bench.run("verify direct");
    assert!(run.code == 2 && run.out.contains("000001.ome.zarr/0/c/0/0"), "{} {}", run.out, run.err);
    bench.good(&format!("generate --out direct --frames 2 --format ome-zarr --verify {TINY}"));
    assert_eq!(bench.files("direct"), bench.files("converted"));
}

#[test]
fn rerender_changes_images_but_not_ground_truth() {
    let bench = Bench::new("rerender");
    bench.good(&format!("generate --out out --range 2..5 {TINY}"));
    let soft = bench
        .good("rerender out --out soft --set optics.extra_blur_um=0.8 --set stain.slide_nucleus=0.5 --camera scmos");
    assert!(soft.out.contains("3 frames written"), "{}", soft.out);
    let (before, after) = (bench.files("out"), bench.files("soft"));
    for name in ["labels/nucleus/000002.tif", "labels/cytoplasm/000004.tif", "labels/layers/000003.tif"] {
        assert_eq!(before[name], after[name], "{name}");
    }
    assert_ne!(before["images/000002.png"], after["images/000002.png"]);
    let same = bench.good("rerender out --out same");
    assert!(same.out.contains("3 frames written"), "{}", same.out);
    assert_eq!(bench.files("same"), before);
    let run = bench.run("rerender out --out other --set cells.intermediate.count=9");
    assert!(run.code == 2 && run.err.contains("`cells` changes the objects of a scene"), "{}", run.err);
    let run = bench.run("rerender out --out finer --set optics.oversampling=3");
    assert!(run.code == 0 || run.err.contains("the ground truth differs"), "{}", run.err);
}

#[test]
fn files_of_others_are_not_replaced() {
    let bench = Bench::new("others");
    fs::write(bench.path("recipe.toml"), "mine").unwrap();
    let tile = format!("slide tile --at 0,0 --size 64,64 --out recipe.toml {TINY}");
    let run = bench.run(&tile);
    assert!(run.code == 2 && run.err.contains("recipe.toml"), "{}", run.err);
    for (out, why) in [
        ("s3:/bucket/set", "write s3://bucket/set"),
        ("recipe.toml", "expected a folder, found a file"),
        ("recipe.toml/set", "recipe.toml"),
    ] {
        let run = bench.run(&format!("generate --out {out} --frames 1 {TINY}"));
        assert!(run.code == 2 && run.err.contains(why), "{out}: {}", run.err);
    }
    assert!(!bench.path("s3:").exists());
    let sweep = "sweep --frames 1 --vary focus.centre_um=1,2 --out";
    for (folder, file) in [("full", "notes.txt"), ("table", "sweep.csv"), ("more", "0002")] {
        fs::create_dir(bench.path(folder)).unwrap();
        fs::write(bench.path(folder).join(file), "mine").unwrap();
        let before = bench.files(folder);
        let run = bench.run(&format!("{sweep} {folder} {TINY}"));
        assert!(run.code == 2 && run.err.contains(file), "{folder}: {}", run.err);
        assert_eq!(bench.files(folder), before);
    }
    #[cfg(unix)]
    {
        fs::create_dir_all(bench.path("links")).unwrap();
        fs::create_dir(bench.path("elsewhere")).unwrap();
        std::os::unix::fs::symlink(bench.path("elsewhere"), bench.path("links/0000")).unwrap();
        let run = bench.run(&format!("{sweep} links {TINY}"));
        assert!(run.code == 2 && run.err.contains("0000"), "{}", run.err);
        assert!(bench.files("elsewhere").is_empty());
        // The same command fails again, so the exit code is 2.
        std::os::unix::fs::symlink(bench.path("nowhere"), bench.path("dangling")).unwrap();
        let run = bench.run(&format!("generate --out dangling --frames 1 {TINY}"));
        assert!(run.code == 2 && run.err.contains("dangling"), "{}", run.err);
    }
    let run =
        bench.run(&format!("sweep --out twice --frames 1 --vary focus.centre_um=1 --vary focus.centre_um=3,4 {TINY}"));
    assert!(run.code == 2 && run.err.contains("given twice") && !bench.path("twice").exists(), "{}", run.err);
    let run = bench.run(&format!("sweep --out equal --frames 1 --vary focus.centre_um=1,1 {TINY}"));
    assert!(run.code == 2 && run.err.contains("occurs twice") && !bench.path("equal").exists(), "{}", run.err);
    let run = bench.run(&format!("generate --out range --range 1..3 --frames-per-shard 2 {TINY}"));
    assert!(run.code == 2 && run.err.contains("multiple of 2") && !bench.path("range").exists(), "{}", run.err);
}

#[test]
fn large_numbers_of_frames_need_no_memory() {
    let bench = Bench::new("vast");
    bench.good(&format!("generate --out out --frames 1 {TINY}"));
    let most = u64::MAX;
    let run = bench.run_within(500_000, &format!("status out --frames {most} --missing"));
    assert_eq!((run.code, run.out.trim()), (0, format!("1-{}", most - 1).as_str()), "{}", run.err);
    let run = bench.run_within(500_000, &format!("status out --frames {most} --missing --tasks 3"));
    assert_eq!((run.code, run.out.trim()), (0, "0-2"), "{}", run.err);
    let run = bench.run_within(500_000, &format!("merge out --frames {most}"));
    assert!(run.code == 2 && run.err.contains("shards are missing"), "{}", run.err);
    // The run starts without delay.
    let words = format!("generate --json --threads 1 --out many --format folder --frames {most} {TINY}");
    let mut child = bench.spawn_piped(&words);
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    assert!(lines.nth(2).unwrap().unwrap().contains("\"done\":2"));
    child.kill().unwrap();
    child.wait().unwrap();
}

#[test]
fn a_sweep_writes_every_combination_and_one_table() {
    let bench = Bench::new("sweep");
    let vary = "--vary camera.full_well_e=2000,18000 --vary debris.speckles.count=0,9,30";
    bench.good(&format!("sweep --out sweep --frames 2 {vary} {TINY}"));
    let table = String::from_utf8(fs::read(bench.path("sweep/sweep.csv")).unwrap()).unwrap();
    let lines: Vec<&str> = table.lines().collect();
    assert_eq!(lines.len(), 1 + 2 * 3 * 2);
    assert_eq!(lines[0], "set,image,slide,file,camera.full_well_e,debris.speckles.count");
    assert_eq!(lines[12], "0005,1,0,images/000001.png,18000,30");
    let files = bench.files("sweep");
    // Cells do not depend on speckles, and masks do not depend on the camera.
    assert_eq!(files["0000/labels/nucleus/000001.tif"], files["0005/labels/nucleus/000001.tif"]);
    assert_eq!(files["0002/labels/debris/000001.tif"], files["0005/labels/debris/000001.tif"]);
    assert_ne!(files["0000/images/000001.png"], files["0003/images/000001.png"]);
    assert_eq!(bench.run(&format!("sweep --out other --frames 1 --vary camera.bits=8,99 {TINY}")).code, 2);
    assert!(!bench.path("other").exists());
}

#[test]
fn a_plan_estimates_time_size_and_shards() {
    let bench = Bench::new("plan");
    let run = bench.good(&format!("plan --frames 100000 --samples 3 --tasks 10 --per-core-hour 0.05 {TINY}"));
    for part in ["391 shards", "core hours", "10 tasks", "price", "webdataset", "on disk"] {
        assert!(run.out.contains(part), "{part}: {}", run.out);
    }
    assert!(bench.files("").is_empty(), "no file remains");
}

#[test]
fn submit_reports_errors_of_the_tasks() {
    let bench = Bench::new("submit-here");
    let submit = |words: &str| bench.run(&format!("submit {words} --frames 30"));
    let run = submit("slurm --tasks 2 -- generate --out x");
    assert!(run.code == 2 && run.err.contains("give only the arguments of `papsynth generate`"), "{}", run.err);
    let run = submit("slurm --tasks 2 -- --out x --set a.b=1");
    assert!(run.code == 2 && run.err.contains("a.b"), "{}", run.err);
    let run = submit("slurm --tasks 2 -- there.toml --out x");
    assert!(run.code == 0 && run.err.contains("there.toml is not on this machine"), "{}", run.err);
    let pod = |out: &str| submit(&format!("kubernetes --tasks 2 --image i -- --out {out}"));
    let run = pod("many");
    assert!(run.code == 0 && run.err.contains("many is inside the pod"), "{}", run.err);
    for out in ["/data/many", "s3://bucket/many"] {
        assert_eq!(pod(out).err, "", "{out}");
    }
}

#[test]
fn changed_inputs_of_a_data_set_are_refused() {
    let bench = Bench::new("changed-inputs");
    bench.good(&format!("generate --out out --frames 1 {TINY}"));
    for name in ["out/recipe.toml", "out/model.json"] {
        let good = fs::read(bench.path(name)).unwrap();
        fs::write(bench.path(name), [&good[..], b"\n"].concat()).unwrap();
        for words in ["rerender out --out again", "convert out --out other --format cellpose"] {
            let run = bench.run(words);
            assert!(run.code == 2 && run.err.contains("was changed after generation"), "{words}: {}", run.err);
        }
        fs::write(bench.path(name), good).unwrap();
    }
    bench.good("rerender out --out again");
}

#[test]
fn submit_prints_scripts_and_rejects_invalid_arguments() {
    let bench = Bench::new("submit");
    let run = bench.good("submit slurm --tasks 4 --threads 2 -- --out many --frames 2000 --format webdataset");
    for part in ["--array=0-3", "--task auto/4", "--cpus-per-task=2", "generate --out many --frames 2000"] {
        assert!(run.out.contains(part), "{part}: {}", run.out);
    }
    let run = bench.good("submit kubernetes --tasks 4 --image papsynth:1 -- --out /data/many --frames 2000");
    for part in ["completions: 4", "backoffLimitPerIndex", "podFailurePolicy", "\"auto/4\"", "values: [2]"] {
        assert!(run.out.contains(part), "{part}: {}", run.out);
    }
    for wrong in [
        "submit slurm --tasks 4 -- --out many --frams 2000",
        "submit slurm --tasks 4 -- --out many --frames 2000 --task 0/4",
        "submit slurm --tasks 9 -- --out many --frames 1000 --format webdataset",
        "submit kubernetes --tasks 4 -- --out many --frames 2000",
    ] {
        assert_eq!(bench.run(wrong).code, 2, "{wrong}");
    }
}

#[test]
fn unfinished_data_sets_are_not_taken_for_complete_ones() {
    let bench = Bench::new("unfinished");
    let generate = format!("generate --out out --frames 4 {TINY}");
    bench.good(&format!("{generate} --task 0/2"));
    bench.good(&format!("generate --out whole --frames 4 --seed 5 {TINY}"));
    let commands = ["convert out --out new --format cellpose", "rerender out --out new", "judge whole out --out new"];
    let built = if cfg!(feature = "judge") { 3 } else { 2 };
    for command in &commands[..built] {
        let run = bench.run(command);
        assert!(run.code == 2 && run.err.contains("out: the data set is not finished"), "{command}: {}", run.err);
        assert!(!bench.path("new").exists(), "{command}");
    }
    bench.good(&generate);
    bench.good("convert out --out new --format cellpose");
}
