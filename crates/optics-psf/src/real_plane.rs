use core::ops::Range;

use rustfft::num_complex::Complex32;

use crate::fft::{Pair, Plans, signed};

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
        Self { reach, start }
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

    /// How far a column reaches; none beyond the last.
    pub(crate) fn reach(&self, column: usize) -> Option<usize> {
        self.reach.get(column).copied()
    }

    /// Of a spectrum at these places, a column's part with |ky| up to `reach` or as far as there is
    /// one: ky = 0 …, and … −1.
    pub(crate) fn column<'a>(&self, spectrum: &'a [Complex32], column: usize, reach: usize) -> [&'a [Complex32]; 2] {
        let Some(own) = self.reach(column) else { return [&[], &[]] };
        let [up, down] = self.places(column);
        let reach = reach.min(own);
        [&spectrum[up.start..=up.start + reach], &spectrum[down.end - reach..down.end]]
    }
}

/// Real images of one size and their spectra, in single precision, by complex FFTs of two rows at a
/// time.
#[derive(Clone)]
pub(crate) struct RealPlane {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Forward and inverse.
    rows: Pair,
    columns: Pair,
}

/// Working memory of [`RealPlane`].
#[derive(Debug, Clone, Default)]
pub(crate) struct PlaneScratch {
    rows: Vec<Complex32>,
    columns: Vec<Complex32>,
    fft: Vec<Complex32>,
    line: Vec<f32>,
}

impl RealPlane {
    pub(crate) fn new(width: usize, height: usize, plans: &Plans) -> Self {
        Self { width, height, rows: plans.pair(width), columns: plans.pair(height) }
    }

    /// 1 / samples.
    #[expect(clippy::cast_possible_truncation, reason = "f32 beside f32 samples")]
    pub(crate) fn norm(&self) -> f32 {
        (1.0 / (self.width * self.height) as f64) as f32
    }

    fn scratch_len(&self) -> usize {
        self.rows.iter().chain(&self.columns).map(|t| t.get_inplace_scratch_len()).max().unwrap_or(0)
    }

    /// The spectrum of an image at the places of `support`, or an empty one if the image is empty. `row` fills each
    /// of `rows`, or says that it is empty, as all other rows are.
    pub(crate) fn forward(
        &self,
        support: &Support,
        rows: Range<usize>,
        mut row: impl FnMut(usize, &mut [f32]) -> bool,
        spectrum: &mut Vec<Complex32>,
        scratch: &mut PlaneScratch,
    ) {
        let (width, height, columns) = (self.width, self.height, support.columns());
        let stride = height + SKEW;
        scratch.rows.clear();
        scratch.rows.resize(PAIRS * width, Complex32::ZERO);
        scratch.columns.resize(columns * stride, Complex32::ZERO);
        scratch.fft.resize(self.scratch_len(), Complex32::ZERO);
        scratch.line.resize(width, 0.0);
        let PlaneScratch { rows: pairs, columns: turned, fft, line } = scratch;
        let mut lit_so_far = false;
        for top in (0..height).step_by(ROWS) {
            let here = ROWS.min(height - top);
            let mut any = false;
            let mut fill = |y: usize, line: &mut [f32]| y < top + here && rows.contains(&y) && row(y, line);
            for (pair, buffer) in pairs.chunks_exact_mut(width).take(here.div_ceil(2)).enumerate() {
                let y = top + 2 * pair;
                let lit = fill(y, line);
                if lit {
                    for (z, &v) in buffer.iter_mut().zip(&*line) {
                        *z = Complex32::new(v, 0.0);
                    }
                } else {
                    buffer.fill(Complex32::ZERO);
                }
                let lit_below = fill(y + 1, line);
                if lit_below {
                    for (z, &v) in buffer.iter_mut().zip(&*line) {
                        z.im = v;
                    }
                }
                if lit || lit_below {
                    self.rows[0].process_with_scratch(buffer, fft);
                    any = true;
                }
            }
            lit_so_far |= any;
            for (x, column) in turned.chunks_exact_mut(stride).take(columns).enumerate() {
                let column = &mut column[top..top + here];
                if !any {
                    column.fill(Complex32::ZERO);
                    continue;
                }
                let mirror = if x == 0 { 0 } else { width - x };
                for (pair, rows) in column.chunks_mut(2).enumerate() {
                    // Z = A + iB, so A = (Z(k) + Z*(−k))/2 and B = (Z(k) − Z*(−k))/2i.
                    let (z, m) = (pairs[pair * width + x], pairs[pair * width + mirror]);
                    rows[0] = Complex32::new(0.5 * (z.re + m.re), 0.5 * (z.im - m.im));
                    if let Some(below) = rows.get_mut(1) {
                        *below = Complex32::new(0.5 * (z.im + m.im), 0.5 * (m.re - z.re));
                    }
                }
            }
        }
        spectrum.clear();
        if !lit_so_far {
            return;
        }
        for (column, reach) in turned.chunks_exact_mut(stride).zip(&support.reach) {
            let column = &mut column[..height];
            self.columns[0].process_with_scratch(column, fft);
            spectrum.extend_from_slice(&column[..=*reach]);
            spectrum.extend_from_slice(&column[height - reach..]);
        }
    }

