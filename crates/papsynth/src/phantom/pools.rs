//! Random fields that the cells of one image share, each cell looking at another place of them, mirrored or not.

use std::sync::OnceLock;

use rand_core::Rng;
use spectral_field::{FieldParams, Padding, SpectralField, Spectrum};

use super::tile::Point;
use crate::key::Key;
use crate::random;

/// Side of a pool in texels: a power of two, so that positions wrap by masking.
pub(crate) const SIDE: usize = 512;

/// Size of a texel of the flecks' and the grain's pool, µm.
const TEXEL_UM: f64 = 0.25;

/// Smoothing of the clouds' pool, texels.
const CLOUD_SIGMA: f64 = 6.0;

/// Correlation length of the grain, texels.
const GRAIN_LENGTH: f64 = 1.6;

/// What makes pools: plans and spectra, the same for every image.
#[derive(Debug)]
pub(crate) struct PoolMaker {
    /// Of clouds, flecks and grain.
    fields: [SpectralField; 3],
}

/// The fields of one image. All have mean 0, variance 1 and repeat after [`SIDE`] texels. Each is made when a cell
/// first asks for it.
#[derive(Debug)]
pub(crate) struct Pools<'a> {
    maker: &'a PoolMaker,
    key: Key,
    drawn: [OnceLock<Pool>; 3],
}

/// A field that repeats.
#[derive(Debug)]
pub(crate) struct Pool {
    values: Vec<f32>,
    /// Values in rising order, thinned out, for thresholds.
    ranked: Vec<f32>,
}

/// Memory for a row of texels; the first may stand once more behind the last.
pub(crate) type Texels = [f32; SIDE + 1];

/// Where one cell looks at a pool, and in which of its four mirror images.
///
/// Looks run along the pool's rows, not at an angle: the fields have no direction of their own, and a row of pixels then
/// needs two rows of texels only.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Look {
    origin: Point,
    /// Texels from a pixel to the next one on the right, and to the one below; negative where mirrored.
    step: Point,
}

/// Where between texels looks lie that step from texel to texel: f with 2f(1 − f) = ⅓, the mean of all f from 0 to 1, so
/// that interpolation leaves every cell the variance that it leaves on average.
const BETWEEN: f64 = 0.211_324_865_405_187_1;

impl PoolMaker {
    pub(crate) fn new() -> Self {
        let spectra = [
            Spectrum::Gaussian { sigma_px: CLOUD_SIGMA },
            Spectrum::BROWNIAN,
            Spectrum::Matern { nu: 0.5, length_px: GRAIN_LENGTH },
        ];
        let fields = spectra.map(|spectrum| {
            let params = FieldParams { width: SIDE, height: SIDE, spectrum, padding: Padding::Periodic };
            SpectralField::new(&params).expect("pools of this size can be planned")
        });
        Self { fields }
    }

    pub(crate) fn make(&self, key: Key) -> Pools<'_> {
        Pools { maker: self, key, drawn: Default::default() }
    }
}

impl Pools<'_> {
    pub(crate) fn clouds(&self) -> &Pool {
        self.pool(0, "pool.clouds")
    }

    pub(crate) fn flecks(&self) -> &Pool {
        self.pool(1, "pool.flecks")
    }

    pub(crate) fn grain(&self) -> &Pool {
        self.pool(2, "pool.grain")
    }

    fn pool(&self, which: usize, purpose: &str) -> &Pool {
        self.drawn[which]
            .get_or_init(|| Pool::new(self.maker.fields[which].draw(&mut self.key.stream("field", 0, purpose))))
    }
}

impl Look {
    /// A random place and mirror image, with texels of `texel_px` pixels.
    pub(crate) fn new<R: Rng + ?Sized>(texel_px: f64, rng: &mut R) -> Self {
        let mut texel = || random::below(SIDE, rng) as f64 + BETWEEN;
        let origin = [texel(), texel()];
        let mirrored = random::below(4, rng);
        let step = |bit: usize| if mirrored & bit == 0 { 1.0 / texel_px } else { -1.0 / texel_px };
        Self { origin, step: [step(1), step(2)] }
    }

    /// For flecks and grain, whose texels have a size of their own.
    pub(crate) fn fine<R: Rng + ?Sized>(pixel_um: f64, rng: &mut R) -> Self {
        Self::new(TEXEL_UM / pixel_um, rng)
    }

    /// For clouds of a standard deviation of smoothing in pixels.
    pub(crate) fn clouds<R: Rng + ?Sized>(sigma_px: f64, rng: &mut R) -> Self {
        Self::new(sigma_px / CLOUD_SIGMA, rng)
    }
}

impl Pool {
    fn new(values: Vec<f32>) -> Self {
        /// Every so-maniest value is enough to know where a share of them lies.
        const THIN: usize = 61;
        let mut ranked: Vec<f32> = values.iter().step_by(THIN).copied().collect();
        ranked.sort_by(f32::total_cmp);
        Self { values, ranked }
    }

    /// The value that a share of the field lies below.
    pub(crate) fn quantile(&self, share: f64) -> f32 {
        let last = self.ranked.len().saturating_sub(1);
        let rank = random::count(share * last as f64).min(last);
        self.ranked.get(rank).copied().unwrap_or(0.0)
    }

