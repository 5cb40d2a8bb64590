//! Periodic noise fields shared by the objects of one image; each object samples them at a random position and
//! mirroring.

use std::sync::OnceLock;

use portable_numerics::rounding::round_to_count;
use rand_core::Rng;
use spectral_field::{FieldParams, Padding, SpectralField, Spectrum};

use super::tile::Point;
use crate::key::Key;
use crate::random;

/// Width and height of a noise field in texels: a power of two, so that positions wrap by masking.
pub(crate) const SIDE: usize = 512;

/// Texel size of the field of the spots of cytoplasm (`cytoplasm.flecks` of a recipe), µm.
const TEXEL_UM: f64 = 0.25;

/// Smoothing of the clouds field, standard deviation in texels.
const CLOUD_SIGMA: f64 = 6.0;

/// Plans and spectra of the noise fields, the same for every image.
#[derive(Debug)]
pub(crate) struct NoiseFieldGenerator {
    /// Clouds and spots of cytoplasm.
    fields: [SpectralField; 2],
}

/// The noise fields of one image, with mean 0, variance 1 and a period of [`SIDE`] texels. Each is computed on first
/// use.
#[derive(Debug)]
pub(crate) struct NoiseFields<'a> {
    generator: &'a NoiseFieldGenerator,
    key: Key,
    drawn: [OnceLock<NoiseField>; 2],
}

/// A periodic field.
#[derive(Debug)]
pub(crate) struct NoiseField {
    /// Panels of [`PANEL`] columns, one after the other. In a panel, the next row follows in memory, so that the memory
    /// that the next row of an object needs is loaded in advance. In units of `unit`, which halves the memory.
    values: Vec<i16>,
    unit: f32,
    /// A subset of the values in ascending order, for quantiles.
    ranked: Vec<f32>,
}

/// Columns of a panel of a noise field.
const PANEL: usize = 64;

/// Buffer for a row of texels; the first texel may be repeated after the last.
pub(crate) type Texels = [f32; SIDE + 1];

/// The position, mirroring and stretch at which one object samples a noise field.
///
/// Sampling follows the rows of the field, so a row of pixels needs only two rows of texels. The fields are isotropic,
/// so no rotation is needed: a stretch in any direction is a rotation of the field, which changes no statistics, and an
/// upper triangular matrix, which keeps its rows.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FieldSampler {
    origin: Point,
    /// Texels per pixel in x and y; negative if mirrored.
    step: Point,
    /// Texels in x per pixel in y.
    shear: f64,
}

/// Subtexel offset f of samplers: 2f(1 − f) = ⅓ is the mean over all f from 0 to 1, so that interpolation reduces the
/// variance of every object by the average factor.
const SUBTEXEL: f64 = 0.211_324_865_405_187_1;

impl NoiseFieldGenerator {
    pub(crate) fn new() -> Self {
        let spectra = [Spectrum::Gaussian { sigma_px: CLOUD_SIGMA }, Spectrum::BROWNIAN];
        let fields = spectra.map(|spectrum| {
            let params = FieldParams { width: SIDE, height: SIDE, spectrum, padding: Padding::Periodic };
            SpectralField::new(&params).expect("a field of this size is valid")
        });
        Self { fields }
    }

    pub(crate) fn fields(&self, key: Key) -> NoiseFields<'_> {
        NoiseFields { generator: self, key, drawn: Default::default() }
    }
}

impl NoiseFields<'_> {
    pub(crate) fn clouds(&self) -> &NoiseField {
        self.noise_field(0, "pool.clouds")
    }

    pub(crate) fn spots(&self) -> &NoiseField {
        self.noise_field(1, "pool.flecks")
    }

    fn noise_field(&self, which: usize, purpose: &str) -> &NoiseField {
        self.drawn[which].get_or_init(|| {
            NoiseField::new(self.generator.fields[which].draw(&mut self.key.stream("field", 0, purpose)))
        })
    }
}

impl FieldSampler {
    /// Draws a random position and mirroring, with texels of `texel_px` pixels.
    pub(crate) fn new<R: Rng + ?Sized>(texel_px: f64, rng: &mut R) -> Self {
        let mut texel = || random::below(SIDE, rng) as f64 + SUBTEXEL;
        let origin = [texel(), texel()];
        let mirrored = random::below(4, rng);
        let step = |bit: usize| if mirrored & bit == 0 { 1.0 / texel_px } else { -1.0 / texel_px };
        Self { origin, step: [step(1), step(2)], shear: 0.0 }
    }

    /// Returns the sampler on a grid of pixels `n` times as large.
    pub(crate) fn coarser(&self, n: f64) -> Self {
        Self { step: self.step.map(|step| n * step), shear: n * self.shear, ..*self }
    }

    /// Draws a sampler for the spots of cytoplasm, with the physical texel size.
    pub(crate) fn fine<R: Rng + ?Sized>(pixel_um: f64, rng: &mut R) -> Self {
        Self::new(TEXEL_UM / pixel_um, rng)
    }

