//! Tests of a study over HTTP.

use std::fs::read_to_string;
use std::io::Write;
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::JoinHandle;

use crate::support::{Scratch, get, post, send};
use papsynth_study::{Session, StudyParams};
use papsynth_web::{Error, Server, serve_study};
use serde_json::{Value, json};

/// A server in its own thread.
struct Running {
    port: u16,
    stop: Arc<AtomicBool>,
    finished: Arc<AtomicUsize>,
    thread: Option<JoinHandle<Result<(), Error>>>,
}

impl Running {
    fn start(scratch: &Scratch) -> Self {
        let params = StudyParams { trials: 6, training: 2, patch_px: 64, ..StudyParams::default() };
        let [real, synthetic, out] = ["real", "synthetic", "out"].map(|name| scratch.join(name));
        let session = Session::open(&params, &real, &synthetic, &out).unwrap();
        let server = Server::bind_near(session.port()).unwrap();
        let (port, stop, finished) = (server.port(), Arc::default(), Arc::<AtomicUsize>::default());
        assert_eq!(server.address(), format!("http://127.0.0.1:{port}/"));
        let (flag, count) = (Arc::clone(&stop), Arc::clone(&finished));
        let thread = std::thread::spawn(move || {
            serve_study(server, session, &flag, |_| {
                count.fetch_add(1, Ordering::SeqCst);
            })
        });
        Self { port, stop, finished, thread: Some(thread) }
    }

    fn state(&self) -> Value {
        serde_json::from_slice(&get(self.port, "/state").body).unwrap()
    }

    /// Shows the current trial and answers "real".
    fn go_on(&self) -> Value {
        let state = self.state();
        let name = state["patches"][0].as_str().unwrap();
        assert_eq!(get(self.port, &format!("/patch/{name}")).status, 200);
        let exposure = json!({ "exposure_ms": 2000.5, "frames": 120, "longest_frame_ms": 17.1, "pixel_ratio": 2.0 });
        let shown = json!({ "patch": name, "exposure": exposure }).to_string();
        assert_eq!(post(self.port, "/shown", &shown).status, 200);
        let said = json!({ "patch": name, "answer": "real", "response_ms": 321.25 }).to_string();
        let answer = post(self.port, "/answer", &said);
        assert_eq!(answer.status, 200);
        serde_json::from_slice(&answer.body).unwrap()
    }

    fn end(mut self) {
        self.stop.store(true, Ordering::SeqCst);
        self.thread.take().unwrap().join().unwrap().unwrap();
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::SeqCst);
    }
}

#[test]
fn a_study_continues_after_a_restart() {
    let scratch = Scratch::of_study("http-study");
    let first = Running::start(&scratch);
    let port = first.port;
    (0..3).for_each(|_| assert_eq!(first.go_on()["finished"], false));
    assert_eq!(get(port, "/result").status, 409);
    first.end();
    let second = Running::start(&scratch);
    assert_eq!(second.port, port, "an open page finds it again");
    assert_eq!(second.state()["answered"], 3);
    (3..8).for_each(|_| {
        second.go_on();
    });
    assert_eq!(second.state()["finished"], true);
    let result: Value = serde_json::from_slice(&get(second.port, "/result").body).unwrap();
    assert_eq!(result["row"]["counts"], json!({ "tp": 3, "fp": 3, "tn": 0, "fn": 0 }));
    assert_eq!(result["row"]["accuracy"]["value"], 0.5);
    assert_eq!(result["exposure"]["median_ms"], 2000.5);
    assert_eq!(result["precision"], json!({ "half_width": 0.05, "trials": 384 }));
    let finished = Arc::clone(&second.finished);
    while finished.load(Ordering::SeqCst) == 0 {
        std::thread::yield_now();
    }
    second.end();
    assert_eq!(finished.load(Ordering::SeqCst), 1, "told once");
    let table = read_to_string(scratch.join("out/1/trials.csv")).unwrap();
    let lines: Vec<&str> = table.lines().collect();
    assert_eq!(lines.len(), 9);
    assert!(lines[0].starts_with("subject,trial,stage,design,truth,answer,correct,exposure_ms,frames,"));
    assert_eq!(lines.iter().filter(|line| line.contains(",training,")).count(), 2);
    assert!(lines[1..].iter().all(|line| line.contains(",real,") && line.contains(",2000.5,120,17.1,2,1,321.25,")));
    let summary: Value = serde_json::from_str(&read_to_string(scratch.join("out/1/summary.json")).unwrap()).unwrap();
    assert_eq!(summary, result);
}

#[test]
fn invalid_requests_do_not_stop_the_server() {
    let scratch = Scratch::of_study("http-garbage");
    let running = Running::start(&scratch);
    let port = running.port;
    let host = format!("Host: 127.0.0.1:{port}");
    let request = |line: &str, headers: &str| format!("{line}\r\n{headers}\r\nConnection: close\r\n\r\n");
    let cases: Vec<(Vec<u8>, &[u16])> = vec![
        (request("GET /state HTTP/1.1", "Host: evil.example").into(), &[421]),
        (request("GET /state HTTP/1.1", "Accept: *").into(), &[400]),
        (request("GET /state HTTP/1.1", &format!("{host}\r\n{host}")).into(), &[400]),
        (request("GET http://evil.example/state HTTP/1.1", &host).into(), &[400]),
        (request("GET /state HTTP/1.1", &format!("{host}\r\nOrigin: http://evil.example")).into(), &[403]),
        (request("GET /../../../etc/passwd HTTP/1.1", &host).into(), &[404]),
        (request("GET /patch/..%2f..%2freal%2ffield-0.png HTTP/1.1", &host).into(), &[409]),
        (request("HEAD /state HTTP/1.1", &host).into(), &[405]),
        (request("OPTIONS * HTTP/1.1", &host).into(), &[404, 405]),
        (request("POST /answer HTTP/1.1", &format!("{host}\r\nContent-Length: 99999999999")).into(), &[413]),
        (request("POST /answer HTTP/1.1", &format!("{host}\r\nContent-Length: nine")).into(), &[400]),
        (request(&format!("GET /{} HTTP/1.1", "a".repeat(100_000)), &host).into(), &[0, 400, 414, 431]),
        (request("GET /state HTTP/1.1", &format!("{host}\r\nX: {}", "a".repeat(100_000))).into(), &[0, 400, 431]),
        (b"\0\xff\xfe\r\n\r\n".to_vec(), &[0, 400]),
        ((0..=255).cycle().take(50_000).collect(), &[0, 400, 431]),
    ];
    for (bytes, expected) in cases {
        let shown = String::from_utf8_lossy(&bytes[..bytes.len().min(80)]).into_owned();
        let status = send(port, &bytes).status;
        assert!(expected.contains(&status), "{shown}: {status}");
        assert_eq!(running.state()["answered"], 0);
    }
    let long = post(port, "/answer", &" ".repeat(5000));
    assert_eq!(long.status, 413);
    // Incomplete bodies and silent connections do not block others.
    let silent: Vec<TcpStream> = (0..8).map(|_| TcpStream::connect(("127.0.0.1", port)).unwrap()).collect();
    assert_eq!(running.state()["answered"], 0);
    let mut half = TcpStream::connect(("127.0.0.1", port)).unwrap();
    half.write_all(request("POST /answer HTTP/1.1", &format!("{host}\r\nContent-Length: 2")).as_bytes()).unwrap();
    assert_eq!(running.state()["answered"], 0);
    drop((silent, half));
    running.end();
}
