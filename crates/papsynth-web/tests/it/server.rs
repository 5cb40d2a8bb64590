//! Tests of the server with raw HTTP requests.

use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::JoinHandle;

use crate::support::{Answer, send};
use papsynth_web::{Error, MAX_BODY, Reply, Request, Server, Site};

/// Echoes request bodies and counts requests.
struct Echo(usize);

impl Site for Echo {
    fn reply(&mut self, request: &Request) -> Reply {
        self.0 += 1;
        match (request.method, request.target) {
            ("GET", "/count") => Reply::json(&self.0),
            ("POST", "/echo") => match request.json::<Vec<u32>>() {
                Ok(numbers) => Reply::json(&numbers),
                Err(error) => error,
            },
            (_, "/echo") => Reply::wrong_method("POST"),
            ("GET", "/panic") => panic!("a site may fail"),
            _ => Reply::error(404, "nothing"),
        }
    }
}

struct Running {
    port: u16,
    stop: Arc<AtomicBool>,
    seen: Arc<AtomicUsize>,
    thread: JoinHandle<Result<(), Error>>,
}

impl Running {
    fn start() -> Self {
        let server = Server::bind(0).unwrap();
        let port = server.port();
        assert_eq!(server.address(), format!("http://127.0.0.1:{port}/"));
        let (stop, seen) = (Arc::<AtomicBool>::default(), Arc::<AtomicUsize>::default());
        let (flag, count) = (Arc::clone(&stop), Arc::clone(&seen));
        let thread =
            std::thread::spawn(move || server.run(Echo(0), &flag, |echo| count.store(echo.0, Ordering::SeqCst)));
        Self { port, stop, seen, thread }
    }

    /// Sends raw bytes and returns the status and the whole reply.
    fn send(&self, bytes: &[u8]) -> (u16, String) {
        let Answer { status, head, body } = send(self.port, bytes);
        (status, head + &String::from_utf8_lossy(&body))
    }

    fn ask(&self, line: &str, headers: &str, body: &str) -> (u16, String) {
        let length = if body.is_empty() { String::new() } else { format!("Content-Length: {}\r\n", body.len()) };
        let head =
            format!("{line} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nConnection: close\r\n{headers}{length}\r\n", self.port);
        self.send(format!("{head}{body}").as_bytes())
    }
}

#[test]
fn the_server_runs_until_stopped_even_after_a_panic() {
    let running = Running::start();
    assert!(running.ask("GET /count", "", "").1.ends_with("\r\n\r\n1"));
    assert_eq!(running.ask("GET /panic", "", "").0, 0);
    let (status, text) = running.ask("GET /count", "", "");
    assert!(status == 200 && text.ends_with("\r\n\r\n3"), "{text}");
    let json = "Content-Type: application/json\r\n";
    assert!(running.ask("POST /echo", json, "[1, 2]").1.ends_with("[1,2]"));
    for (headers, body, expected) in [
        ("", "[1]", 415),
        ("Content-Type: text/plain\r\n", "[1]", 415),
        (json, "[1", 400),
        (json, "{}", 400),
        (json, &" ".repeat(MAX_BODY + 1) as &str, 413),
    ] {
        assert_eq!(running.ask("POST /echo", headers, body).0, expected, "{headers}{body:.9}");
    }
    let (status, text) = running.ask("GET /echo", "", "");
    assert!(status == 405 && text.to_lowercase().contains("allow: post"), "{text}");
    for (line, headers, expected) in [
        ("GET /count", "Origin: http://evil.example\r\n", 403),
        ("GET /count", "Host: 127.0.0.1\r\n", 400),
        ("GET http://evil.example/count", "", 400),
        ("GET /nothing", "", 404),
    ] {
        assert_eq!(running.ask(line, headers, "").0, expected, "{line} {headers}");
    }
    assert_eq!(running.send(b"GET /count HTTP/1.1\r\nHost: evil.example\r\nConnection: close\r\n\r\n").0, 421);
    running.stop.store(true, Ordering::SeqCst);
    let seen = Arc::clone(&running.seen);
    running.thread.join().unwrap().unwrap();
    // Rejected requests do not reach the site; `poll` sees its last state.
    assert_eq!(seen.load(Ordering::SeqCst), 3 + 5 + 1 + 1);
}

#[test]
fn replies_have_the_security_headers() {
    let running = Running::start();
    let head = running.ask("GET /count", "", "").1.to_lowercase();
    for header in [
        "cache-control: no-store",
        "content-security-policy: default-src 'none'",
        "x-content-type-options: nosniff",
        "referrer-policy: no-referrer",
        "cross-origin-resource-policy: same-origin",
    ] {
        assert!(head.contains(header), "{header}: {head}");
    }
    assert!(!head.contains("access-control"), "{head}");
    running.stop.store(true, Ordering::SeqCst);
    running.thread.join().unwrap().unwrap();
}

#[test]
fn it_listens_on_loopback_only_and_reports_a_port_in_use() {
    let server = Server::bind(0).unwrap();
    let error = Server::bind(server.port()).unwrap_err();
    assert!(error.to_string().contains(&format!("127.0.0.1:{}", server.port())), "{error}");
    // A previous port that is in use is not an error.
    assert_ne!(Server::bind_near(server.port()).unwrap().port(), server.port());
    // The server does not listen on other addresses such as 127.0.0.2.
    assert!(TcpStream::connect(("127.0.0.2", server.port())).is_err());
}
