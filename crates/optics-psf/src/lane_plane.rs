use std::sync::Arc;

use multiversion::multiversion;
pub(crate) use portable_numerics::fourier::ZERO;
use portable_numerics::fourier::{LaneFft, transposed};

use crate::grid::signed;

/// Sequences transformed in parallel: one cache line of single precision.
pub(crate) const LANES: usize = 16;

/// A complex number per sequence: real parts, then imaginary parts. Also two runs of real numbers.
pub(crate) type Lanes = portable_numerics::fourier::Lanes<f32, LANES>;

/// Cached FFT plans by length.
pub(crate) type LanePlans = portable_numerics::fourier::Plans<f32>;

/// Columns of an image transformed together: two per lane, as real and imaginary part.
pub(crate) const STRIPE: usize = 2 * LANES;

/// Frequencies of a real image, on one half of the spectrum and inside an ellipse. Blocks hold [`LANES`] frequencies
/// along y, one per lane, for kx = 0 … r, −r … −1. Lanes beyond the ellipse hold unspecified values.
#[derive(Debug)]
pub(crate) struct LaneSupport {
    /// r and start index of each block.
    reach: Vec<usize>,
    start: Vec<usize>,
    /// Highest frequency along y.
    top: usize,
}

impl LaneSupport {
    /// Selects frequencies up to `radius` cycles per sample. The Nyquist frequency of an even size is excluded; its
    /// sign is ambiguous.
    pub(crate) fn new(width: usize, height: usize, radius: f64) -> Self {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most half the grid size")]
        let bins = |cycles: f64, side: usize| ((cycles.max(0.0) * side as f64) as usize).min((side - 1) / 2);
        let top = bins(radius, height);
        let block = |y: usize| {
            let f = y as f64 / height as f64;
            bins((radius * radius - f * f).max(0.0).sqrt(), width)
        };
        let reach: Vec<usize> = (0..=top).step_by(LANES).map(block).collect();
        let ends = reach.iter().scan(0, |end, r| {
            let start = *end;
            *end += 2 * r + 1;
            Some(start)
        });
        Self { start: ends.collect(), reach, top }
    }

    pub(crate) fn blocks(&self) -> usize {
        self.reach.len()
    }

    pub(crate) fn reach(&self, block: usize) -> usize {
        self.reach[block]
    }

    /// Iterates over frequencies in storage order, in cycles per sample: kx and ky of every lane.
    pub(crate) fn frequencies(&self, width: usize, height: usize) -> impl Iterator<Item = [[f64; 2]; LANES]> {
        self.reach.iter().enumerate().flat_map(move |(block, &reach)| {
            (0..=reach).chain(width - reach..width).map(move |x| {
                let fx = signed(x, width) / width as f64;
                core::array::from_fn(|l| [fx, (block * LANES + l) as f64 / height as f64])
            })
        })
    }

    pub(crate) fn block<'a>(&self, spectrum: &'a [Lanes], block: usize) -> &'a [Lanes] {
        &spectrum[self.start[block]..][..2 * self.reach[block] + 1]
    }

    /// Copies a block of a spectrum to its positions in a line.
    fn put(&self, spectrum: &[Lanes], block: usize, line: &mut [Lanes]) {
        let (low, high) = self.block(spectrum, block).split_at(self.reach[block] + 1);
        line[..low.len()].copy_from_slice(low);
        let behind = line.len() - high.len();
        line[behind..].copy_from_slice(high);
    }

    pub(crate) fn block_mut<'a>(&self, spectrum: &'a mut [Lanes], block: usize) -> &'a mut [Lanes] {
        &mut spectrum[self.start[block]..][..2 * self.reach[block] + 1]
    }
}

/// Transforms between real images of one size and their spectra in single precision, by complex FFTs of two columns at
/// a time.
#[derive(Debug, Clone)]
pub(crate) struct LanePlane {
    pub(crate) width: usize,
    pub(crate) height: usize,
    along_x: Arc<LaneFft<f32>>,
    along_y: Arc<LaneFft<f32>>,
}

/// Working memory of [`LanePlane`].
#[derive(Debug, Clone, Default)]
pub(crate) struct LaneScratch {
    /// Spectra along y, by block, from left to right.
    turned: Vec<Lanes>,
    stripe: Vec<Lanes>,
    line: Vec<Lanes>,
    spare: Vec<Lanes>,
}

