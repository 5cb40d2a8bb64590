//! Images with outlines of the ground truth, and the contact sheet.

use std::collections::BTreeMap;
use std::io;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use papsynth::truth::{Group, Mask, Run};
use papsynth::{Finished, Plane};

use crate::error::Error;
use crate::files::write_file;
use crate::read::LevelImage;
use crate::write::{self, rgb_png};
use papsynth::white_level as white;

/// A colour image with 8 bits a channel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RgbImage {
    /// Columns.
    pub width: usize,
    /// Red, green and blue of each pixel, row by row.
    pub rgb: Vec<u8>,
}

impl RgbImage {
    /// Converts a plane to 8 bits.
    #[must_use]
    pub fn plain(plane: &Plane, finished: &Finished) -> Self {
        Self::of(plane, finished, &[])
    }

    /// Converts a plane and draws the outlines of all objects: cytoplasm green, nuclei orange, debris blue.
    #[must_use]
    pub fn overlay(plane: &Plane, finished: &Finished) -> Self {
        let objects = &finished.truth.objects;
        let masks: Vec<_> = objects.iter().map(|object| (object.group(), object.amodal.clone())).collect();
        Self::of(plane, finished, &masks)
    }

    fn of(plane: &Plane, finished: &Finished, masks: &[(Group, Mask)]) -> Self {
        let (view, camera) = (&finished.scene.view, &finished.scene.camera);
        let mut drawn = Self::blank(view.width, view.height, BACKGROUND);
        let levels = plane.grey.clone();
        let image = LevelImage { width: view.width, channels: plane.channels, levels, white: white(camera.bits) };
        let place = Place { x: 0, y: 0, width: view.width, height: view.height };
        drawn.draw(&image, image.white, masks, place);
        drawn
    }

    /// Encodes the image as a PNG file.
    ///
    /// # Errors
    /// If it is empty, or larger than PNG allows.
    pub fn to_png(&self) -> io::Result<Vec<u8>> {
        rgb_png(&self.rgb, self.width)
    }

    fn blank(width: usize, height: usize, colour: [u8; 3]) -> Self {
        Self { width, rgb: colour.repeat(width * height) }
    }

    fn set(&mut self, x: usize, y: usize, colour: [u8; 3]) {
        let at = (y * self.width + x) * 3;
        if x < self.width
            && let Some(pixel) = self.rgb.get_mut(at..at + 3)
        {
            pixel.copy_from_slice(&colour);
        }
    }

    /// Draws an image, downscaled to `place`, and outlines over it.
    fn draw(&mut self, image: &LevelImage, white: u16, masks: &[(Group, Mask)], place: Place) {
        let (width, height, channels) = (image.width, image.height(), image.channels);
        // Sums of the columns of a row of pixels.
        let mut columns = vec![0_u32; width * channels];
        for y in 0..place.height {
            let rows = span(y, place.height, height);
            columns.fill(0);
            for row in image.levels.chunks_exact((width * channels).max(1)).skip(rows.start).take(rows.len()) {
                columns.iter_mut().zip(row).for_each(|(sum, &level)| *sum += u32::from(level));
            }
            for x in 0..place.width {
                let span = span(x, place.width, width);
                let mut sums = [0_u64; 3];
                for pixel in columns[span.start * channels..span.end * channels].chunks_exact(channels) {
                    sums.iter_mut().zip(pixel).for_each(|(sum, &level)| *sum += u64::from(level));
                }
                let full = (rows.len() * span.len()) as u64 * u64::from(white);
                let mean = |sum: u64| u8::try_from((sum * 255 + full / 2) / full.max(1)).unwrap_or(u8::MAX);
                let colour = if channels == 3 { sums.map(mean) } else { [mean(sums[0]); 3] };
                self.set(place.x + x, place.y + y, colour);
            }
        }
        // Nuclei are drawn last, over the other outlines.
        for group in [Group::Cytoplasm, Group::Debris, Group::Nucleus] {
            for (_, mask) in masks.iter().filter(|(of, _)| *of == group) {
                for [x, y] in edge(mask) {
                    let x = x as usize * place.width / width;
                    let y = y as usize * place.height / height;
                    self.set(place.x + x, place.y + y, colour(group));
                }
            }
        }
    }