    /// Draws a sampler for clouds with smoothing `sigma_px`.
    pub(crate) fn clouds<R: Rng + ?Sized>(sigma_px: f64, rng: &mut R) -> Self {
        Self::new(sigma_px / CLOUD_SIGMA, rng)
    }

    /// Returns the sampler of a field that is `stretch` times as long in a direction as across it, with the same area.
    pub(crate) fn stretched(self, stretch: f64, direction_rad: f64) -> Self {
        debug_assert!(self.shear == 0.0 && stretch > 0.0, "{stretch}");
        let (sin, cos) = (libm::sin(direction_rad), libm::cos(direction_rad));
        // AᵀA for the matrix A of the stretch, and its Cholesky factor. The determinant of A is 1.
        let xx = cos * cos / stretch + sin * sin * stretch;
        let xy = sin * cos * (1.0 / stretch - stretch);
        let [x, y] = self.step;
        let x_scale = xx.sqrt();
        Self { step: [x * x_scale, y / x_scale], shear: x * xy / x_scale, ..self }
    }
}

impl NoiseField {
    fn new(values: Vec<f32>) -> Self {
        /// Step of the subset: quantiles need only part of the values.
        const STRIDE: usize = 61;
        let mut ranked: Vec<f32> = values.iter().step_by(STRIDE).copied().collect();
        ranked.sort_by(f32::total_cmp);
        let greatest = values.iter().fold(f32::MIN_POSITIVE, |greatest, value| greatest.max(value.abs()));
        let per_unit = f32::from(i16::MAX) / greatest;
        let mut panels = vec![0; values.len()];
        for (y, row) in values.chunks_exact(SIDE).enumerate() {
            for (panel, row) in row.chunks_exact(PANEL).enumerate() {
                round(&mut panels[(panel * SIDE + y) * PANEL..][..PANEL], row, per_unit);
            }
        }
        Self { values: panels, unit: 1.0 / per_unit, ranked }
    }

    /// Returns the value below which a fraction of the field lies.
    pub(crate) fn quantile(&self, fraction: f64) -> f32 {
        let last = self.ranked.len().saturating_sub(1);
        let rank = round_to_count(fraction * last as f64).min(last);
        self.ranked.get(rank).copied().unwrap_or(0.0)
    }

    /// Interpolates between two rows, from column `start` on.
    fn between(&self, mut texels: &mut [f32], start: usize, rows: [usize; 2], weight: f32) {
        let mut column = start;
        while !texels.is_empty() {
            let (panel, first) = (column % SIDE / PANEL, column % PANEL);
            let (part, rest) = texels.split_at_mut(texels.len().min(PANEL - first));
            let lines = rows.map(|y| &self.values[(panel * SIDE + y) * PANEL + first..][..part.len()]);
            blend(part, lines, weight, self.unit);
            column += part.len();
            texels = rest;
        }
    }

    /// Writes the field at a row of pixels that starts at `first`, by linear interpolation. `texels` is a buffer.
    pub(crate) fn row_into(&self, row: &mut [f32], sampler: &FieldSampler, first: Point, texels: &mut Texels) {
        let x = fixed(sampler.origin[0] + first[0] * sampler.step[0] + first[1] * sampler.shear);
        let y = fixed(sampler.origin[1] + first[1] * sampler.step[1]);
        let step = fixed(sampler.step[0]);
        // The range of texels of the row, from the leftmost, or all of them.
        let span = u64::from(step.cast_signed().unsigned_abs()) * row.len().saturating_sub(1) as u64;
        let count = (span / u64::from(ONE) + 2).min(SIDE as u64) as usize;
        let leftmost = if step.cast_signed() < 0 { x.wrapping_sub(span as u32) } else { x };
        let start = wrapped(leftmost);
        let rows = [wrapped(y), wrapped(y.wrapping_add(ONE))];
        self.between(&mut texels[..=count], start, rows, fraction(y));
        if step.cast_signed().unsigned_abs() == ONE && row.len() < SIDE {
            sample_unit_steps(row, &texels[..count], fraction(x), step != ONE);
        } else {
            sample(row, texels, x.wrapping_sub(start as u32 * ONE), step);
        }
    }
}

/// Positions are fixed-point numbers in 2⁻¹⁶ texels, which wrap without rounding.
const ONE: u32 = 1 << 16;

fn fixed(texels: f64) -> u32 {
    // The cast to 32 bits wraps, as intended.
    (texels * f64::from(ONE)).floor() as i64 as u32
}

/// Returns the texel index of a position.
#[inline(always)]
fn wrapped(position: u32) -> usize {
    (position >> 16) as usize % SIDE
}

/// Returns the fractional part of a position.
#[inline(always)]
fn fraction(position: u32) -> f32 {
    (position % ONE) as f32 * (1.0 / ONE as f32)
}