impl LanePlane {
    pub(crate) fn new(width: usize, height: usize, plans: &LanePlans) -> Self {
        Self { width, height, along_x: plans.get(width), along_y: plans.get(height) }
    }

    /// Returns 1 / samples.
    #[expect(clippy::cast_possible_truncation, reason = "samples use single precision")]
    pub(crate) fn norm(&self) -> f32 {
        (1.0 / (self.width * self.height) as f64) as f32
    }

    /// Returns the width rounded up to full stripes.
    fn padded(&self) -> usize {
        self.width.next_multiple_of(STRIPE)
    }

    /// Computes the spectrum of an image on `support`, or an empty one if the image is empty. `fill` writes all rows of
    /// the stripe of columns from an index on, with zeros beyond the image, or returns false if the stripe is empty.
    pub(crate) fn forward(
        &self,
        support: &LaneSupport,
        mut fill: impl FnMut(usize, &mut [Lanes]) -> bool,
        spectrum: &mut Vec<Lanes>,
        scratch: &mut LaneScratch,
    ) {
        let padded = self.padded();
        scratch.turned.resize(support.blocks() * padded, ZERO);
        let LaneScratch { turned, stripe, spare, .. } = &mut *scratch;
        stripe.resize(self.height, ZERO);
        spare.resize(self.height, ZERO);
        let mut nonzero = false;
        for left in (0..padded).step_by(STRIPE) {
            if fill(left, stripe) {
                nonzero = true;
                self.along_y.process(stripe, spare);
                split(stripe, support.top, turned, padded, left);
            } else {
                for block in turned.chunks_exact_mut(padded) {
                    block[left..left + STRIPE].fill(ZERO);
                }
            }
        }
        spectrum.clear();
        if nonzero {
            self.finish(support, spectrum, scratch);
        }
    }

    /// Transforms spectra along y to the spectrum.
    fn finish(&self, support: &LaneSupport, spectrum: &mut Vec<Lanes>, scratch: &mut LaneScratch) {
        let LaneScratch { turned, line, spare, .. } = scratch;
        line.resize(self.width, ZERO);
        spare.resize(self.width, ZERO);
        for (block, reach) in turned.chunks_exact(self.padded()).zip(&support.reach) {
            line.copy_from_slice(&block[..self.width]);
            self.along_x.process(line, spare);
            spectrum.extend_from_slice(&line[..=*reach]);
            spectrum.extend_from_slice(&line[self.width - reach..]);
        }
    }

    /// Transforms a spectrum to spectra along y.
    fn begin(&self, support: &LaneSupport, mut fill: impl FnMut(usize, &mut [Lanes]), scratch: &mut LaneScratch) {
        let padded = self.padded();
        scratch.turned.resize(support.blocks() * padded, ZERO);
        let LaneScratch { turned, line, spare, .. } = scratch;
        line.resize(self.width, ZERO);
        spare.resize(self.width, ZERO);
        for (k, block) in turned.chunks_exact_mut(padded).enumerate() {
            line.fill(ZERO);
            fill(k, line);
            self.along_x.process(line, spare);
            // The inverse transform equals the forward transform of the reversed sequence, and its reversed result.
            block[0] = line[0];
            for (to, from) in block[1..].iter_mut().zip(line[1..].iter().rev()) {
                *to = *from;
            }
            block[self.width..].fill(ZERO);
        }
    }

    /// Computes the image of a spectrum, times the number of samples. `fill` adds one block of the spectrum, kx = 0 …
    /// and … −1, to zeros. `visit` receives all rows of each stripe that covers the first `columns`.
    pub(crate) fn inverse(
        &self,
        support: &LaneSupport,
        fill: impl FnMut(usize, &mut [Lanes]),
        columns: usize,
        mut visit: impl FnMut(usize, &[Lanes]),
        scratch: &mut LaneScratch,
    ) {
        self.begin(support, fill, scratch);
        let LaneScratch { turned, stripe, spare, .. } = scratch;
        stripe.resize(self.height, ZERO);
        spare.resize(self.height, ZERO);
        for left in (0..columns.min(self.width)).step_by(STRIPE) {
            join(turned, self.padded(), left, support.top, stripe);
            self.along_y.process(stripe, spare);
            visit(left, stripe);
        }
    }