    /// Draws digits; other characters are blank.
    fn write(&mut self, text: &str, x: usize, y: usize) {
        for (i, digit) in text.chars().map(|c| c.to_digit(10)).enumerate() {
            let rows = digit.map_or([0; 7], |d| DIGITS[d as usize]);
            for (row, bits) in rows.iter().enumerate() {
                for column in (0..5).filter(|column| bits >> (4 - column) & 1 == 1) {
                    for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                        self.set(x + i * 12 + 2 * column + dx, y + 2 * row + dy, [255; 3]);
                    }
                }
            }
        }
    }
}

/// A rectangle in the target image, px.
#[derive(Debug, Clone, Copy)]
struct Place {
    x: usize,
    y: usize,
    width: usize,
    height: usize,
}

const BACKGROUND: [u8; 3] = [32; 3];

/// Colours that are distinguishable with colour vision deficiency (Okabe and Ito).
fn colour(group: Group) -> [u8; 3] {
    match group {
        Group::Cytoplasm => [0, 158, 115],
        Group::Nucleus => [213, 94, 0],
        Group::Debris => [86, 180, 233],
    }
}

/// Digits of 5 x 7 pixels; the highest of the 5 bits is the leftmost pixel.
const DIGITS: [[u8; 7]; 10] = [
    [0x0E, 0x11, 0x13, 0x15, 0x19, 0x11, 0x0E],
    [0x04, 0x0C, 0x04, 0x04, 0x04, 0x04, 0x0E],
    [0x0E, 0x11, 0x01, 0x02, 0x04, 0x08, 0x1F],
    [0x1F, 0x02, 0x04, 0x02, 0x01, 0x11, 0x0E],
    [0x02, 0x06, 0x0A, 0x12, 0x1F, 0x02, 0x02],
    [0x1F, 0x10, 0x1E, 0x01, 0x01, 0x11, 0x0E],
    [0x06, 0x08, 0x10, 0x1E, 0x11, 0x11, 0x0E],
    [0x1F, 0x01, 0x02, 0x04, 0x08, 0x08, 0x08],
    [0x0E, 0x11, 0x11, 0x0E, 0x11, 0x11, 0x0E],
    [0x0E, 0x11, 0x11, 0x0F, 0x01, 0x02, 0x0C],
];

/// Returns the source pixels, of `from`, of target pixel `i`, of `to`; at least 1.
fn span(i: usize, to: usize, from: usize) -> std::ops::Range<usize> {
    let start = i * from / to;
    start..((i + 1) * from / to).max(start + 1).min(from)
}

/// Returns the pixels of a mask with a neighbour outside it.
fn edge(mask: &Mask) -> Vec<[u32; 2]> {
    let rows: Vec<&[Run]> = mask.runs().chunk_by(|a, b| a.y == b.y).collect();
    let row = |number: Option<usize>, y: Option<u32>| {
        let found = number.and_then(|number| rows.get(number));
        found.filter(|row| Some(row[0].y) == y).copied().unwrap_or_default()
    };
    let mut pixels = Vec::new();
    for (number, runs) in rows.iter().enumerate() {
        let y = runs[0].y;
        let above = row(number.checked_sub(1), y.checked_sub(1));
        let below = row(Some(number + 1), Some(y + 1));
        for run in *runs {
            let mut from = run.x0;
            for (a, b) in above.iter().flat_map(|a| below.iter().map(move |b| (a, b))) {
                // All four neighbours of these pixels are in the mask.
                let (x0, x1) = (a.x0.max(b.x0).max(run.x0 + 1), a.x1.min(b.x1).min(run.x1 - 1));
                if x0 < x1 {
                    pixels.extend((from..x0).map(|x| [x, y]));
                    from = x1;
                }
            }
            pixels.extend((from..run.x1).map(|x| [x, y]));
        }
    }
    pixels
}

