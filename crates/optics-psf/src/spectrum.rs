//! Fourier transforms between images and their spectra inside an ellipse of frequencies.
//!
//! A complex image holds two real ones. Sixteen columns, then sixteen rows of frequencies, are transformed at once, one
//! in each vector lane.

use core::ops::Range;
use std::sync::Arc;

use multiversion::multiversion;
pub(crate) use portable_numerics::fourier::ZERO;
use portable_numerics::fourier::{LaneFft, transposed};

/// Sequences transformed in parallel: one cache line of single precision.
pub(crate) const LANES: usize = 16;

/// A complex number per sequence: real parts, then imaginary parts.
pub(crate) type Lanes = portable_numerics::fourier::Lanes<f32, LANES>;

/// Cached FFT plans by length.
pub(crate) type LanePlans = portable_numerics::fourier::Plans<f32>;

/// Selects frequencies inside an ellipse.
///
/// Frequencies ky ≥ 0 form blocks of [`LANES`], one per lane. A block has kx from −r to r, where r is its reach.
#[derive(Debug)]
pub(crate) struct Support {
    reach: Vec<usize>,
    /// Index of the first kx of each block in a spectrum.
    start: Vec<usize>,
    /// Largest ky.
    top: usize,
}

impl Support {
    /// Selects frequencies up to `radius` cycles per sample. The Nyquist frequency of an even size is excluded; its
    /// sign is ambiguous.
    pub(crate) fn new([width, height]: [usize; 2], radius: f64) -> Self {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most half the grid size")]
        let bins = |cycles: f64, side: usize| ((cycles.max(0.0) * side as f64) as usize).min((side - 1) / 2);
        let top = bins(radius, height);
        let reach_of = |y: usize| {
            let f = y as f64 / height as f64;
            bins((radius * radius - f * f).max(0.0).sqrt(), width)
        };
        let reach: Vec<usize> = (0..=top).step_by(LANES).map(reach_of).collect();
        let starts = reach.iter().scan(0, |end, r| {
            let start = *end;
            *end += 2 * r + 1;
            Some(start)
        });
        Self { start: starts.collect(), reach, top }
    }

    pub(crate) fn blocks(&self) -> usize {
        self.reach.len()
    }

    pub(crate) fn reach(&self, block: usize) -> usize {
        self.reach[block]
    }

    /// Iterates over frequencies in the order of a spectrum, in cycles per sample: kx and ky of every lane.
    pub(crate) fn frequencies(&self, [width, height]: [usize; 2]) -> impl Iterator<Item = [[f64; 2]; LANES]> {
        self.reach.iter().enumerate().flat_map(move |(block, &reach)| {
            (0..=2 * reach).map(move |i| {
                let fx = (i as f64 - reach as f64) / width as f64;
                core::array::from_fn(|l| [fx, (block * LANES + l) as f64 / height as f64])
            })
        })
    }

    /// Returns the indices of a block in a spectrum.
    pub(crate) fn range(&self, block: usize) -> Range<usize> {
        self.start[block]..self.start[block] + 2 * self.reach[block] + 1
    }

    /// Returns the number of lanes of a block with a frequency.
    fn lanes(&self, block: usize) -> usize {
        LANES.min(self.top + 1 - block * LANES)
    }
}

/// The spectrum F of an image on a [`Support`]; empty vectors stand for zero. Lanes without a frequency hold
/// unspecified values.
#[derive(Debug, Clone, Default)]
pub(crate) struct Spectrum {
    /// F(kx, ky).
    pub(crate) plus: Vec<Lanes>,
    /// F(−kx, −ky) at the index of F(kx, ky). Empty for a real image, where it is the conjugate.
    pub(crate) minus: Vec<Lanes>,
}

impl Spectrum {
    pub(crate) fn is_empty(&self) -> bool {
        self.plus.is_empty()
    }

    pub(crate) fn clear(&mut self) {
        self.plus.clear();
        self.minus.clear();
    }
}

/// Transforms of images of one size.
#[derive(Debug, Clone)]
pub(crate) struct Grid {
    pub(crate) width: usize,
    pub(crate) height: usize,
    along_x: Arc<LaneFft<f32>>,
    along_y: Arc<LaneFft<f32>>,
}

