//! `papsynth workbench`.

use crate::support::Bench;
#[cfg(unix)]
use crate::support::TINY;

#[test]
fn invalid_input_of_a_workbench_has_exit_code_2() {
    let bench = Bench::new("workbench-refused");
    for (words, named) in [
        ("workbench missing.toml", "missing.toml"),
        ("workbench --preset unknown", "unknown"),
        ("workbench --set camera.read_noise=3", "read_noise_e"),
        ("workbench --port 0", "--port"),
        ("workbench --max-memory 2XiB", "--max-memory"),
    ] {
        let run = bench.run(words);
        assert!(run.code == 2 && run.err.contains(named), "{words}: {} {}", run.code, run.err);
    }
}

#[cfg(unix)]
#[test]
fn a_workbench_starts_with_the_recipe_and_ends_with_ctrl_c() {
    let bench = Bench::new("workbench-serves");
    let server = bench.serve(&format!("workbench --seed 9 --set camera.read_noise_e=77 {TINY}"));
    let info = server.get("/info");
    assert_eq!(info["seed"], 9);
    assert_eq!(info["recipe"]["camera"]["read_noise_e"].as_f64(), Some(77.0));
    assert_eq!(server.interrupt(), Some(0));
}

/// A session of a page: other presets, fields, optics and sizes, small images, images of the user.
#[cfg(target_os = "linux")]
#[test]
fn a_session_stays_within_the_memory() {
    use serde_json::{Value, json};

    const MIB: u64 = 1 << 20;
    const LIMIT: u64 = 1024 * MIB;
    let bench = Bench::new("workbench-memory");
    let server = bench.serve("workbench --threads 2 --max-memory 1GiB");
    let render = |recipe: &Value, view: &str, index: u64| -> Value {
        let asked =
            json!({ "recipe": recipe, "seed": 1, "index": index, "view": view, "focus_um": null, "noise_free": false });
        let reply = server.post("/render", "application/json", asked.to_string().as_bytes());
        let (length, rest) = reply.split_first_chunk::<4>().unwrap();
        serde_json::from_slice(&rest[..usize::try_from(u32::from_le_bytes(*length)).unwrap()]).unwrap()
    };
    let info = server.get("/info");
    let recipe_of = |name: &str| {
        let presets = info["presets"].as_array().unwrap();
        presets.iter().find(|preset| preset["name"] == name).unwrap()["recipe"].clone()
    };
    let mut shown = Value::Null;
    for name in ["lbc", "inflamed", "dense"] {
        let mut recipe = recipe_of(name);
        for index in 0..2 {
            for view in ["coarse", "reduced", "full"] {
                shown = render(&recipe, view, index);
            }
            assert!(shown["id"].is_u64(), "{shown}");
        }
        render(&recipe, "small", 2);
        for step in 0..4 {
            recipe["optics"]["condenser_na"] = json!(0.3 + 0.05 * f64::from(step));
            render(&recipe, "full", 1);
        }
        assert!(server.peak_bytes() <= LIMIT, "{name}: {} MiB", server.peak_bytes() / MIB);
    }
    // The largest field that is accepted.
    let mut recipe = recipe_of("lbc");
    for side in [8000, 4000, 1200] {
        (recipe["field"]["width_px"], recipe["field"]["height_px"]) = (json!(side), json!(side));
        let head = render(&recipe, "reduced", 0);
        if head["id"].is_u64() {
            shown = render(&recipe, "full", 0);
            break;
        }
        assert!(head["errors"][0]["message"].as_str().unwrap().contains("MiB"), "{head}");
    }
    let id = &shown["id"];
    server.get(&format!("/legend/{id}/class/nucleus"));
    assert!(server.peak_bytes() <= LIMIT, "{} pixels: {} MiB", shown["width"], server.peak_bytes() / MIB);
    // Images of the user, until they are rejected.
    bench.grey_png("large.png", 1500, 1000, |x, y| u8::try_from((x * 7 + y * 13) % 251).unwrap());
    let file = std::fs::read(bench.path("large.png")).unwrap();
    let is_kept = |_: &u32| !server.post("/real", "application/octet-stream", &file).starts_with(b"{\"error\"");
    let kept = (0..200).take_while(is_kept).count();
    assert!((1..200).contains(&kept), "{kept}");
    assert!(server.peak_bytes() <= LIMIT, "{kept} images: {} MiB", server.peak_bytes() / MIB);
    assert_eq!(server.interrupt(), Some(0));
}