/// Thumbnails of the first frames with outlines and names.
pub(crate) struct ContactSheet {
    pub(crate) image: RgbImage,
    frames: usize,
}

impl ContactSheet {
    /// Largest number of frames.
    pub(crate) const MAX_FRAMES: usize = 24;
    const COLUMNS: usize = 4;
    /// Largest size of a thumbnail, px: a quarter of the default field.
    const SIZE: [usize; 2] = [344, 260];
    const GAP: usize = 8;
    const CAPTION: usize = 22;

    pub(crate) fn new(frames: usize) -> Self {
        let shown = frames.clamp(1, Self::MAX_FRAMES);
        let columns = shown.min(Self::COLUMNS);
        let [width, height] = Self::cell();
        let rows = shown.div_ceil(columns);
        Self { image: RgbImage::blank(columns * width + Self::GAP, rows * height + Self::GAP, BACKGROUND), frames: 0 }
    }

    fn cell() -> [usize; 2] {
        [Self::SIZE[0] + Self::GAP, Self::SIZE[1] + Self::CAPTION + Self::GAP]
    }

    /// Draws the thumbnail of a frame: its image, and the outlines of its objects.
    pub(crate) fn thumbnail(image: &LevelImage, white: u16, masks: &[(Group, Mask)]) -> RgbImage {
        let [width, height] = fitted([image.width, image.height()], Self::SIZE);
        let mut thumbnail = RgbImage::blank(width, height, BACKGROUND);
        thumbnail.draw(image, white, masks, Place { x: 0, y: 0, width, height });
        thumbnail
    }

    pub(crate) fn add(&mut self, name: &str, thumbnail: &RgbImage) {
        let [cell_width, cell_height] = Self::cell();
        let x = Self::GAP + self.frames % Self::COLUMNS * cell_width;
        let y = Self::GAP + self.frames / Self::COLUMNS * cell_height;
        self.frames += 1;
        self.image.write(name, x, y);
        let rows = self.image.rgb.chunks_exact_mut(3 * self.image.width).skip(y + Self::CAPTION);
        for (row, pixels) in rows.zip(thumbnail.rgb.chunks_exact(3 * thumbnail.width)) {
            row[3 * x..][..pixels.len()].copy_from_slice(pixels);
        }
    }
}

/// Thumbnails of frames that this process wrote, so that a merge does not read their images again. Only those with the
/// smallest indices are kept, because others cannot be on a contact sheet.
#[derive(Debug, Clone, Default)]
pub(crate) struct Thumbnails(Arc<Mutex<BTreeMap<u64, RgbImage>>>);

impl Thumbnails {
    /// Keeps the thumbnail of a frame, if it may be on the contact sheet.
    pub(crate) fn keep(&self, frame: u64, draw: impl FnOnce() -> RgbImage) {
        let is_late = |kept: &BTreeMap<u64, RgbImage>| {
            kept.len() >= ContactSheet::MAX_FRAMES && kept.last_key_value().is_some_and(|(&last, _)| last < frame)
        };
        if is_late(&self.kept()) {
            return;
        }
        let thumbnail = draw();
        let mut kept = self.kept();
        kept.insert(frame, thumbnail);
        if kept.len() > ContactSheet::MAX_FRAMES {
            kept.pop_last();
        }
    }

    /// Returns the thumbnail of a frame, if it is kept.
    pub(crate) fn get(&self, frame: u64) -> Option<RgbImage> {
        self.kept().get(&frame).cloned()
    }

