//! Reading a text that the user names.

use std::fs::File;
use std::io::{Read, stdin};
use std::path::Path;

use crate::exit::{Complaint, Failure};

/// A text and the name it goes by; `-` is standard input.
pub(crate) fn read(path: &Path, largest: u64, what: &str) -> Result<(String, String), Failure> {
    let is_stdin = path == Path::new("-");
    let name = if is_stdin { "standard input".to_owned() } else { path.display().to_string() };
    let mut bytes = Vec::new();
    let read = if is_stdin {
        stdin().lock().take(largest + 1).read_to_end(&mut bytes)
    } else {
        File::open(path).and_then(|file| file.take(largest + 1).read_to_end(&mut bytes))
    };
    read.map_err(|error| Failure::file("read", path, &error))?;
    let refuse = |message: String| Failure::input(Complaint::new(message));
    if bytes.len() as u64 > largest {
        return Err(refuse(format!("{name}: it is larger than {largest} bytes; expected {what}")));
    }
    String::from_utf8(bytes).map(|text| (name.clone(), text)).map_err(|error| {
        let good = error.utf8_error().valid_up_to();
        let bytes = error.into_bytes();
        let line = bytes[..good].iter().filter(|b| **b == b'\n').count() + 1;
        let byte = bytes.get(good).copied().unwrap_or_default();
        refuse(format!("{name}:{line}: the byte 0x{byte:02x} is no text; expected {what} in UTF-8"))
    })
}