    /// Writes the first `columns` of the image of a spectrum, times the number of samples.
    pub(crate) fn image_into(
        &self,
        support: &LaneSupport,
        spectrum: &[Lanes],
        columns: usize,
        image: &mut [f32],
        scratch: &mut LaneScratch,
    ) {
        let fill = |block: usize, line: &mut [Lanes]| support.put(spectrum, block, line);
        let keep = |left: usize, stripe: &[Lanes]| {
            for (row, stripe) in image.chunks_exact_mut(columns).zip(stripe) {
                for (to, from) in row[left..].iter_mut().zip(stripe.as_flattened()) {
                    *to = *from;
                }
            }
        };
        self.inverse(support, fill, columns, keep, scratch);
    }

    /// Computes the spectrum of `map(image)`, for the image of a spectrum times the number of samples.
    pub(crate) fn mapped(
        &self,
        support: &LaneSupport,
        fill: impl FnMut(usize, &mut [Lanes]),
        mut map: impl FnMut(&mut [Lanes]),
        spectrum: &mut Vec<Lanes>,
        scratch: &mut LaneScratch,
    ) {
        self.begin(support, fill, scratch);
        let padded = self.padded();
        let LaneScratch { turned, stripe, spare, .. } = &mut *scratch;
        stripe.resize(self.height, ZERO);
        spare.resize(self.height, ZERO);
        for left in (0..padded).step_by(STRIPE) {
            join(turned, padded, left, support.top, stripe);
            self.along_y.process(stripe, spare);
            map(stripe);
            self.along_y.process(stripe, spare);
            split(stripe, support.top, turned, padded, left);
        }
        spectrum.clear();
        self.finish(support, spectrum, scratch);
    }
}

type Square = portable_numerics::fourier::Square<f32, LANES>;

/// Separate calls: `map` would become a function without vector instructions.
#[inline(always)]
fn all_transposed([a, b, c, d]: &[Square; 4]) -> [Square; 4] {
    [transposed(a), transposed(b), transposed(c), transposed(d)]
}

/// Splits the spectra of a stripe of real columns, up to the frequency `top`, and stores them next to each other.
#[multiversion(targets = "simd")]
fn split(stripe: &[Lanes], top: usize, turned: &mut [Lanes], padded: usize, left: usize) {
    for (block, turned) in turned.chunks_exact_mut(padded).take(top / LANES + 1).enumerate() {
        let mut parts = [[[0.0; LANES]; LANES]; 4];
        let [a_re, a_im, b_re, b_im] = &mut parts;
        for i in 0..LANES.min(top + 1 - block * LANES) {
            let k = block * LANES + i;
            let (z, m) = (&stripe[k], &stripe[if k == 0 { 0 } else { stripe.len() - k }]);
            // Z = A + iB, so A = (Z(k) + Z*(−k))/2 and B = (Z(k) − Z*(−k))/2i.
            for l in 0..LANES {
                a_re[i][l] = 0.5 * (z[0][l] + m[0][l]);
                a_im[i][l] = 0.5 * (z[1][l] - m[1][l]);
                b_re[i][l] = 0.5 * (z[1][l] + m[1][l]);
                b_im[i][l] = 0.5 * (m[0][l] - z[0][l]);
            }
        }
        let [a_re, a_im, b_re, b_im] = all_transposed(&parts);
        let (a, b) = turned[left..left + STRIPE].split_at_mut(LANES);
        for i in 0..LANES {
            a[i] = [a_re[i], a_im[i]];
            b[i] = [b_re[i], b_im[i]];
        }
    }
}

