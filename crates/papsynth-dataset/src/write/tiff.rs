//! TIFF: pages written one after the other, and compressed images.

use std::io::{self, Cursor};

use miniz_oxide::deflate::compress_to_vec_zlib;
use tiff::encoder::{DirectoryEncoder, Rational, TiffEncoder, TiffKind, TiffKindBig, TiffKindStandard};
use tiff::tags::{CompressionMethod, Predictor, Tag};
use tiff::{TiffError, TiffResult};

use super::page::{Out, Page, Pixels, photometric, resolution};
use super::pyramid;

/// Pages of a file larger than this go into a BigTIFF. Offsets of a classic file end at 2³² bytes; the rest is for its directories.
const CLASSIC_BYTES: u64 = 0xFF00_0000;

/// Writes uncompressed pages to a file as they arrive. Noise and expected grey levels hardly compress, and a plane
/// takes a tenth of the time to write this way.
pub(crate) enum PageWriter<'a> {
    Classic(TiffEncoder<Box<dyn Out + 'a>, TiffKindStandard>),
    Big(TiffEncoder<Box<dyn Out + 'a>, TiffKindBig>),
}

impl<'a> PageWriter<'a> {
    /// A file that will hold about `bytes` bytes of pixels.
    pub(crate) fn new(out: impl Out + 'a, bytes: u64) -> io::Result<Self> {
        let out: Box<dyn Out> = Box::new(out);
        match bytes < CLASSIC_BYTES {
            true => TiffEncoder::new(out).map(Self::Classic).map_err(as_io),
            false => TiffEncoder::new_big(out).map(Self::Big).map_err(as_io),
        }
    }

    /// Writes a page of one channel or of three.
    pub(crate) fn write(&mut self, pixels: Pixels, page: &Page) -> io::Result<()> {
        let written = match self {
            Self::Classic(encoder) => plain_page(encoder, pixels, page),
            Self::Big(encoder) => plain_page(encoder, pixels, page),
        };
        written.map_err(as_io)
    }

    /// A page in tiles with smaller versions, if it is large, else as it is. For formats whose readers expect that.
    pub(crate) fn write_pyramid(&mut self, pixels: Pixels, page: &Page) -> io::Result<()> {
        if !pyramid::is_large(page.width, pixels.len() / (page.width * page.channels).max(1)) {
            return self.write(pixels, page);
        }
        let written = match (&mut *self, pixels) {
            (Self::Classic(encoder), Pixels::U8(data)) => pyramid::page(encoder, data, page),
            (Self::Classic(encoder), Pixels::U16(data)) => pyramid::page(encoder, data, page),
            (Self::Big(encoder), Pixels::U8(data)) => pyramid::page(encoder, data, page),
            (Self::Big(encoder), Pixels::U16(data)) => pyramid::page(encoder, data, page),
            _ => return self.write(pixels, page),
        };
        written.map_err(as_io)
    }
}

/// A label image of 16 bits, or of 32 if a label needs them.
pub(crate) fn label_tiff(ids: &[u32], width: usize, pixel_um: f64) -> io::Result<Vec<u8>> {
    label_pages(&[ids], &Page { width, channels: 1, pixel_um, text: None })
}

/// Label images as pages, all of 16 bits, or all of 32 if a label needs them.
pub(crate) fn label_pages<I: AsRef<[u32]>>(pages: &[I], page: &Page) -> io::Result<Vec<u8>> {
    if !pages.iter().all(|ids| fits_16_bits(ids.as_ref())) {
        let pages: Vec<Pixels> = pages.iter().map(|ids| Pixels::U32(ids.as_ref())).collect();
        return compressed(&pages, page);
    }
    #[expect(clippy::cast_possible_truncation, reason = "they fit")]
    let narrow: Vec<Vec<u16>> = pages.iter().map(|ids| ids.as_ref().iter().map(|&id| id as u16).collect()).collect();
    let pages: Vec<Pixels> = narrow.iter().map(|ids| Pixels::U16(ids)).collect();
    compressed(&pages, page)
}

/// Whether no label needs more than 16 bits.
pub(crate) fn fits_16_bits(ids: &[u32]) -> bool {
    ids.iter().all(|&id| id <= u16::MAX.into())
}

/// Pages of whole numbers, compressed, and not as differences along a row: ImageJ shows those as they are. The first has the text.
pub(crate) fn compressed(pages: &[Pixels], page: &Page) -> io::Result<Vec<u8>> {
    let mut out = Cursor::new(Vec::new());
    let mut write = || -> TiffResult<()> {
        let mut encoder = TiffEncoder::new(Box::new(&mut out) as Box<dyn Out>)?;
        for (number, &pixels) in pages.iter().enumerate() {
            let text = page.text.filter(|_| number == 0);
            compressed_page(&mut encoder, pixels, &Page { text, ..*page })?;
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

fn compressed_page(
    encoder: &mut TiffEncoder<Box<dyn Out + '_>, TiffKindStandard>,
    pixels: Pixels,
    page: &Page,
) -> TiffResult<()> {
    let row = (page.width * page.channels).max(1);
    let (bits, format) = pixels.sample();
    let rows = (STRIP_BYTES / (row * usize::from(bits / 8))).max(1);
    let mut directory = encoder.image_directory()?;
    let (mut offsets, mut sizes) = (Vec::new(), Vec::new());
    for from in (0..pixels.len()).step_by(rows * row) {
        let strip = compress_to_vec_zlib(&pixels.bytes(from..pixels.len().min(from + rows * row)), FASTEST);
        offsets.push(u32::try_from(directory.write_data(strip.as_slice())?)?);
        sizes.push(u32::try_from(strip.len())?);
    }
    if let Some(text) = page.text {
        directory.write_tag(Tag::ImageDescription, text)?;
    }
    directory.write_tag(Tag::BitsPerSample, vec![bits; page.channels].as_slice())?;
    directory.write_tag(Tag::StripOffsets, offsets.as_slice())?;
    directory.write_tag(Tag::StripByteCounts, sizes.as_slice())?;
    directory.write_tag(Tag::SampleFormat, vec![format.to_u16(); page.channels].as_slice())?;
    resolution(&mut directory, page.pixel_um)?;
    head(&mut directory, pixels.len() / row, rows, CompressionMethod::Deflate, page)?;
    directory.finish()
}

/// Bytes of a strip that is not compressed, at least, if there are so many.
const PLAIN_STRIP_BYTES: usize = 1_000_000;

/// A page that is not compressed, byte by byte as the library writes it of a type known beforehand.
fn plain_page<K: TiffKind>(
    encoder: &mut TiffEncoder<Box<dyn Out + '_>, K>,
    pixels: Pixels,
    page: &Page,
) -> TiffResult<()> {
    let row = (page.width * page.channels).max(1);
    let (bits, format) = pixels.sample();
    let rows = PLAIN_STRIP_BYTES.div_ceil(row * usize::from(bits / 8));
    let mut directory = encoder.image_directory()?;
    for tag in [Tag::XResolution, Tag::YResolution] {
        // Replaced at once; what it was stays in the file.
        directory.write_tag(tag, Rational { n: 1, d: 1 })?;
    }
    if let Some(text) = page.text {
        directory.write_tag(Tag::ImageDescription, text)?;
    }
    resolution(&mut directory, page.pixel_um)?;
    let (mut offsets, mut sizes) = (Vec::new(), Vec::new());
    for from in (0..pixels.len()).step_by(rows * row) {
        let strip = pixels.bytes(from..pixels.len().min(from + rows * row));
        offsets.push(K::convert_offset(directory.write_data(&*strip)?)?);
        sizes.push(K::convert_offset(strip.len() as u64)?);
    }
    directory.write_tag(Tag::BitsPerSample, vec![bits; page.channels].as_slice())?;
    directory.write_tag(Tag::SampleFormat, vec![format.to_u16(); page.channels].as_slice())?;
    directory.write_tag(Tag::StripOffsets, K::convert_slice(&offsets))?;
    directory.write_tag(Tag::StripByteCounts, K::convert_slice(&sizes))?;
    directory.write_tag(Tag::Predictor, Predictor::None.to_u16())?;
    head(&mut directory, pixels.len() / row, rows, CompressionMethod::None, page)?;
    directory.finish()
}

/// What is the same of all pages in strips; each stands in the directory itself.
fn head<K: TiffKind>(
    directory: &mut DirectoryEncoder<Box<dyn Out + '_>, K>,
    height: usize,
    rows: usize,
    compression: CompressionMethod,
    page: &Page,
) -> TiffResult<()> {
    directory.write_tag(Tag::ImageWidth, u32::try_from(page.width)?)?;
    directory.write_tag(Tag::ImageLength, u32::try_from(height)?)?;
    directory.write_tag(Tag::Compression, compression.to_u16())?;
    directory.write_tag(Tag::PhotometricInterpretation, photometric(page.channels))?;
    directory.write_tag(Tag::SamplesPerPixel, u16::try_from(page.channels)?)?;
    directory.write_tag(Tag::RowsPerStrip, u32::try_from(rows)?)
}

/// What goes wrong with a TIFF in the making is the making's fault.
fn as_io(error: TiffError) -> io::Error {
    match error {
        TiffError::IoError(error) => error,
        other => io::Error::other(other),
    }
}
