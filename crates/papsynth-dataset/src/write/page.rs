//! What a page of a TIFF file shows.

use std::borrow::Cow;
use std::io::{Seek, Write};
use std::ops::Range;

use tiff::TiffResult;
use tiff::encoder::{DirectoryEncoder, Rational, TiffKind, TiffValue};
use tiff::tags::{PhotometricInterpretation, ResolutionUnit, SampleFormat, Tag};

/// Where a TIFF file is written to.
pub(crate) trait Out: Write + Seek {}

impl<T: Write + Seek> Out for T {}

/// A page apart from its pixels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Page<'a> {
    /// Columns.
    pub(crate) width: usize,
    /// Channels of a pixel: 1, or 3 for red, green and blue.
    pub(crate) channels: usize,
    /// Side of a pixel, µm.
    pub(crate) pixel_um: f64,
    /// Its description, ASCII.
    pub(crate) text: Option<&'a str>,
}

/// The pixels of a page.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Pixels<'a> {
    U8(&'a [u8]),
    U16(&'a [u16]),
    U32(&'a [u32]),
    F32(&'a [f32]),
}

impl<'a> Pixels<'a> {
    pub(super) fn len(self) -> usize {
        match self {
            Self::U8(data) => data.len(),
            Self::U16(data) => data.len(),
            Self::U32(data) => data.len(),
            Self::F32(data) => data.len(),
        }
    }

    /// Bits of a value, and what they stand for.
    pub(super) fn sample(self) -> (u16, SampleFormat) {
        match self {
            Self::U8(_) => (8, SampleFormat::Uint),
            Self::U16(_) => (16, SampleFormat::Uint),
            Self::U32(_) => (32, SampleFormat::Uint),
            Self::F32(_) => (32, SampleFormat::IEEEFP),
        }
    }

    /// The bytes of some values, in the order of this machine.
    pub(super) fn bytes(self, range: Range<usize>) -> Cow<'a, [u8]> {
        match self {
            Self::U8(data) => data[range].data(),
            Self::U16(data) => data[range].data(),
            Self::U32(data) => data[range].data(),
            Self::F32(data) => data[range].data(),
        }
    }
}

/// What the channels of a pixel are.
pub(super) fn photometric(channels: usize) -> u16 {
    match channels {
        3 => PhotometricInterpretation::RGB.to_u16(),
        _ => PhotometricInterpretation::BlackIsZero.to_u16(),
    }
}

/// The size of a pixel: pixels per centimetre, to a thousandth.
pub(super) fn resolution<W: Out, K: TiffKind>(directory: &mut DirectoryEncoder<W, K>, pixel_um: f64) -> TiffResult<()> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let n = (1e7 / pixel_um + 0.5) as u32;
    directory.write_tag(Tag::ResolutionUnit, ResolutionUnit::Centimeter.to_u16())?;
    directory.write_tag(Tag::XResolution, Rational { n, d: 1000 })?;
    directory.write_tag(Tag::YResolution, Rational { n, d: 1000 })
}
