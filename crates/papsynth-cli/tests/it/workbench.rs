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
    use std::io::{BufRead, BufReader, Read, Write};
    use std::net::TcpStream;
    use std::process::Command;

    let bench = Bench::new("workbench-serves");
    let mut child = bench.spawn_piped(&format!("workbench --seed 9 --set camera.read_noise_e=77 {TINY}"));
    let mut text = String::new();
    assert!(BufReader::new(child.stdout.take().unwrap()).read_line(&mut text).unwrap() > 0);
    let address = text.split_whitespace().find_map(|word| word.strip_prefix("http://127.0.0.1:")).unwrap();
    let port: u16 = address.trim_end_matches('/').parse().unwrap();
    let mut stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    let request = format!("GET /info HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nConnection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    let info: serde_json::Value = serde_json::from_str(answer.split("\r\n\r\n").nth(1).unwrap()).unwrap();
    assert_eq!(info["seed"], 9);
    assert_eq!(info["recipe"]["camera"]["read_noise_e"].as_f64(), Some(77.0));
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(0));
}