/// Working memory of [`Grid`].
#[derive(Debug, Clone, Default)]
pub(crate) struct GridScratch {
    /// For each block of a support: the rows of its frequencies, from left to right.
    turned: Vec<Lanes>,
    /// Columns of the image, stripe by stripe.
    columns: Vec<Lanes>,
    buffers: [Vec<Lanes>; 2],
    plus: Vec<Lanes>,
    minus: Vec<Lanes>,
    image: Vec<Lanes>,
}

/// Whether the pixels of an image are complex, or real with two columns per lane: real parts, then imaginary parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pixels {
    Complex,
    Real,
}

impl Pixels {
    /// Columns of a stripe, which are transformed together.
    pub(crate) const fn stripe(self) -> usize {
        match self {
            Self::Complex => LANES,
            Self::Real => 2 * LANES,
        }
    }
}

impl Grid {
    pub(crate) fn new([width, height]: [usize; 2], plans: &LanePlans) -> Self {
        Self { width, height, along_x: plans.get(width), along_y: plans.get(height) }
    }

    /// Returns 1 / samples.
    #[expect(clippy::cast_possible_truncation, reason = "samples use single precision")]
    pub(crate) fn norm(&self) -> f32 {
        (1.0 / (self.width * self.height) as f64) as f32
    }

    /// Returns the width rounded up to full stripes.
    fn padded(&self, pixels: Pixels) -> usize {
        self.width.next_multiple_of(pixels.stripe())
    }

    /// Computes the spectrum of an image on `support`, or an empty one if the image is empty.
    ///
    /// `fill` writes all rows of the stripe of columns from an index on, with zeros beyond the image, or returns false
    /// if the stripe is empty.
    pub(crate) fn forward(
        &self,
        support: &Support,
        pixels: Pixels,
        mut fill: impl FnMut(usize, &mut [Lanes]) -> bool,
        spectrum: &mut Spectrum,
        scratch: &mut GridScratch,
    ) {
        let padded = self.padded(pixels);
        let GridScratch { turned, buffers: [stripe, transform], columns: spare, .. } = scratch;
        turned.resize(2 * support.blocks() * padded, ZERO);
        [&mut *stripe, transform].into_iter().for_each(|buffer| buffer.resize(self.height, ZERO));
        spare.resize(spare.len().max(self.height), ZERO);
        let mut is_empty = true;
        for left in (0..padded).step_by(pixels.stripe()) {
            if fill(left, stripe) {
                is_empty = false;
                self.along_y.transform(stripe, transform, &mut spare[..self.height]);
                split(transform, pixels, turned, padded, left);
            } else {
                turned.chunks_exact_mut(padded).for_each(|row| row[left..left + pixels.stripe()].fill(ZERO));
            }
        }
        spectrum.clear();
        if is_empty {
            return;
        }
        let [line, spare] = &mut scratch.buffers;
        [&mut *line, spare].into_iter().for_each(|buffer| buffer.resize(self.width, ZERO));
        for (rows, &reach) in scratch.turned.chunks_exact(2 * padded).zip(&support.reach) {
            let (plus, minus) = rows.split_at(padded);
            self.along_x.transform(&plus[..self.width], line, spare);
            spectrum.plus.extend_from_slice(&line[self.width - reach..]);
            spectrum.plus.extend_from_slice(&line[..=reach]);
            if pixels == Pixels::Complex {
                self.along_x.transform(&minus[..self.width], line, spare);
                spectrum.minus.extend(line[..=reach].iter().rev());
                spectrum.minus.extend(line[self.width - reach..].iter().rev());
            }
        }
    }

