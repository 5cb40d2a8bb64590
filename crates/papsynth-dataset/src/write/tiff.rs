//! TIFF: files of pages, compressed images, and pyramids of large pages in tiles, for viewers that read only the
//! visible part.

use std::borrow::Cow;
use std::io::{self, Cursor, Seek, Write};
use std::ops::Range;

use miniz_oxide::deflate::compress_to_vec_zlib;
use tiff::encoder::{DirectoryEncoder, Rational, TiffEncoder, TiffKind, TiffKindBig, TiffKindStandard, TiffValue};
use tiff::tags::{CompressionMethod, PhotometricInterpretation, ResolutionUnit, SampleFormat, Tag};
use tiff::{TiffError, TiffResult};

use super::deflate::compressed_runs;
use super::plain::PlainPages;
use crate::error::Error;
use crate::files::{FileRecord, Output, Pending};
use crate::truth::LabelRuns;

pub(crate) trait Out: Write + Seek {}

impl<T: Write + Seek> Out for T {}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Page<'a> {
    /// Columns.
    pub(crate) width: usize,
    /// Channels of a pixel: 1, or 3 for red, green and blue.
    pub(crate) channels: usize,
    /// Size of a pixel, µm.
    pub(crate) pixel_um: f64,
    /// Description (`ImageDescription`), ASCII.
    pub(crate) text: Option<&'a str>,
}