    /// A row of a tile, the pixel at `first` and those right of it: the field at each, by linear interpolation.
    /// `texels` is memory.
    pub(crate) fn row_into(&self, row: &mut [f32], look: &Look, first: Point, texels: &mut Texels) {
        let x = fixed(look.origin[0] + first[0] * look.step[0]);
        let y = fixed(look.origin[1] + first[1] * look.step[1]);
        let line = |y: u32| &self.values[wrapped(y) * SIDE..][..SIDE];
        let (upper, lower) = (line(y), line(y.wrapping_add(ONE)));
        let step = fixed(look.step[0]);
        // The texels that the row meets, from the leftmost on, or all of them.
        let span = u64::from(step.cast_signed().unsigned_abs()) * row.len().saturating_sub(1) as u64;
        let count = (span / u64::from(ONE) + 2).min(SIDE as u64) as usize;
        let leftmost = if step.cast_signed() < 0 { x.wrapping_sub(span as u32) } else { x };
        let start = wrapped(leftmost);
        let (ahead, around) = texels[..=count].split_at_mut((count + 1).min(SIDE - start));
        between(ahead, &upper[start..], &lower[start..], fraction(y));
        between(around, upper, lower, fraction(y));
        if step.cast_signed().unsigned_abs() == ONE && row.len() < SIDE {
            even(row, &texels[..count], fraction(x), step != ONE);
        } else {
            sample(row, texels, x.wrapping_sub(start as u32 * ONE), step);
        }
    }
}

/// Positions are kept in 2⁻¹⁶ texels: whole numbers wrap without rounding.
const ONE: u32 = 1 << 16;

fn fixed(texels: f64) -> u32 {
    // The cast to 32 bits wraps on purpose.
    (texels * f64::from(ONE)).floor() as i64 as u32
}

/// The texel that a position lies in, within the pool.
#[inline(always)]
fn wrapped(position: u32) -> usize {
    (position >> 16) as usize % SIDE
}

/// How far into its texel a position lies.
#[inline(always)]
fn fraction(position: u32) -> f32 {
    (position % ONE) as f32 * (1.0 / ONE as f32)
}

/// Blends two rows of texels.
#[multiversion::multiversion(targets = "simd")]
fn between(texels: &mut [f32], upper: &[f32], lower: &[f32], share: f32) {
    for ((texel, upper), lower) in texels.iter_mut().zip(upper).zip(lower) {
        *texel = upper + share * (lower - upper);
    }
}

/// Interpolates in a row of texels at even steps.
#[multiversion::multiversion(targets = "simd")]
fn sample(row: &mut [f32], texels: &Texels, first: u32, step: u32) {
    let mut position = first;
    for value in row {
        let (texel, share) = (wrapped(position), fraction(position));
        let left = texels[texel];
        *value = left + share * (texels[texel + 1] - left);
        position = position.wrapping_add(step);
    }
}

/// The same from texel to texel, from the first one on, or to it.
#[multiversion::multiversion(targets = "simd")]
fn even(row: &mut [f32], texels: &[f32], share: f32, mirrored: bool) {
    let blend = |(value, (left, right)): (&mut f32, (&f32, &f32))| *value = left + share * (right - left);
    let pairs = texels.iter().zip(&texels[1..]);
    if mirrored { row.iter_mut().rev().zip(pairs).for_each(blend) } else { row.iter_mut().zip(pairs).for_each(blend) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_is_the_field_at_each_pixel_however_long_it_is() {
        let mut rng = Key { seed: 2, index: 0 }.stream("test", 0, "pools");
        let pool = Pool::new((0..SIDE * SIDE).map(|_| random::uniform(&mut rng) as f32).collect());
        assert!((pool.quantile(0.25) - 0.25).abs() < 0.03);
        for (texel_px, times) in [(0.3, 1), (1.0, 4), (1.17, 1), (4.0, 1)] {
            for length in [1, 2, 60, 511, 512, 1400].repeat(times) {
                let look = Look::new(texel_px, &mut rng);
                let mut row = vec![0.0; length];
                pool.row_into(&mut row, &look, [3.0, 5.0], &mut [0.0; SIDE + 1]);
                for (i, value) in row.iter().enumerate() {
                    let place = [3.0 + i as f64, 5.0];
                    let [x, y] = [0, 1].map(|axis| look.origin[axis] + place[axis] * look.step[axis]);
                    let texel = |x: f64, y: f64| {
                        let [x, y] = [x, y].map(|c| c.rem_euclid(SIDE as f64) as usize);
                        f64::from(pool.values[y * SIDE + x])
                    };
                    let [u, v] = [x - x.floor(), y - y.floor()];
                    let upper = texel(x, y) * (1.0 - u) + texel(x + 1.0, y) * u;
                    let lower = texel(x, y + 1.0) * (1.0 - u) + texel(x + 1.0, y + 1.0) * u;
                    let slow = upper * (1.0 - v) + lower * v;
                    // Steps are kept in 2⁻¹⁶ texels.
                    let slack = 1e-4 + 2e-5 * i as f64;
                    assert!((f64::from(*value) - slow).abs() < slack, "{texel_px} {length} {i}: {value} {slow}");
                }
            }
        }
    }
}
