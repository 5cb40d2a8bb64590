//! Grey levels of fields, positions of patches, and patches with noise as PNG files that differ only in their pixels.

use papsynth_dataset::read::{LevelImage, Limits, Stack};
use png::{BitDepth, ColorType, Compression, Encoder, Filter};
use portable_numerics::random::{Normals, below};
use rand_core::Rng;

use crate::error::Error;
use crate::fields::{Field, bytes};

/// Rows and columns at each border of a field that are not shown: fusion of planes or registration can leave them
/// black.
const MARGIN_PX: usize = 8;

/// Stride of the sampled pixels and rows that decide whether a patch is shown.
const STRIDE_PX: usize = 4;

/// Quantile of the levels that defines the glass; bright specks are above it.
const GLASS_QUANTILE: f64 = 0.95;

/// Lower bound of the glass level of a patch, as a fraction of that of the field. Uneven illumination reduces it by
/// less.
const MIN_GLASS: f32 = 0.85;

/// A pixel below this fraction of the glass level is covered. Noise and uneven illumination reduce the level by less.
const MAX_COVERED: f32 = 0.92;

/// Smallest covered fraction of a patch.
const MIN_COVER: f64 = 0.2;

/// Largest overlap of two patches of a field, as a fraction of their area.
const MAX_OVERLAP: f64 = 0.25;

/// Random positions tried in a field for each patch.
const TRIES: usize = 60;

pub(crate) type Places = Vec<[usize; 2]>;

#[derive(Debug, Clone)]
pub(crate) struct GreyImage {
    pub(crate) width: usize,
    pub(crate) levels: Vec<f32>,
}

/// An image as in its file.
#[derive(Debug)]
pub(crate) struct Raw {
    pub(crate) image: GreyImage,
    pub(crate) bytes: Vec<u8>,
    /// Whether the file has more than 8 bits.
    pub(crate) is_deep: bool,
}

impl Raw {
    /// Reads a field. Of a colour image it reads the green channel, which has the highest contrast and is nearest to
    /// the 570 nm of the paper; of a stack the central plane.
    pub(crate) fn read(field: &Field) -> Result<Self, Error> {
        let limits = Limits::default();
        let bytes = bytes(&field.path, limits.max_file_bytes)?;
        let refuse = |problem| papsynth_dataset::Error::Input { path: field.path.clone(), problem };
        let is_stack = field.frame.as_ref().is_some_and(|frame| frame.summary.planes_um.len() > 1);
        if is_stack {
            let Stack { width, mut planes } = Stack::decode(&bytes, &limits).map_err(refuse)?;
            let central = planes.len() / 2;
            let levels = if planes.is_empty() { Vec::new() } else { planes.swap_remove(central) };
            return Ok(Self { image: GreyImage { width, levels }, bytes, is_deep: true });
        }
        let LevelImage { width, channels, levels, white } = LevelImage::decode(&bytes, &limits).map_err(refuse)?;
        let green = if channels > 1 { 1 } else { 0 };
        let levels = levels.into_iter().skip(green).step_by(channels).map(f32::from).collect();
        Ok(Self { image: GreyImage { width, levels }, bytes, is_deep: white > u16::from(u8::MAX) })
    }
}

impl GreyImage {
    pub(crate) fn height(&self) -> usize {
        self.levels.len() / self.width.max(1)
    }

    pub(crate) fn most(&self) -> f32 {
        self.levels.iter().copied().fold(0.0, f32::max)
    }

    pub(crate) fn glass(&self) -> f32 {
        glass(&mut self.sample([0, 0], [self.width, self.height()], STRIDE_PX))
    }

