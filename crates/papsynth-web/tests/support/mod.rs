//! Temporary folders and an HTTP client for tests.

pub(crate) mod view;

use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::PathBuf;
use std::time::Duration;

/// A temporary folder, removed on drop.
pub(crate) struct Scratch(PathBuf);

impl Scratch {
    pub(crate) fn new(name: &str) -> Self {
        let path = |n: u32| std::env::temp_dir().join(format!("papsynth-web-{}-{name}-{n}", std::process::id()));
        // Concurrent tests may use the same name.
        let path = (0..).map(path).find(|path| fs::create_dir(path).is_ok()).unwrap();
        Self(path)
    }

    /// Creates the folders `real` and `synthetic` with three images each.
    pub(crate) fn of_study(name: &str) -> Self {
        let scratch = Self::new(name);
        for (side, glass) in [("real", 200), ("synthetic", 230)] {
            fs::create_dir_all(scratch.join(side)).unwrap();
            for k in 0..3 {
                fs::write(scratch.join(&format!("{side}/field-{k}.png")), picture(k, glass)).unwrap();
            }
        }
        scratch
    }

    pub(crate) fn join(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// An image of dark discs on a bright background.
fn picture(number: u32, glass: u8) -> Vec<u8> {
    const SIDE: u32 = 240;
    let disc = |x: u32, y: u32| {
        let (dx, dy) = ((x + 17 * number) % 60, (y + 29 * number) % 60);
        dx.abs_diff(30).pow(2) + dy.abs_diff(30).pow(2) < 400
    };
    let pixels = (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| (x, y)));
    let bytes: Vec<u8> = pixels.map(|(x, y)| if disc(x, y) { glass / 2 } else { glass }).collect();
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, SIDE, SIDE);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&bytes).unwrap();
    writer.finish().unwrap();
    out
}

/// A reply: head as text, and body.
pub(crate) struct Answer {
    pub(crate) status: u16,
    pub(crate) head: String,
    pub(crate) body: Vec<u8>,
}

/// Sends raw bytes and reads until the server closes the connection.
pub(crate) fn send(port: u16, bytes: &[u8]) -> Answer {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
    // The server may close the connection before all is sent.
    let _ = stream.write_all(bytes);
    let mut all = Vec::new();
    let _ = stream.read_to_end(&mut all);
    let end = all.windows(4).position(|four| four == b"\r\n\r\n").map_or(all.len(), |at| at + 4);
    let head = String::from_utf8_lossy(&all[..end]).into_owned();
    let status = head.split(' ').nth(1).and_then(|word| word.parse().ok()).unwrap_or(0);
    Answer { status, head, body: all[end..].to_vec() }
}

pub(crate) fn get(port: u16, path: &str) -> Answer {
    send(port, format!("GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nConnection: close\r\n\r\n").as_bytes())
}

pub(crate) fn post(port: u16, path: &str, body: &str) -> Answer {
    let head = format!(
        "POST {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nContent-Type: application/json\r\nContent-Length: {}\r\n\
         Connection: close\r\n\r\n",
        body.len()
    );
    send(port, format!("{head}{body}").as_bytes())
}
