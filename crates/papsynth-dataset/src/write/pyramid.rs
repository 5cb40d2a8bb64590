//! Pages in tiles, each with the same at half the size, and again: viewers of large images read what they show.

use tiff::TiffResult;
use tiff::encoder::{DirectoryEncoder, TiffEncoder, TiffKind, TiffValue};
use tiff::tags::{SampleFormat, Tag};

use super::page::{Out, Page, photometric, resolution};

/// Side of a tile.
const TILE: usize = 512;

/// From this side on an image is written as a pyramid.
const LARGE: usize = 2048;

/// Whether an image is written as a pyramid.
pub(crate) fn is_large(width: usize, height: usize) -> bool {
    width.max(height) >= LARGE
}

/// Grey levels of 8 or of 16 bits.
pub(super) trait Level: Copy + Default + Into<u32> + TryFrom<u32> {
    const BITS: u16;
}

impl Level for u8 {
    const BITS: u16 = 8;
}

impl Level for u16 {
    const BITS: u16 = 16;
}

/// An image whose channels lie side by side.
struct Image<'a, T> {
    levels: &'a [T],
    width: usize,
    channels: usize,
}

impl<T: Level> Image<'_, T> {
    fn height(&self) -> usize {
        self.levels.len() / (self.width * self.channels).max(1)
    }

    /// The means of two by two pixels, rounded; an odd last row or column is left out.
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
                    half.push(mean.expect("a mean of levels has no more bits than they have"));
                }
            }
        }
        half
    }

    /// The levels of a tile; where it reaches beyond the image, 0.
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

/// Adds a page and its smaller versions, down to one tile, as sub-images.
pub(super) fn page<W: Out, K: TiffKind, T: Level>(
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
    directory.write_tag(Tag::BitsPerSample, vec![T::BITS; channels].as_slice())?;
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

#[cfg(test)]
#[allow(clippy::cast_possible_truncation, reason = "the numbers are small")]
mod tests {
    use std::io::Cursor;

    use tiff::decoder::{Decoder, DecodingResult};
    use tiff::tags::IfdPointer;

    use super::*;

    #[test]
    fn tiles_hold_the_image_and_every_level_its_means() {
        for channels in [1, 3] {
            let (width, height) = (2111_usize, 1300_usize);
            let levels: Vec<u16> = (0..width * height * channels).map(|i| (i * 7919 % 60_013) as u16).collect();
            let mut out = Cursor::new(Vec::new());
            let mut encoder = TiffEncoder::new(&mut out).unwrap();
            let head = Page { width, channels, pixel_um: 0.25, text: Some("text") };
            page(&mut encoder, &levels, &head).unwrap();
            let bytes = out.into_inner();
            let mut decoder = Decoder::new(Cursor::new(&bytes)).unwrap();
            assert!(matches!(decoder.read_image().unwrap(), DecodingResult::U16(read) if read == levels));
            assert!(!decoder.more_images(), "smaller ones lie beside the chain");
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
    fn means_are_those_by_hand() {
        let image = Image { levels: &[0_u8, 1, 9, 1, 1, 9, 5, 5, 5], width: 3, channels: 1 };
        assert_eq!(image.halved(), [1]);
    }
}
