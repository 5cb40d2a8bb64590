//! The texture of nuclei: donors and their patches (paper, section "Texture synthesis", Figs. 4, 5).

use std::sync::{Arc, OnceLock};

use fsd_shape::ShapeModel;
use multiversion::multiversion;
use portable_numerics::rounding::round_to_count;
use quilt_texture::{QuiltParams, Quilter, Source};
use spectral_field::{FieldParams, Padding, SpectralField, Spectrum};

use super::tile::{Point, Tile};
use crate::error::ErrorKind;
use crate::key::{Key, Stream};
use crate::model::{ChromatinStatistics, Donor, LogNormal, NucleusStatistics, OUTSIDE};
use crate::random;

/// Pixel size of synthetic donors, µm: the paper's.
const SYNTHETIC_PIXEL_UM: f64 = 0.25;

/// Synthetic donors per class.
const SYNTHETIC_DONORS: usize = 48;

/// Blur of the microscope of the measured chromatin, standard deviation in µm (the paper's 0.9 px).
const MEASURED_SIGMA_UM: f64 = 0.225;

/// The donors of a class: textures with mean 0 and variance 1 inside their nuclei.
#[derive(Debug)]
pub(crate) struct DonorSet {
    /// Synthetic donors are created on first use.
    sources: Vec<OnceLock<Source>>,
    /// Name of the class.
    name: String,
    /// Radius of the nuclei.
    radius_um: LogNormal,
    /// Outlines of the nuclei.
    shapes: Arc<ShapeModel>,
    /// Pixel size, µm.
    pub(crate) pixel_um: f64,
    pub(crate) imaged: bool,
    /// Factor from the imaged standard deviation to that in the object plane.
    pub(crate) sharpening: f64,
    /// Draws one field for the complete nucleus instead of patches.
    field: ChromatinField,
}

/// A random field with the spectrum, skewness and radial profile of a class.
#[derive(Debug)]
struct ChromatinField {
    field: SpectralField,
    skew: Skew,
    profile: Vec<f64>,
}

impl DonorSet {
    /// Creates the donors of a class: learned ones if available, else synthetic ones.
    pub(crate) fn new(name: &str, nucleus: &NucleusStatistics, shapes: &Arc<ShapeModel>) -> Result<Self, ErrorKind> {
        let field = ChromatinField::new(&nucleus.chromatin)?;
        let imaged = !nucleus.donors.is_empty();
        let (sources, pixel_um) = match nucleus.donors.first() {
            Some(first) => {
                let same = nucleus.donors.iter().all(|d| (d.pixel_um - first.pixel_um).abs() < 1e-6);
                if !same {
                    return Err(ErrorKind::DonorPixels(name.to_owned()));
                }
                let learned = nucleus.donors.iter().map(|donor| learned_source(donor).map(OnceLock::from));
                (learned.collect::<Result<Vec<_>, _>>()?, first.pixel_um)
            }
            None => ((0..SYNTHETIC_DONORS).map(|_| OnceLock::new()).collect(), SYNTHETIC_PIXEL_UM),
        };
        let sharpening = if imaged { 1.0 } else { 1.0 / blur_attenuation(&nucleus.chromatin) };
        let (name, radius_um, shapes) = (name.to_owned(), nucleus.radius_um, Arc::clone(shapes));
        Ok(Self { sources, name, radius_um, shapes, pixel_um, imaged, sharpening, field })
    }

    /// Returns the source of a donor.
    fn source(&self, index: usize) -> Result<&Source, ErrorKind> {
        if let Some(source) = self.sources[index].get() {
            return Ok(source);
        }
        // If several threads create the same donor, their results are equal.
        let source = self.synthetic_source(index as u64)?;
        Ok(self.sources[index].get_or_init(|| source))
    }

