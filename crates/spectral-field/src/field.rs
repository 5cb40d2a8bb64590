use core::f64::consts::{FRAC_1_SQRT_2, SQRT_2, TAU};
use core::fmt;
use std::sync::Arc;

use rand_core::Rng;
use rustfft::{Fft as Transform, FftPlanner, FftPlannerScalar, num_complex::Complex32};

use crate::normal::Ziggurat;
use crate::{Error, Fft, FieldParams};

/// Amplitudes below this part of the largest are zero: they are lost in the rounding of the FFT,
/// and smooth spectra then need only a corner of the grid.
const NEGLIGIBLE: f64 = 1e-7;

/// Rows gathered at a time: as many complex numbers of a column as one cache line holds.
const ROWS: usize = 8;

/// Gaussian random fields of one size and spectrum: planned once, drawn often.
///
/// A draw colours white noise in the frequency domain: field(x) = Σ_k A_k W_k exp(2πi k·x), with
/// A_k² the spectrum on the FFT grid, Σ A_k² = 1, and W_k independent complex normal deviates.
/// Only half of the plane of frequencies is drawn, as the field is real.
#[derive(Clone)]
pub struct SpectralField {
    width: usize,
    height: usize,
    /// Width and height of the FFT grid.
    grid: [usize; 2],
    /// A_k / √2 for kx = 0, 1, ... and all ky, each column of frequencies contiguous. Columns
    /// beyond the last with an amplitude are left out.
    amplitude: Vec<f32>,
    /// For each column, the largest |ky| with an amplitude.
    reach: Vec<usize>,
    columns: Arc<dyn Transform<f32>>,
    rows: Arc<dyn Transform<f32>>,
    normal: Ziggurat,
}

impl SpectralField {
    /// Plans the transforms and tabulates the amplitudes.
    ///
    /// # Errors
    ///
    /// If a side is 0 or too long, or a number of the spectrum is not finite or out of range.
    pub fn new(params: &FieldParams) -> Result<Self, Error> {
        let grid = params.grid()?;
        let (rows, columns) = match params.fft {
            Fft::Fastest => {
                let mut planner = FftPlanner::new();
                (planner.plan_fft_inverse(grid[0]), planner.plan_fft_inverse(grid[1]))
            }
            Fft::Portable => {
                let mut planner = FftPlannerScalar::new();
                (planner.plan_fft_inverse(grid[0]), planner.plan_fft_inverse(grid[1]))
            }
        };
        let (amplitude, reach) = amplitudes(params, grid);
        Ok(Self {
            width: params.width,
            height: params.height,
            grid,
            amplitude,
            reach,
            columns,
            rows,
            normal: Ziggurat::new(),
        })
    }

    /// Width of a drawn field, px.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height of a drawn field, px.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// Width and height of the periodic grid of which a field is the upper left part, px.
    #[must_use]
    pub fn grid(&self) -> [usize; 2] {
        self.grid
    }

    /// A new field, row by row: mean 0 and variance 1 over many draws.
    #[must_use]
    pub fn draw<R: Rng + ?Sized>(&self, rng: &mut R) -> Vec<f32> {
        let mut field = vec![0.0; self.width * self.height];
        self.draw_into(&mut field, rng);
        field
    }

    /// Overwrites `field`, `width` x `height` row by row, with what [`draw`](Self::draw) returns.
    ///
    /// # Panics
    ///
    /// If `field` has not `width` x `height` elements.
    pub fn draw_into<R: Rng + ?Sized>(&self, field: &mut [f32], rng: &mut R) {
        assert_eq!(
            field.len(),
            self.width * self.height,
            "the field must have {} x {} elements",
            self.width,
            self.height
        );
        let spectrum = self.coloured_columns(rng);
        let grid_width = self.grid[0];
        let mut pairs = vec![Complex32::ZERO; ROWS / 2 * grid_width];
        let mut scratch = vec![Complex32::ZERO; self.rows.get_inplace_scratch_len()];
        for (block, lines) in field.chunks_mut(ROWS * self.width).enumerate() {
            let first = block * ROWS;
            let used = pairs.len().min((lines.len() / self.width).div_ceil(2) * grid_width);
            self.gather(&spectrum, first, &mut pairs[..used]);
            self.rows.process_with_scratch(&mut pairs[..used], &mut scratch);
            for (pair, two) in pairs.chunks(grid_width).zip(lines.chunks_mut(2 * self.width)) {
                let (upper, lower) = two.split_at_mut(self.width);
                for (out, z) in upper.iter_mut().zip(pair) {
                    *out = z.re;
                }
                for (out, z) in lower.iter_mut().zip(pair) {
                    *out = z.im;
                }
            }
        }
    }

