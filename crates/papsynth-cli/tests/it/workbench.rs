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
