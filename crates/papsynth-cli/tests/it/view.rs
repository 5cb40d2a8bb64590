//! `papsynth view`.

#[allow(dead_code, reason = "each test uses a part")]
use std::fs;

use crate::support::{Bench, TINY};

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
    use std::io::{BufRead, BufReader, Read, Write};
    use std::net::TcpStream;
    use std::process::Command;

    let bench = Bench::new("view-serves");
    bench.good(&format!("generate --out set --frames 2 {TINY}"));
    let mut child = bench.spawn_piped("view set");
    let mut out = BufReader::new(child.stdout.take().unwrap());
    let mut text = String::new();
    (0..2).for_each(|_| assert!(out.read_line(&mut text).unwrap() > 0));
    let address = text.split_whitespace().find_map(|word| word.strip_prefix("http://127.0.0.1:")).unwrap();
    let port: u16 = address.trim_end_matches('/').parse().unwrap();
    let mut stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    let request = format!("GET /info HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nConnection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    let info: serde_json::Value = serde_json::from_str(answer.split("\r\n\r\n").nth(1).unwrap()).unwrap();
    assert_eq!((&info["title"], &info["images"]), (&"set".into(), &2.into()), "{info}");
    let taken = bench.run(&format!("view set --port {port}"));
    assert!(taken.code == 2 && taken.err.contains(&format!("127.0.0.1:{port}")), "{}", taken.err);
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(0));
}