    /// Draws a synthetic donor: a nucleus shape of the class filled with its field.
    fn synthetic_source(&self, index: u64) -> Result<Source, ErrorKind> {
        // Donors are part of the model, so their key does not depend on the image.
        let mut rng = Key { seed: 0, index: 0 }.stream(&format!("donor/{}", self.name), index, "made");
        let radius =
            self.radius_um.median * libm::exp(self.radius_um.log_sd * random::normal(&mut rng)) / SYNTHETIC_PIXEL_UM;
        /// Minimum radius of a donor, px.
        const MIN_RADIUS: f64 = 9.0;
        let drawn = self.shapes.draw(radius.max(MIN_RADIUS), &mut rng)?;
        let outline: Vec<Point> = drawn.descriptors.outline(64);
        let mut coverage = Tile::around(&outline, 1.0);
        coverage.cover(&outline);
        let mut pixels = self.field.texture(&coverage.values, coverage.width, &mut rng);
        standardise(&mut pixels, &coverage.values);
        Ok(Source::new(&pixels, &coverage.values, coverage.width)?)
    }

    /// Synthesises a texture from patches of some of the donors, with mean 0 and variance 1 over the covered pixels.
    pub(crate) fn quilt(
        &self,
        coverage: &Tile,
        pixel_um: f64,
        donors: usize,
        params: &QuiltParams,
        rng: &mut Stream,
    ) -> Result<Vec<f32>, ErrorKind> {
        let chosen = choose(self.sources.len(), donors, rng).into_iter().map(|index| self.source(index));
        let quilter = Quilter::new(&chosen.collect::<Result<Vec<_>, _>>()?, params)?;
        let grid = DonorGrid::new(coverage, pixel_um / self.pixel_um);
        Ok(grid.sample(&quilter.synthesise(&grid.mask, grid.width, rng).pixels, coverage))
    }

    /// Draws a texture as one random field, with mean 0 and variance 1 over the covered pixels.
    pub(crate) fn field(&self, coverage: &Tile, pixel_um: f64, rng: &mut Stream) -> Vec<f32> {
        let grid = DonorGrid::new(coverage, pixel_um / SYNTHETIC_PIXEL_UM);
        grid.sample(&self.field.texture(&grid.mask, grid.width, rng), coverage)
    }
}

/// Draws `wanted` of `count` indices without repetition, or all indices if there are fewer.
fn choose(count: usize, wanted: usize, rng: &mut Stream) -> Vec<usize> {
    let mut remaining: Vec<usize> = (0..count).collect();
    (0..wanted.min(count)).map(|_| remaining.swap_remove(random::below(remaining.len(), rng))).collect()
}

/// Converts a learned donor to a source of patches.
fn learned_source(donor: &Donor) -> Result<Source, ErrorKind> {
    let mask: Vec<f32> = donor.absorbance_milli.iter().map(|&v| if v == OUTSIDE { 0.0 } else { 1.0 }).collect();
    let mut pixels: Vec<f32> =
        donor.absorbance_milli.iter().map(|&v| if v == OUTSIDE { 0.0 } else { f32::from(v) / 1000.0 }).collect();
    standardise(&mut pixels, &mask);
    Source::new(&pixels, &mask, donor.width).map_err(ErrorKind::Donor)
}

impl ChromatinField {
    fn new(chromatin: &ChromatinStatistics) -> Result<Self, ErrorKind> {
        /// Width and height of the periodic field, px: larger than any nucleus at the pixel size of synthetic donors.
        const SIDE: usize = 128;
        let spectrum = Spectrum::Matern { nu: chromatin.nu, length_px: chromatin.length_um / SYNTHETIC_PIXEL_UM };
        let params = FieldParams { width: SIDE, height: SIDE, spectrum, padding: Padding::Periodic };
        Ok(Self {
            field: SpectralField::new(&params)?,
            skew: Skew::new(chromatin.skewness),
            profile: chromatin.rim_to_centre.clone(),
        })
    }

    /// Draws a field with the skewness of the class and its profile from rim to centre.
    fn texture(&self, mask: &[f32], width: usize, rng: &mut Stream) -> Vec<f32> {
        /// Mean absorbance relative to its standard deviation inside a nucleus; scales the profile.
        const MEAN_OVER_SD: f64 = 4.0;
        let side = self.field.width();
        let draw = self.field.draw(rng);
        let depth = depth_from_rim(mask, width);
        let mut pixels = Vec::with_capacity(mask.len());
        for (y, depth) in depth.chunks_exact(width).enumerate() {
            let normals = draw[(y % side) * side..][..side].iter().cycle();
            pixels.extend(depth.iter().zip(normals).map(|(&depth, &normal)| {
                let trend = MEAN_OVER_SD * (interpolate(&self.profile, depth) - 1.0);
                (trend + self.skew.apply(f64::from(normal))) as f32
            }));
        }
        pixels
    }
}