    fn kept(&self) -> MutexGuard<'_, BTreeMap<u64, RgbImage>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Returns the largest size of the same aspect ratio within a box, without upscaling.
fn fitted([width, height]: [usize; 2], [most_width, most_height]: [usize; 2]) -> [usize; 2] {
    if width <= most_width && height <= most_height {
        [width, height]
    } else if width * most_height >= height * most_width {
        [most_width, (height * most_width / width).max(1)]
    } else {
        [(width * most_height / height).max(1), most_height]
    }
}

/// Writes grey levels (row by row, channels interleaved) as a PNG file.
///
/// # Errors
/// If the file cannot be written. An existing file is then unchanged.
pub fn write_png(
    path: &Path,
    levels: &[u16],
    width: usize,
    channels: usize,
    bits: u32,
    pixel_um: f64,
) -> Result<(), Error> {
    let bytes = write::png(levels, width, channels, bits, pixel_um).map_err(Error::io("write", path))?;
    write_file(path, &bytes)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_thumbnails_of_the_first_frames_are_kept() {
        let thumbnails = Thumbnails::default();
        let of = |frame: u64| RgbImage::blank(usize::try_from(frame % 7).unwrap() + 1, 1, BACKGROUND);
        let mut frames: Vec<u64> = (0..60).map(|i| i * 37 % 60).collect();
        frames.push(3);
        for frame in frames {
            thumbnails.keep(frame, || of(frame));
        }
        for frame in 0..60 {
            let expected = (frame < ContactSheet::MAX_FRAMES as u64).then(|| of(frame));
            assert_eq!(thumbnails.get(frame), expected, "{frame}");
        }
    }

    proptest! {
        #[test]
        fn the_edge_is_the_pixels_without_four_neighbours(
            width in 1_usize..12,
            pixels in proptest::collection::vec(proptest::bool::weighted(0.8), 144),
        ) {
            let tile: Vec<f32> = pixels.iter().map(|&inside| f32::from(u8::from(inside))).collect();
            let mask = Mask::from_tile(&tile, width, [0, 0], width, 144 / width, |v| v > 0.5);
            let all: Vec<[usize; 2]> = mask.pixels(width).map(|pixel| [pixel % width, pixel / width]).collect();
            let has = |x: usize, y: usize| all.contains(&[x, y]);
            let is_inside = |[x, y]: [usize; 2]| {
                x > 0 && y > 0 && has(x - 1, y) && has(x + 1, y) && has(x, y - 1) && has(x, y + 1)
            };
            let expected: Vec<_> = all.iter().copied().filter(|&pixel| !is_inside(pixel)).collect();
            let found: Vec<_> = edge(&mask).into_iter().map(|pixel| pixel.map(|at| at as usize)).collect();
            prop_assert_eq!(found, expected);
        }
    }
    proptest! {
        #[test]
        fn a_downscaled_pixel_is_the_mean_of_its_source_pixels(
            [width, height] in [1_usize..40, 1..40],
            [columns, rows] in [1_usize..40, 1..40],
            channels in prop_oneof![Just(1_usize), Just(3)],
            seed in 0_usize..1000,
        ) {
            let (columns, rows) = (columns.min(width), rows.min(height));
            let level = |at: usize| u16::try_from((at * 7919 + seed * 104_729) % 4096).unwrap();
            let levels: Vec<u16> = (0..width * height * channels).map(level).collect();
            let image = LevelImage { width, channels, levels, white: 4095 };
            let mut drawn = RgbImage::blank(columns + 2, rows + 1, BACKGROUND);
            drawn.draw(&image, image.white, &[], Place { x: 1, y: 1, width: columns, height: rows });
            for (pixel, found) in drawn.rgb.as_chunks::<3>().0.iter().enumerate() {
                let (x, y) = (pixel % (columns + 2), pixel / (columns + 2));
                let mut expected = BACKGROUND;
                if (1..=columns).contains(&x) && y > 0 {
                    for (channel, expected) in expected.iter_mut().enumerate() {
                        let (mut sum, mut count) = (0, 0);
                        for row in span(y - 1, rows, height) {
                            for column in span(x - 1, columns, width) {
                                sum += usize::from(image.levels[(row * width + column) * channels + channel % channels]);
                                count += 4095;
                            }
                        }
                        *expected = u8::try_from((sum * 255 + count / 2) / count).unwrap();
                    }
                }
                prop_assert_eq!(*found, expected);
            }
        }
    }
}
