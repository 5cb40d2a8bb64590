//! `papsynth view`.

use std::fs;

use crate::support::Bench;
#[cfg(unix)]
use crate::support::TINY;

#[test]
fn invalid_input_of_a_view_has_exit_code_2() {
    let bench = Bench::new("view-refused");
    fs::create_dir(bench.path("empty")).unwrap();
    fs::create_dir(bench.path("slide")).unwrap();
    fs::write(bench.path("slide/slide.json"), "{}").unwrap();
    let slide = if cfg!(feature = "zarr") { "slide.json" } else { "--features zarr" };
    for (words, named) in [
        ("view", "DIR"),
        ("view missing", "no such folder"),
        ("view empty", "neither a data set nor a slide"),
        ("view slide", slide),
        ("view empty --port 0", "--port"),
        ("view empty --port 65536", "--port"),
    ] {
        let run = bench.run(words);
        assert!(run.code == 2 && run.err.contains(named), "{words}: {} {}", run.code, run.err);
    }
}

#[cfg(unix)]
#[test]
fn the_server_runs_until_ctrl_c() {
    let bench = Bench::new("view-serves");
    bench.good(&format!("generate --out set --frames 2 {TINY}"));
    let server = bench.serve("view set");
    let info = server.get("/info");
    assert_eq!((&info["title"], &info["images"]), (&"set".into(), &2.into()), "{info}");
    let port = server.port;
    let taken = bench.run(&format!("view set --port {port}"));
    assert!(taken.code == 2 && taken.err.contains(&format!("127.0.0.1:{port}")), "{}", taken.err);
    assert_eq!(server.interrupt(), Some(0));
}
