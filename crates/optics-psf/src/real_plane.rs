use core::ops::Range;
use std::sync::Arc;

use rustfft::num_complex::Complex32;
use rustfft::{Fft as Transform, FftDirection};

use crate::fft::{Fft, signed};

/// Pairs of rows that are transformed together: what they have of a column fills two cache lines.
const PAIRS: usize = 8;
const ROWS: usize = 2 * PAIRS;

/// Numbers between columns: with sides that are powers of two, pieces of columns would otherwise share the few
/// places of a cache.
const SKEW: usize = 8;

/// Frequencies of a real image on one side of the spectrum and inside an ellipse: columns 0, 1 … of
/// frequencies along x, each with ky = 0 … r, −r … −1.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Support {
    /// r of each column, and where it begins.
    reach: Vec<usize>,
    start: Vec<usize>,
    len: usize,
}

impl Support {
    /// Frequencies up to `radius` cycles per sample on a grid; the highest one of an even side, whose
    /// sign is ambiguous, never.
    pub(crate) fn new(width: usize, height: usize, radius: f64) -> Self {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most half a side")]
        let bins = |cycles: f64, side: usize| ((cycles.max(0.0) * side as f64) as usize).min((side - 1) / 2);
        let column = |x: usize| {
            let f = x as f64 / width as f64;
            bins((radius * radius - f * f).max(0.0).sqrt(), height)
        };
        let reach: Vec<usize> = (0..=bins(radius, width)).map(column).collect();
        let mut start = Vec::with_capacity(reach.len());
        let mut len = 0;
        for r in &reach {
            start.push(len);
            len += 2 * r + 1;
        }
        Self { reach, start, len }
    }

    pub(crate) fn len(&self) -> usize {
        self.len
    }

    pub(crate) fn columns(&self) -> usize {
        self.reach.len()
    }

    /// The places of a column, ky = 0 … r, and ky = −r … −1.
    fn places(&self, column: usize) -> [Range<usize>; 2] {
        let (start, reach) = (self.start[column], self.reach[column]);
        [start..start + reach + 1, start + reach + 1..start + 2 * reach + 1]
    }

    /// Frequencies in cycles per sample, in the order of their places.
    pub(crate) fn frequencies(&self, width: usize, height: usize) -> impl Iterator<Item = [f64; 2]> {
        self.reach.iter().enumerate().flat_map(move |(x, &reach)| {
            let fx = x as f64 / width as f64;
            (0..=reach).chain(height - reach..height).map(move |y| [fx, signed(y, height) / height as f64])
        })
    }

    /// For each run of places in `self`, the run of the same frequencies in `larger`.
    pub(crate) fn runs<'a>(&'a self, larger: &'a Self) -> impl Iterator<Item = (Range<usize>, Range<usize>)> {
        (0..self.columns()).flat_map(move |x| {
            let ([up, down], [above, below]) = (self.places(x), larger.places(x));
            let above = above.start..above.start + up.len();
            let below = below.end - down.len()..below.end;
            [(up, above), (down, below)]
        })
    }
}

/// Real images of one size and their spectra, in single precision, by complex FFTs of two rows at a
/// time.
#[derive(Clone)]
pub(crate) struct RealPlane {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Forward and inverse.
    rows: [Arc<dyn Transform<f32>>; 2],
    columns: [Arc<dyn Transform<f32>>; 2],
}

/// Working memory of [`RealPlane`].
#[derive(Debug, Clone, Default)]
pub(crate) struct PlaneScratch {
    rows: Vec<Complex32>,
    columns: Vec<Complex32>,
    fft: Vec<Complex32>,
}

impl RealPlane {
    pub(crate) fn new(width: usize, height: usize, fft: Fft) -> Self {
        let plan = |len| [FftDirection::Forward, FftDirection::Inverse].map(|direction| fft.plan(len, direction));
        Self { width, height, rows: plan(width), columns: plan(height) }
    }

    /// 1 / samples.
    #[expect(clippy::cast_possible_truncation, reason = "f32 beside f32 samples")]
    pub(crate) fn norm(&self) -> f32 {
        (1.0 / (self.width * self.height) as f64) as f32
    }

    fn scratch_len(&self) -> usize {
        self.rows.iter().chain(&self.columns).map(|t| t.get_inplace_scratch_len()).max().unwrap_or(0)
    }

