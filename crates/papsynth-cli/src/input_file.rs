//! Text files that the user names.

use std::fs::File;
use std::io::{Read, stdin};
use std::path::Path;

use crate::exit::ExitError;

/// Reads a text of at most `max_bytes` bytes, and returns its name and content. `-` is standard input.
pub(crate) fn read(path: &Path, max_bytes: u64, expected: &str) -> Result<(String, String), ExitError> {
    let is_stdin = path == Path::new("-");
    let name = if is_stdin { "standard input".to_owned() } else { path.display().to_string() };
    let mut bytes = Vec::new();
    let read = if is_stdin {
        stdin().lock().take(max_bytes + 1).read_to_end(&mut bytes)
    } else {
        File::open(path).and_then(|file| file.take(max_bytes + 1).read_to_end(&mut bytes))
    };
    read.map_err(|error| ExitError::file("read", path, &error))?;
    if bytes.len() as u64 > max_bytes {
        return Err(ExitError::input(format!("{name}: larger than {max_bytes} bytes; expected {expected}")));
    }
    String::from_utf8(bytes).map(|text| (name.clone(), text)).map_err(|error| {
        let byte = error.utf8_error().valid_up_to();
        let line = error.as_bytes()[..byte].iter().filter(|b| **b == b'\n').count() + 1;
        ExitError::input(format!("{name}:{line}: not valid UTF-8 at byte {byte}; expected {expected}"))
    })
}
