//! TIFF.

use std::io::{Cursor, ErrorKind};

use tiff::decoder::{Decoder, DecodingResult};
use tiff::tags::Tag;
use tiff::{ColorType, TiffError};

use super::Limits;
use super::raster::{Channels, Raster, Samples};
use crate::error::Problem;

const ACCEPTED: &str = "8 or 16 bit (labels: also 32 bit) unsigned grey samples";

/// `PlanarConfiguration`: the channels of a pixel stand together.
const CHUNKY: u16 = 1;

pub(super) fn decode(bytes: &[u8], limits: &Limits) -> Result<Raster, Problem> {
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(problem)?;
    let (width, height) = decoder.dimensions().map_err(problem)?;
    limits.check(width, height)?;
    let colour = decoder.colortype().map_err(problem)?;
    let (channels, count) = match colour {
        ColorType::Gray(8 | 16 | 32) => (Channels::Grey, 1),
        ColorType::GrayA(8 | 16) => (Channels::GreyAlpha, 2),
        ColorType::RGB(8 | 16) => (Channels::Rgb, 3),
        ColorType::RGBA(8 | 16) => (Channels::Rgba, 4),
        other => return Err(Problem::Samples { found: format!("{other:?} samples"), accepted: ACCEPTED }),
    };
    let planar = decoder.find_tag_unsigned::<u16>(Tag::PlanarConfiguration).map_err(problem)?;
    if count > 1 && planar.is_some_and(|p| p != CHUNKY) {
        return Err(Problem::Samples { found: "channels in separate planes".to_owned(), accepted: ACCEPTED });
    }
    if decoder.more_images() {
        return Err(Problem::Pages);
    }
    let pixels = width as usize * height as usize;
    let mut tiff_limits = tiff::decoder::Limits::default();
    // Four channels of two bytes, or one of four.
    tiff_limits.decoding_buffer_size = pixels.saturating_mul(8);
    tiff_limits.intermediate_buffer_size = pixels.saturating_mul(8).max(1 << 20);
    let mut decoder = decoder.with_limits(tiff_limits);
    let samples = match decoder.read_image().map_err(problem)? {
        DecodingResult::U8(samples) => Samples::U8(samples),
        DecodingResult::U16(samples) => Samples::U16(samples),
        DecodingResult::U32(samples) => Samples::U32(samples),
        DecodingResult::F16(_) | DecodingResult::F32(_) | DecodingResult::F64(_) => {
            return Err(Problem::Samples { found: "floating-point samples".to_owned(), accepted: ACCEPTED });
        }
        _ => return Err(Problem::Samples { found: "signed or 64 bit samples".to_owned(), accepted: ACCEPTED }),
    };
    let found = match &samples {
        Samples::U8(s) => s.len(),
        Samples::U16(s) => s.len(),
        Samples::U32(s) => s.len(),
    };
    if found != pixels * count {
        return Err(Problem::Broken { format: "TIFF", message: format!("{found} samples for {pixels} pixels") });
    }
    Ok(Raster { width: width as usize, channels, samples })
}

fn problem(error: TiffError) -> Problem {
    match error {
        TiffError::IoError(e) if e.kind() == ErrorKind::UnexpectedEof => Problem::Truncated { format: "TIFF" },
        other => Problem::Broken { format: "TIFF", message: other.to_string() },
    }
}