    /// Resamples to pixels that are `factor` times as large: area-weighted means, as in a camera with larger pixels. A
    /// factor up to 1 changes nothing.
    pub(crate) fn reduced(self, factor: f64) -> Self {
        if factor <= 1.0 {
            return self;
        }
        let height = self.height();
        let columns = weights(self.width, factor);
        let rows = weights(height, factor);
        let width = columns.len();
        let mut narrow = Vec::with_capacity(width * height);
        for row in self.levels.chunks_exact(self.width.max(1)) {
            narrow.extend(
                columns.iter().map(|(first, parts)| {
                    parts.iter().zip(&row[*first..]).map(|(part, level)| part * level).sum::<f32>()
                }),
            );
        }
        let mut levels = vec![0.0_f32; width * rows.len()];
        for (out, (first, parts)) in levels.chunks_exact_mut(width.max(1)).zip(&rows) {
            for (part, row) in parts.iter().zip(narrow.chunks_exact(width).skip(*first)) {
                out.iter_mut().zip(row).for_each(|(out, level)| *out += part * level);
            }
        }
        Self { width, levels }
    }

    /// Returns every `stride`-th level of a rectangle along both axes.
    fn sample(&self, [x, y]: [usize; 2], [width, height]: [usize; 2], stride: usize) -> Vec<f32> {
        let rows = self.levels.chunks_exact(self.width.max(1)).skip(y).take(height).step_by(stride);
        rows.flat_map(|row| row[x..x + width].iter().copied().step_by(stride)).collect()
    }

    /// Returns the levels of a square, or `None` if it extends beyond the image.
    pub(crate) fn square(&self, [x, y]: [usize; 2], side: usize) -> Option<Vec<f32>> {
        let is_inside = x.checked_add(side)? <= self.width && y.checked_add(side)? <= self.height();
        is_inside.then(|| self.sample([x, y], [side, side], 1))
    }

    /// Returns up to `wanted` random positions (left, top) of patches that are sufficiently covered and have little
    /// overlap. The rule is the same for real and synthetic fields, and depends only on ratios of levels, not on the
    /// exposure.
    pub(crate) fn places<R: Rng + ?Sized>(&self, side: usize, wanted: usize, rng: &mut R) -> Places {
        let mut places = Places::new();
        let free = |length: usize| length.checked_sub(side + 2 * MARGIN_PX);
        let (Some(right), Some(down)) = (free(self.width), free(self.height())) else { return places };
        let glass = self.glass();
        for _ in 0..TRIES.saturating_mul(wanted) {
            if places.len() == wanted {
                break;
            }
            let place = [MARGIN_PX + below(right + 1, rng), MARGIN_PX + below(down + 1, rng)];
            if places.iter().all(|other| overlap(place, *other, side) <= MAX_OVERLAP)
                && self.cover(place, side, glass) >= MIN_COVER
            {
                places.push(place);
            }
        }
        places
    }

    /// Returns the covered fraction of a patch.
    fn cover(&self, place: [usize; 2], side: usize, field_glass: f32) -> f64 {
        let mut sample = self.sample(place, [side, side], STRIDE_PX);
        let glass = glass(&mut sample).max(MIN_GLASS * field_glass);
        sample.iter().filter(|&&level| level < MAX_COVERED * glass).count() as f64 / sample.len().max(1) as f64
    }
}

/// Returns the overlap of two squares as a fraction of their area.
fn overlap(a: [usize; 2], b: [usize; 2], side: usize) -> f64 {
    let shared = |k: usize| side.saturating_sub(a[k].abs_diff(b[k])) as f64;
    shared(0) * shared(1) / (side * side) as f64
}

/// Returns the [`GLASS_QUANTILE`] of a sample.
fn glass(sample: &mut [f32]) -> f32 {
    if sample.is_empty() {
        return 0.0;
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a fraction of a length")]
    let place = ((sample.len() - 1) as f64 * GLASS_QUANTILE) as usize;
    *sample.select_nth_unstable_by(place, f32::total_cmp).1
}

/// Returns for each larger pixel along a line of `length` pixels the first pixel that it covers, and the weights of
/// all.
fn weights(length: usize, factor: f64) -> Vec<(usize, Vec<f32>)> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to a length")]
    let whole = |x: f64| x as usize;
    let count = whole(length as f64 / factor);
    (0..count)
        .map(|k| {
            let (from, to) = (k as f64 * factor, (k + 1) as f64 * factor);
            let first = whole(from);
            let last = whole(to.ceil()).min(length);
            #[expect(clippy::cast_possible_truncation, reason = "fractions of a pixel")]
            let part = |i: usize| (((to.min((i + 1) as f64)) - from.max(i as f64)).max(0.0) / factor) as f32;
            (first, (first..last).map(part).collect())
        })
        .collect()
}