/// Combines the spectra along y of a stripe, reversed, so that a forward transform gives the image.
#[multiversion(targets = "simd")]
fn join(turned: &[Lanes], padded: usize, left: usize, top: usize, stripe: &mut [Lanes]) {
    let height = stripe.len();
    stripe[top + 1..height - top].fill(ZERO);
    for (block, turned) in turned.chunks_exact(padded).take(top / LANES + 1).enumerate() {
        let mut parts = [[[0.0; LANES]; LANES]; 4];
        let (a, b) = turned[left..left + STRIPE].split_at(LANES);
        for i in 0..LANES {
            [parts[0][i], parts[1][i]] = a[i];
            [parts[2][i], parts[3][i]] = b[i];
        }
        let [a_re, a_im, b_re, b_im] = all_transposed(&parts);
        for i in 0..LANES.min(top + 1 - block * LANES) {
            let k = block * LANES + i;
            // A + iB at k, A* + iB* at −k: a real column in each part.
            let mut sums = [ZERO; 2];
            for l in 0..LANES {
                sums[0][0][l] = a_re[i][l] + b_im[i][l];
                sums[0][1][l] = b_re[i][l] - a_im[i][l];
                sums[1][0][l] = a_re[i][l] - b_im[i][l];
                sums[1][1][l] = a_im[i][l] + b_re[i][l];
            }
            stripe[k] = sums[0];
            stripe[if k == 0 { 0 } else { height - k }] = sums[1];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_xoshiro::Xoshiro256PlusPlus;
    use rand_xoshiro::rand_core::{Rng, SeedableRng};

    /// Reference: one frequency at a time.
    fn oracle(image: &[f32], width: usize, [fx, fy]: [f64; 2]) -> [f64; 2] {
        let mut sum = [0.0; 2];
        for (i, &v) in image.iter().enumerate() {
            let (c, s) = crate::pupil::turn(-(fx * (i % width) as f64 + fy * (i / width) as f64));
            sum[0] += f64::from(v) * c;
            sum[1] += f64::from(v) * s;
        }
        sum
    }

    fn fill(image: &[f32], width: usize) -> impl FnMut(usize, &mut [Lanes]) -> bool {
        move |left, stripe| {
            for (row, stripe) in image.chunks_exact(width).zip(stripe.iter_mut()) {
                for (x, to) in stripe.as_flattened_mut().iter_mut().enumerate() {
                    *to = row.get(left + x).copied().unwrap_or(0.0);
                }
            }
            stripe.iter().flatten().flatten().any(|v| *v != 0.0)
        }
    }

    #[test]
    fn spectra_match_direct_sums_and_round_trip() {
        for (width, height, radius) in [(27, 39, 0.3), (90, 75, 0.26), (40, 98, 9.0), (33, 1, 0.2)] {
            let mut rng = Xoshiro256PlusPlus::seed_from_u64(0x5EC7);
            let mut number = || (rng.next_u32() >> 8) as f32 / 16_777_216.0;
            let mut image: Vec<f32> = (0..width * height).map(|_| number()).collect();
            if width > 80 {
                image.iter_mut().enumerate().filter(|(i, _)| i % width < 40).for_each(|(_, v)| *v = 0.0);
            }
            let plane = LanePlane::new(width, height, &LanePlans::default());
            let support = LaneSupport::new(width, height, radius);
            let (mut spectrum, mut scratch) = (Vec::new(), LaneScratch::default());
            plane.forward(&support, fill(&image, width), &mut spectrum, &mut scratch);
            let inside = |x: f64, y: f64| x * x + y * y <= radius * radius;
            // Direct sums, and the coefficients inside the ellipse.
            let mut kept = vec![ZERO; spectrum.len()];
            let mut known = Vec::new();
            for block in 0..support.blocks() {
                let (reach, from) = (support.reach(block), support.block(&spectrum, block));
                let to = support.block_mut(&mut kept, block);
                for (i, (from, to)) in from.iter().zip(to).enumerate() {
                    let kx = if i <= reach { i as f64 } else { i as f64 - (2 * reach + 1) as f64 };
                    for l in 0..LANES {
                        let ky = block * LANES + l;
                        let f = [kx / width as f64, ky as f64 / height as f64];
                        if 2 * ky < height && inside(f[0], f[1]) {
                            (to[0][l], to[1][l]) = (from[0][l], from[1][l]);
                            known.push((block, i, l, f));
                        }
                    }
                }
            }
            for &(block, i, l, f) in known.iter().step_by(3) {
                let value = support.block(&spectrum, block)[i];
                let [re, im] = oracle(&image, width, f);
                let error = (f64::from(value[0][l]) - re).abs() + (f64::from(value[1][l]) - im).abs();
                assert!(error < 4e-4, "{f:?}: {error}");
            }
            // The image of these coefficients has the same spectrum there.
            let mut back = vec![0.0; image.len()];
            plane.image_into(&support, &kept, width, &mut back, &mut scratch);
            for &(block, i, l, f) in known.iter().step_by(7) {
                let value = support.block(&spectrum, block)[i];
                let [re, im] = oracle(&back, width, f).map(|v| v / (width * height) as f64);
                let error = (f64::from(value[0][l]) - re).abs() + (f64::from(value[1][l]) - im).abs();
                assert!(error < 4e-4, "{f:?}: {error}");
            }
        }
    }
}
