use core::f64::consts::{FRAC_1_SQRT_2, SQRT_2, TAU};

use multiversion::multiversion;
use portable_numerics::fourier::{self, LaneFft, ZERO, transposed};
use portable_numerics::random::Ziggurat;
use rand_core::Rng;

use crate::{Error, FieldParams};

/// Amplitudes below this part of the largest are zero: they are lost in the rounding of the FFT,
/// and smooth spectra then need only a corner of the grid.
const NEGLIGIBLE: f64 = 1e-7;

/// Columns of frequencies that are transformed together: a cache line of single precision.
const LANES: usize = 16;

/// Rows that are transformed together: two in each lane, as real and imaginary part.
const ROWS: usize = 2 * LANES;

/// A complex number of each lane.
type Lanes = fourier::Lanes<f32, LANES>;

/// Gaussian random fields of one size and spectrum: planned once, drawn often.
///
/// A draw colours white noise in the frequency domain: field(x) = Σ_k A_k W_k exp(2πi k·x), with
/// A_k² the spectrum on the FFT grid, Σ A_k² = 1, and W_k independent complex normal deviates.
/// Only half of the plane of frequencies is drawn, as the field is real.
#[derive(Debug, Clone)]
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
    columns: LaneFft<f32>,
    rows: LaneFft<f32>,
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
        let (amplitude, reach) = amplitudes(params, grid);
        Ok(Self {
            width: params.width,
            height: params.height,
            grid,
            amplitude,
            reach,
            columns: LaneFft::new(grid[1]),
            rows: LaneFft::new(grid[0]),
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
        let mut line = vec![ZERO; self.grid[0]];
        let mut spare = line.clone();
        for (block, rows) in field.chunks_mut(ROWS * self.width).enumerate() {
            gather(&spectrum, self.amplitude.len() / self.grid[1], block * ROWS, &mut line);
            self.rows.process(&mut line, &mut spare);
            scatter(&line, rows, self.width);
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

    /// The columns of frequencies, coloured and transformed along y: blocks of them side by side.
    fn coloured_columns<R: Rng + ?Sized>(&self, rng: &mut R) -> Vec<Vec<Lanes>> {
        #[expect(clippy::cast_possible_truncation, reason = "a constant")]
        const ROOT: f32 = SQRT_2 as f32;
        let [width, height] = self.grid;
        let mut spare = vec![ZERO; height];
        let mut blocks = Vec::new();
        for (first, reaches) in (0..).step_by(LANES).zip(self.reach.chunks(LANES)) {
            // The inverse transform is the forward one of the reversed sequence, of which the first comes in at the end.
            let mut block = vec![ZERO; height + 1];
            let amplitudes = self.amplitude[first * height..].chunks(height);
            for (l, (amplitude, &reach)) in amplitudes.zip(reaches).enumerate() {
                let mut colour = |from: usize, to: usize| {
                    let places = block[height + 1 - to..=height - from].iter_mut().rev();
                    for (z, &a) in places.zip(&amplitude[from..to]) {
                        let [re, im] = self.normal.pair(rng);
                        (z[0][l], z[1][l]) = (a * re, a * im);
                    }
                };
                colour(0, reach + 1);
                colour((reach + 1).max(height - reach), height);
            }
            block.swap_remove(0);
            self.columns.process(&mut block, &mut spare);
            for l in (0..reaches.len()).filter(|l| is_own_mirror(first + l, width)) {
                // A real field needs a mirrored column, Z(-k) = Z*(k): the real part of its
                // transform is that of the mirrored one, at half the variance.
                block.iter_mut().for_each(|z| (z[0][l], z[1][l]) = (ROOT * z[0][l], 0.0));
            }
            block.resize(height.next_multiple_of(ROWS), ZERO);
            blocks.push(block);
        }
        blocks
    }
}

/// Lays spectra of rows from the `first` on, reversed, into `line`, Z = A + iB of two in each lane: one complex transform
/// then yields two real rows. The first `columns` have a frequency.
#[multiversion(targets = "simd")]
fn gather(spectrum: &[Vec<Lanes>], columns: usize, first: usize, line: &mut [Lanes]) {
    let width = line.len();
    line.fill(ZERO);
    for (kx, block) in (0..).step_by(LANES).zip(spectrum) {
        let mut parts = [[[0.0; LANES]; LANES]; 4];
        let (a, b) = block[first..first + ROWS].split_at(LANES);
        for l in 0..LANES {
            [parts[0][l], parts[1][l]] = a[l];
            [parts[2][l], parts[3][l]] = b[l];
        }
        let [a_re, a_im] = [transposed(&parts[0]), transposed(&parts[1])];
        let [b_re, b_im] = [transposed(&parts[2]), transposed(&parts[3])];
        for i in 0..LANES.min(columns - kx) {
            let (mut z, mut mirrored) = (ZERO, ZERO);
            for l in 0..LANES {
                z[0][l] = a_re[i][l] - b_im[i][l];
                z[1][l] = a_im[i][l] + b_re[i][l];
                mirrored[0][l] = a_re[i][l] + b_im[i][l];
                mirrored[1][l] = b_re[i][l] - a_im[i][l];
            }
            // The two are one where they have one place.
            line[kx + i] = mirrored;
            line[if kx + i == 0 { 0 } else { width - kx - i }] = z;
        }
    }
}

/// Writes at most [`ROWS`] rows of `width`: real parts, then imaginary parts.
#[multiversion(targets = "simd")]
fn scatter(line: &[Lanes], rows: &mut [f32], width: usize) {
    let (whole, rest) = line.as_chunks();
    let mut last = [ZERO; LANES];
    last[..rest.len()].copy_from_slice(rest);
    for (left, values) in (0..width).step_by(LANES).zip(whole.iter().chain([&last])) {
        let mut parts = [[[0.0; LANES]; LANES]; 2];
        for i in 0..LANES {
            [parts[0][i], parts[1][i]] = values[i];
        }
        let parts = [transposed(&parts[0]), transposed(&parts[1])];
        let rows = rows.chunks_exact_mut(width).zip(parts.as_flattened());
        if left + LANES <= width {
            rows.for_each(|(row, part)| row[left..left + LANES].copy_from_slice(part));
        } else {
            rows.for_each(|(row, part)| row[left..].copy_from_slice(&part[..width - left]));
        }
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
