//! TIFF: pages written one after the other, and label images.

use std::io::{self, Cursor, Seek, Write};

use miniz_oxide::deflate::compress_to_vec_zlib;
use papsynth::truth::Group;
use tiff::encoder::colortype::{ColorType, Gray8, Gray16, Gray32, Gray32Float, RGB8, RGB16, RGB32Float};
use tiff::encoder::{DirectoryEncoder, Rational, TiffEncoder, TiffKind, TiffKindBig, TiffKindStandard, TiffValue};
use tiff::tags::{CompressionMethod, PhotometricInterpretation, ResolutionUnit, SampleFormat, Tag};
use tiff::{TiffError, TiffResult};

use super::{ome, pyramid};
use crate::record::Geometry;

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

impl<W: Write + Seek> PageWriter<W> {
    /// A page in tiles with smaller versions, if it is large, else as it is. For formats whose readers expect that.
    pub(crate) fn write_pyramid(
        &mut self,
        pixels: Pixels,
        width: usize,
        channels: usize,
        pixel_um: f64,
        description: Option<&str>,
    ) -> TiffResult<()> {
        let height = pixels.len() / (width * channels).max(1);
        match (self, pixels) {
            (writer, pixels) if width.max(height) < pyramid::LARGE => {
                writer.write(pixels, width, channels, pixel_um, description)
            }
            (Self::Classic(e), Pixels::U8(data)) => pyramid::page(e, data, width, channels, pixel_um, description),
            (Self::Classic(e), Pixels::U16(data)) => pyramid::page(e, data, width, channels, pixel_um, description),
            (Self::Big(e), Pixels::U8(data)) => pyramid::page(e, data, width, channels, pixel_um, description),
            (Self::Big(e), Pixels::U16(data)) => pyramid::page(e, data, width, channels, pixel_um, description),
            (writer, pixels) => writer.write(pixels, width, channels, pixel_um, description),
        }
    }
}

impl Pixels<'_> {
    fn len(&self) -> usize {
        match self {
            Self::U8(data) => data.len(),
            Self::U16(data) => data.len(),
            Self::U32(data) => data.len(),
            Self::F32(data) => data.len(),
        }
    }
}

/// The size of a pixel.
pub(super) fn resolution<W: Write + Seek, K: TiffKind>(
    directory: &mut DirectoryEncoder<W, K>,
    pixel_um: f64,
) -> TiffResult<()> {
    directory.write_tag(Tag::ResolutionUnit, ResolutionUnit::Centimeter.to_u16())?;
    directory.write_tag(Tag::XResolution, per_centimetre(pixel_um))?;
    directory.write_tag(Tag::YResolution, per_centimetre(pixel_um))
}

/// A label image of 16 bits, or of 32 if a label needs them.
pub(crate) fn label_tiff(ids: &[u32], width: usize, pixel_um: f64) -> io::Result<Vec<u8>> {
    if !fits_16_bits(ids) {
        return compressed(&[Pixels::U32(ids)], width, 1, pixel_um, None);
    }
    compressed(&[Pixels::U16(&labels_16(ids))], width, 1, pixel_um, None)
}

/// Grey levels or colours of a frame's picture.
pub(crate) fn picture_tiff(picture: &[u16], geometry: &Geometry) -> io::Result<Vec<u8>> {
    image_tiff(picture, geometry, None)
}

/// The same as OME-TIFF of one plane.
pub(crate) fn ome_picture(picture: &[u16], geometry: &Geometry) -> io::Result<Vec<u8>> {
    let (text, view) = (ome::of_picture(geometry), geometry.view);
    if view.width.max(view.height) < pyramid::LARGE {
        return image_tiff(picture, geometry, Some(&text));
    }
    let mut out = Cursor::new(Vec::new());
    let narrow = if geometry.bits <= 8 { narrow(picture) } else { Vec::new() };
    let pixels = if geometry.bits <= 8 { Pixels::U8(&narrow) } else { Pixels::U16(picture) };
    let bytes = 3 * picture.len() as u64;
    PageWriter::new(&mut out, bytes)
        .and_then(|mut w| w.write_pyramid(pixels, view.width, geometry.channels, view.pixel_um, Some(&text)))
        .map_err(as_io)?;
    Ok(out.into_inner())
}

fn image_tiff(picture: &[u16], geometry: &Geometry, description: Option<&str>) -> io::Result<Vec<u8>> {
    let Geometry { view, channels, bits, .. } = geometry;
    match bits {
        ..=8 => compressed(&[Pixels::U8(&narrow(picture))], view.width, *channels, view.pixel_um, description),
        _ => compressed(&[Pixels::U16(picture)], view.width, *channels, view.pixel_um, description),
    }
}

/// Layers of labels as channels of an OME-TIFF.
pub(crate) fn ome_labels(layers: &[Vec<u32>], group: Group, geometry: &Geometry) -> io::Result<Vec<u8>> {
    let view = geometry.view;
    let small = layers.iter().all(|layer| fits_16_bits(layer));
    let text = ome::of_labels(geometry, group, layers.len(), if small { "uint16" } else { "uint32" });
    if !small {
        let pages: Vec<Pixels> = layers.iter().map(|layer| Pixels::U32(layer)).collect();
        return compressed(&pages, view.width, 1, view.pixel_um, Some(&text));
    }
    let narrow: Vec<Vec<u16>> = layers.iter().map(|layer| labels_16(layer)).collect();
    let pages: Vec<Pixels> = narrow.iter().map(|layer| Pixels::U16(layer)).collect();
    compressed(&pages, view.width, 1, view.pixel_um, Some(&text))
}

