//! Grey images and label images.

use std::path::Path;

use papsynth::truth::LabelMap;

use super::file::{Limits, parse};
use super::jpeg;
use super::raster::{Channels, Meaning, Raster, Samples, decode_png};
use super::tiff;
use crate::error::{Error, InputError};

pub(crate) const PNG_SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Little- and big-endian TIFF and BigTIFF.
const TIFF_SIGNATURES: [&[u8]; 4] = [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"];

/// An image in grey levels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GreyImage {
    /// Columns.
    pub width: usize,
    /// Grey levels `0..=white` in row-major order.
    pub grey: Vec<u16>,
    /// Largest grey level of the sample type: 255 or 65535. A 12-bit camera uses only 1/16 of the range of a 16-bit
    /// file.
    pub white: u16,
}

impl GreyImage {
    /// Decodes a PNG, JPEG or TIFF file.
    ///
    /// # Errors
    /// If the bytes are not a complete image of grey pixels within the limits.
    pub fn decode(bytes: &[u8], limits: &Limits) -> Result<Self, InputError> {
        Self::of(decode(bytes, limits, Meaning::Brightness)?)
    }

    fn of(raster: Raster) -> Result<Self, InputError> {
        let width = raster.width;
        let (grey, white) = levels(raster.grey()?)?;
        Ok(Self { width, grey, white })
    }

    /// Reads a PNG, JPEG or TIFF file.
    ///
    /// # Errors
    /// If the file cannot be read, or is not a complete image of grey pixels within the limits.
    pub fn read(path: &Path, limits: &Limits) -> Result<Self, Error> {
        parse(path, limits, |bytes| Self::decode(bytes, limits))
    }

    /// Rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.grey.len() / self.width.max(1)
    }

    /// Grey levels divided by [`white`](Self::white), 0 to 1.
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
    /// Levels `0..=white` in row-major order, channels interleaved.
    pub levels: Vec<u16>,
    /// Largest level of the sample type: 255 or 65535.
    pub white: u16,
}

impl LevelImage {
    /// Decodes a PNG, JPEG or TIFF file.
    ///
    /// # Errors
    /// If the bytes are not a complete image of opaque pixels within the limits.
    pub fn decode(bytes: &[u8], limits: &Limits) -> Result<Self, InputError> {
        Self::of(decode(bytes, limits, Meaning::Brightness)?)
    }

    fn of(raster: Raster) -> Result<Self, InputError> {
        if raster.channels != Channels::Rgb {
            let GreyImage { width, grey: levels, white } = GreyImage::of(raster)?;
            return Ok(Self { width, channels: 1, levels, white });
        }
        let width = raster.width;
        let (levels, white) = levels(raster.samples)?;
        Ok(Self { width, channels: 3, levels, white })
    }

    /// Calls `take` with each image of a file, in order. A TIFF file may have several images, other files have one.
    pub(crate) fn pages(
        bytes: &[u8],
        limits: &Limits,
        take: &mut dyn FnMut(Self) -> Result<(), InputError>,
    ) -> Result<(), InputError> {
        match is_tiff(bytes) {
            true => tiff::pages(bytes, limits, &mut |raster| take(Self::of(raster)?)),
            false => take(Self::decode(bytes, limits)?),
        }
    }

    /// Reads a PNG, JPEG or TIFF file.
    ///
    /// # Errors
    /// If the file cannot be read, or is not a complete image of opaque pixels within the limits.
    pub fn read(path: &Path, limits: &Limits) -> Result<Self, Error> {
        parse(path, limits, |bytes| Self::decode(bytes, limits))
    }

    /// Rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.levels.len() / (self.width * self.channels).max(1)
    }
}

fn levels(samples: Samples) -> Result<(Vec<u16>, u16), InputError> {
    match samples {
        Samples::U8(samples) => Ok((samples.iter().map(|&sample| sample.into()).collect(), u8::MAX.into())),
        Samples::U16(samples) => Ok((samples, u16::MAX)),
        Samples::U32(_) | Samples::F32(_) => Err(InputError::samples("32 bit samples", "8 or 16 bit grey images")),
    }
}

/// Decodes a PNG or TIFF file of labels; 0 is background.
///
/// # Errors
/// If the bytes are not a complete image of one channel within the limits.
pub fn label_map(bytes: &[u8], limits: &Limits) -> Result<LabelMap, InputError> {
    labels(decode(bytes, limits, Meaning::Labels)?)
}

/// Reads the label images of a TIFF file, one per page. More than `most` pages are an error.
pub(crate) fn label_pages(bytes: &[u8], limits: &Limits, most: usize) -> Result<Vec<LabelMap>, InputError> {
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

fn labels(raster: Raster) -> Result<LabelMap, InputError> {
    let width = raster.width;
    let ids = match raster.grey()? {
        Samples::U8(samples) => samples.iter().map(|&sample| sample.into()).collect(),
        Samples::U16(samples) => samples.iter().map(|&sample| sample.into()).collect(),
        Samples::U32(samples) => samples,
        Samples::F32(_) => {
            return Err(InputError::samples("floating-point samples", "8, 16 or 32 bit labels"));
        }
    };
    Ok(LabelMap { width, ids })
}

/// Reads a PNG or TIFF file of labels; 0 is background.
///
/// # Errors
/// If the file cannot be read, or is not a complete image of one channel within the limits.
pub fn read_label_map(path: &Path, limits: &Limits) -> Result<LabelMap, Error> {
    parse(path, limits, |bytes| label_map(bytes, limits))
}

pub(super) fn decode(bytes: &[u8], limits: &Limits, meaning: Meaning) -> Result<Raster, InputError> {
    if bytes.starts_with(PNG_SIGNATURE) {
        decode_png(bytes, limits, meaning)
    } else if is_tiff(bytes) {
        tiff::decode(bytes, limits, meaning)
    } else if bytes.starts_with(jpeg::SIGNATURE) {
        match meaning {
            Meaning::Brightness => jpeg::decode(bytes, limits),
            Meaning::Labels => Err(jpeg::lossy_labels()),
        }
    } else if bytes.len() < PNG_SIGNATURE.len() && PNG_SIGNATURE.starts_with(bytes) && !bytes.is_empty() {
        Err(InputError::Truncated("PNG"))
    } else {
        Err(InputError::Format)
    }
}

pub(super) fn is_tiff(bytes: &[u8]) -> bool {
    TIFF_SIGNATURES.iter().any(|s| bytes.starts_with(s))
}
