//! Single output files: checked before the work, and written under a temporary name that is renamed at the end.

use std::fs::File;
use std::io::{BufReader, ErrorKind, Read};
use std::path::Path;

use papsynth_dataset::{RgbImage, write_file};
use png::{BitDepth, ColorType, Compression, Decoder, Encoder, Filter, PixelDimensions, Unit};

use crate::exit::ExitError;

/// Keyword and beginning of the PNG text chunk by which images of papsynth are recognised.
const SOFTWARE: &str = "Software";
const PAPSYNTH: &str = "papsynth ";

/// A kind of output, and how an older output of the kind is recognised.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Kind {
    /// A recipe of `papsynth init`, which the user edits: never recognised.
    Recipe,
    /// A PNG with the text chunk `Software: papsynth …`.
    Image,
    /// A text that begins with these bytes, and its name.
    Text(&'static [u8], &'static str),
}

/// An output file that may be written.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OutputFile<'a> {
    path: &'a Path,
}

impl<'a> OutputFile<'a> {
    /// Checks that writing to `path` replaces at most an older output of the same kind; with `force`, any file.
    pub(crate) fn check(path: &'a Path, kind: Kind, force: bool) -> Result<Self, ExitError> {
        if matches!(kind, Kind::Image) {
            check_ending(path)?;
        }
        if path.is_dir() || path.to_string_lossy().ends_with(std::path::is_separator) {
            let message = format!("{}: is a folder; expected the name of a file", path.display());
            return Err(ExitError::input(message));
        }
        if path == Path::new("-") {
            return Err(ExitError::input("--out -: expected the name of a file; standard output is not supported"));
        }
        // Opening a pipe could block forever.
        if path.exists() && !path.is_file() {
            let message = format!("{}: not a regular file; expected the name of a file", path.display());
            return Err(ExitError::input(message));
        }
        if force {
            return Ok(Self { path });
        }
        let file = match File::open(path) {
            Ok(file) => file,
            // The write reports folders that are files.
            Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
                return Ok(Self { path });
            }
            Err(error) => return Err(ExitError::file("read", path, &error)),
        };
        let name = path.display();
        let is_replaceable = match kind {
            Kind::Recipe => false,
            Kind::Image => is_image_of_papsynth(file),
            Kind::Text(begins, _) => begins_with(file, begins),
        };
        let message = match kind {
            _ if is_replaceable => return Ok(Self { path }),
            Kind::Recipe => format!("{name}: the file exists"),
            Kind::Image => format!("{name}: the file exists and is not an image that papsynth wrote"),
            Kind::Text(_, what) => format!("{name}: the file exists and is not {what}"),
        };
        Err(ExitError::with_help(message, "choose another name, or replace the file with --force"))
    }

    /// Writes the file. After an error the former file is unchanged.
    pub(crate) fn write(self, bytes: &[u8]) -> Result<(), ExitError> {
        Ok(write_file(self.path, bytes)?)
    }

    /// Writes an RGB image of 8 bits.
    pub(crate) fn write_rgb(self, image: &RgbImage) -> Result<(), ExitError> {
        self.write_png(&image.rgb, image.width, ColorType::Rgb, BitDepth::Eight, None)
    }

    /// Writes grey levels, row by row with interleaved channels, in 8 bits if `bits` ≤ 8, else in 16.
    pub(crate) fn write_levels(
        self,
        levels: &[u16],
        width: usize,
        channels: usize,
        bits: u32,
        pixel_um: f64,
    ) -> Result<(), ExitError> {
        let color = if channels == 3 { ColorType::Rgb } else { ColorType::Grayscale };
        if bits <= 8 {
            let bytes: Vec<u8> = levels.iter().map(|level| level.to_le_bytes()[0]).collect();
            self.write_png(&bytes, width, color, BitDepth::Eight, Some(pixel_um))
        } else {
            let bytes: Vec<u8> = levels.iter().flat_map(|level| level.to_be_bytes()).collect();
            self.write_png(&bytes, width, color, BitDepth::Sixteen, Some(pixel_um))
        }
    }

    fn write_png(
        self,
        bytes: &[u8],
        width: usize,
        color: ColorType,
        depth: BitDepth,
        pixel_um: Option<f64>,
    ) -> Result<(), ExitError> {
        let png = encode(bytes, width, color, depth, pixel_um)
            .map_err(|error| ExitError::file("write", self.path, &std::io::Error::other(error)))?;
        self.write(&png)
    }
}