    /// The expected product of two pixels `lag` = [x, y] px apart: the autocorrelation, wrapped
    /// around the grid. Takes time proportional to the grid; meant for checks.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "sides are at most 2^15")]
    pub fn autocorrelation(&self, lag: [f64; 2]) -> f64 {
        let [width, height] = self.grid;
        let mut sum = 0.0;
        for (kx, column) in self.amplitude.chunks(height).enumerate() {
            let across = TAU * lag[0] * kx as f64 / width as f64;
            // Columns other than the two that are their own mirror images stand for two.
            let weight = if is_own_mirror(kx, width) { 2.0 } else { 4.0 };
            for (ky, &a) in column.iter().enumerate() {
                let a = f64::from(a);
                let ky = if 2 * ky > height { ky as f64 - height as f64 } else { ky as f64 };
                let along = TAU * lag[1] * ky / height as f64;
                // cos(across + along), of which the mirrored ky cancels the odd part.
                sum += weight * a * a * libm::cos(across) * libm::cos(along);
            }
        }
        sum
    }

    /// The columns of frequencies, coloured and transformed along y.
    fn coloured_columns<R: Rng + ?Sized>(&self, rng: &mut R) -> Vec<Complex32> {
        let height = self.grid[1];
        let mut spectrum = vec![Complex32::ZERO; self.amplitude.len()];
        let mut scratch = vec![Complex32::ZERO; self.columns.get_inplace_scratch_len()];
        let columns = spectrum.chunks_mut(height).zip(self.amplitude.chunks(height));
        for ((column, amplitude), &reach) in columns.zip(&self.reach) {
            let mut colour = |from: usize, to: usize| {
                for (z, &a) in column[from..to].iter_mut().zip(&amplitude[from..to]) {
                    let [re, im] = self.normal.pair(rng);
                    *z = Complex32::new(a * re, a * im);
                }
            };
            colour(0, reach + 1);
            colour((reach + 1).max(height - reach), height);
            self.columns.process_with_scratch(column, &mut scratch);
        }
        spectrum
    }

    /// Lays rows `first`, `first + 1` of the spectrum into the first line of `pairs` as
    /// Z = A + iB, the next two into the next: one complex transform then yields two real rows.
    fn gather(&self, spectrum: &[Complex32], first: usize, pairs: &mut [Complex32]) {
        #[expect(clippy::cast_possible_truncation, reason = "a constant")]
        const ROOT: f32 = SQRT_2 as f32;
        let [width, height] = self.grid;
        pairs.fill(Complex32::ZERO);
        for (kx, column) in spectrum.chunks(height).enumerate() {
            let column = &column[first..];
            for (pair, two) in pairs.chunks_mut(width).zip(column.chunks(2)) {
                let (a, b) = (two[0], two.get(1).copied().unwrap_or_default());
                if is_own_mirror(kx, width) {
                    // A real field needs a mirrored column, Z(-k) = Z*(k): the real part of its
                    // transform is that of the mirrored one, at half the variance.
                    pair[kx] = Complex32::new(ROOT * a.re, ROOT * b.re);
                } else {
                    pair[kx] = Complex32::new(a.re - b.im, a.im + b.re);
                    pair[width - kx] = Complex32::new(a.re + b.im, b.re - a.im);
                }
            }
        }
    }
}

impl fmt::Debug for SpectralField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SpectralField")
            .field("width", &self.width)
            .field("height", &self.height)
            .field("grid", &self.grid)
            .finish_non_exhaustive()
    }
}

/// Whether column kx of frequencies and column -kx are the same.
fn is_own_mirror(kx: usize, width: usize) -> bool {
    kx == 0 || 2 * kx == width
}

/// The columns of A_k / √2 with Σ A_k² = 1 over the whole plane, and how far each reaches.
#[expect(clippy::cast_precision_loss, reason = "sides are at most 2^15")]
fn amplitudes(params: &FieldParams, grid: [usize; 2]) -> (Vec<f32>, Vec<usize>) {
    let [width, height] = grid;
    let half = height / 2 + 1;
    let mut power = Vec::with_capacity((width / 2 + 1) * half);
    let mut total = 0.0;
    for kx in 0..=width / 2 {
        for ky in 0..half {
            let frequency = [kx as f64 / width as f64, ky as f64 / height as f64];
            let folded = params.spectrum.folded_density(frequency);
            // The constant part of a power law is infinite, and left out.
            let s = if folded.is_finite() { folded } else { 0.0 };
            let mirrors = |k, n| if is_own_mirror(k, n) { 1.0 } else { 2.0 };
            total += mirrors(kx, width) * mirrors(ky, height) * s;
            power.push(s);
        }
    }
    let largest = power.iter().copied().fold(0.0, f64::max);
    let least = largest * NEGLIGIBLE * NEGLIGIBLE;
    // A grid of one pixel has no frequency but the constant one.
    let scale = if total > 0.0 { FRAC_1_SQRT_2 / total.sqrt() } else { 0.0 };
    let mut amplitude = Vec::new();
    let mut reach = Vec::new();
    for column in power.chunks(half) {
        let Some(last) = column.iter().rposition(|&s| s > least) else {
            break;
        };
        reach.push(last);
        amplitude.extend((0..height).map(|ky| {
            let s = column[ky.min(height - ky)];
            #[expect(clippy::cast_possible_truncation, reason = "the FFT is single precision")]
            let a = if s > least { (scale * s.sqrt()) as f32 } else { 0.0 };
            a
        }));
    }
    (amplitude, reach)
}
