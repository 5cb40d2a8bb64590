//! A data set over HTTP.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::support::{Pixels, Scratch, recipe, write};
use papsynth_dataset::Format;
use papsynth_loopback::Server;
use papsynth_view::View;

#[test]
fn a_browser_of_this_machine_gets_page_and_tiles_and_others_nothing() {
    let scratch = Scratch::new("http");
    write(&scratch.join("set"), &recipe(""), &[Format::Folder], 1);
    let view = View::open(&scratch.join("set")).unwrap();
    let server = Server::bind(0).unwrap();
    let port = server.port();
    let stop = Arc::<AtomicBool>::default();
    let flag = Arc::clone(&stop);
    let thread = std::thread::spawn(move || server.run(view, &flag, |_| ()));
    let ask = |path: &str, host: &str| {
        let mut stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
        stream
            .write_all(format!("GET {path} HTTP/1.1\r\nHost: {host}:{port}\r\nConnection: close\r\n\r\n").as_bytes())
            .unwrap();
        let mut all = Vec::new();
        stream.read_to_end(&mut all).unwrap();
        let end = all.windows(4).position(|four| four == b"\r\n\r\n").unwrap() + 4;
        (String::from_utf8_lossy(&all[..end]).to_lowercase(), all[end..].to_vec())
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