/// Adds Gaussian noise of `sigma` grey levels and rounds to 8 bits. The random numbers do not depend on the levels.
pub(crate) fn noisy<R: Rng + ?Sized>(levels: &[f32], sigma: f64, rng: &mut R) -> Vec<u8> {
    let mut normals = Normals::new(rng);
    levels
        .iter()
        .map(|&level| {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates at black and white")]
            let grey = (f64::from(level) + sigma * normals.draw() + 0.5) as u8;
            grey
        })
        .collect()
}

/// Encodes a square of 8-bit grey levels. The file is not compressed: the size of a compressed file could distinguish
/// real from synthetic patches. It has only the mandatory chunks.
pub(crate) fn png(grey: &[u8], side: usize) -> Vec<u8> {
    let mut out = Vec::with_capacity(grey.len() + grey.len() / 64);
    let length = u32::try_from(side).unwrap_or_default();
    let mut encoder = Encoder::new(&mut out, length, length);
    encoder.set_color(ColorType::Grayscale);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::NoCompression);
    encoder.set_filter(Filter::NoFilter);
    let written = encoder.write_header().and_then(|mut writer| {
        writer.write_image_data(grey)?;
        writer.finish()
    });
    debug_assert!(written.is_ok(), "the size is valid: {written:?}");
    out
}

#[cfg(test)]
mod tests {
    use rand_core::SeedableRng;
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;

    fn field(width: usize, height: usize, level: impl Fn(usize, usize) -> f32) -> GreyImage {
        GreyImage { width, levels: (0..width * height).map(|i| level(i % width, i / width)).collect() }
    }

    fn rng() -> Xoshiro256PlusPlus {
        Xoshiro256PlusPlus::seed_from_u64(3)
    }

    #[test]
    fn larger_pixels_are_means_of_smaller_ones() {
        let constant = field(37, 23, |_, _| 7.0).reduced(1.32);
        assert_eq!((constant.width, constant.height()), (28, 17));
        assert!(constant.levels.iter().all(|level| (level - 7.0).abs() < 1e-5));
        // A gradient is preserved at the pixel centres.
        let slope = field(40, 12, |x, y| x as f32 + 3.0 * y as f32).reduced(1.5);
        for (i, level) in slope.levels.iter().enumerate() {
            let centre = |k: usize| 1.5 * (k as f32 + 0.5) - 0.5;
            let wanted = centre(i % slope.width) + 3.0 * centre(i / slope.width);
            // Pixels are piecewise constant, so the means differ slightly from the gradient.
            assert!((level - wanted).abs() < 0.7, "{i}: {level} for {wanted}");
        }
        let halves = field(4, 2, |x, _| x as f32).reduced(2.0);
        assert_eq!(halves.levels, [0.5, 2.5]);
        assert_eq!(field(4, 2, |x, _| x as f32).reduced(1.0).width, 4);
    }

    #[test]
    fn patches_are_covered_and_have_little_overlap() {
        // Discs of half the intensity on unevenly illuminated glass.
        let image = field(900, 700, |x, y| {
            let light = 230.0 - 0.02 * x as f32;
            let (dx, dy) = ((x % 300) as f32 - 150.0, (y % 300) as f32 - 150.0);
            if dx * dx + dy * dy < 80.0 * 80.0 { 0.5 * light } else { light }
        });
        let places = image.places(200, 8, &mut rng());
        assert_eq!(places.len(), 8);
        let glass = image.glass();
        for (k, &[x, y]) in places.iter().enumerate() {
            assert!(
                (MARGIN_PX..=900 - 200 - MARGIN_PX).contains(&x) && (MARGIN_PX..=700 - 200 - MARGIN_PX).contains(&y)
            );
            assert!(image.cover([x, y], 200, glass) >= MIN_COVER);
            assert!(places[..k].iter().all(|other| overlap([x, y], *other, 200) <= MAX_OVERLAP));
        }
        assert_eq!(places, image.places(200, 8, &mut rng()), "the same seed gives the same positions");
        // The exposure does not change the positions.
        let darker = GreyImage { width: image.width, levels: image.levels.iter().map(|l| l * 0.5).collect() };
        assert_eq!(places, darker.places(200, 8, &mut rng()));
    }