/// Rounds `scale` times the values to integers.
#[multiversion::multiversion(targets = "simd")]
fn round(out: &mut [i16], values: &[f32], scale: f32) {
    /// 1.5·2²³: adding it rounds to an integer, which the lowest bits then hold.
    const ROUND: f32 = 12_582_912.0;
    for (out, value) in out.iter_mut().zip(values) {
        *out = (value * scale + ROUND).to_bits() as i16;
    }
}

/// Interpolates between two rows of values in units of `unit`.
#[multiversion::multiversion(targets = "simd")]
fn blend(texels: &mut [f32], [upper, lower]: [&[i16]; 2], weight: f32, unit: f32) {
    for ((texel, upper), lower) in texels.iter_mut().zip(upper).zip(lower) {
        let (upper, lower) = (f32::from(*upper), f32::from(*lower));
        *texel = unit * (upper + weight * (lower - upper));
    }
}

/// Interpolates within a row of texels at equal steps.
#[multiversion::multiversion(targets = "simd")]
fn sample(row: &mut [f32], texels: &Texels, first: u32, step: u32) {
    let mut position = first;
    for value in row {
        let (texel, weight) = (wrapped(position), fraction(position));
        let left = texels[texel];
        *value = left + weight * (texels[texel + 1] - left);
        position = position.wrapping_add(step);
    }
}

/// The same for steps of one texel, forwards or mirrored.
#[multiversion::multiversion(targets = "simd")]
fn sample_unit_steps(row: &mut [f32], texels: &[f32], weight: f32, mirrored: bool) {
    let blend = |(value, (left, right)): (&mut f32, (&f32, &f32))| *value = left + weight * (right - left);
    let pairs = texels.iter().zip(&texels[1..]);
    if mirrored { row.iter_mut().rev().zip(pairs).for_each(blend) } else { row.iter_mut().zip(pairs).for_each(blend) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stretched_field_is_longer_along_the_direction_and_shorter_across_it() {
        let mut rng = Key { seed: 5, index: 0 }.stream("test", 0, "stretch");
        for (stretch, direction) in
            [(1.0, 0.3), (2.0, 0.0), (3.0, 1.1), (2.5, -2.0), (4.0, core::f64::consts::FRAC_PI_2)]
        {
            let sampler = FieldSampler::new(4.0, &mut rng).stretched(stretch, direction);
            let texels = |[x, y]: Point| {
                let [u, v] = [x * sampler.step[0] + y * sampler.shear, y * sampler.step[1]];
                4.0 * (u * u + v * v).sqrt()
            };
            let (sin, cos) = (libm::sin(direction), libm::cos(direction));
            assert!((texels([cos, sin]) * stretch.sqrt() - 1.0).abs() < 1e-9, "{stretch} {direction}");
            assert!((texels([-sin, cos]) / stretch.sqrt() - 1.0).abs() < 1e-9, "{stretch} {direction}");
            assert!(((sampler.step[0] * sampler.step[1]).abs() * 16.0 - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_row_matches_bilinear_interpolation_for_any_length() {
        let mut rng = Key { seed: 2, index: 0 }.stream("test", 0, "pools");
        let values: Vec<f32> = (0..SIDE * SIDE).map(|_| random::uniform(&mut rng) as f32).collect();
        let noise_field = NoiseField::new(values.clone());
        assert!((noise_field.quantile(0.25) - 0.25).abs() < 0.03);
        for (texel_px, times) in [(0.3, 1), (1.0, 4), (1.17, 1), (4.0, 1)] {
            for length in [1, 2, 60, 511, 512, 1400].repeat(times) {
                let whole = FieldSampler::new(texel_px, &mut rng);
                let sampler = if length == 60 { whole.stretched(2.5, 0.7) } else { whole };
                let mut row = vec![0.0; length];
                noise_field.row_into(&mut row, &sampler, [3.0, 5.0], &mut [0.0; SIDE + 1]);
                for (i, value) in row.iter().enumerate() {
                    let place = [3.0 + i as f64, 5.0];
                    let [x, y] = [0, 1].map(|axis| sampler.origin[axis] + place[axis] * sampler.step[axis]);
                    let x = x + place[1] * sampler.shear;
                    let texel = |x: f64, y: f64| {
                        let [x, y] = [x, y].map(|c| c.rem_euclid(SIDE as f64) as usize);
                        f64::from(values[y * SIDE + x])
                    };
                    let [u, v] = [x - x.floor(), y - y.floor()];
                    let upper = texel(x, y) * (1.0 - u) + texel(x + 1.0, y) * u;
                    let lower = texel(x, y + 1.0) * (1.0 - u) + texel(x + 1.0, y + 1.0) * u;
                    let slow = upper * (1.0 - v) + lower * v;
                    // Steps are rounded to 2⁻¹⁶ texels.
                    let tolerance = 1e-4 + 2e-5 * i as f64;
                    assert!((f64::from(*value) - slow).abs() < tolerance, "{texel_px} {length} {i}: {value} {slow}");
                }
            }
        }
    }
}