    /// Computes the image of a spectrum, times the number of pixels. Frequencies beyond those of this grid are aliased.
    ///
    /// `fill` writes one block of the spectrum: F(kx, ky) and F(−kx, −ky), or the first alone for a real image. `visit`
    /// receives all rows of each stripe that covers the first `width` columns, with real and imaginary parts exchanged.
    pub(crate) fn inverse(
        &self,
        support: &Support,
        pixels: Pixels,
        mut fill: impl FnMut(usize, &mut [Lanes], &mut [Lanes]),
        width: usize,
        mut visit: impl FnMut(usize, &mut [Lanes]),
        scratch: &mut GridScratch,
    ) {
        let padded = self.padded(pixels);
        let GridScratch { turned, columns, buffers: [line, spare], plus, minus, .. } = scratch;
        turned.resize(2 * support.blocks() * padded, ZERO);
        [&mut *line, spare].into_iter().for_each(|buffer| buffer.resize(self.width, ZERO));
        for (block, rows) in turned.chunks_exact_mut(2 * padded).enumerate() {
            let len = 2 * support.reach(block) + 1;
            [&mut *plus, minus].into_iter().for_each(|buffer| buffer.resize(buffer.len().max(len), ZERO));
            fill(block, &mut plus[..len], &mut minus[..len]);
            let (to_plus, to_minus) = rows.split_at_mut(padded);
            // The inverse transform is the forward transform with real and imaginary parts exchanged.
            place(&plus[..len], false, line);
            self.along_x.transform(line, &mut to_plus[..self.width], spare);
            to_plus[self.width..].fill(ZERO);
            if pixels == Pixels::Complex {
                place(&minus[..len], true, line);
                self.along_x.transform(line, &mut to_minus[..self.width], spare);
                to_minus[self.width..].fill(ZERO);
            }
        }
        let [transform, spare] = [line, spare];
        [&mut *transform, spare].into_iter().for_each(|buffer| buffer.resize(self.height, ZERO));
        columns.resize(columns.len().max(self.height), ZERO);
        let stripe = &mut columns[..self.height];
        for left in (0..width.min(self.width)).step_by(pixels.stripe()) {
            join(turned, support, pixels, padded, left, stripe);
            self.along_y.transform(stripe, transform, spare);
            visit(left, transform);
        }
    }

    /// Writes the first `width` columns of the real image of a spectrum, times the number of pixels.
    pub(crate) fn image_into(
        &self,
        support: &Support,
        spectrum: &[Lanes],
        width: usize,
        image: &mut [f32],
        scratch: &mut GridScratch,
    ) {
        let fill = |block: usize, plus: &mut [Lanes], _: &mut [Lanes]| {
            plus.copy_from_slice(&spectrum[support.range(block)]);
        };
        let keep = |left: usize, stripe: &mut [Lanes]| {
            for (row, [second, first]) in image.chunks_exact_mut(width).zip(&*stripe) {
                for (to, from) in row[left..].iter_mut().zip(first.iter().chain(second)) {
                    *to = *from;
                }
            }
        };
        self.inverse(support, Pixels::Real, fill, width, keep, scratch);
    }

    /// Computes the spectrum of the square of a real image, given by its spectrum. `scales` are factors of the image
    /// before it is squared, and of the squares.
    pub(crate) fn squared(
        &self,
        support: &Support,
        fill: impl FnMut(usize, &mut [Lanes], &mut [Lanes]),
        scales: [f32; 2],
        spectrum: &mut Spectrum,
        scratch: &mut GridScratch,
    ) {
        let mut image = core::mem::take(&mut scratch.image);
        image.clear();
        let keep = |_: usize, stripe: &mut [Lanes]| {
            let from = image.len();
            image.extend_from_slice(stripe);
            square(&mut image[from..], scales);
        };
        self.inverse(support, Pixels::Real, fill, self.width, keep, scratch);
        let fill = |left: usize, stripe: &mut [Lanes]| {
            // Real and imaginary parts were exchanged.
            let from = &image[left / Pixels::Real.stripe() * self.height..][..self.height];
            stripe.iter_mut().zip(from).for_each(|(to, from)| *to = [from[1], from[0]]);
            true
        };
        self.forward(support, Pixels::Real, fill, spectrum, scratch);
        scratch.image = image;
    }
}

/// Multiplies numbers by a factor, squares them, and multiplies the squares by another factor.
#[multiversion(targets = "simd")]
fn square(values: &mut [Lanes], [before, after]: [f32; 2]) {
    for value in values.as_flattened_mut().as_flattened_mut() {
        let u = *value * before;
        *value = after * (u * u);
    }
}

/// Returns the rows of a block, transposed: real parts, then imaginary parts.
#[inline(always)]
fn turned_rows<'a>(row: impl Fn(usize) -> &'a Lanes) -> [[[f32; LANES]; LANES]; 2] {
    [transposed(core::array::from_fn(|l| &row(l)[0])), transposed(core::array::from_fn(|l| &row(l)[1]))]
}

