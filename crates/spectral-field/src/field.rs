use core::f64::consts::{FRAC_1_SQRT_2, SQRT_2, TAU};

use multiversion::multiversion;
use portable_numerics::fourier::{self, LaneFft, ZERO, transposed};
use portable_numerics::random::Ziggurat;
use rand_core::Rng;

use crate::{Error, FieldParams};

/// Amplitudes below this fraction of the largest are set to zero. They are below the rounding error of the FFT, and
/// smooth spectra then need only a corner of the grid.
const NEGLIGIBLE: f64 = 1e-7;

/// Columns of frequencies transformed together: a cache line of single precision.
const LANES: usize = 16;

/// Rows transformed together: two per lane, as real and imaginary part.
const ROWS: usize = 2 * LANES;

/// A complex number per lane.
type Lanes = fourier::Lanes<f32, LANES>;

/// A plan for Gaussian random fields of one size and spectrum, for repeated draws.
///
/// A draw filters white noise in the frequency domain: field(x) = Σ_k A_k W_k exp(2πi k·x). A_k² is the spectrum on the
/// FFT grid with Σ A_k² = 1, and W_k are independent complex normal deviates. The field is real, so only half of the
/// frequency plane is drawn.
#[derive(Debug, Clone)]
pub struct SpectralField {
    width: usize,
    height: usize,
    /// Width and height of the FFT grid.
    grid: [usize; 2],
    /// A_k / √2 for kx = 0, 1, ... and all ky, in column-major order. Columns beyond the last non-zero amplitude are
    /// left out.
    amplitude: Vec<f32>,
    /// Largest |ky| with a non-zero amplitude, per column.
    reach: Vec<usize>,
    columns: LaneFft<f32>,
    rows: LaneFft<f32>,
    normal: Ziggurat,
}

impl SpectralField {
    /// Plans the transforms and computes the amplitudes.
    ///
    /// # Errors
    ///
    /// If a size is 0 or too large, or a parameter of the spectrum is not finite or out of range.
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

    /// Returns the width of a drawn field in pixels.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Returns the height of a drawn field in pixels.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// Returns the width and height of the periodic grid in pixels. A field is its upper left part.
    #[must_use]
    pub fn grid(&self) -> [usize; 2] {
        self.grid
    }

    /// Draws a new field in row-major order. Mean 0 and variance 1 hold over many draws.
    #[must_use]
    pub fn draw<R: Rng + ?Sized>(&self, rng: &mut R) -> Vec<f32> {
        let mut field = vec![0.0; self.width * self.height];
        self.draw_into(&mut field, rng);
        field
    }

    /// Overwrites `field`, `width` x `height` in row-major order, with the result of [`draw`](Self::draw).
    ///
    /// # Panics
    ///
    /// If `field` does not have `width` x `height` elements.
    pub fn draw_into<R: Rng + ?Sized>(&self, field: &mut [f32], rng: &mut R) {
        assert_eq!(
            field.len(),
            self.width * self.height,
            "the field must have {} x {} elements",
            self.width,
            self.height
        );
        let spectrum = self.filtered_columns(rng);
        let mut line = vec![ZERO; self.grid[0]];
        let mut spare = line.clone();
        for (block, rows) in field.chunks_mut(ROWS * self.width).enumerate() {
            pack_rows(&spectrum, self.amplitude.len() / self.grid[1], block * ROWS, &mut line);
            self.rows.process(&mut line, &mut spare);
            write_rows(&line, rows, self.width);
        }
    }

    /// Returns the expected product of two pixels at a distance `lag` = [x, y] in pixels: the autocorrelation, periodic
    /// in the grid. The time is proportional to the size of the grid; intended for tests.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "sizes are at most 2^15")]
    pub fn autocorrelation(&self, lag: [f64; 2]) -> f64 {
        let [width, height] = self.grid;
        let mut sum = 0.0;
        for (kx, column) in self.amplitude.chunks(height).enumerate() {
            let across = TAU * lag[0] * kx as f64 / width as f64;
            // Every column except the two self-mirrored ones also represents its mirror image.
            let weight = if is_self_mirrored(kx, width) { 2.0 } else { 4.0 };
            for (ky, &a) in column.iter().enumerate() {
                let a = f64::from(a);
                let ky = if 2 * ky > height { ky as f64 - height as f64 } else { ky as f64 };
                let along = TAU * lag[1] * ky / height as f64;
                // cos(across + along); the mirrored ky cancels the odd part.
                sum += weight * a * a * libm::cos(across) * libm::cos(along);
            }
        }
        sum
    }

