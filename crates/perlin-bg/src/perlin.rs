use crate::error::{Error, require};
use crate::kernel::{Profile, lattice_line, point, single};
use portable_numerics::random::SplitMix64;

/// Fade curve: blends the four corners of a lattice cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Fade {
    /// 3t² − 2t³: Perlin's noise of 1985 (the paper's reference 32). Its second derivative is discontinuous at lattice
    /// lines.
    Cubic,
    /// 6t⁵ − 15t⁴ + 10t³: Perlin's improvement of 2002 ([doi:10.1145/566654.566636]), with two continuous derivatives.
    ///
    /// [doi:10.1145/566654.566636]: https://doi.org/10.1145/566654.566636
    #[default]
    Quintic,
}

impl Fade {
    #[inline(always)]
    fn at(self, t: f32) -> f32 {
        match self {
            Self::Cubic => t * t * (3.0 - 2.0 * t),
            Self::Quintic => t * t * t * (t * (t * 6.0 - 15.0) + 10.0),
        }
    }
}

/// Parameters of [`Perlin`].
#[derive(Debug, Clone, PartialEq)]
pub struct PerlinParams {
    /// Fade curve. Default: [`Fade::Quintic`] (ours; the paper cites the noise of 1985, which is [`Fade::Cubic`]).
    pub fade: Fade,
    /// Number of equidistant directions of the lattice gradients, 3 to 65536. Default: 256 (ours; the power spectrum
    /// does not depend on the number, but few directions cause visibly repeated slopes).
    pub gradients: usize,
}

impl Default for PerlinParams {
    fn default() -> Self {
        Self { fade: Fade::default(), gradients: 256 }
    }
}

/// Perlin's gradient noise in the plane, as a pure function of position.
///
/// Lattice points are the integers. The noise is zero on them, and within ±[`Perlin::BOUND`] elsewhere. Gradients are a
/// hash of the key and the 64-bit coordinates: the noise has no period, and overlapping windows agree bit for bit.
#[derive(Debug, Clone)]
pub struct Perlin {
    fade: Fade,
    directions: Vec<[f32; 2]>,
    key: u64,
}

impl Perlin {
    /// Bound of the noise's absolute value: √2/2, plus a margin for `f32` rounding.
    pub const BOUND: f64 = core::f64::consts::FRAC_1_SQRT_2 * (1.0 + 1e-6);

    /// Creates the noise of a `key`.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] if `gradients` is not between 3 and 65536.
    pub fn new(params: &PerlinParams, key: u64) -> Result<Self, Error> {
        // Two directions do not span the plane; more than 2^16 only cost memory.
        let count = params.gradients as f64;
        require("gradients", count, (3..=1 << 16).contains(&params.gradients), "between 3 and 65536")?;
        let directions = (0..params.gradients)
            .map(|i| {
                let (sin, cos) = libm::sincos(core::f64::consts::TAU * i as f64 / count);
                [single(cos), single(sin)]
            })
            .collect();
        Ok(Self { fade: params.fade, directions, key })
    }

    /// Returns the same noise with another key.
    pub(crate) fn with_key(&self, key: u64) -> Self {
        Self { key, ..self.clone() }
    }

    /// Returns the noise at a point, in lattice cells; NaN for a non-finite position.
    pub fn at(&self, x: f64, y: f64) -> f32 {
        let (column, row) = (self.profile(x), self.profile(y));
        let line = |j: i64| {
            lattice_line(
                column.offset,
                column.fade,
                self.gradient([column.cell, j]),
                self.gradient([column.cell.wrapping_add(1), j]),
            )
        };
        point(line(row.cell), line(row.cell.wrapping_add(1)), row)
    }

    /// Splits a coordinate into its cell and the offset in the cell.
    #[inline]
    pub(crate) fn profile(&self, position: f64) -> Profile {
        let floor = position.floor();
        let offset = single(position - floor);
        Profile {
            #[expect(
                clippy::cast_possible_truncation,
                reason = "`as` saturates; beyond 2^63 cells every position is a lattice point"
            )]
            cell: floor as i64,
            offset,
            fade: self.fade.at(offset),
        }
    }

    /// Returns the unit gradient at a lattice point.
    #[inline]
    pub(crate) fn gradient(&self, cell: [i64; 2]) -> [f32; 2] {
        let hash = cell.iter().fold(self.key, |key, c| SplitMix64::word(key, c.cast_unsigned())) >> 32;
        // Multiply-shift maps 32 random bits uniformly to the table without a division.
        self.directions[((hash * self.directions.len() as u64) >> 32) as usize]
    }
}

#[cfg(test)]
mod tests;