/// Stores the spectra along y of a stripe, by frequency.
#[multiversion(targets = "simd")]
fn split(spectra: &[Lanes], pixels: Pixels, turned: &mut [Lanes], padded: usize, left: usize) {
    let height = spectra.len();
    for (block, rows) in turned.chunks_exact_mut(2 * padded).enumerate() {
        let (plus, minus) = rows.split_at_mut(padded);
        let ky = |l: usize| (block * LANES + l).min(height - 1);
        let above = |l: usize| &spectra[ky(l)];
        let below = |l: usize| &spectra[if ky(l) == 0 { 0 } else { height - ky(l) }];
        match pixels {
            Pixels::Complex => {
                store(turned_rows(above), &mut plus[left..left + LANES]);
                store(turned_rows(below), &mut minus[left..left + LANES]);
            }
            Pixels::Real => {
                // Z = A + iB, so A = (Z(k) + Z*(−k))/2 and B = (Z(k) − Z*(−k))/2i.
                let (mut a, mut b) = ([ZERO; LANES], [ZERO; LANES]);
                for l in 0..LANES {
                    let (z, m) = (above(l), below(l));
                    for i in 0..LANES {
                        a[l][0][i] = 0.5 * (z[0][i] + m[0][i]);
                        a[l][1][i] = 0.5 * (z[1][i] - m[1][i]);
                        b[l][0][i] = 0.5 * (z[1][i] + m[1][i]);
                        b[l][1][i] = 0.5 * (m[0][i] - z[0][i]);
                    }
                }
                let (to_a, to_b) = plus[left..left + 2 * LANES].split_at_mut(LANES);
                store(turned_rows(|l| &a[l]), to_a);
                store(turned_rows(|l| &b[l]), to_b);
            }
        }
    }
}

#[inline(always)]
fn store([re, im]: [[[f32; LANES]; LANES]; 2], to: &mut [Lanes]) {
    for (to, (re, im)) in to.iter_mut().zip(re.into_iter().zip(im)) {
        *to = [re, im];
    }
}

/// Writes a block of a spectrum, kx from −r to r or reversed, to its positions in a line, with real and imaginary parts
/// exchanged. The rest of the line becomes zero, and frequencies at the same position are added.
#[multiversion(targets = "simd")]
fn place(block: &[Lanes], is_reversed: bool, line: &mut [Lanes]) {
    let (width, reach) = (line.len(), block.len() / 2);
    if block.len() <= width {
        let (upper, rest) = line.split_at_mut(reach + 1);
        let (zeros, lower) = rest.split_at_mut(width - block.len());
        zeros.fill(ZERO);
        if is_reversed {
            upper.iter_mut().zip(block[..=reach].iter().rev()).for_each(|(to, from)| *to = exchanged(from));
            lower.iter_mut().zip(block[reach + 1..].iter().rev()).for_each(|(to, from)| *to = exchanged(from));
        } else {
            upper.iter_mut().zip(&block[reach..]).for_each(|(to, from)| *to = exchanged(from));
            lower.iter_mut().zip(&block[..reach]).for_each(|(to, from)| *to = exchanged(from));
        }
        return;
    }
    line.fill(ZERO);
    let mut at = (width - reach % width) % width;
    for i in 0..block.len() {
        let from = &block[if is_reversed { block.len() - 1 - i } else { i }];
        add(&mut line[at], &exchanged(from));
        at = if at + 1 == width { 0 } else { at + 1 };
    }
}

#[inline(always)]
fn exchanged([re, im]: &Lanes) -> Lanes {
    [*im, *re]
}

