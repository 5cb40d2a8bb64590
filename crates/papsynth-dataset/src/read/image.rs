//! Grey images and label images.

use std::path::Path;

use papsynth::truth::LabelMap;

use super::file::{Limits, parse};
use super::raster::{Channels, Meaning, Raster, Samples, decode_png};
use super::tiff;
use crate::error::{Error, Problem};

pub(crate) const PNG_SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Little- and big-endian TIFF and BigTIFF.
const TIFF_SIGNATURES: [&[u8]; 4] = [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"];

/// An image in grey levels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GreyImage {
    /// Columns.
    pub width: usize,
    /// Grey levels `0..=white`, row by row.
    pub grey: Vec<u16>,
    /// The largest grey level that the file could hold: 255 or 65535. A camera of 12 bits fills only the lowest
    /// sixteenth of a 16-bit file.
    pub white: u16,
}

impl GreyImage {
    /// Decodes a PNG or TIFF file.
    ///
    /// # Errors
    /// If the bytes are not a whole image of grey pixels within the limits.
    pub fn decode(bytes: &[u8], limits: &Limits) -> Result<Self, Problem> {
        Self::of(decode(bytes, limits, Meaning::Brightness)?)
    }

    fn of(raster: Raster) -> Result<Self, Problem> {
        let width = raster.width;
        let (grey, white) = levels(raster.grey()?)?;
        Ok(Self { width, grey, white })
    }

    /// Reads a PNG or TIFF file.
    ///
    /// # Errors
    /// If the file cannot be read, or is not a whole image of grey pixels within the limits.
    pub fn read(path: &Path, limits: &Limits) -> Result<Self, Error> {
        parse(path, limits, |bytes| Self::decode(bytes, limits))
    }

    /// Rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.grey.len() / self.width.max(1)
    }

    /// Grey levels as fractions of [`white`](Self::white), 0 to 1.
    #[must_use]
    pub fn fractions(&self) -> Vec<f32> {
        let white = f32::from(self.white.max(1));
        self.grey.iter().map(|&g| f32::from(g) / white).collect()
    }
}

/// An image in grey levels or in colour.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LevelImage {
    /// Columns.
    pub width: usize,
    /// 1, or 3 for red, green and blue.
    pub channels: usize,
    /// Levels `0..=white`, row by row, the channels of a pixel side by side.
    pub levels: Vec<u16>,
    /// The largest level that the file could hold: 255 or 65535.
    pub white: u16,
}

impl LevelImage {
    /// Decodes a PNG or TIFF file.
    ///
    /// # Errors
    /// If the bytes are not a whole image of opaque pixels within the limits.
    pub fn decode(bytes: &[u8], limits: &Limits) -> Result<Self, Problem> {
        Self::of(decode(bytes, limits, Meaning::Brightness)?)
    }

    fn of(raster: Raster) -> Result<Self, Problem> {
        if raster.channels != Channels::Rgb {
            let GreyImage { width, grey: levels, white } = GreyImage::of(raster)?;
            return Ok(Self { width, channels: 1, levels, white });
        }
        let width = raster.width;
        let (levels, white) = levels(raster.samples)?;
        Ok(Self { width, channels: 3, levels, white })
    }

    /// Hands over the images of a file, one after the other: a PNG file has one, a TIFF file may have several.
    pub(crate) fn pages(
        bytes: &[u8],
        limits: &Limits,
        take: &mut dyn FnMut(Self) -> Result<(), Problem>,
    ) -> Result<(), Problem> {
        match is_tiff(bytes) {
            true => tiff::pages(bytes, limits, &mut |raster| take(Self::of(raster)?)),
            false => take(Self::decode(bytes, limits)?),
        }
    }

    /// Reads a PNG or TIFF file.
    ///
    /// # Errors
    /// If the file cannot be read, or is not a whole image of opaque pixels within the limits.
    pub fn read(path: &Path, limits: &Limits) -> Result<Self, Error> {
        parse(path, limits, |bytes| Self::decode(bytes, limits))
    }

    /// Rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.levels.len() / (self.width * self.channels).max(1)
    }

    pub(crate) fn level(&self, x: usize, y: usize, channel: usize) -> u16 {
        self.levels[(y * self.width + x) * self.channels + channel]
    }
}

fn levels(samples: Samples) -> Result<(Vec<u16>, u16), Problem> {
    match samples {
        Samples::U8(samples) => Ok((samples.into_iter().map(u16::from).collect(), u8::MAX.into())),
        Samples::U16(samples) => Ok((samples, u16::MAX)),
        Samples::U32(_) | Samples::F32(_) => Err(Problem::samples("32 bit samples", "8 or 16 bit grey images")),
    }
}

/// Decodes a PNG or TIFF file of labels; 0 is no object.
///
/// # Errors
/// If the bytes are not a whole image of one channel within the limits.
pub fn label_map(bytes: &[u8], limits: &Limits) -> Result<LabelMap, Problem> {
    labels(decode(bytes, limits, Meaning::Labels)?)
}

/// The label images of a TIFF file, one a page; more than `most` are refused.
pub(crate) fn label_pages(bytes: &[u8], limits: &Limits, most: usize) -> Result<Vec<LabelMap>, Problem> {
    let mut pages = Vec::new();
    tiff::pages(bytes, limits, &mut |raster| {
        if pages.len() >= most {
            return Err(tiff::too_many(most));
        }
        pages.push(labels(raster)?);
        Ok(())
    })?;
    Ok(pages)
}

fn labels(raster: Raster) -> Result<LabelMap, Problem> {
    let width = raster.width;
    let ids = match raster.grey()? {
        Samples::U8(samples) => samples.into_iter().map(u32::from).collect(),
        Samples::U16(samples) => samples.into_iter().map(u32::from).collect(),
        Samples::U32(samples) => samples,
        Samples::F32(_) => {
            return Err(Problem::samples("floating-point samples", "8, 16 or 32 bit labels"));
        }
    };
    Ok(LabelMap { width, ids })
}

/// Reads a PNG or TIFF file of labels; 0 is no object.
///
/// # Errors
/// If the file cannot be read, or is not a whole image of one channel within the limits.
pub fn read_label_map(path: &Path, limits: &Limits) -> Result<LabelMap, Error> {
    parse(path, limits, |bytes| label_map(bytes, limits))
}

pub(super) fn decode(bytes: &[u8], limits: &Limits, meaning: Meaning) -> Result<Raster, Problem> {
    if bytes.starts_with(PNG_SIGNATURE) {
        decode_png(bytes, limits, meaning)
    } else if is_tiff(bytes) {
        tiff::decode(bytes, limits)
    } else if bytes.len() < PNG_SIGNATURE.len() && PNG_SIGNATURE.starts_with(bytes) && !bytes.is_empty() {
        Err(Problem::Truncated("PNG"))
    } else {
        Err(Problem::Format)
    }
}

pub(super) fn is_tiff(bytes: &[u8]) -> bool {
    TIFF_SIGNATURES.iter().any(|s| bytes.starts_with(s))
}
