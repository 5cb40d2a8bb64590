//! TIFF.

use std::io::{Cursor, ErrorKind};

use tiff::decoder::{Decoder, DecodingResult};
use tiff::tags::Tag;
use tiff::{ColorType, TiffError};

use super::file::Limits;
use super::raster::{Channels, Raster, Samples};
use crate::error::Problem;

const ACCEPTED: &str = "8 or 16 bit (labels: also 32 bit) unsigned grey samples";
const ACCEPTED_PAGES: &str = "8, 16 or 32 bit unsigned or 32 bit floating-point grey samples";

/// `PlanarConfiguration`: the channels of a pixel stand together.
const CHUNKY: u16 = 1;

/// At one of the images of a file.
type Reader<'a> = Decoder<Cursor<&'a [u8]>>;

pub(super) fn decode(bytes: &[u8], limits: &Limits) -> Result<Raster, Problem> {
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(problem)?;
    if decoder.more_images() {
        // What is wrong with the first is told before.
        shape(&mut decoder, limits, ACCEPTED)?;
        return Err(Problem::unfit("holds several images; accepted is one image a file"));
    }
    match page(decoder, limits, ACCEPTED)?.0 {
        Raster { samples: Samples::F32(_), .. } => Err(Problem::samples("floating-point samples", ACCEPTED)),
        raster => Ok(raster),
    }
}

/// Hands over the images of a file, one after the other.
pub(super) fn pages(
    bytes: &[u8],
    limits: &Limits,
    take: &mut dyn FnMut(Raster) -> Result<(), Problem>,
) -> Result<(), Problem> {
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(problem)?;
    loop {
        let (raster, rest) = page(decoder, limits, ACCEPTED_PAGES)?;
        take(raster)?;
        decoder = rest;
        if !decoder.more_images() {
            return Ok(());
        }
        decoder.next_image().map_err(problem)?;
    }
}

/// The pages of a file of 32-bit floating-point numbers, whatever their channels. A short file may have very many, all in the same place: more
/// than `most` are refused.
pub(crate) fn float_pages(bytes: &[u8], limits: &Limits, most: usize) -> Result<Vec<Vec<f32>>, Problem> {
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(problem)?;
    let mut pages = Vec::new();
    loop {
        let (width, height) = decoder.dimensions().map_err(problem)?;
        limits.check(width, height)?;
        let mut tiff_limits = tiff::decoder::Limits::default();
        // Three channels of four bytes.
        tiff_limits.decoding_buffer_size = (width as usize * height as usize).saturating_mul(12);
        decoder = decoder.with_limits(tiff_limits);
        let DecodingResult::F32(samples) = decoder.read_image().map_err(problem)? else {
            return Err(Problem::samples("whole numbers", "floating-point samples"));
        };
        pages.push(samples);
        if !decoder.more_images() {
            return Ok(pages);
        }
        if pages.len() >= most {
            return Err(too_many(most));
        }
        decoder.next_image().map_err(problem)?;
    }
}

pub(super) fn too_many(most: usize) -> Problem {
    Problem::unfit(format!("it has more than {most} pages"))
}

/// What the first page of a file says that it shows, if it says anything.
pub(crate) fn description(bytes: &[u8]) -> Result<Option<String>, Problem> {
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(problem)?;
    let Some(value) = decoder.find_tag(Tag::ImageDescription).map_err(problem)? else { return Ok(None) };
    value.into_string().map(Some).map_err(problem)
}

/// Columns, pixels, and channels of the image that the decoder is at.
fn shape(decoder: &mut Reader, limits: &Limits, accepted: &'static str) -> Result<(usize, usize, Channels), Problem> {
    let (width, height) = decoder.dimensions().map_err(problem)?;
    limits.check(width, height)?;
    let colour = decoder.colortype().map_err(problem)?;
    let channels = match colour {
        ColorType::Gray(8 | 16 | 32) => Channels::Grey,
        ColorType::GrayA(8 | 16) => Channels::GreyAlpha,
        ColorType::RGB(8 | 16) => Channels::Rgb,
        ColorType::RGBA(8 | 16) => Channels::Rgba,
        other => return Err(Problem::samples(format!("{other:?} samples"), accepted)),
    };
    let planar = decoder.find_tag_unsigned::<u16>(Tag::PlanarConfiguration).map_err(problem)?;
    if channels.count() > 1 && planar.is_some_and(|p| p != CHUNKY) {
        return Err(Problem::samples("channels in separate planes", accepted));
    }
    Ok((width as usize, width as usize * height as usize, channels))
}

fn page<'a>(mut decoder: Reader<'a>, limits: &Limits, accepted: &'static str) -> Result<(Raster, Reader<'a>), Problem> {
    let (width, pixels, channels) = shape(&mut decoder, limits, accepted)?;
    let mut tiff_limits = tiff::decoder::Limits::default();
    // Four channels of two bytes, or one of four.
    tiff_limits.decoding_buffer_size = pixels.saturating_mul(8);
    tiff_limits.intermediate_buffer_size = pixels.saturating_mul(8).max(1 << 20);
    let mut decoder = decoder.with_limits(tiff_limits);
    let (found, samples) = match decoder.read_image().map_err(problem)? {
        DecodingResult::U8(samples) => (samples.len(), Samples::U8(samples)),
        DecodingResult::U16(samples) => (samples.len(), Samples::U16(samples)),
        DecodingResult::U32(samples) => (samples.len(), Samples::U32(samples)),
        DecodingResult::F32(samples) => (samples.len(), Samples::F32(samples)),
        DecodingResult::F16(_) | DecodingResult::F64(_) => {
            return Err(Problem::samples("floating-point samples", accepted));
        }
        _ => return Err(Problem::samples("signed or 64 bit samples", accepted)),
    };
    if found != pixels * channels.count() {
        return Err(Problem::broken("TIFF", format!("{found} samples for {pixels} pixels")));
    }
    Ok((Raster { width, channels, samples }, decoder))
}

fn problem(error: TiffError) -> Problem {
    match error {
        TiffError::IoError(e) if e.kind() == ErrorKind::UnexpectedEof => Problem::Truncated("TIFF"),
        other => Problem::broken("TIFF", other),
    }
}
