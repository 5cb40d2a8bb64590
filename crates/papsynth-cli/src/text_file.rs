//! Files that the user names: a text to be read, and what may be written.

use std::fs::File;
use std::io::{Read, stdin};
use std::path::Path;

use crate::exit::Failure;

/// Makes sure that writing to `out` costs the user nothing but an older output of the same kind: a file that is there must
/// begin as one does.
pub(crate) fn may_replace(out: &Path, begins: &[u8], what: &str) -> Result<(), Failure> {
    let Ok(file) = File::open(out) else { return Ok(()) };
    let mut found = Vec::new();
    let read = file.take(begins.len() as u64).read_to_end(&mut found);
    // What cannot be read, such as a folder, is told of when it is written.
    if read.is_err() || found == begins || found.is_empty() {
        return Ok(());
    }
    let message = format!("{}: there is another kind of file of this name; expected {what} or none", out.display());
    Err(Failure::wrong(message, "choose another name, or remove the file"))
}

/// Makes sure that files can be written to the folder `out`, each in the place of nothing but an older one of its kind.
#[cfg(any(feature = "calibrate", feature = "judge"))]
pub(crate) fn may_replace_in(out: &Path, files: &[(&str, &[u8], &str)]) -> Result<(), Failure> {
    files.iter().try_for_each(|(name, begins, what)| may_replace(&out.join(name), begins, what))?;
    if out.exists() && !out.is_dir() {
        let message = format!("--out {}: there is a file of this name; expected a folder", out.display());
        return Err(Failure::input(message));
    }
    Ok(())
}

/// Makes sure that a PNG can be written there, and that its name says nothing else.
pub(crate) fn is_png(out: &Path) -> Result<(), Failure> {
    const OTHERS: [&str; 7] = ["jpg", "jpeg", "tif", "tiff", "gif", "bmp", "webp"];
    let ending = out.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
    if OTHERS.contains(&ending.as_str()) {
        let message = format!("--out {}: the picture is a PNG; expected a name that ends in .png", out.display());
        return Err(Failure::input(message));
    }
    may_replace(out, b"\x89PNG", "an older picture")
}

/// Makes sure, before long work, that a file can be written there, and leaves nothing behind.
#[cfg(feature = "judge")]
pub(crate) fn can_write(out: &Path) -> Result<(), Failure> {
    if out.is_dir() {
        let message = format!("{}: this is a folder; expected the name of a file", out.display());
        return Err(Failure::input(message));
    }
    // Folders that are not there yet are made when it is written.
    let named = out.ancestors().skip(1).filter(|folder| !folder.as_os_str().is_empty());
    let folder = named.into_iter().find(|folder| folder.exists()).unwrap_or(Path::new("."));
    let name = out.file_name().unwrap_or_default().to_string_lossy();
    let probe = folder.join(format!(".{name}.{}", std::process::id()));
    File::create_new(&probe).map_err(|error| Failure::file("write", out, &error))?;
    std::fs::remove_file(&probe).map_err(|error| Failure::file("remove", &probe, &error))
}

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
    let refuse = |message: String| Failure::input(message);
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
