//! The decimated path for wide kernels: halve, blur what is small, double.
//!
//! Each halving weighs with 1 4 6 4 1 (variance 1) and each doubling with the same taps, which is
//! cubic B-spline subdivision. On their own lattices all of them have the same variance at every
//! phase, so variances add without an error: with d halvings the impulse response has
//! 2·(4ᵈ - 1)/3 from the two ways and 4ᵈ·s² from the kernel of width s between them.

use crate::fir::{self, Source};
use crate::kernel::Kernel;
use crate::{Border, Scratch};

/// The least width, in its own pixels, of the kernel between the two ways. It bounds what folds
/// back in halving, and the excess kurtosis of the whole, to below 1e-3 of the range.
pub(crate) const NARROWEST: f64 = 1.6;

/// The same for errors below 2e-4.
pub(crate) const NARROWEST_BY_DEFAULT: f64 = 2.25;

/// Beyond this, more halvings save nothing.
const MOST_HALVINGS: u32 = 6;

/// How a wide kernel is split into halvings and what is left to do on the small image.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Pyramid {
    halvings: usize,
    kernel: Kernel,
    /// Pixels that surround the image while it is halved, for each border.
    reach_of_nothing: usize,
    reach: usize,
}

impl Pyramid {
    /// None where the kernel is too narrow to be halved even once.
    pub(crate) fn new(sigma: f64, narrowest: f64, radius: usize, lost_tail: f64) -> Option<Self> {
        let split = |halvings: u32| {
            let area = f64::from(4_u32.pow(halvings));
            let rest = (sigma * sigma - 2.0 * (area - 1.0) / 3.0) / area;
            (rest >= narrowest * narrowest).then(|| (halvings as usize, rest.sqrt()))
        };
        let (halvings, rest) = (1..=MOST_HALVINGS).rev().find_map(split)?;
        let step = 1 << halvings;
        Some(Self {
            halvings,
            kernel: Kernel::new(rest, lost_tail),
            // The taps of all halvings, or of all doublings, reach less than two small pixels.
            reach_of_nothing: 2 * step,
            reach: (radius + 2 * step).next_multiple_of(step),
        })
    }

    /// Blurs `source` into `dst`, which is larger by `margin` on each side.
    pub(crate) fn blur(&self, source: Source<'_>, margin: usize, dst: &mut [f32], scratch: &mut Scratch) {
        let reach = match source.border {
            Border::Zero => self.reach_of_nothing,
            Border::Reflect | Border::Replicate => self.reach,
        };
        let step = 1 << self.halvings;
        let full = |side: usize| (side + 2 * (margin + reach)).next_multiple_of(step);
        let (width, height) = (full(source.width), full(source.height()));

        let mut levels = core::mem::take(&mut scratch.levels);
        levels.resize_with(self.halvings + 1, Vec::new);
        for l in 1..=self.halvings {
            let (above, below) = levels.split_at_mut(l);
            let level = &mut below[0];
            level.resize((width >> l) * (height >> l), 0.0);
            let (source, before) = match l {
                1 => (source, margin + reach),
                _ => (alone(&above[l - 1], width >> (l - 1)), 0),
            };
            halve(source, before, level, width >> l, &mut scratch.line);
        }

        let (least, mut small) = (self.halvings, core::mem::take(&mut levels[0]));
        small.resize(levels[least].len(), 0.0);
        let coarse = alone(&levels[least], width >> least);
        fir::blur(coarse, self.kernel.half(), 0, &mut small, scratch);
        levels[0] = small;
        levels.swap(0, least);

        for l in (1..self.halvings).rev() {
            let (above, below) = levels.split_at_mut(l + 1);
            double(&below[0], width >> (l + 1), &mut above[l], width >> l, 0, &mut scratch.line);
        }
        let out_width = source.width + 2 * margin;
        double(&levels[1], width / 2, dst, out_width, reach, &mut scratch.line);
        scratch.levels = levels;
    }
}

/// A small image, with nothing around it that could matter.
fn alone(pixels: &[f32], width: usize) -> Source<'_> {
    Source { pixels, width, border: Border::Zero }
}