/// Transforms standard normal deviates n to a shifted log-normal (exp(s·n) − mean) / sd with mean 0, variance 1 and
/// about a given skewness.
#[derive(Debug)]
struct Skew {
    s: f64,
    mean: f64,
    /// Negative if s is.
    sd: f64,
}

impl Skew {
    fn new(skewness: f64) -> Self {
        // For small s, the skewness of exp(s·n) is 3 s.
        let s = skewness / 3.0;
        let variance = libm::expm1(s * s) * libm::exp(s * s);
        Self { s, mean: libm::exp(0.5 * s * s), sd: variance.sqrt() * s.signum() }
    }

    fn apply(&self, normal: f64) -> f64 {
        if self.s.abs() < 1e-6 { normal } else { (libm::exp(self.s * normal) - self.mean) / self.sd }
    }
}

/// Returns the depth of every pixel, 0 at the rim to 1 at the deepest pixel, by a two-pass chamfer distance.
fn depth_from_rim(mask: &[f32], width: usize) -> Vec<f64> {
    const DIAGONAL: f64 = core::f64::consts::SQRT_2;
    let height = mask.len() / width;
    let mut depth: Vec<f64> = mask.iter().map(|m| if *m >= 0.5 { f64::INFINITY } else { 0.0 }).collect();
    let get = |depth: &[f64], x: i64, y: i64| {
        if x < 0 || y < 0 || x >= width as i64 || y >= height as i64 {
            0.0
        } else {
            depth[y as usize * width + x as usize]
        }
    };
    for sign in [-1, 1] {
        for at in 0..mask.len() {
            let at = if sign < 0 { at } else { mask.len() - 1 - at };
            let (x, y) = ((at % width) as i64, (at / width) as i64);
            for (dx, dy, step) in [(1, 0, 1.0), (0, 1, 1.0), (1, 1, DIAGONAL), (-1, 1, DIAGONAL)] {
                depth[at] = depth[at].min(get(&depth, x + sign * dx, y + sign * dy) + step);
            }
        }
    }
    let deepest = depth.iter().fold(1.0_f64, |a, b| a.max(*b));
    depth.iter().map(|d| d / deepest).collect()
}

/// Interpolates linearly in a profile of equal steps; `at` is 0 at the outer edge of the first step and 1 at the inner
/// edge of the last.
pub(crate) fn interpolate(profile: &[f64], at: f64) -> f64 {
    let position = (at.clamp(0.0, 1.0) * profile.len() as f64 - 0.5).clamp(0.0, (profile.len() - 1) as f64);
    let cell = round_to_count(position.floor()).min(profile.len() - 1);
    let next = (cell + 1).min(profile.len() - 1);
    profile[cell] + (position - cell as f64) * (profile[next] - profile[cell])
}

/// Shifts and scales pixels to mean 0 and variance 1 inside a mask; pixels outside become 0.
pub(super) fn standardise(pixels: &mut [f32], mask: &[f32]) {
    let [count, sum, _] = sums_inside(pixels, mask, 0.0);
    let mean = sum / count.max(1.0);
    let [_, _, squares] = sums_inside(pixels, mask, mean);
    let variance = squares / count.max(1.0);
    let scale = if variance > 0.0 { 1.0 / variance.sqrt() } else { 0.0 };
    for (pixel, mask) in pixels.iter_mut().zip(mask) {
        *pixel = if *mask > 0.0 { ((f64::from(*pixel) - mean) * scale) as f32 } else { 0.0 };
    }
}

/// Returns the number of pixels inside a mask, and the sums of their differences from `centre` and of the squares, in a
/// fixed order.
#[multiversion(targets = "simd")]
fn sums_inside(pixels: &[f32], mask: &[f32], centre: f64) -> [f64; 3] {
    /// Number of partial sums.
    const LANES: usize = 16;
    let mut sums = [[0.0; LANES]; 3];
    for (pixels, mask) in pixels.chunks(LANES).zip(mask.chunks(LANES)) {
        for (i, (pixel, mask)) in pixels.iter().zip(mask).enumerate() {
            let inside = if *mask >= 0.5 { 1.0 } else { 0.0 };
            let difference = inside * (f64::from(*pixel) - centre);
            sums[0][i] += inside;
            sums[1][i] += difference;
            sums[2][i] += difference * difference;
        }
    }
    sums.map(|lanes| lanes.iter().sum())
}