/// Collects the spectra along y of a stripe. The inverse of [`split`]; real and imaginary parts are exchanged.
#[multiversion(targets = "simd")]
fn join(turned: &[Lanes], support: &Support, pixels: Pixels, padded: usize, left: usize, stripe: &mut [Lanes]) {
    let height = stripe.len();
    let is_aliased = 2 * support.top >= height;
    if is_aliased {
        stripe.fill(ZERO);
    } else {
        stripe[support.top + 1..height - support.top].fill(ZERO);
    }
    for (block, rows) in turned.chunks_exact(2 * padded).enumerate() {
        let (plus, minus) = rows.split_at(padded);
        let (above, below) = match pixels {
            Pixels::Complex => (turned_rows(|l| &plus[left + l]), turned_rows(|l| &minus[left + l])),
            Pixels::Real => {
                let (a, b) = (turned_rows(|l| &plus[left + l]), turned_rows(|l| &plus[left + LANES + l]));
                // Exchanged parts of A + iB at k and of A* + iB* at −k, from exchanged parts of A and B.
                let (mut above, mut below) = ([[[0.0; LANES]; LANES]; 2], [[[0.0; LANES]; LANES]; 2]);
                sums(&mut above[0], &a[0], &b[1], 1.0);
                sums(&mut above[1], &a[1], &b[0], -1.0);
                sums(&mut below[0], &b[1], &a[0], -1.0);
                sums(&mut below[1], &a[1], &b[0], 1.0);
                (above, below)
            }
        };
        for l in 0..support.lanes(block) {
            let ky = block * LANES + l;
            let (above, below) = ([above[0][l], above[1][l]], [below[0][l], below[1][l]]);
            if is_aliased {
                add(&mut stripe[ky % height], &above);
                if ky > 0 {
                    add(&mut stripe[(height - ky % height) % height], &below);
                }
            } else {
                stripe[ky] = above;
                if ky > 0 {
                    stripe[height - ky] = below;
                }
            }
        }
    }
}

/// Computes a + sign · b in one loop; the compiler turns nested loops into gathers.
#[inline(always)]
fn sums(to: &mut [[f32; LANES]; LANES], a: &[[f32; LANES]; LANES], b: &[[f32; LANES]; LANES], sign: f32) {
    for ((to, a), b) in to.as_flattened_mut().iter_mut().zip(a.as_flattened()).zip(b.as_flattened()) {
        *to = a + sign * b;
    }
}

