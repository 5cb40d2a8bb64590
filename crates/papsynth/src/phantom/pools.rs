//! Random fields that the cells of one image share, each cell looking at another place of them at another angle.

use rand_core::Rng;
use spectral_field::{Fft, FieldParams, Padding, SpectralField, Spectrum};

use super::tile::Point;
use crate::key::Key;
use crate::random;

/// Side of a pool in texels: a power of two, so that positions wrap by masking.
const SIDE: usize = 512;

/// Size of a texel of the flecks' and the grain's pool, µm.
const TEXEL_UM: f64 = 0.25;

/// Smoothing of the clouds' pool, texels.
const CLOUD_SIGMA: f64 = 6.0;

/// Correlation length of the grain, texels.
const GRAIN_LENGTH: f64 = 1.6;

/// What makes pools: plans and spectra, the same for every image.
#[derive(Debug)]
pub(crate) struct PoolMaker {
    clouds: SpectralField,
    flecks: SpectralField,
    grain: SpectralField,
}

/// The fields of one image. All have mean 0, variance 1 and repeat after [`SIDE`] texels.
#[derive(Debug)]
pub(crate) struct Pools {
    pub(crate) clouds: Pool,
    pub(crate) flecks: Pool,
    pub(crate) grain: Pool,
}

/// A field that repeats.
#[derive(Debug)]
pub(crate) struct Pool {
    values: Vec<f32>,
    /// Values in rising order, thinned out, for thresholds.
    ranked: Vec<f32>,
}

/// Where and at which angle one cell looks at a pool.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Look {
    origin: Point,
    across: Point,
}

impl PoolMaker {
    pub(crate) fn new(fft: Fft) -> Result<Self, String> {
        let maker = |spectrum| {
            let params = FieldParams { width: SIDE, height: SIDE, spectrum, fft, padding: Padding::Periodic };
            SpectralField::new(&params).map_err(|e| e.to_string())
        };
        Ok(Self {
            clouds: maker(Spectrum::Gaussian { sigma_px: CLOUD_SIGMA })?,
            flecks: maker(Spectrum::BROWNIAN)?,
            grain: maker(Spectrum::Matern { nu: 0.5, length_px: GRAIN_LENGTH })?,
        })
    }

    /// The pools of an image.
    pub(crate) fn make(&self, key: Key) -> Pools {
        let draw = |field: &SpectralField, purpose: &str| Pool::new(field.draw(&mut key.stream("field", 0, purpose)));
        Pools {
            clouds: draw(&self.clouds, "pool.clouds"),
            flecks: draw(&self.flecks, "pool.flecks"),
            grain: draw(&self.grain, "pool.grain"),
        }
    }
}

impl Look {
    /// A random place and angle, with texels of `texel_px` pixels.
    pub(crate) fn new<R: Rng + ?Sized>(texel_px: f64, rng: &mut R) -> Self {
        let angle = random::direction(rng);
        let step = 1.0 / texel_px;
        Self {
            origin: [random::between(0.0, SIDE as f64, rng), random::between(0.0, SIDE as f64, rng)],
            across: [step * libm::cos(angle), step * libm::sin(angle)],
        }
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

    /// Visits a row of a tile: the field at each pixel, by linear interpolation.
    pub(crate) fn row(&self, look: &Look, first: Point, count: usize, mut visit: impl FnMut(usize, f32)) {
        /// Positions are kept in 2⁻¹⁶ texels: whole numbers wrap without rounding.
        const ONE: f64 = 65_536.0;
        const MASK: u32 = SIDE as u32 - 1;
        let [ax, ay] = look.across;
        let x = look.origin[0] + first[0] * ax - first[1] * ay;
        let y = look.origin[1] + first[0] * ay + first[1] * ax;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "wraps on purpose")]
        let fixed = |value: f64| (value * ONE).floor() as i64 as u32;
        let (mut x, mut y, dx, dy) = (fixed(x), fixed(y), fixed(ax), fixed(ay));
        for column in 0..count {
            let fraction = |value: u32| (value & 0xffff) as f32 * (1.0 / 65_536.0);
            let (fx, fy) = (fraction(x), fraction(y));
            let (x0, y0) = ((x >> 16 & MASK) as usize, (y >> 16 & MASK) as usize);
            let (x1, y1) = ((x0 + 1) & MASK as usize, (y0 + 1) & MASK as usize);
            let at = |x: usize, y: usize| self.values[y * SIDE + x];
            let upper = at(x0, y0) + fx * (at(x1, y0) - at(x0, y0));
            let lower = at(x0, y1) + fx * (at(x1, y1) - at(x0, y1));
            visit(column, upper + fy * (lower - upper));
            x = x.wrapping_add(dx);
            y = y.wrapping_add(dy);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_look_reads_the_field_and_wraps() {
        let values: Vec<f32> = (0..SIDE * SIDE).map(|i| (i % SIDE) as f32).collect();
        let pool = Pool::new(values);
        let look = Look { origin: [510.25, 3.0], across: [1.0, 0.0] };
        let mut seen = Vec::new();
        pool.row(&look, [0.0, 0.0], 4, |_, v| seen.push(v));
        assert_eq!(seen[0], 510.25);
        assert_eq!(seen[1], 511.0 + 0.25 * (0.0 - 511.0), "between the last column and the first");
        assert_eq!(seen[2], 0.25);
        assert!((pool.quantile(0.5) - 256.0).abs() < 8.0);
    }
}