/// Returns the fraction of the standard deviation of chromatin that remains in images of the measuring microscope.
fn blur_attenuation(chromatin: &ChromatinStatistics) -> f64 {
    /// Highest frequency, cycles per µm: far beyond the cut-off of the microscope.
    const HIGHEST: f64 = 8.0;
    const STEPS: usize = 4000;
    let spectrum = Spectrum::Matern { nu: chromatin.nu, length_px: chromatin.length_um };
    let (mut all, mut passed) = (0.0, 0.0);
    for step in 0..STEPS {
        let f = HIGHEST * (step as f64 + 0.5) / STEPS as f64;
        let power = spectrum.density(f) * f;
        let transfer = libm::exp(
            -2.0 * (core::f64::consts::PI * MEASURED_SIGMA_UM * f) * (core::f64::consts::PI * MEASURED_SIGMA_UM * f),
        );
        all += power;
        passed += power * transfer * transfer;
    }
    (passed / all).sqrt()
}

/// A nucleus on the grid of its donors, which may have another pixel size than the image.
struct DonorGrid {
    mask: Vec<f32>,
    width: usize,
    /// Donor pixels per image pixel.
    ratio: f64,
}

impl DonorGrid {
    fn new(coverage: &Tile, ratio: f64) -> Self {
        if (ratio - 1.0).abs() < 1e-9 {
            return Self { mask: coverage.values.clone(), width: coverage.width, ratio: 1.0 };
        }
        let size = |pixels: usize| round_to_count((pixels as f64 * ratio).ceil()) + 2;
        let (width, height) = (size(coverage.width), size(coverage.height()));
        let mut mask = vec![0.0; width * height];
        // All image pixels that interpolate from here need texture.
        let near = |position: usize, count: usize| {
            let at = round_to_count(position as f64 / ratio).min(count - 1);
            [at, (at + 1).min(count - 1)]
        };
        let columns: Vec<[usize; 2]> = (0..width).map(|x| near(x, coverage.width)).collect();
        for (y, row) in mask.chunks_exact_mut(width).enumerate() {
            let [upper, lower] =
                near(y, coverage.height()).map(|y| &coverage.values[y * coverage.width..][..coverage.width]);
            for (value, &[left, right]) in row.iter_mut().zip(&columns) {
                let covered = upper[left].max(upper[right]).max(lower[left].max(lower[right]));
                *value = if covered > 0.0 { 1.0 } else { 0.0 };
            }
        }
        Self { mask, width, ratio }
    }

