//! TIFF.

use std::io::{Cursor, ErrorKind};

use tiff::decoder::{Decoder, DecodingResult};
use tiff::tags::{CompressionMethod, Tag};
use tiff::{ColorType, TiffError};

use super::file::Limits;
use super::jpeg;
use super::raster::{Channels, Meaning, Raster, Samples};
use crate::error::InputError;

const ACCEPTED: &str = "8 or 16 bit (labels: also 32 bit) unsigned grey samples";
const ACCEPTED_PAGES: &str = "8, 16 or 32 bit unsigned or 32 bit floating-point grey samples";

/// `PlanarConfiguration`: the channels of a pixel are interleaved.
const CHUNKY: u16 = 1;

/// A decoder positioned at one of the images of a file.
type Reader<'a> = Decoder<Cursor<&'a [u8]>>;

pub(super) fn decode(bytes: &[u8], limits: &Limits, meaning: Meaning) -> Result<Raster, InputError> {
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(problem)?;
    if decoder.more_images() {
        // Errors of the first image are reported before the number of images.
        shape(&mut decoder, limits, ACCEPTED)?;
        return Err(InputError::unfit("the file has several images; expected one image in the file"));
    }
    if meaning == Meaning::Labels && is_jpeg(&mut decoder)? {
        return Err(jpeg::lossy_labels());
    }
    match page(decoder, bytes, limits, ACCEPTED)?.0 {
        Raster { samples: Samples::F32(_), .. } => Err(InputError::samples("floating-point samples", ACCEPTED)),
        raster => Ok(raster),
    }
}

/// Calls `take` with each image of a file, in order.
pub(super) fn pages(
    bytes: &[u8],
    limits: &Limits,
    take: &mut dyn FnMut(Raster) -> Result<(), InputError>,
) -> Result<(), InputError> {
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(problem)?;
    loop {
        let (raster, rest) = page(decoder, bytes, limits, ACCEPTED_PAGES)?;
        take(raster)?;
        decoder = rest;
        if !decoder.more_images() {
            return Ok(());
        }
        decoder.next_image().map_err(problem)?;
    }
}