    /// The spectrum of an image at the places of `support`. `row` fills row after row, or says that
    /// it is empty.
    pub(crate) fn forward(
        &self,
        support: &Support,
        mut row: impl FnMut(usize, &mut [f32]) -> bool,
        spectrum: &mut Vec<Complex32>,
        line: &mut Vec<f32>,
        scratch: &mut PlaneScratch,
    ) {
        let (width, height, columns) = (self.width, self.height, support.columns());
        scratch.rows.clear();
        scratch.rows.resize(PAIRS * width, Complex32::ZERO);
        let stride = height + SKEW;
        scratch.columns.resize(columns * stride, Complex32::ZERO);
        scratch.fft.resize(self.scratch_len(), Complex32::ZERO);
        line.resize(width, 0.0);
        for top in (0..height).step_by(ROWS) {
            let here = ROWS.min(height - top);
            let mut any = false;
            for (pair, buffer) in scratch.rows.chunks_exact_mut(width).take(here.div_ceil(2)).enumerate() {
                let lit = row(top + 2 * pair, line);
                for (z, &v) in buffer.iter_mut().zip(&*line) {
                    *z = Complex32::new(if lit { v } else { 0.0 }, 0.0);
                }
                let lit_below = 2 * pair + 1 < here && row(top + 2 * pair + 1, line);
                if lit_below {
                    for (z, &v) in buffer.iter_mut().zip(&*line) {
                        z.im = v;
                    }
                }
                if lit || lit_below {
                    self.rows[0].process_with_scratch(buffer, &mut scratch.fft);
                    any = true;
                }
            }
            for (x, column) in scratch.columns.chunks_exact_mut(stride).enumerate() {
                let column = &mut column[top..top + here];
                if !any {
                    column.fill(Complex32::ZERO);
                    continue;
                }
                let mirror = if x == 0 { 0 } else { width - x };
                for (pair, rows) in column.chunks_mut(2).enumerate() {
                    // Z = A + iB, so A = (Z(k) + Z*(−k))/2 and B = (Z(k) − Z*(−k))/2i.
                    let (z, m) = (scratch.rows[pair * width + x], scratch.rows[pair * width + mirror]);
                    rows[0] = Complex32::new(0.5 * (z.re + m.re), 0.5 * (z.im - m.im));
                    if let Some(below) = rows.get_mut(1) {
                        *below = Complex32::new(0.5 * (z.im + m.im), 0.5 * (m.re - z.re));
                    }
                }
            }
        }
        spectrum.clear();
        for (column, reach) in scratch.columns.chunks_exact_mut(stride).zip(&support.reach) {
            let column = &mut column[..height];
            self.columns[0].process_with_scratch(column, &mut scratch.fft);
            spectrum.extend_from_slice(&column[..=*reach]);
            spectrum.extend_from_slice(&column[height - reach..]);
        }
    }

