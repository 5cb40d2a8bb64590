//! Tests of the viewer over HTTP.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::support::view::{Pixels, recipe, write};
use crate::support::{Scratch, send};
use papsynth_dataset::Format;
use papsynth_web::{Server, Viewer};

#[test]
fn local_pages_get_tiles_and_other_sites_get_nothing() {
    let scratch = Scratch::new("http");
    write(&scratch.join("set"), &recipe(""), &[Format::Folder], 1);
    let view = Viewer::open(&scratch.join("set")).unwrap();
    let server = Server::bind(0).unwrap();
    let port = server.port();
    let stop = Arc::<AtomicBool>::default();
    let flag = Arc::clone(&stop);
    let thread = std::thread::spawn(move || server.run(view, &flag, |_| ()));
    let ask = |path: &str, host: &str| {
        let request = format!("GET {path} HTTP/1.1\r\nHost: {host}:{port}\r\nConnection: close\r\n\r\n");
        let answer = send(port, request.as_bytes());
        (answer.head.to_lowercase(), answer.body)
    };
    let (head, body) = ask("/", "localhost");
    assert!(head.starts_with("http/1.1 200") && head.contains("content-security-policy: default-src 'none'"), "{head}");
    assert!(String::from_utf8(body).unwrap().contains("<canvas"));
    let (head, body) = ask("/tile/0/0/0/1-1.png", "127.0.0.1");
    assert!(head.contains("content-type: image/png"), "{head}");
    let tile = Pixels::decode(&body);
    assert_eq!([tile.width, tile.height], [300 - 256, 270 - 256]);
    assert!(ask("/label/0/nucleus/9/0-0.png", "127.0.0.1").0.starts_with("http/1.1 404"));
    assert!(ask("/../manifest.json", "127.0.0.1").0.starts_with("http/1.1 404"));
    for host in ["evil.example", "127.0.0.2", "[::1]"] {
        assert!(ask("/info", host).0.starts_with("http/1.1 421"), "{host}");
    }
    stop.store(true, Ordering::SeqCst);
    thread.join().unwrap().unwrap();
}