    /// Draws and filters the columns of frequencies and transforms them along y, in blocks.
    fn filtered_columns<R: Rng + ?Sized>(&self, rng: &mut R) -> Vec<Vec<Lanes>> {
        #[expect(clippy::cast_possible_truncation, reason = "a constant")]
        const ROOT: f32 = SQRT_2 as f32;
        let [width, height] = self.grid;
        let mut spare = vec![ZERO; height];
        let mut blocks = Vec::new();
        for (first, reaches) in (0..).step_by(LANES).zip(self.reach.chunks(LANES)) {
            // The inverse transform equals the forward transform of the reversed sequence; its first element is at the
            // end.
            let mut block = vec![ZERO; height + 1];
            let amplitudes = self.amplitude[first * height..].chunks(height);
            for (l, (amplitude, &reach)) in amplitudes.zip(reaches).enumerate() {
                let mut draw = |from: usize, to: usize| {
                    let places = block[height + 1 - to..=height - from].iter_mut().rev();
                    for (z, &a) in places.zip(&amplitude[from..to]) {
                        let [re, im] = self.normal.pair(rng);
                        (z[0][l], z[1][l]) = (a * re, a * im);
                    }
                };
                draw(0, reach + 1);
                draw((reach + 1).max(height - reach), height);
            }
            block.swap_remove(0);
            self.columns.process(&mut block, &mut spare);
            for l in (0..reaches.len()).filter(|l| is_self_mirrored(first + l, width)) {
                // A real field needs a self-mirrored column, Z(-k) = Z*(k). The real part of its transform is that of
                // the mirrored column, at half the variance.
                block.iter_mut().for_each(|z| (z[0][l], z[1][l]) = (ROOT * z[0][l], 0.0));
            }
            block.resize(height.next_multiple_of(ROWS), ZERO);
            blocks.push(block);
        }
        blocks
    }
}

/// Copies the spectra of rows from `first` on to `line`, reversed, as Z = A + iB of two rows per lane: one complex
/// transform then gives two real rows. Only the first `columns` have frequencies.
#[multiversion(targets = "simd")]
fn pack_rows(spectrum: &[Vec<Lanes>], columns: usize, first: usize, line: &mut [Lanes]) {
    let width = line.len();
    line.fill(ZERO);
    for (kx, block) in (0..).step_by(LANES).zip(spectrum) {
        let part = |first: usize, part: usize| transposed(core::array::from_fn(|l| &block[first + l][part]));
        let [a_re, a_im, b_re, b_im] = [part(first, 0), part(first, 1), part(first + LANES, 0), part(first + LANES, 1)];
        for i in 0..LANES.min(columns - kx) {
            let (mut z, mut mirrored) = (ZERO, ZERO);
            for l in 0..LANES {
                z[0][l] = a_re[i][l] - b_im[i][l];
                z[1][l] = a_im[i][l] + b_re[i][l];
                mirrored[0][l] = a_re[i][l] + b_im[i][l];
                mirrored[1][l] = b_re[i][l] - a_im[i][l];
            }
            // Both values are equal at a shared position.
            line[kx + i] = mirrored;
            line[if kx + i == 0 { 0 } else { width - kx - i }] = z;
        }
    }
}

/// Writes at most [`ROWS`] rows of `width`: real parts, then imaginary parts.
#[multiversion(targets = "simd")]
fn write_rows(line: &[Lanes], rows: &mut [f32], width: usize) {
    let (whole, rest) = line.as_chunks();
    let mut last = [ZERO; LANES];
    last[..rest.len()].copy_from_slice(rest);
    for (left, values) in (0..width).step_by(LANES).zip(whole.iter().chain([&last])) {
        let parts = [0, 1].map(|part| transposed(core::array::from_fn(|l| &values[l][part])));
        let rows = rows.chunks_exact_mut(width).zip(parts.as_flattened());
        if left + LANES <= width {
            rows.for_each(|(row, part)| row[left..left + LANES].copy_from_slice(part));
        } else {
            rows.for_each(|(row, part)| row[left..].copy_from_slice(&part[..width - left]));
        }
    }
}

/// Returns whether the columns kx and -kx are the same.
fn is_self_mirrored(kx: usize, width: usize) -> bool {
    kx == 0 || 2 * kx == width
}

/// Returns the columns of A_k / √2, with Σ A_k² = 1 over the complete plane, and the largest |ky| of each.
#[expect(clippy::cast_precision_loss, reason = "sizes are at most 2^15")]
fn amplitudes(params: &FieldParams, grid: [usize; 2]) -> (Vec<f32>, Vec<usize>) {
    let [width, height] = grid;
    let half = height / 2 + 1;
    let mut power = Vec::with_capacity((width / 2 + 1) * half);
    let mut total = 0.0;
    let along: Vec<f64> = (0..half).map(|ky| ky as f64 / height as f64).collect();
    let mut folded = vec![0.0; half];
    for kx in 0..=width / 2 {
        params.spectrum.folded_density(kx as f64 / width as f64, &along, &mut folded);
        for (ky, &folded) in folded.iter().enumerate() {
            // The constant part of a power law is infinite and left out.
            let s = if folded.is_finite() { folded } else { 0.0 };
            let mirrors = |k, n| if is_self_mirrored(k, n) { 1.0 } else { 2.0 };
            total += mirrors(kx, width) * mirrors(ky, height) * s;
            power.push(s);
        }
    }
    let largest = power.iter().copied().fold(0.0, f64::max);
    let least = largest * NEGLIGIBLE * NEGLIGIBLE;
    // A grid of one pixel has only the constant frequency.
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
            #[expect(clippy::cast_possible_truncation, reason = "the FFT uses single precision")]
            let a = if s > least { (scale * s.sqrt()) as f32 } else { 0.0 };
            a
        }));
    }
    (amplitude, reach)
}