#[inline(always)]
fn add(to: &mut Lanes, from: &Lanes) {
    for (to, from) in to.iter_mut().zip(from) {
        for (to, from) in to.iter_mut().zip(from) {
            *to += from;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_xoshiro::Xoshiro256PlusPlus;
    use rand_xoshiro::rand_core::{Rng, SeedableRng};

    /// Reference: one frequency at a time.
    fn oracle(image: &[[f32; 2]], width: usize, [fx, fy]: [f64; 2]) -> [f64; 2] {
        let mut sum = [0.0; 2];
        for (i, value) in image.iter().enumerate() {
            let (c, s) = crate::pupil::turn(-(fx * (i % width) as f64 + fy * (i / width) as f64));
            let [re, im] = value.map(f64::from);
            sum[0] += re * c - im * s;
            sum[1] += re * s + im * c;
        }
        sum
    }

    fn fill(image: &[[f32; 2]], width: usize, pixels: Pixels) -> impl FnMut(usize, &mut [Lanes]) -> bool {
        move |left, stripe| {
            for (row, stripe) in image.chunks_exact(width).zip(stripe.iter_mut()) {
                let value = |x: usize| row.get(left + x).copied().unwrap_or([0.0; 2]);
                let [re, im] = stripe;
                for (l, (re, im)) in re.iter_mut().zip(im).enumerate() {
                    let (first, second) = (value(l), value(LANES + l));
                    (*re, *im) = match pixels {
                        Pixels::Complex => (first[0], first[1]),
                        Pixels::Real => (first[0], second[0]),
                    };
                }
            }
            stripe.iter().flatten().flatten().any(|v| *v != 0.0)
        }
    }

    fn random(pixels: Pixels, count: usize) -> Vec<[f32; 2]> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(0x5EC7);
        let mut number = || (rng.next_u32() >> 8) as f32 / 16_777_216.0;
        (0..count).map(|_| [number(), if pixels == Pixels::Real { 0.0 } else { number() }]).collect()
    }

    /// Frequencies of the lanes in use, with their index.
    fn known(support: &Support, size: [usize; 2]) -> Vec<(usize, usize, [f64; 2])> {
        let mut known = Vec::new();
        for (index, frequencies) in support.frequencies(size).enumerate() {
            let block = (0..support.blocks()).find(|&block| support.range(block).contains(&index)).unwrap();
            known.extend((0..support.lanes(block)).map(|l| (index, l, frequencies[l])));
        }
        known
    }

    #[test]
    fn spectra_match_direct_sums() {
        for pixels in [Pixels::Complex, Pixels::Real] {
            for (width, height, radius) in [(27, 39, 0.3), (90, 75, 0.26), (40, 98, 9.0), (33, 1, 0.2)] {
                let mut image = random(pixels, width * height);
                if width > 80 {
                    image.iter_mut().enumerate().filter(|(i, _)| i % width < 40).for_each(|(_, v)| *v = [0.0; 2]);
                }
                let grid = Grid::new([width, height], &LanePlans::default());
                let support = Support::new([width, height], radius);
                let (mut spectrum, mut scratch) = (Spectrum::default(), GridScratch::default());
                grid.forward(&support, pixels, fill(&image, width, pixels), &mut spectrum, &mut scratch);
                for &(index, l, [fx, fy]) in known(&support, [width, height]).iter().step_by(3) {
                    let mut found = vec![(&spectrum.plus, [fx, fy])];
                    if pixels == Pixels::Complex {
                        found.push((&spectrum.minus, [-fx, -fy]));
                    }
                    for (values, f) in found {
                        let [re, im] = oracle(&image, width, f);
                        let value = &values[index];
                        let error = (f64::from(value[0][l]) - re).abs() + (f64::from(value[1][l]) - im).abs();
                        assert!(error < 6e-4, "{pixels:?} {f:?}: {error}");
                    }
                }
            }
        }
    }

    #[test]
    fn images_match_direct_sums_and_fine_frequencies_are_aliased() {
        let (width, height) = (48, 60);
        for pixels in [Pixels::Complex, Pixels::Real] {
            // The grid of the image: as fine as that of the spectrum, or coarser by 2 or 3.
            for coarser in [1, 2, 3] {
                let image = random(pixels, width * height);
                let plans = LanePlans::default();
                let support = Support::new([width, height], 0.31);
                let (mut spectrum, mut scratch) = (Spectrum::default(), GridScratch::default());
                let from = Grid::new([width, height], &plans);
                from.forward(&support, pixels, fill(&image, width, pixels), &mut spectrum, &mut scratch);
                let to = Grid::new([width / coarser, height / coarser], &plans);
                let mut found = vec![[0.0_f32; 2]; to.width * to.height];
                let fill = |block: usize, plus: &mut [Lanes], minus: &mut [Lanes]| {
                    plus.copy_from_slice(&spectrum.plus[support.range(block)]);
                    if pixels == Pixels::Complex {
                        minus.copy_from_slice(&spectrum.minus[support.range(block)]);
                    }
                };
                let visit = |left: usize, stripe: &mut [Lanes]| {
                    for (y, [second, first]) in stripe.iter().enumerate() {
                        for l in 0..LANES {
                            let mut set = |x: usize, value| {
                                if x < to.width {
                                    found[y * to.width + x] = value;
                                }
                            };
                            match pixels {
                                Pixels::Complex => set(left + l, [first[l], second[l]]),
                                Pixels::Real => {
                                    set(left + l, [first[l], 0.0]);
                                    set(left + LANES + l, [second[l], 0.0]);
                                }
                            }
                        }
                    }
                };
                to.inverse(&support, pixels, fill, to.width, visit, &mut scratch);
                // The image of the kept frequencies at every `coarser`th sample.
                let frequencies = known(&support, [width, height]);
                for i in (0..found.len()).step_by(37) {
                    let (x, y) = (coarser * (i % to.width), coarser * (i / to.width));
                    let mut sum = [0.0; 2];
                    let mut add = |[re, im]: [f64; 2], [fx, fy]: [f64; 2]| {
                        let (c, s) = crate::pupil::turn(fx * x as f64 + fy * y as f64);
                        sum = [sum[0] + re * c - im * s, sum[1] + re * s + im * c];
                    };
                    for &(_, _, [fx, fy]) in &frequencies {
                        add(oracle(&image, width, [fx, fy]), [fx, fy]);
                        if fy > 0.0 {
                            add(oracle(&image, width, [-fx, -fy]), [-fx, -fy]);
                        }
                    }
                    let error = (0..2).map(|k| (f64::from(found[i][k]) - sum[k]).abs()).fold(0.0, f64::max);
                    assert!(error < 2e-3 * (width * height) as f64 / 100.0, "{pixels:?} {coarser} {i}: {error}");
                }
            }
        }
    }
}