    /// Interpolates the texture linearly on the image grid, with mean 0 and variance 1 over the covered pixels.
    fn sample(&self, texture: &[f32], coverage: &Tile) -> Vec<f32> {
        if self.ratio == 1.0 {
            let mut pixels = texture.to_vec();
            standardise(&mut pixels, &coverage.values);
            return pixels;
        }
        let near = |place: usize, count: usize| {
            let at = place as f64 * self.ratio;
            let first = round_to_count(at.floor()).min(count - 1);
            (first, (first + 1).min(count - 1), (at - first as f64) as f32)
        };
        let columns: Vec<(usize, usize, f32)> = (0..coverage.width).map(|x| near(x, self.width)).collect();
        let mut pixels = vec![0.0; coverage.values.len()];
        let mut line = vec![0.0; self.width];
        for (y, row) in pixels.chunks_exact_mut(coverage.width).enumerate() {
            let (upper, lower, weight) = near(y, texture.len() / self.width);
            let [upper, lower] = [upper, lower].map(|y| &texture[y * self.width..][..self.width]);
            for ((value, upper), lower) in line.iter_mut().zip(upper).zip(lower) {
                *value = upper + weight * (lower - upper);
            }
            for (value, &(left, right, weight)) in row.iter_mut().zip(&columns) {
                *value = line[left] + weight * (line[right] - line[left]);
            }
        }
        standardise(&mut pixels, &coverage.values);
        pixels
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_skew_preserves_mean_and_variance() {
        let mut rng = Key { seed: 5, index: 0 }.stream("test", 0, "skew");
        let n = 40_000;
        let draws: Vec<f64> = (0..n).map(|_| Skew::new(0.4).apply(random::normal(&mut rng))).collect();
        let moment = |k: i32| draws.iter().map(|x| libm::pow(*x, f64::from(k))).sum::<f64>() / f64::from(n);
        assert!(moment(1).abs() < 0.02, "{}", moment(1));
        assert!((moment(2) - 1.0).abs() < 0.03, "{}", moment(2));
        assert!((moment(3) - 0.4).abs() < 0.1, "{}", moment(3));
    }

    #[test]
    fn depth_increases_from_the_rim() {
        let mask: Vec<f32> =
            (0..81).map(|i| if (1..8).contains(&(i % 9)) && (1..8).contains(&(i / 9)) { 1.0 } else { 0.0 }).collect();
        let depth = depth_from_rim(&mask, 9);
        assert_eq!(depth[4 * 9 + 4], 1.0);
        assert_eq!(depth[0], 0.0);
        assert_eq!(depth[9 + 4], 0.25);
    }

    #[test]
    fn standardised_pixels_have_mean_zero_and_variance_one_inside() {
        let mut pixels: Vec<f32> = (0..97_u8).map(|i| 40.0 + f32::from(i.wrapping_mul(37) % 23)).collect();
        let mask: Vec<f32> = (0..97_u8).map(|i| f32::from(i % 5) * 0.25).collect();
        standardise(&mut pixels, &mask);
        let inside: Vec<f64> = pixels.iter().zip(&mask).filter(|(_, m)| **m >= 0.5).map(|(p, _)| (*p).into()).collect();
        let mean = inside.iter().sum::<f64>() / inside.len() as f64;
        let square = inside.iter().map(|p| p * p).sum::<f64>() / inside.len() as f64;
        assert!(mean.abs() < 1e-6 && (square - 1.0).abs() < 1e-6, "{mean} {square}");
        assert!(pixels.iter().zip(&mask).all(|(p, m)| *m > 0.0 || *p == 0.0));
    }

    #[test]
    fn a_donor_grid_covers_and_interpolates_the_image() {
        let disc = |x: f64, y: f64| if (x - 17.0) * (x - 17.0) + (y - 12.0) * (y - 12.0) < 90.0 { 1.0 } else { 0.0 };
        let place = |i: usize| ((i % 35) as f64, (i / 35) as f64);
        let values = (0..35 * 25).map(|i| disc(place(i).0, place(i).1)).collect();
        let coverage = Tile { origin: [0; 2], width: 35, values };
        for ratio in [0.4, 0.83, 1.0, 1.9] {
            let grid = DonorGrid::new(&coverage, ratio);
            // A linear function is interpolated exactly, except for its mean and scale.
            let linear = |x: f64, y: f64| 2.0 * x - 3.0 * y;
            let at = |i: usize| linear((i % grid.width) as f64, (i / grid.width) as f64) as f32;
            let texture: Vec<f32> = (0..grid.mask.len()).map(at).collect();
            let found = grid.sample(&texture, &coverage);
            let mut wanted: Vec<f32> =
                (0..35 * 25).map(|i| linear(ratio * place(i).0, ratio * place(i).1) as f32).collect();
            standardise(&mut wanted, &coverage.values);
            for (i, (found, wanted)) in found.iter().zip(&wanted).enumerate() {
                assert!((found - wanted).abs() < 1e-4, "{ratio} {i}: {found} {wanted}");
            }
            if ratio != 1.0 {
                for (i, mask) in grid.mask.iter().enumerate() {
                    let [x, y] = [i % grid.width, i / grid.width].map(|c| round_to_count(c as f64 / ratio));
                    let near = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)];
                    let covered = |(x, y): (usize, usize)| coverage.values[y.min(24) * 35 + x.min(34)] > 0.0;
                    assert_eq!(*mask > 0.0, near.into_iter().any(covered), "{ratio} {i}");
                }
            }
        }
    }

    #[test]
    fn profiles_interpolate_between_their_steps() {
        assert_eq!(interpolate(&[1.0, 3.0], 0.5), 2.0);
        assert_eq!(interpolate(&[1.0, 3.0], 0.0), 1.0);
        assert_eq!(interpolate(&[1.0, 3.0], 1.0), 3.0);
        assert_eq!(interpolate(&[7.0], 0.3), 7.0);
    }
}