#[derive(Debug, Clone, Copy)]
pub(crate) enum Pixels<'a> {
    U8(&'a [u8]),
    U16(&'a [u16]),
    F32(&'a [f32]),
}

impl<'a> Pixels<'a> {
    /// Returns the number of values.
    pub(super) fn len(self) -> usize {
        match self {
            Self::U8(data) => data.len(),
            Self::U16(data) => data.len(),
            Self::F32(data) => data.len(),
        }
    }

    /// Returns the bits and the format of a sample.
    pub(super) fn sample(self) -> (u16, SampleFormat) {
        match self {
            Self::U8(_) => (8, SampleFormat::Uint),
            Self::U16(_) => (16, SampleFormat::Uint),
            Self::F32(_) => (32, SampleFormat::IEEEFP),
        }
    }

    /// Returns the bytes of a range of values, in native byte order.
    pub(super) fn bytes(self, range: Range<usize>) -> Cow<'a, [u8]> {
        match self {
            Self::U8(data) => data[range].data(),
            Self::U16(data) => data[range].data(),
            Self::F32(data) => data[range].data(),
        }
    }
}

/// Returns the photometric interpretation of an image.
pub(super) fn photometric(channels: usize) -> u16 {
    match channels {
        3 => PhotometricInterpretation::RGB.to_u16(),
        _ => PhotometricInterpretation::BlackIsZero.to_u16(),
    }
}

/// Returns the resolution in pixels per centimetre, rounded to 0.001.
pub(super) fn per_centimetre(pixel_um: f64) -> Rational {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let n = (1e7 / pixel_um + 0.5) as u32;
    Rational { n, d: 1000 }
}

fn resolution<W: Out, K: TiffKind>(directory: &mut DirectoryEncoder<W, K>, pixel_um: f64) -> TiffResult<()> {
    directory.write_tag(Tag::ResolutionUnit, ResolutionUnit::Centimeter.to_u16())?;
    directory.write_tag(Tag::XResolution, per_centimetre(pixel_um))?;
    directory.write_tag(Tag::YResolution, per_centimetre(pixel_um))
}

/// Largest size of the pages of a classic TIFF; larger ones need BigTIFF. Offsets are below 2³², and directories need
/// some space.
pub(super) const CLASSIC_BYTES: u64 = 0xFF00_0000;

/// Writes large pages as pyramids, one after the other.
pub(crate) enum PyramidWriter<'a> {
    Classic(TiffEncoder<Box<dyn Out + 'a>, TiffKindStandard>),
    Big(TiffEncoder<Box<dyn Out + 'a>, TiffKindBig>),
}

impl<'a> PyramidWriter<'a> {
    /// Creates a file for about `bytes` bytes of pixels.
    fn new(out: impl Out + 'a, bytes: u64) -> io::Result<Self> {
        let out: Box<dyn Out> = Box::new(out);
        match bytes < CLASSIC_BYTES {
            true => TiffEncoder::new(out).map(Self::Classic).map_err(as_io),
            false => TiffEncoder::new_big(out).map(Self::Big).map_err(as_io),
        }
    }

    fn write(&mut self, pixels: Pixels, page: &Page) -> io::Result<()> {
        let written = match (self, pixels) {
            (Self::Classic(encoder), Pixels::U8(data)) => pyramid_page(encoder, data, page),
            (Self::Classic(encoder), Pixels::U16(data)) => pyramid_page(encoder, data, page),
            (Self::Big(encoder), Pixels::U8(data)) => pyramid_page(encoder, data, page),
            (Self::Big(encoder), Pixels::U16(data)) => pyramid_page(encoder, data, page),
            (_, Pixels::F32(_)) => return Err(io::Error::other("pyramids are of integers")),
        };
        written.map_err(as_io)
    }
}

/// Encodes an image of integers as a pyramid.
pub(crate) fn pyramid(pixels: Pixels, page: &Page) -> io::Result<Vec<u8>> {
    let mut out = Cursor::new(Vec::new());
    let bytes = pixels.bytes(0..pixels.len()).len() as u64 * 3 / 2;
    PyramidWriter::new(&mut out, bytes)?.write(pixels, page)?;
    Ok(out.into_inner())
}

/// A TIFF file that is renamed from its temporary name when it is complete.
pub(crate) enum Pages {
    Plain(PlainPages<Output>),
    Pyramids(Pending, PyramidWriter<'static>),
}

impl Pages {
    /// Starts a file of `pages` pages, with about `bytes` bytes of pixels.
    pub(crate) fn new(pending: Pending, pages: usize, bytes: u64) -> Result<Self, Error> {
        let path = pending.path().to_owned();
        PlainPages::new(Output::new(pending)?, pages, bytes).map(Self::Plain).map_err(Error::io("write", &path))
    }

    /// Starts a file of large pages, which are written as pyramids, with about `bytes` bytes of pixels.
    pub(crate) fn pyramids(pending: Pending, bytes: u64) -> Result<Self, Error> {
        let writer = PyramidWriter::new(pending.handle()?, bytes).map_err(Error::io("write", pending.path()))?;
        Ok(Self::Pyramids(pending, writer))
    }

    pub(crate) fn write(&mut self, pixels: Pixels, page: &Page) -> Result<(), Error> {
        match self {
            Self::Plain(pages) => {
                let written = pages.write(pixels, page);
                written.map_err(|error| Error::io("write", pages.inner().path())(error))
            }
            Self::Pyramids(pending, writer) => writer.write(pixels, page).map_err(Error::io("write", pending.path())),
        }
    }

    pub(crate) fn commit(self) -> Result<FileRecord, Error> {
        match self {
            Self::Plain(pages) => pages.into_inner().commit(),
            Self::Pyramids(pending, _) => pending.commit(),
        }
    }
}

/// Encodes label images as pages: all with 16 bits, or all with 32 if a label needs them.
pub(crate) fn label_pages(pages: &[LabelRuns], page: &Page) -> io::Result<Vec<u8>> {
    let is_narrow = pages.iter().all(LabelRuns::fits_16_bits);
    compressed_pages(pages.iter().map(|labels| Strips::of_labels(labels, is_narrow)), page)
}

/// Encodes an image as a compressed page of integers.
pub(crate) fn compressed(pixels: Pixels, page: &Page) -> io::Result<Vec<u8>> {
    compressed_pages([Strips::of_pixels(pixels, page)].into_iter(), page)
}

/// Compression level of images. Higher levels hardly make them smaller.
const FASTEST: u8 = 1;

/// Size of an uncompressed strip of compressed pages, bytes.
const STRIP_BYTES: usize = 1 << 18;

/// The pixels of a page as compressed strips, without the horizontal predictor, which ImageJ ignores.
struct Strips {
    compressed: Vec<Vec<u8>>,
    /// Rows of the page, and of a strip.
    rows: [usize; 2],
    bits: u16,
    format: SampleFormat,
}

impl Strips {
    fn of_pixels(pixels: Pixels, page: &Page) -> Self {
        let row = (page.width * page.channels).max(1);
        let (bits, format) = pixels.sample();
        let rows = Self::rows(row, bits);
        let strips = (0..pixels.len()).step_by(rows * row);
        let strip = |from| pixels.bytes(from..pixels.len().min(from + rows * row));
        let compressed = strips.map(|from| compress_to_vec_zlib(&strip(from), FASTEST)).collect();
        Self { compressed, rows: [pixels.len() / row, rows], bits, format }
    }

    /// Compresses a label image with 16 bits if `is_narrow`, else with 32.
    fn of_labels(labels: &LabelRuns, is_narrow: bool) -> Self {
        let bits = if is_narrow { 16 } else { 32 };
        let rows = Self::rows(labels.width, bits);
        #[expect(clippy::cast_possible_truncation, reason = "the labels fit into 16 bits")]
        let narrow = |(label, count): (u32, usize)| ((label as u16).to_ne_bytes(), count);
        let compress = |runs: Vec<(u32, usize)>| match is_narrow {
            true => compressed_runs(runs.into_iter().map(narrow)),
            false => compressed_runs(runs.into_iter().map(|(label, count)| (label.to_ne_bytes(), count))),
        };
        let compressed = labels.parts(rows * labels.width).into_iter().map(compress).collect();
        Self { compressed, rows: [labels.height, rows], bits, format: SampleFormat::Uint }
    }

    /// Returns the rows of a strip.
    fn rows(row: usize, bits: u16) -> usize {
        (STRIP_BYTES / (row * usize::from(bits / 8))).max(1)
    }
}

/// Encodes compressed pages. The first one has the description.
fn compressed_pages(pages: impl Iterator<Item = Strips>, page: &Page) -> io::Result<Vec<u8>> {
    let mut out = Cursor::new(Vec::new());
    let write = || -> TiffResult<()> {
        let mut encoder = TiffEncoder::new(Box::new(&mut out) as Box<dyn Out>)?;
        for (number, strips) in pages.enumerate() {
            let text = page.text.filter(|_| number == 0);
            compressed_page(&mut encoder, &strips, &Page { text, ..*page })?;
        }
        Ok(())
    };
    write().map_err(as_io)?;
    Ok(out.into_inner())
}

fn compressed_page(
    encoder: &mut TiffEncoder<Box<dyn Out + '_>, TiffKindStandard>,
    &Strips { ref compressed, rows: [height, rows], bits, format }: &Strips,
    page: &Page,
) -> TiffResult<()> {
    let mut directory = encoder.image_directory()?;
    let (mut offsets, mut sizes) = (Vec::new(), Vec::new());
    for strip in compressed {
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
    directory.write_tag(Tag::ImageWidth, u32::try_from(page.width)?)?;
    directory.write_tag(Tag::ImageLength, u32::try_from(height)?)?;
    directory.write_tag(Tag::Compression, CompressionMethod::Deflate.to_u16())?;
    directory.write_tag(Tag::PhotometricInterpretation, photometric(page.channels))?;
    directory.write_tag(Tag::SamplesPerPixel, u16::try_from(page.channels)?)?;
    directory.write_tag(Tag::RowsPerStrip, u32::try_from(rows)?)?;
    directory.finish()
}

/// Width and height of a tile.
const TILE: usize = 512;

/// Images of at least this width or height are written as pyramids.
const LARGE: usize = 2048;

pub(crate) fn is_large(width: usize, height: usize) -> bool {
    width.max(height) >= LARGE
}

/// A level of 8 or 16 bits.
trait Level: Copy + Default + Into<u32> + TryFrom<u32> {}

impl Level for u8 {}

impl Level for u16 {}

/// An image with interleaved channels.
struct Image<'a, T> {
    levels: &'a [T],
    width: usize,
    channels: usize,
}

impl<T: Level> Image<'_, T> {
    fn height(&self) -> usize {
        self.levels.len() / (self.width * self.channels).max(1)
    }

    /// Returns the rounded means of 2 x 2 pixels. An odd last row or column is left out.
    fn halved(&self) -> Vec<T> {
        let (row, channels) = (self.width * self.channels, self.channels);
        let [width, height] = [self.width / 2, self.height() / 2];
        let mut half = Vec::with_capacity(width * height * channels);
        for y in 0..height {
            let rows = [&self.levels[2 * y * row..][..row], &self.levels[(2 * y + 1) * row..][..row]];
            for x in 0..width {
                for channel in 0..channels {
                    let at = 2 * x * channels + channel;
                    let sum: u32 = rows.iter().map(|row| row[at].into() + row[at + channels].into()).sum();
                    let mean = T::try_from((sum + 2) / 4).ok();
                    half.push(mean.expect("a mean of levels fits into their type"));
                }
            }
        }
        half
    }

    /// Returns the levels of a tile; 0 outside the image.
    fn tile(&self, column: usize, row: usize) -> Vec<T> {
        let mut tile = vec![T::default(); TILE * TILE * self.channels];
        let from = column * TILE * self.channels;
        let to = ((column + 1) * TILE).min(self.width) * self.channels;
        let rows = self.levels.chunks_exact(self.width * self.channels).skip(row * TILE).take(TILE);
        for (out, levels) in tile.chunks_exact_mut(TILE * self.channels).zip(rows) {
            out[..to - from].copy_from_slice(&levels[from..to]);
        }
        tile
    }
}

/// Writes a page and, as sub-images, its smaller versions down to one tile.
fn pyramid_page<W: Out, K: TiffKind, T: Level>(
    encoder: &mut TiffEncoder<W, K>,
    levels: &[T],
    &Page { width, channels, pixel_um, text }: &Page,
) -> TiffResult<()>
where
    [T]: TiffValue,
{
    let whole = Image { levels, width, channels };
    let mut smaller = Vec::new();
    let (mut half, mut um) = (whole.halved(), pixel_um);
    let mut side = width / 2;
    while side.max(half.len() / (side * channels).max(1)) >= TILE {
        let image = Image { levels: &half, width: side, channels };
        um *= 2.0;
        let mut directory = encoder.extra_directory()?;
        directory.write_tag(Tag::NewSubfileType, 1_u32)?;
        fill(&mut directory, &image, um)?;
        smaller.push(directory.finish_with_offsets()?.offset);
        (half, side) = (image.halved(), side / 2);
    }
    let mut directory = encoder.image_directory()?;
    if let Some(text) = text {
        directory.write_tag(Tag::ImageDescription, text)?;
    }
    fill(&mut directory, &whole, pixel_um)?;
    if !smaller.is_empty() {
        directory.write_tag(Tag::SubIfd, K::convert_slice(&smaller))?;
    }
    directory.finish()
}

fn fill<W: Out, K: TiffKind, T: Level>(
    directory: &mut DirectoryEncoder<W, K>,
    image: &Image<T>,
    pixel_um: f64,
) -> TiffResult<()>
where
    [T]: TiffValue,
{
    let (width, height, channels) = (image.width, image.height(), image.channels);
    let (mut offsets, mut sizes) = (Vec::new(), Vec::new());
    for row in 0..height.div_ceil(TILE) {
        for column in 0..width.div_ceil(TILE) {
            let tile = image.tile(column, row);
            offsets.push(K::convert_offset(directory.write_data(tile.as_slice())?)?);
            sizes.push(u32::try_from(size_of_val(tile.as_slice()))?);
        }
    }
    directory.write_tag(Tag::ImageWidth, u32::try_from(width)?)?;
    directory.write_tag(Tag::ImageLength, u32::try_from(height)?)?;
    directory.write_tag(Tag::BitsPerSample, vec![u16::try_from(8 * size_of::<T>())?; channels].as_slice())?;
    directory.write_tag(Tag::Compression, 1_u16)?;
    directory.write_tag(Tag::PhotometricInterpretation, photometric(channels))?;
    directory.write_tag(Tag::SamplesPerPixel, u16::try_from(channels)?)?;
    directory.write_tag(Tag::SampleFormat, vec![SampleFormat::Uint.to_u16(); channels].as_slice())?;
    directory.write_tag(Tag::TileWidth, u32::try_from(TILE)?)?;
    directory.write_tag(Tag::TileLength, u32::try_from(TILE)?)?;
    directory.write_tag(Tag::TileOffsets, K::convert_slice(&offsets))?;
    directory.write_tag(Tag::TileByteCounts, sizes.as_slice())?;
    resolution(directory, pixel_um)
}

/// Converts encoder errors to I/O errors.
fn as_io(error: TiffError) -> io::Error {
    match error {
        TiffError::IoError(error) => error,
        other => io::Error::other(other),
    }
}

#[cfg(test)]
#[allow(clippy::cast_possible_truncation, reason = "the numbers are small")]
mod tests {
    use tiff::decoder::{Decoder, DecodingResult};
    use tiff::tags::IfdPointer;

    use super::*;

    #[test]
    fn pyramids_have_tiles_of_every_level() {
        for channels in [1, 3] {
            let (width, height) = (2111_usize, 1300_usize);
            let levels: Vec<u16> = (0..width * height * channels).map(|i| (i * 7919 % 60_013) as u16).collect();
            let mut out = Cursor::new(Vec::new());
            let mut encoder = TiffEncoder::new(&mut out).unwrap();
            let head = Page { width, channels, pixel_um: 0.25, text: Some("text") };
            pyramid_page(&mut encoder, &levels, &head).unwrap();
            let bytes = out.into_inner();
            let mut decoder = Decoder::new(Cursor::new(&bytes)).unwrap();
            assert!(matches!(decoder.read_image().unwrap(), DecodingResult::U16(read) if read == levels));
            assert!(!decoder.more_images(), "smaller levels are not in the chain of pages");
            let mut expected = Image { levels: &levels, width, channels }.halved();
            let mut side = width / 2;
            let places = decoder.get_tag_u64_vec(Tag::SubIfd).unwrap();
            assert_eq!(places.len(), 2);
            for place in places {
                let directory = decoder.read_directory(IfdPointer(place)).unwrap();
                let mut tags = decoder.read_directory_tags(&directory);
                let mut numbers = |tag| tags.get_tag(tag).unwrap().into_u64_vec().unwrap();
                assert_eq!(numbers(Tag::ImageWidth), [side as u64]);
                let image = Image { levels: &expected, width: side, channels };
                let columns = side.div_ceil(TILE);
                for (number, offset) in numbers(Tag::TileOffsets).into_iter().enumerate() {
                    let tile: Vec<u8> =
                        image.tile(number % columns, number / columns).iter().flat_map(|v| v.to_ne_bytes()).collect();
                    assert_eq!(bytes[offset as usize..][..tile.len()], tile);
                }
                let half = image.halved();
                (expected, side) = (half, side / 2);
            }
        }
    }

    #[test]
    fn a_small_image_is_halved_as_by_hand() {
        let image = Image { levels: &[0_u8, 1, 9, 1, 1, 9, 5, 5, 5], width: 3, channels: 1 };
        assert_eq!(image.halved(), [1]);
    }
}
