//! Decoded images of all formats, and PNG.

use std::io::{Cursor, ErrorKind};

use png::{BitDepth, ColorType, Decoder, DecodingError, Transformations};

use super::file::Limits;
use crate::error::InputError;

/// Samples as stored in the file, in row-major order, channels interleaved.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Samples {
    U8(Vec<u8>),
    U16(Vec<u16>),
    U32(Vec<u32>),
    F32(Vec<f32>),
}

/// Channels of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Channels {
    Grey,
    GreyAlpha,
    Rgb,
    Rgba,
}

impl Channels {
    pub(super) fn count(self) -> usize {
        match self {
            Self::Grey => 1,
            Self::GreyAlpha => 2,
            Self::Rgb => 3,
            Self::Rgba => 4,
        }
    }
}

/// A decoded image of one, two, three or four channels.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Raster {
    pub(super) width: usize,
    pub(super) channels: Channels,
    pub(super) samples: Samples,
}

impl Raster {
    /// Returns one channel, if all pixels are grey and opaque.
    pub(super) fn grey(self) -> Result<Samples, InputError> {
        let (channels, width) = (self.channels, self.width);
        Ok(match self.samples {
            Samples::U8(samples) => Samples::U8(grey(samples, channels, u8::MAX, width)?),
            Samples::U16(samples) => Samples::U16(grey(samples, channels, u16::MAX, width)?),
            Samples::U32(samples) => Samples::U32(grey(samples, channels, u32::MAX, width)?),
            Samples::F32(samples) => Samples::F32(grey(samples, channels, 1.0, width)?),
        })
    }
}

fn grey<T: Copy + PartialEq>(
    samples: Vec<T>,
    channels: Channels,
    opaque: T,
    width: usize,
) -> Result<Vec<T>, InputError> {
    let count = channels.count();
    let colours = match channels {
        Channels::Grey => return Ok(samples),
        Channels::GreyAlpha => 1,
        Channels::Rgb | Channels::Rgba => 3,
    };
    let pixels = samples.chunks_exact(count).enumerate();
    pixels
        .map(|(i, pixel)| {
            let what = if pixel[..colours].iter().any(|c| *c != pixel[0]) {
                "coloured"
            } else if count > colours && pixel[colours] != opaque {
                "transparent"
            } else {
                return Ok(pixel[0]);
            };
            Err(InputError::NotGrey { what, x: i % width, y: i / width })
        })
        .collect()
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Meaning {
    /// Brightness: fewer than 8 bits are scaled to the full range, palette indices become colours.
    Brightness,
    /// Labels: values are kept; with a palette, the indices.
    Labels,
}

/// Memory limit of the decoder for chunks other than image data, which are not used.
const CHUNK_BYTES: usize = 1 << 20;

pub(super) fn decode_png(bytes: &[u8], limits: &Limits, meaning: Meaning) -> Result<Raster, InputError> {
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), png::Limits { bytes: CHUNK_BYTES });
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let header = decoder.read_header_info().map_err(problem)?;
    limits.check(header.width, header.height)?;
    decoder.set_transformations(match meaning {
        Meaning::Brightness => Transformations::EXPAND,
        Meaning::Labels => Transformations::IDENTITY,
    });
    let mut reader = decoder.read_info().map_err(problem)?;
    let size = reader.output_buffer_size().ok_or_else(|| problem(DecodingError::LimitsExceeded))?;
    let mut buffer = vec![0; size];
    let frame = reader.next_frame(&mut buffer).map_err(problem)?;
    // Up to the last chunk, so that a file without it counts as truncated.
    reader.finish().map_err(problem)?;
    let width = frame.width as usize;
    let channels = match frame.color_type {
        ColorType::Grayscale | ColorType::Indexed => Channels::Grey,
        ColorType::GrayscaleAlpha => Channels::GreyAlpha,
        ColorType::Rgb => Channels::Rgb,
        ColorType::Rgba => Channels::Rgba,
    };
    let samples = match frame.bit_depth {
        BitDepth::Sixteen => Samples::U16(buffer.chunks_exact(2).map(|b| u16::from_be_bytes([b[0], b[1]])).collect()),
        BitDepth::Eight => Samples::U8(buffer),
        narrow => Samples::U8(unpack(&buffer, narrow as usize, width, frame.line_size)),
    };
    Ok(Raster { width, channels, samples })
}

/// Unpacks samples of 1, 2 or 4 bits. The first sample is in the highest bits of a byte; each row starts at a byte.
fn unpack(rows: &[u8], bits: usize, width: usize, line_size: usize) -> Vec<u8> {
    let mask = u8::MAX >> (8 - bits);
    let row = |line: &[u8]| -> Vec<u8> {
        (0..width).map(|x| (line[x * bits / 8] >> (8 - bits - x * bits % 8)) & mask).collect()
    };
    rows.chunks_exact(line_size).flat_map(row).collect()
}

fn problem(error: DecodingError) -> InputError {
    match error {
        DecodingError::IoError(e) if e.kind() == ErrorKind::UnexpectedEof => InputError::Truncated("PNG"),
        other => InputError::broken("PNG", other),
    }
}