/// Reads the pages of a file of 32-bit floating-point numbers with any number of channels. More than `most` pages are
/// an error, because many directory entries of a short file may refer to the same data.
pub(crate) fn float_pages(bytes: &[u8], limits: &Limits, most: usize) -> Result<Vec<Vec<f32>>, InputError> {
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(problem)?;
    let mut pages = Vec::new();
    loop {
        let (width, height) = decoder.dimensions().map_err(problem)?;
        limits.check(width, height)?;
        check_jpeg(&mut decoder, bytes, limits)?;
        let mut tiff_limits = tiff::decoder::Limits::default();
        // Three channels of four bytes.
        tiff_limits.decoding_buffer_size = (width as usize * height as usize).saturating_mul(12);
        decoder = decoder.with_limits(tiff_limits);
        let DecodingResult::F32(samples) = decoder.read_image().map_err(problem)? else {
            return Err(InputError::samples("integers", "floating-point samples"));
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

pub(super) fn too_many(most: usize) -> InputError {
    InputError::unfit(format!("the file has more than {most} pages"))
}

/// Returns the description (`ImageDescription`) of the first page of a file, if there is one.
pub(crate) fn description(bytes: &[u8]) -> Result<Option<String>, InputError> {
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(problem)?;
    let Some(value) = decoder.find_tag(Tag::ImageDescription).map_err(problem)? else { return Ok(None) };
    value.into_string().map(Some).map_err(problem)
}

/// Returns the columns, the number of pixels, and the channels of the image at which the decoder is.
fn shape(
    decoder: &mut Reader,
    limits: &Limits,
    accepted: &'static str,
) -> Result<(usize, usize, Channels), InputError> {
    let (width, height) = decoder.dimensions().map_err(problem)?;
    limits.check(width, height)?;
    let colour = decoder.colortype().map_err(problem)?;
    let channels = match colour {
        ColorType::Gray(8 | 16 | 32) => Channels::Grey,
        ColorType::GrayA(8 | 16) => Channels::GreyAlpha,
        ColorType::RGB(8 | 16) => Channels::Rgb,
        ColorType::YCbCr(8) if is_jpeg(decoder)? => Channels::Rgb,
        ColorType::RGBA(8 | 16) => Channels::Rgba,
        other => return Err(InputError::samples(described(other), accepted)),
    };
    let planar = decoder.find_tag_unsigned::<u16>(Tag::PlanarConfiguration).map_err(problem)?;
    if channels.count() > 1 && planar.is_some_and(|p| p != CHUNKY) {
        return Err(InputError::samples("channels in separate planes", accepted));
    }
    Ok((width as usize, width as usize * height as usize, channels))
}

fn described(colour: ColorType) -> String {
    let (name, bits) = match colour {
        ColorType::Gray(bits) => ("grey", bits),
        ColorType::GrayA(bits) => ("grey and alpha", bits),
        ColorType::RGB(bits) => ("RGB", bits),
        ColorType::RGBA(bits) => ("RGBA", bits),
        ColorType::CMYK(bits) => ("CMYK", bits),
        ColorType::YCbCr(bits) => ("YCbCr", bits),
        ColorType::Palette(bits) => ("palette", bits),
        _ => return "samples of another colour type".to_owned(),
    };
    format!("{name} samples of {bits} bits")
}

fn is_jpeg(decoder: &mut Reader) -> Result<bool, InputError> {
    let compression = decoder.find_tag_unsigned::<u16>(Tag::Compression).map_err(problem)?;
    Ok(compression == Some(CompressionMethod::ModernJPEG.to_u16()))
}

/// Checks the JPEG streams of the image at which the decoder is: their sizes, and that the file has all of their bytes.
/// The library checks neither.
fn check_jpeg(decoder: &mut Reader, bytes: &[u8], limits: &Limits) -> Result<(), InputError> {
    if !is_jpeg(decoder)? {
        return Ok(());
    }
    jpeg::check_frames(bytes, limits)?;
    for tags in [[Tag::StripOffsets, Tag::StripByteCounts], [Tag::TileOffsets, Tag::TileByteCounts]] {
        let [offsets, sizes] = tags.map(|tag| decoder.find_tag(tag).ok().flatten().and_then(|v| v.into_u64_vec().ok()));
        let ends = offsets.unwrap_or_default().into_iter().zip(sizes.unwrap_or_default());
        if ends.into_iter().any(|(offset, size)| offset.saturating_add(size) > bytes.len() as u64) {
            return Err(InputError::Truncated("TIFF"));
        }
    }
    Ok(())
}

fn page<'a>(
    mut decoder: Reader<'a>,
    bytes: &[u8],
    limits: &Limits,
    accepted: &'static str,
) -> Result<(Raster, Reader<'a>), InputError> {
    let (width, pixels, channels) = shape(&mut decoder, limits, accepted)?;
    check_jpeg(&mut decoder, bytes, limits)?;
    let is_ycbcr = matches!(decoder.colortype().map_err(problem)?, ColorType::YCbCr(_));
    let mut tiff_limits = tiff::decoder::Limits::default();
    // Four channels of two bytes, or one of four.
    tiff_limits.decoding_buffer_size = pixels.saturating_mul(8);
    tiff_limits.intermediate_buffer_size = pixels.saturating_mul(8).max(1 << 20);
    let mut decoder = decoder.with_limits(tiff_limits);
    let (found, samples) = match decoder.read_image().map_err(problem)? {
        DecodingResult::U8(mut samples) => {
            if is_ycbcr {
                samples.as_chunks_mut().0.iter_mut().for_each(|pixel| *pixel = jpeg::rgb(*pixel));
            }
            (samples.len(), Samples::U8(samples))
        }
        DecodingResult::U16(samples) => (samples.len(), Samples::U16(samples)),
        DecodingResult::U32(samples) => (samples.len(), Samples::U32(samples)),
        DecodingResult::F32(samples) => (samples.len(), Samples::F32(samples)),
        DecodingResult::F16(_) | DecodingResult::F64(_) => {
            return Err(InputError::samples("16 or 64 bit floating-point samples", accepted));
        }
        _ => return Err(InputError::samples("signed or 64 bit samples", accepted)),
    };
    if found != pixels * channels.count() {
        return Err(InputError::broken("TIFF", format!("{found} samples for {pixels} pixels")));
    }
    Ok((Raster { width, channels, samples }, decoder))
}

fn problem(error: TiffError) -> InputError {
    match error {
        TiffError::IoError(e) if e.kind() == ErrorKind::UnexpectedEof => InputError::Truncated("TIFF"),
        other => InputError::broken("TIFF", other),
    }
}