    #[test]
    fn empty_glass_is_not_shown_and_covered_patches_are() {
        let uneven = field(600, 600, |x, y| 200.0 - 0.04 * (x + y) as f32 + ((x * 7 + y * 13) % 5) as f32);
        assert!(uneven.places(200, 3, &mut rng()).is_empty());
        // A cell larger than a patch covers half of the field.
        let covered = field(1200, 500, |x, _| if x < 600 { 120.0 } else { 230.0 });
        let places = covered.places(200, 4, &mut rng());
        assert_eq!(places.len(), 4);
        assert!(places.iter().all(|[x, _]| *x < 600));
    }

    #[test]
    fn small_fields_have_no_patches() {
        for (width, height) in [(0, 0), (1, 1), (215, 300), (300, 215)] {
            assert!(field(width, height, |_, _| 1.0).places(200, 2, &mut rng()).is_empty());
        }
        assert_eq!(field(216, 216, |x, _| if x < 100 { 1.0 } else { 2.0 }).places(200, 2, &mut rng()), [[8, 8]]);
    }

    #[test]
    fn noise_has_the_specified_standard_deviation() {
        let mut rng = rng();
        let n = 200_000;
        for sigma in [0.7, 5.0] {
            let noisy = noisy(&vec![100.25; n], sigma, &mut rng);
            let mean = noisy.iter().map(|&g| f64::from(g)).sum::<f64>() / n as f64;
            let variance = noisy.iter().map(|&g| (f64::from(g) - mean) * (f64::from(g) - mean)).sum::<f64>() / n as f64;
            // Rounding adds 1/12. Within 5 standard errors.
            let wanted = sigma * sigma + 1.0 / 12.0;
            assert!((mean - 100.25).abs() < 5.0 * (wanted / n as f64).sqrt(), "{mean}");
            assert!((variance - wanted).abs() < 5.0 * wanted * (2.0 / n as f64).sqrt(), "{variance} for {wanted}");
        }
    }

    #[test]
    fn without_noise_levels_are_rounded_and_bounded() {
        let mut rng = rng();
        assert_eq!(noisy(&[0.0, 0.49, 0.5, 254.6, 300.0, -3.0], 0.0, &mut rng), [0, 0, 1, 255, 255, 0]);
    }

    #[test]
    fn files_differ_in_their_pixels_alone() {
        let flat = png(&vec![128; 200 * 200], 200);
        let mut rng = rng();
        let rough = png(&noisy(&vec![128.0; 200 * 200], 20.0, &mut rng), 200);
        assert_eq!(flat.len(), rough.len());
        let chunks = |file: &[u8]| {
            let (mut at, mut chunks) = (8, Vec::new());
            while at < file.len() {
                let length = usize::try_from(u32::from_be_bytes(file[at..at + 4].try_into().unwrap())).unwrap();
                chunks.push((String::from_utf8(file[at + 4..at + 8].to_vec()).unwrap(), length));
                at += 12 + length;
            }
            chunks
        };
        assert_eq!(chunks(&flat), chunks(&rough));
        assert!(chunks(&flat).iter().all(|(kind, _)| ["IHDR", "IDAT", "IEND"].contains(&kind.as_str())));
        let mut reader = png::Decoder::new(std::io::Cursor::new(&rough)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        assert_eq!((info.width, info.height, info.color_type), (200, 200, ColorType::Grayscale));
    }
}