    /// The image of a spectrum at the places of `support`, times the number of samples. `fill` adds column after
    /// column, ky = 0 … r and −r … −1, to zeros; `row` gets the first `rows` rows, one after the other.
    pub(crate) fn inverse(
        &self,
        support: &Support,
        mut fill: impl FnMut(usize, [&mut [Complex32]; 2]),
        rows: usize,
        mut row: impl FnMut(usize, &[f32]),
        scratch: &mut PlaneScratch,
    ) {
        let (width, height, columns) = (self.width, self.height, support.columns());
        let stride = height + SKEW;
        scratch.rows.clear();
        scratch.rows.resize(PAIRS * width, Complex32::ZERO);
        scratch.columns.resize(columns * stride, Complex32::ZERO);
        scratch.fft.resize(self.scratch_len(), Complex32::ZERO);
        scratch.line.resize(width, 0.0);
        let PlaneScratch { rows: pairs, columns: turned, fft, line } = scratch;
        for (x, (column, reach)) in turned.chunks_exact_mut(stride).zip(&support.reach).enumerate() {
            let column = &mut column[..height];
            column.fill(Complex32::ZERO);
            let (up, rest) = column.split_at_mut(reach + 1);
            let below = rest.len() - reach;
            fill(x, [up, &mut rest[below..]]);
            self.columns[1].process_with_scratch(column, fft);
        }
        for top in (0..rows.min(height)).step_by(ROWS) {
            let here = ROWS.min(height - top);
            for buffer in pairs.chunks_exact_mut(width) {
                buffer[columns..=width - columns].fill(Complex32::ZERO);
            }
            for (x, column) in turned.chunks_exact(stride).take(columns).enumerate() {
                for (pair, rows) in column[top..top + here].chunks(2).enumerate() {
                    let (a, b) = (rows[0], rows.get(1).copied().unwrap_or(Complex32::ZERO));
                    let buffer = &mut pairs[pair * width..(pair + 1) * width];
                    // A + iB at k, A* + iB* at −k: a real row in each part.
                    if x > 0 {
                        buffer[width - x] = Complex32::new(a.re + b.im, b.re - a.im);
                    }
                    buffer[x] = Complex32::new(a.re - b.im, a.im + b.re);
                }
            }
            let here = ROWS.min(rows - top);
            for (pair, buffer) in pairs.chunks_exact_mut(width).take(here.div_ceil(2)).enumerate() {
                self.rows[1].process_with_scratch(buffer, fft);
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
    use crate::Fft;
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
            let plane = RealPlane::new(width, height, &Plans::new(fft));
            let support = Support::new(width, height, radius);
            let (mut spectrum, mut scratch) = (Vec::new(), PlaneScratch::default());
            let row = |y: usize, row: &mut [f32]| {
                row.copy_from_slice(&image[y * width..(y + 1) * width]);
                row.iter().any(|v| *v != 0.0)
            };
            plane.forward(&support, 0..height, row, &mut spectrum, &mut scratch);
            assert_eq!(spectrum.len(), support.frequencies(width, height).count());
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
            let fill = |x: usize, to: [&mut [Complex32]; 2]| {
                let reach = support.reach(x).unwrap();
                for (to, from) in to.into_iter().zip(support.column(&spectrum, x, reach)) {
                    to.copy_from_slice(from);
                }
            };
            plane.inverse(&support, fill, height, keep, &mut scratch);
            for (value, &f) in spectrum.iter().zip(&frequencies).step_by(7) {
                let [re, im] = oracle(&back, width, f).map(|v| v / (width * height) as f64);
                assert!((f64::from(value.re) - re).abs() + (f64::from(value.im) - im).abs() < 2e-4);
            }
        }
    }

    #[expect(clippy::cast_possible_truncation, reason = "small whole numbers")]
    #[test]
    fn columns_are_found_in_a_larger_support() {
        let (large, small) = (Support::new(32, 24, 0.4), Support::new(32, 24, 0.17));
        let mark = |[x, y]: [f64; 2]| Complex32::new((32.0 * x) as f32, (24.0 * y) as f32);
        let [all, few] = [&large, &small].map(|s| s.frequencies(32, 24).map(mark).collect::<Vec<_>>());
        for x in 0..large.columns() {
            let reach = small.reach(x).unwrap_or(0);
            let [up, down] = small.column(&few, x, usize::MAX);
            if up.is_empty() {
                assert!(x >= small.columns() && down.is_empty());
            } else {
                assert_eq!(large.column(&all, x, reach), [up, down]);
                assert_eq!((up.len(), down.len()), (reach + 1, reach));
            }
        }
    }

    #[test]
    fn empty_images_have_empty_spectra() {
        let plane = RealPlane::new(12, 10, &Plans::new(Fft::Portable));
        let (mut spectrum, mut scratch) = (vec![Complex32::ONE; 3], PlaneScratch::default());
        plane.forward(&Support::new(12, 10, 0.4), 2..7, |_, _| false, &mut spectrum, &mut scratch);
        assert!(spectrum.is_empty());
    }
}
