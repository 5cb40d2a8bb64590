//! Reading complete files within limits.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

use crate::error::{Error, InputError};

/// Limits on the files that are read. The defaults are choices of this library.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Largest width and height of an image, pixels. Default 32768, the largest size of a field.
    pub max_side_px: u32,
    /// Largest number of pixels of an image. Default 2²⁶ (8192 x 8192).
    pub max_pixels: u64,
    /// Largest size of a file, bytes. Default 2³⁰.
    pub max_file_bytes: u64,
    /// Largest number of separate regions of a label image. Default 100000.
    pub max_regions: usize,
    /// Whether images with lossy compression (JPEG) are read. Default true; measurements of noise need false.
    pub allow_lossy: bool,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            max_side_px: 32_768,
            max_pixels: 1 << 26,
            max_file_bytes: 1 << 30,
            max_regions: 100_000,
            allow_lossy: true,
        }
    }
}

impl Limits {
    /// Checks the size that an image file states, before memory is allocated for it.
    pub(super) fn check(&self, width: u32, height: u32) -> Result<(), InputError> {
        let pixels = u64::from(width) * u64::from(height);
        if width.max(height) > self.max_side_px || pixels > self.max_pixels || pixels == 0 {
            return Err(InputError::ImageSize {
                width: width.into(),
                height: height.into(),
                max_side: self.max_side_px.into(),
                max_pixels: self.max_pixels,
            });
        }
        Ok(())
    }
}

pub(super) fn parse<T>(
    path: &Path,
    limits: &Limits,
    parse: impl FnOnce(&[u8]) -> Result<T, InputError>,
) -> Result<T, Error> {
    parse(&bytes(path, limits.max_file_bytes)?).map_err(Error::input(path))
}

/// Reads a regular file of at most `limit` bytes.
pub(crate) fn bytes(path: &Path, limit: u64) -> Result<Vec<u8>, Error> {
    let failed = |e: io::Error| match e.kind() {
        io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => Error::input(path)(InputError::Missing("file")),
        io::ErrorKind::IsADirectory => Error::input(path)(InputError::Folder),
        _ => Error::io("read", path)(e),
    };
    // Before the file is opened, because to open a named pipe waits for a writer.
    let metadata = fs::metadata(path).map_err(failed)?;
    if !metadata.is_file() && !metadata.is_dir() {
        return Err(Error::input(path)(InputError::NotAFile));
    }
    let file = File::open(path).map_err(failed)?;
    let size = metadata.len();
    let mut bytes = Vec::new();
    // A growing file may have more bytes than its metadata state.
    file.take(limit.saturating_add(1)).read_to_end(&mut bytes).map_err(failed)?;
    let read = bytes.len() as u64;
    if read > limit {
        return Err(Error::input(path)(InputError::FileSize { bytes: size.max(read), limit }));
    }
    Ok(bytes)
}