fn fits_16_bits(ids: &[u32]) -> bool {
    ids.iter().all(|&id| id <= u16::MAX.into())
}

#[expect(clippy::cast_possible_truncation, reason = "they fit")]
fn labels_16(ids: &[u32]) -> Vec<u16> {
    ids.iter().map(|&id| id as u16).collect()
}

/// Grey levels of at most 8 bits.
#[expect(clippy::cast_possible_truncation, reason = "they fit")]
pub(crate) fn narrow(levels: &[u16]) -> Vec<u8> {
    levels.iter().map(|&g| g as u8).collect()
}

/// Pages of whole numbers, compressed, and not as differences along a row: ImageJ shows those as they are.
pub(crate) fn compressed(
    pages: &[Pixels],
    width: usize,
    channels: usize,
    pixel_um: f64,
    description: Option<&str>,
) -> io::Result<Vec<u8>> {
    let mut out = Cursor::new(Vec::new());
    let mut write = || -> TiffResult<()> {
        let mut encoder = TiffEncoder::new(&mut out)?;
        for (number, &pixels) in pages.iter().enumerate() {
            let description = description.filter(|_| number == 0);
            compressed_page(&mut encoder, pixels, width, channels, pixel_um, description)?;
        }
        Ok(())
    };
    write().map_err(as_io)?;
    Ok(out.into_inner())
}

/// Labels are runs, of which more effort makes little.
const FASTEST: u8 = 1;

/// Bytes of a strip, before it is compressed.
const STRIP_BYTES: usize = 1 << 18;

fn compressed_page<W: Write + Seek, K: TiffKind>(
    encoder: &mut TiffEncoder<W, K>,
    pixels: Pixels,
    width: usize,
    channels: usize,
    pixel_um: f64,
    description: Option<&str>,
) -> TiffResult<()> {
    let (values, bytes) = match pixels {
        Pixels::U8(data) => (data.len(), 1),
        Pixels::U16(data) => (data.len(), 2),
        Pixels::U32(data) => (data.len(), 4),
        Pixels::F32(_) => return Err(io::Error::other("floating-point pages are not compressed").into()),
    };
    let row = (width * channels).max(1);
    let rows = (STRIP_BYTES / (row * bytes)).max(1);
    let mut page = encoder.image_directory()?;
    let (mut offsets, mut sizes) = (Vec::new(), Vec::new());
    for from in (0..values).step_by(rows * row) {
        let to = values.min(from + rows * row);
        let strip: Vec<u8> = match pixels {
            Pixels::U8(data) => data[from..to].to_vec(),
            Pixels::U16(data) => data[from..to].iter().flat_map(|value| value.to_ne_bytes()).collect(),
            Pixels::U32(data) => data[from..to].iter().flat_map(|value| value.to_ne_bytes()).collect(),
            Pixels::F32(_) => Vec::new(),
        };
        let strip = compress_to_vec_zlib(&strip, FASTEST);
        offsets.push(u32::try_from(page.write_data(strip.as_slice())?)?);
        sizes.push(u32::try_from(strip.len())?);
    }
    if let Some(text) = description {
        page.write_tag(Tag::ImageDescription, text)?;
    }
    page.write_tag(Tag::ImageWidth, u32::try_from(width)?)?;
    page.write_tag(Tag::ImageLength, u32::try_from(values / row)?)?;
    let bits = u16::try_from(8 * bytes)?;
    page.write_tag(Tag::BitsPerSample, vec![bits; channels].as_slice())?;
    page.write_tag(Tag::Compression, CompressionMethod::Deflate.to_u16())?;
    let photometric =
        if channels == 3 { PhotometricInterpretation::RGB } else { PhotometricInterpretation::BlackIsZero };
    page.write_tag(Tag::PhotometricInterpretation, photometric.to_u16())?;
    page.write_tag(Tag::StripOffsets, offsets.as_slice())?;
    page.write_tag(Tag::SamplesPerPixel, u16::try_from(channels)?)?;
    page.write_tag(Tag::RowsPerStrip, u32::try_from(rows)?)?;
    page.write_tag(Tag::StripByteCounts, sizes.as_slice())?;
    page.write_tag(Tag::SampleFormat, vec![SampleFormat::Uint.to_u16(); channels].as_slice())?;
    resolution(&mut page, pixel_um)?;
    page.finish()
}

/// What goes wrong with a TIFF in the making is the making's fault.
pub(crate) fn as_io(error: TiffError) -> io::Error {
    match error {
        TiffError::IoError(error) => error,
        other => io::Error::other(other),
    }
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
    resolution(tags, pixel_um)?;
    image.write_data(data)
}

/// Pixels per centimetre, to a thousandth.
fn per_centimetre(pixel_um: f64) -> Rational {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let n = (1e7 / pixel_um + 0.5) as u32;
    Rational { n, d: 1000 }
}