/// Every second pixel of `source`, counted from `before` pixels above and to the left of its
/// first one, of what 1 4 6 4 1 makes of it.
#[multiversion::multiversion(targets = "simd")]
fn halve(source: Source<'_>, before: usize, out: &mut [f32], width: usize, line: &mut Vec<f32>) {
    let start = -before.cast_signed() - 2;
    let source_width = source.width;
    let long = 2 * width + 4;
    line.resize(source_width + 2 * long, 0.0);
    let (sum, rest) = line.split_at_mut(source_width);
    let (long_line, phases) = rest.split_at_mut(long);
    let (even, odd) = phases.split_at_mut(width + 2);
    let height = source.height();
    let mut extension = source.border.extension(source_width, start, long_line);
    for (k, out) in out.chunks_exact_mut(width).enumerate() {
        let top = start + 2 * k.cast_signed();
        sum.fill(0.0);
        // Two rows of equal weight at a time, as the taps are symmetric.
        for (near, far, weight) in [(0, 4, 1.0 / 16.0), (1, 3, 4.0 / 16.0), (2, 2, 3.0 / 16.0)] {
            let row = |i| source.border.source(top + i, height).map(|y| source.row(y));
            match (row(near), row(far)) {
                (Some(a), Some(b)) => {
                    for ((s, a), b) in sum.iter_mut().zip(a).zip(b) {
                        *s += weight * (a + b);
                    }
                }
                (Some(a), None) | (None, Some(a)) => {
                    for (s, a) in sum.iter_mut().zip(a) {
                        *s += weight * a;
                    }
                }
                (None, None) => {}
            }
        }
        for ((pair, e), o) in extension.of(sum).chunks_exact(2).zip(even.iter_mut()).zip(odd.iter_mut()) {
            (*e, *o) = (pair[0], pair[1]);
        }
        let outer = even.iter().zip(&even[2..]);
        let inner = odd.iter().zip(&odd[1..]);
        for (((out, (a, e)), (b, d)), c) in out.iter_mut().zip(outer).zip(inner).zip(&even[1..]) {
            *out = (1.0 / 16.0) * (a + e) + (4.0 / 16.0) * (b + d) + (6.0 / 16.0) * c;
        }
    }
}

/// Cubic B-spline subdivision: twice as many pixels along each side, of which those from `skip`
/// (even) on, along both, go to `out`.
#[multiversion::multiversion(targets = "simd")]
fn double(small: &[f32], small_width: usize, out: &mut [f32], width: usize, skip: usize, line: &mut Vec<f32>) {
    let rows = (small.len() / small_width).cast_signed();
    line.clear();
    line.resize(2 * small_width + 2, 0.0);
    // Beyond the image is nothing: a row of it, and a pixel on each side of every row.
    let (nothing, line) = line.split_at_mut(small_width);
    for (y, out) in out.chunks_exact_mut(width).enumerate() {
        let y = y + skip;
        let k = (y / 2).cast_signed();
        let row = |k: isize| {
            if (0..rows).contains(&k) { &small[k.cast_unsigned() * small_width..][..small_width] } else { &*nothing }
        };
        let sum = &mut line[1..=small_width];
        if y.is_multiple_of(2) {
            let outer = row(k - 1).iter().zip(row(k + 1));
            for ((s, (a, c)), b) in sum.iter_mut().zip(outer).zip(row(k)) {
                *s = 0.125 * (a + c) + 0.75 * b;
            }
        } else {
            for ((s, a), b) in sum.iter_mut().zip(row(k)).zip(row(k + 1)) {
                *s = 0.5 * (a + b);
            }
        }
        let line = &line[skip / 2..];
        let around = line.iter().zip(&line[1..]).zip(&line[2..]);
        let mut pairs = out.chunks_exact_mut(2);
        for (pair, ((a, b), c)) in (&mut pairs).zip(around) {
            pair[0] = 0.125 * (a + c) + 0.75 * b;
            pair[1] = 0.5 * (b + c);
        }
        if let [last] = pairs.into_remainder() {
            let [a, b, c] = [0, 1, 2].map(|i| line[width / 2 + i]);
            *last = 0.125 * (a + c) + 0.75 * b;
        }
    }
}