    /// The image of a spectrum at the places of `support`, times the number of samples: `row` gets
    /// row after row.
    pub(crate) fn inverse(
        &self,
        support: &Support,
        spectrum: &[Complex32],
        mut row: impl FnMut(usize, &[f32]),
        line: &mut Vec<f32>,
        scratch: &mut PlaneScratch,
    ) {
        let (width, height, columns) = (self.width, self.height, support.columns());
        scratch.rows.clear();
        scratch.rows.resize(PAIRS * width, Complex32::ZERO);
        let stride = height + SKEW;
        scratch.columns.resize(columns * stride, Complex32::ZERO);
        scratch.fft.resize(self.scratch_len(), Complex32::ZERO);
        line.resize(width, 0.0);
        for (x, column) in scratch.columns.chunks_exact_mut(stride).enumerate() {
            let reach = support.reach[x];
            let [up, down] = support.places(x);
            column[..=reach].copy_from_slice(&spectrum[up]);
            column[reach + 1..height - reach].fill(Complex32::ZERO);
            column[height - reach..height].copy_from_slice(&spectrum[down]);
            self.columns[1].process_with_scratch(&mut column[..height], &mut scratch.fft);
        }
        for top in (0..height).step_by(ROWS) {
            let here = ROWS.min(height - top);
            for buffer in scratch.rows.chunks_exact_mut(width) {
                buffer[columns..=width - columns].fill(Complex32::ZERO);
            }
            for (x, column) in scratch.columns.chunks_exact(stride).enumerate() {
                for (pair, rows) in column[top..top + here].chunks(2).enumerate() {
                    let (a, b) = (rows[0], rows.get(1).copied().unwrap_or(Complex32::ZERO));
                    let buffer = &mut scratch.rows[pair * width..(pair + 1) * width];
                    // A + iB at k, A* + iB* at −k: a real row in each part.
                    if x > 0 {
                        buffer[width - x] = Complex32::new(a.re + b.im, b.re - a.im);
                    }
                    buffer[x] = Complex32::new(a.re - b.im, a.im + b.re);
                }
            }
            for (pair, buffer) in scratch.rows.chunks_exact_mut(width).take(here.div_ceil(2)).enumerate() {
                self.rows[1].process_with_scratch(buffer, &mut scratch.fft);
                for (v, z) in line.iter_mut().zip(&*buffer) {
                    *v = z.re;
                }
                row(top + 2 * pair, line);
                if 2 * pair + 1 == here {
                    continue;
                }
                for (v, z) in line.iter_mut().zip(&*buffer) {
                    *v = z.im;
                }
                row(top + 2 * pair + 1, line);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_xoshiro::Xoshiro256PlusPlus;
    use rand_xoshiro::rand_core::{Rng, SeedableRng};

    /// One frequency after the other.
    fn oracle(image: &[f32], width: usize, [fx, fy]: [f64; 2]) -> [f64; 2] {
        let mut sum = [0.0; 2];
        for (i, &v) in image.iter().enumerate() {
            let (c, s) = crate::pupil::turn(-(fx * (i % width) as f64 + fy * (i / width) as f64));
            sum[0] += f64::from(v) * c;
            sum[1] += f64::from(v) * s;
        }
        sum
    }

    #[test]
    fn spectra_are_the_sums_and_come_back() {
        let (width, height) = (27, 39);
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(0x5EC7);
        let mut image: Vec<f32> = (0..width * height).map(|_| (rng.next_u32() >> 8) as f32 / 16_777_216.0).collect();
        image[width * 16..width * 33].fill(0.0);
        for (fft, radius) in [(Fft::Fastest, 0.3), (Fft::Portable, 0.3), (Fft::Portable, 9.0)] {
            let plane = RealPlane::new(width, height, fft);
            let support = Support::new(width, height, radius);
            let (mut spectrum, mut line, mut scratch) = (Vec::new(), Vec::new(), PlaneScratch::default());
            let row = |y: usize, row: &mut [f32]| {
                row.copy_from_slice(&image[y * width..(y + 1) * width]);
                row.iter().any(|v| *v != 0.0)
            };
            plane.forward(&support, row, &mut spectrum, &mut line, &mut scratch);
            assert_eq!(spectrum.len(), support.len());
            let frequencies: Vec<[f64; 2]> = support.frequencies(width, height).collect();
            for (value, &f) in spectrum.iter().zip(&frequencies) {
                let [re, im] = oracle(&image, width, f);
                let error = (f64::from(value.re) - re).abs() + (f64::from(value.im) - im).abs();
                assert!(error < 2e-4, "{f:?}: {value} {re} {im}");
                assert!(f[0] * f[0] + f[1] * f[1] <= radius * radius + 1e-12);
            }
            // The image of what was kept has the same spectrum there.
            let mut back = vec![0.0; image.len()];
            let keep = |y: usize, row: &[f32]| back[y * width..(y + 1) * width].copy_from_slice(row);
            plane.inverse(&support, &spectrum, keep, &mut line, &mut scratch);
            for (value, &f) in spectrum.iter().zip(&frequencies).step_by(7) {
                let [re, im] = oracle(&back, width, f).map(|v| v / (width * height) as f64);
                assert!((f64::from(value.re) - re).abs() + (f64::from(value.im) - im).abs() < 2e-4);
            }
        }
    }

    #[test]
    fn runs_match_frequencies() {
        let (large, small) = (Support::new(32, 24, 0.4), Support::new(32, 24, 0.17));
        let all: Vec<[f64; 2]> = large.frequencies(32, 24).collect();
        let few: Vec<[f64; 2]> = small.frequencies(32, 24).collect();
        let mut seen = 0;
        for (from, to) in small.runs(&large) {
            seen += from.len();
            assert!(from.zip(to).all(|(i, j)| few[i] == all[j]));
        }
        assert_eq!(seen, small.len());
    }
}