/// Checks that files can be written to the folder `out`, each replacing at most an older file of its kind.
#[cfg(any(feature = "calibrate", feature = "completions", feature = "judge"))]
pub(crate) fn check_folder(out: &Path, files: &[(&str, Kind)]) -> Result<(), ExitError> {
    if out.exists() && !out.is_dir() {
        return Err(ExitError::input(format!("--out {}: is a file; expected a folder", out.display())));
    }
    for (name, kind) in files {
        let path = out.join(name);
        if let (Err(_), Kind::Text(_, what)) = (OutputFile::check(&path, *kind, false), kind) {
            let message = format!("{}: the file exists and is not {what}", path.display());
            return Err(ExitError::with_help(message, "choose another folder with --out, or remove the file"));
        }
    }
    Ok(())
}

/// Checks, before long work, that a file can be created at `out`. Leaves no file.
#[cfg(feature = "judge")]
pub(crate) fn check_writable(out: &Path) -> Result<(), ExitError> {
    // Missing folders are created with the file.
    let named = out.ancestors().skip(1).filter(|folder| !folder.as_os_str().is_empty());
    let folder = named.into_iter().find(|folder| folder.exists()).unwrap_or(Path::new("."));
    let name = out.file_name().unwrap_or_default().to_string_lossy();
    let probe = folder.join(format!(".{name}.{}", std::process::id()));
    File::create_new(&probe).map_err(|error| ExitError::file("write", out, &error))?;
    std::fs::remove_file(&probe).map_err(|error| ExitError::file("remove", &probe, &error))
}

/// Rejects names that end like another image format.
fn check_ending(out: &Path) -> Result<(), ExitError> {
    const OTHERS: [&str; 7] = ["jpg", "jpeg", "tif", "tiff", "gif", "bmp", "webp"];
    let ending = out.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
    if OTHERS.contains(&ending.as_str()) {
        let message = format!("--out {}: the image is a PNG; expected a name that ends in .png", out.display());
        return Err(ExitError::input(message));
    }
    Ok(())
}

/// Whether a file begins with these bytes. Empty files count, as they hold nothing.
fn begins_with(file: File, begins: &[u8]) -> bool {
    let mut found = Vec::new();
    file.take(begins.len() as u64).read_to_end(&mut found).is_ok_and(|_| found == begins || found.is_empty())
}

fn is_image_of_papsynth(file: File) -> bool {
    if file.metadata().is_ok_and(|metadata| metadata.is_file() && metadata.len() == 0) {
        return true;
    }
    Decoder::new(BufReader::new(file)).read_info().is_ok_and(|reader| {
        let texts = &reader.info().uncompressed_latin1_text;
        texts.iter().any(|text| text.keyword == SOFTWARE && text.text.starts_with(PAPSYNTH))
    })
}

fn encode(
    bytes: &[u8],
    width: usize,
    color: ColorType,
    depth: BitDepth,
    pixel_um: Option<f64>,
) -> Result<Vec<u8>, png::EncodingError> {
    let samples = bytes.len() / if depth == BitDepth::Sixteen { 2 } else { 1 };
    let height = samples / (width * color.samples()).max(1);
    // Images of papsynth have at most 32768 pixels on a side.
    let [width, height] = [width, height].map(|side| u32::try_from(side).unwrap_or(u32::MAX));
    let mut out = Vec::with_capacity(bytes.len());
    let mut encoder = Encoder::new(&mut out, width, height);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.set_compression(Compression::Fast);
    // One filter for all rows is as small on noisy images as a choice for each row, and twice as fast.
    encoder.set_filter(Filter::Up);
    if let Some(pixel_um) = pixel_um {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the cast saturates")]
        let per_metre = (1e6 / pixel_um + 0.5) as u32;
        encoder.set_pixel_dims(Some(PixelDimensions { xppu: per_metre, yppu: per_metre, unit: Unit::Meter }));
    }
    encoder.add_text_chunk(SOFTWARE.to_owned(), format!("{PAPSYNTH}{}", env!("CARGO_PKG_VERSION")))?;
    let mut writer = encoder.write_header()?;
    writer.write_image_data(bytes)?;
    writer.finish()?;
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn image_paths_papsynth_are_recognised_by_their_text_chunk() {
        let path = std::env::temp_dir().join(format!("papsynth-output-file-{}.png", std::process::id()));
        let check = |force| OutputFile::check(&path, Kind::Image, force);
        assert!(check(false).is_ok(), "no file");
        let mut plain = Vec::new();
        let encoder = Encoder::new(&mut plain, 1, 1);
        encoder.write_header().unwrap().write_image_data(&[7]).unwrap();
        for other in [&plain[..], b"\x89PNG", b"text"] {
            std::fs::write(&path, other).unwrap();
            assert!(check(false).is_err());
        }
        check(true).unwrap().write_levels(&[1, 2], 2, 1, 12, 0.25).unwrap();
        check(false).unwrap().write_levels(&[1, 2], 2, 1, 8, 0.25).unwrap();
        assert!(check(false).is_ok());
        std::fs::remove_file(&path).unwrap();
    }
}
