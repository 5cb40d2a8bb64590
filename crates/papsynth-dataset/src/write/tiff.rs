//! TIFF: pages written one after the other, and label images.

use std::io::{Cursor, Seek, Write};

use tiff::TiffResult;
use tiff::encoder::colortype::{ColorType, Gray8, Gray16, Gray32, Gray32Float, RGB8, RGB16, RGB32Float};
use tiff::encoder::{
    Compression, DeflateLevel, Predictor, Rational, TiffEncoder, TiffKind, TiffKindBig, TiffKindStandard, TiffValue,
};
use tiff::tags::{ResolutionUnit, Tag};

/// Pages of a file larger than this go into a BigTIFF. Offsets of a classic file end at 2³² bytes; the rest is for its directories.
const CLASSIC_BYTES: u64 = 0xFF00_0000;

/// The pixels of a page.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Pixels<'a> {
    U8(&'a [u8]),
    U16(&'a [u16]),
    U32(&'a [u32]),
    F32(&'a [f32]),
}

/// Writes uncompressed pages to a file as they arrive. Noise and expected grey levels hardly compress, and a plane
/// takes a tenth of the time to write this way.
pub(crate) enum PageWriter<W: Write + Seek> {
    Classic(TiffEncoder<W, TiffKindStandard>),
    Big(TiffEncoder<W, TiffKindBig>),
}

impl<W: Write + Seek> PageWriter<W> {
    /// A file that will hold about `bytes` bytes of pixels.
    pub(crate) fn new(writer: W, bytes: u64) -> TiffResult<Self> {
        Ok(if bytes < CLASSIC_BYTES {
            Self::Classic(TiffEncoder::new(writer)?)
        } else {
            Self::Big(TiffEncoder::new_big(writer)?)
        })
    }

    /// Writes a page of one channel or of three; `description` is ASCII.
    pub(crate) fn write(
        &mut self,
        pixels: Pixels,
        width: usize,
        channels: usize,
        pixel_um: f64,
        description: Option<&str>,
    ) -> TiffResult<()> {
        match self {
            Self::Classic(encoder) => page(encoder, pixels, width, channels, pixel_um, description),
            Self::Big(encoder) => page(encoder, pixels, width, channels, pixel_um, description),
        }
    }
}

/// A label image of 16 bits, or of 32 if a label needs them.
pub(crate) fn label_tiff(ids: &[u32], width: usize, pixel_um: f64) -> TiffResult<Vec<u8>> {
    if ids.iter().copied().max() > Some(u16::MAX.into()) {
        return compressed(Pixels::U32(ids), width, pixel_um);
    }
    #[expect(clippy::cast_possible_truncation, reason = "the largest fits")]
    let narrow: Vec<u16> = ids.iter().map(|&id| id as u16).collect();
    compressed(Pixels::U16(&narrow), width, pixel_um)
}

/// One page of few different values, compressed: differences along a row are nearly all zero.
pub(crate) fn compressed(pixels: Pixels, width: usize, pixel_um: f64) -> TiffResult<Vec<u8>> {
    let mut out = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut out)?
        .with_compression(Compression::Deflate(DeflateLevel::Fast))
        .with_predictor(Predictor::Horizontal);
    page(&mut encoder, pixels, width, 1, pixel_um, None)?;
    Ok(out.into_inner())
}

fn page<W: Write + Seek, K: TiffKind>(
    encoder: &mut TiffEncoder<W, K>,
    pixels: Pixels,
    width: usize,
    channels: usize,
    pixel_um: f64,
    description: Option<&str>,
) -> TiffResult<()> {
    match pixels {
        Pixels::U8(data) if channels == 3 => image::<_, RGB8, _>(encoder, data, width, pixel_um, description),
        Pixels::U16(data) if channels == 3 => image::<_, RGB16, _>(encoder, data, width, pixel_um, description),
        Pixels::F32(data) if channels == 3 => image::<_, RGB32Float, _>(encoder, data, width, pixel_um, description),
        Pixels::U8(data) => image::<_, Gray8, _>(encoder, data, width, pixel_um, description),
        Pixels::U16(data) => image::<_, Gray16, _>(encoder, data, width, pixel_um, description),
        Pixels::U32(data) => image::<_, Gray32, _>(encoder, data, width, pixel_um, description),
        Pixels::F32(data) => image::<_, Gray32Float, _>(encoder, data, width, pixel_um, description),
    }
}

fn image<W: Write + Seek, C: ColorType, K: TiffKind>(
    encoder: &mut TiffEncoder<W, K>,
    data: &[C::Inner],
    width: usize,
    pixel_um: f64,
    description: Option<&str>,
) -> TiffResult<()>
where
    [C::Inner]: TiffValue,
{
    let height = data.len() / (width * C::BITS_PER_SAMPLE.len()).max(1);
    let mut image = encoder.new_image::<C>(u32::try_from(width)?, u32::try_from(height)?)?;
    let tags = image.encoder();
    if let Some(text) = description {
        tags.write_tag(Tag::ImageDescription, text)?;
    }
    tags.write_tag(Tag::ResolutionUnit, ResolutionUnit::Centimeter.to_u16())?;
    tags.write_tag(Tag::XResolution, per_centimetre(pixel_um))?;
    tags.write_tag(Tag::YResolution, per_centimetre(pixel_um))?;
    image.write_data(data)
}

/// Pixels per centimetre, to a thousandth.
fn per_centimetre(pixel_um: f64) -> Rational {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let n = (1e7 / pixel_um + 0.5) as u32;
    Rational { n, d: 1000 }
}
