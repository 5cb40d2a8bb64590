//! Memory estimates and limits.
#![cfg(target_os = "linux")]

use std::io::{BufRead, BufReader};

use crate::support::Bench;
use serde_json::Value;

/// Expected and measured peak memory of a run, bytes.
fn measured(bench: &Bench, words: &str) -> [u64; 2] {
    let run = bench.good(&format!("generate --json --out out {words}"));
    let events: Vec<Value> = run.out.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let of = |name: &str, key: &str| {
        events.iter().find(|event| event["event"] == name).and_then(|event| event[key].as_u64()).unwrap()
    };
    std::fs::remove_dir_all(bench.path("out")).unwrap();
    [of("start", "memory_bytes"), of("done", "peak_memory_bytes")]
}

/// Runs with `cargo xtask torture`.
#[test]
#[ignore = "takes a minute"]
fn the_estimate_is_an_upper_bound_within_a_factor() {
    let bench = Bench::new("estimate");
    let square = |side: usize, frames: usize| {
        format!("--frames {frames} --set field.width_px={side} --set field.height_px={side} --set layout.kind=uniform")
    };
    let mut wrong = Vec::new();
    for words in [
        format!("--threads 1 {} --set cells={{}} --set debris={{}}", square(64, 1)),
        format!("--threads 1 {}", square(256, 1)),
        format!("--threads 1 {}", square(1024, 3)),
        format!("--threads 1 {} --set optics.oversampling=1", square(1024, 1)),
        format!("--threads 1 {} --set optics.oversampling=4", square(1024, 1)),
        format!("--threads 1 {} --set field.pixel_um=0.125", square(1024, 1)),
        format!("--threads 1 {} --set field.pixel_um=0.5", square(1024, 1)),
        format!("--threads 1 {} --set cells.intermediate.count=200", square(1024, 1)),
        format!("--threads 1 {} --set light.kind=colour", square(1024, 1)),
        format!("--threads 1 {} --set focus.planes=3", square(1024, 1)),
        format!("--threads 1 {} --set focus.planes=9 --format webdataset", square(1024, 1)),
        format!("--threads 1 {} --set focus.planes=3 --set light.kind=colour", square(768, 1)),
        format!("--threads 1 {} --set focus.planes=128 --set focus.step_um=1", square(256, 1)),
        format!("--threads 2 {}", square(1024, 4)),
        format!("--threads 4 {}", square(1024, 1)),
        format!("--threads 4 {} --set light.kind=colour", square(768, 1)),
        format!("--threads 1 {} --set cells={{}}", square(4096, 1)),
        format!("--threads 1 {} --set cells={{}} --set light.kind=colour", square(3072, 1)),
        "--threads 1 --frames 2 --preset dense".to_owned(),
        "--threads 1 --frames 2 --preset inflamed".to_owned(),
        "--threads 1 --frames 2 --preset paper-2015".to_owned(),
    ] {
        let [expected, needed] = measured(&bench, &words).map(|bytes| bytes as f64 / 1_048_576.0);
        let line = format!("{expected:6.0} MiB expected, {needed:6.0} MiB needed, {:.2}: {words}", expected / needed);
        eprintln!("{line}");
        if needed > expected || expected > 2.5 * needed {
            wrong.push(line);
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Anonymous memory of a process, kilobytes.
fn resident(process: u32) -> f64 {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("RssAnon:")).unwrap();
    line.trim().strip_suffix("kB").unwrap().trim().parse().unwrap()
}

/// Generates `PAPSYNTH_TINY` images, or 100000. Mean memory grows by less than 5 % between the second and the last
/// tenth.
#[test]
#[ignore = "takes a quarter of an hour"]
fn a_hundred_thousand_tiny_images_need_no_more_memory_than_ten_thousand() {
    let bench = Bench::new("tiny");
    let count: u64 = std::env::var("PAPSYNTH_TINY").ok().and_then(|n| n.parse().ok()).unwrap_or(100_000);
    let mut child = bench.spawn_piped(&format!(
        "generate --json --threads 2 --out out --frames {count} --format webdataset --preset paper-2015 --set layout.kind=uniform \
         --set field.width_px=32 --set field.height_px=32 --set cells={{}} --set cells.intermediate.count=1 \
         --set debris.bacilli.clusters=0 --set debris.leukocytes.clusters=0 --set debris.speckles.count=0"
    ));
    let (mut early, mut late) = (Vec::new(), Vec::new());
    for line in BufReader::new(child.stdout.take().unwrap()).lines() {
        let event: Value = serde_json::from_str(&line.unwrap()).unwrap();
        match event["done"].as_u64() {
            // The process may end during the last frames.
            Some(done) if done % 20 != 0 || done + 100 > count => {}
            Some(done) if done * 10 / count == 1 => early.push(resident(child.id())),
            Some(done) if done * 10 / count == 9 => late.push(resident(child.id())),
            _ => {}
        }
    }
    assert!(child.wait().unwrap().success());
    let mean = |samples: &[f64]| samples.iter().sum::<f64>() / samples.len() as f64;
    let (early, late) = (mean(&early), mean(&late));
    let growth = 100.0 * (late / early - 1.0);
    eprintln!("{count} images: {early:.0} kB in the second tenth, {late:.0} kB in the last, {growth:+.1} %");
    assert!(growth < 5.0, "{early:.0} kB, then {late:.0} kB");
}

#[test]
fn fewer_threads_are_used_or_the_run_is_rejected_if_memory_is_short() {
    let bench = Bench::new("fit");
    let field =
        |side: usize| format!("--set field.width_px={side} --set field.height_px={side} --set layout.kind=uniform");
    // Without the limit, the kernel would kill the run.
    let run = bench.run(&format!("generate --out out --frames 1 {} --max-memory 2GiB", field(32_768)));
    assert_eq!(run.code, 2, "{}", run.err);
    for part in ["field.width_px", "32768 x 32768", "2.0 GiB", "--max-memory"] {
        assert!(run.err.contains(part), "{part}: {}", run.err);
    }
    assert!(!bench.path("out").exists());
    let small = format!("{} --set cells={{}} --set debris={{}}", field(512));
    let events = |words: &str| bench.good(&format!("generate --json {small} {words}"));
    let run = events("--out one --frames 8 --threads 8 --max-memory 100MiB");
    let start: Value = serde_json::from_str(run.out.lines().next().unwrap()).unwrap();
    let (threads, bytes) = (start["threads"].as_u64().unwrap(), start["memory_bytes"].as_u64().unwrap());
    assert!((1..8).contains(&threads) && bytes <= 100 << 20, "{start}");
    assert!(run.err.contains(&format!("{threads} of 8 threads are used")), "{}", run.err);
    let run = events("--out eight --frames 8 --threads 8 --max-memory 64GiB");
    let start: Value = serde_json::from_str(run.out.lines().next().unwrap()).unwrap();
    assert_eq!((start["threads"].as_u64(), run.err.as_str()), (Some(8), ""));
    assert_eq!(bench.files("one"), bench.files("eight"));
    for wrong in ["0", "2XB", "-1", "1e9"] {
        let run = bench.run(&format!("generate --out out --frames 1 --max-memory {wrong}"));
        assert_eq!(run.code, 2, "{wrong}: {}", run.err);
    }
}

#[test]
fn an_address_space_limit_is_an_error_or_is_kept() {
    let bench = Bench::new("addresses");
    for kilobytes in [60_000, 200_000, 330_000, 400_000, 700_000] {
        let run = bench.run_within(kilobytes, "generate --out out --frames 2 --threads 2");
        let is_rejected = run.code == 2 && run.err.contains("address-space limit") && run.err.contains("MiB");
        assert!(run.code == 0 || is_rejected, "{kilobytes}: {} {}", run.code, run.err);
        let _ = std::fs::remove_dir_all(bench.path("out"));
    }
}

#[cfg(target_os = "linux")]
#[test]
fn commands_that_render_refuse_a_field_that_does_not_fit() {
    let bench = Bench::new("memory-commands");
    let size = "--set field.width_px=6000 --set field.height_px=6000 --threads 1";
    for command in [
        "preview --out look.png",
        "generate --out set --frames 1",
        "plan --frames 2 --samples 2",
        "sweep --out sets --frames 1 --vary focus.centre_um=0,1",
    ] {
        let run = bench.run_within(2_000_000, &format!("{command} {size}"));
        assert!(run.code == 2 && run.err.contains("6000 x 6000 pixels"), "{command}: {}", run.err);
    }
    bench.good("generate --out small --frames 1 --scenes --set field.width_px=64 --set field.height_px=64");
    let scene = std::fs::read_to_string(bench.path("small/scenes/000000.json")).unwrap();
    let larger = scene.replacen("\"width\":64", "\"width\":6000", 1).replacen("\"height\":64", "\"height\":6000", 1);
    std::fs::write(bench.path("larger.json"), larger).unwrap();
    let run = bench.run_within(2_000_000, "render --scene larger.json --out look.png --threads 1");
    assert!(run.code == 2 && run.err.contains("6000 x 6000 pixels"), "{}", run.err);
    for name in ["look.png", "set", "sets"] {
        assert!(!bench.path(name).exists(), "{name}");
    }
}
