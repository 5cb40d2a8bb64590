//! Decimated convolution for wide kernels: downsample, blur the small image, upsample.
//!
//! Downsampling and upsampling use the weights 1 6 15 20 15 6 1 (variance 3/2), quintic B-spline subdivision. Their
//! variance is the same at every phase, so variances add exactly: for d halvings the impulse response has 4ᵈ - 1 from
//! resampling and 4ᵈ·s² from the kernel of width s. Fourth cumulants add as well: resampling contributes -(16ᵈ - 1)/10,
//! which the kernel compensates. The remaining error is aliasing.

use crate::fir::{self, Source};
use crate::kernel::Kernel;
use crate::{Border, Scratch};

/// Smallest σ of the kernel on the small image, in its pixels. Aliasing is then below 1e-3 of the range for every
/// image: 4.4e-4 along each axis for one halving, less for more.
pub(crate) const NARROWEST: f64 = 1.1;

/// Smallest σ for errors below 2e-4 of the range: 9e-5 along each axis.
pub(crate) const NARROWEST_BY_DEFAULT: f64 = 1.5;

/// Largest number of halvings; more save no time.
const MOST_HALVINGS: u32 = 6;

/// Split of a wide kernel into halvings and a kernel on the small image.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Pyramid {
    halvings: usize,
    kernel: Kernel,
    /// Pixels of padding around the image, for zero and for other borders.
    zero_padding: usize,
    padding: usize,
}

impl Pyramid {
    /// Returns `None` if the kernel is too narrow for one halving.
    pub(crate) fn new(sigma: f64, narrowest: f64, radius: usize, lost_tail: f64) -> Option<Self> {
        let split = |halvings: u32| {
            let area = f64::from(4_u32.pow(halvings));
            let rest = (sigma * sigma - (area - 1.0)) / area;
            (rest >= narrowest * narrowest).then(|| (halvings as usize, rest.sqrt(), 0.1 - 0.1 / (area * area)))
        };
        let (halvings, rest, fourth_cumulant) = (1..=MOST_HALVINGS).rev().find_map(split)?;
        let step = 1 << halvings;
        Some(Self {
            halvings,
            kernel: Kernel::with_fourth_cumulant(rest, fourth_cumulant, lost_tail),
            // The taps of all halvings or doublings together reach less than three small pixels.
            zero_padding: 3 * step,
            padding: (radius + 3 * step).next_multiple_of(step),
        })
    }

    /// Blurs `source` into `dst`, which is larger by `margin` on each side.
    pub(crate) fn blur(&self, source: Source<'_>, margin: usize, dst: &mut [f32], scratch: &mut Scratch) {
        let reach = match source.border {
            Border::Zero => self.zero_padding,
            Border::Reflect | Border::Replicate => self.padding,
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
                _ => (zero_bordered(&above[l - 1], width >> (l - 1)), 0),
            };
            halve(source, before, level, width >> l, &mut scratch.line);
        }

        let (least, mut small) = (self.halvings, core::mem::take(&mut levels[0]));
        small.resize(levels[least].len(), 0.0);
        let coarse = zero_bordered(&levels[least], width >> least);
        fir::blur(coarse, &self.kernel.half, 0, 0, &mut small, scratch);
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

/// Returns a small image with a zero border, which is large enough to have no effect.
fn zero_bordered(pixels: &[f32], width: usize) -> Source<'_> {
    Source { pixels, width, border: Border::Zero }
}

/// Filters `source` with 1 6 15 20 15 6 1 and keeps every second pixel, starting `before` pixels above and to the left
/// of its first pixel.
#[multiversion::multiversion(targets = "simd")]
fn halve(source: Source<'_>, before: usize, out: &mut [f32], width: usize, line: &mut Vec<f32>) {
    /// Weights at ±3, ±2, ±1 and 0.
    const TAPS: [f32; 4] = [1.0 / 64.0, 6.0 / 64.0, 15.0 / 64.0, 20.0 / 64.0];
    let start = -before.cast_signed() - 3;
    let source_width = source.width;
    let long = 2 * width + 6;
    line.clear();
    line.resize(2 * (source_width + long), 0.0);
    let (nothing, rest) = line.split_at_mut(source_width);
    let (sum, rest) = rest.split_at_mut(source_width);
    let (long_line, phases) = rest.split_at_mut(long);
    let (even, odd) = phases.split_at_mut(width + 3);
    let height = source.height();
    let mut extension = source.border.extension(source_width, start, long_line);
    for (k, out) in out.chunks_exact_mut(width).enumerate() {
        let top = start + 2 * k.cast_signed();
        let mut rows = [&*nothing; 7];
        let mut any = false;
        for (y, row) in (top..).zip(&mut rows) {
            if let Some(y) = source.border.source(y, height) {
                (*row, any) = (source.row(y), true);
            }
        }
        if !any {
            out.fill(0.0);
            continue;
        }
        let [a, b, c, d, e, f, g] = rows;
        folded(sum, [[a, g], [b, f], [c, e]], d, TAPS);
        for ((pair, e), o) in extension.of(sum).chunks_exact(2).zip(even.iter_mut()).zip(odd.iter_mut()) {
            (*e, *o) = (pair[0], pair[1]);
        }
        let far = [&*even, &even[3..]];
        folded(out, [far, [odd, &odd[2..]], [&even[1..], &even[2..]]], &odd[1..], TAPS);
    }
}

/// Adds pixels of equal weight before weighting.
#[inline(always)]
fn folded(out: &mut [f32], pairs: [[&[f32]; 2]; 3], centre: &[f32], weights: [f32; 4]) {
    let n = out.len();
    let [[a, g], [b, f], [c, e]] = pairs;
    let (a, b, c, d, e, f, g) = (&a[..n], &b[..n], &c[..n], &centre[..n], &e[..n], &f[..n], &g[..n]);
    for i in 0..n {
        let outer = weights[0] * (a[i] + g[i]) + weights[1] * (b[i] + f[i]);
        out[i] = outer + weights[2] * (c[i] + e[i]) + weights[3] * d[i];
    }
}

/// Quintic B-spline subdivision: doubles width and height. `out` receives the pixels from the even index `skip` on,
/// along both axes.
#[multiversion::multiversion(targets = "simd")]
fn double(small: &[f32], small_width: usize, out: &mut [f32], width: usize, skip: usize, line: &mut Vec<f32>) {
    let rows = (small.len() / small_width).cast_signed();
    line.clear();
    line.resize(2 * small_width + 3, 0.0);
    // Zeros outside of the image: one row, and pixels before and after every row.
    let (nothing, line) = line.split_at_mut(small_width);
    for (y, out) in out.chunks_exact_mut(width).enumerate() {
        let y = y + skip;
        let k = (y / 2).cast_signed();
        let row = |k: isize| {
            if (0..rows).contains(&k) { &small[k.cast_unsigned() * small_width..][..small_width] } else { &*nothing }
        };
        let (a, b, c, d) = (row(k - 1), row(k), row(k + 1), row(k + 2));
        let (a, b, c, d) = (&a[..small_width], &b[..small_width], &c[..small_width], &d[..small_width]);
        let sum = &mut line[1..=small_width];
        if y.is_multiple_of(2) {
            for i in 0..small_width {
                sum[i] = on(a[i], b[i], c[i]);
            }
        } else {
            for i in 0..small_width {
                sum[i] = between(a[i], b[i], c[i], d[i]);
            }
        }
        let line = &line[skip / 2..];
        let (pairs, rest) = out.as_chunks_mut::<2>();
        let n = pairs.len();
        let (a, b, c, d) = (&line[..n], &line[1..=n], &line[2..n + 2], &line[3..n + 3]);
        for i in 0..n {
            pairs[i] = [on(a[i], b[i], c[i]), between(a[i], b[i], c[i], d[i])];
        }
        if let [last] = rest {
            *last = on(line[n], line[n + 1], line[n + 2]);
        }
    }
}

/// Returns the value at the position of the central one of three small pixels.
#[inline(always)]
fn on(before: f32, here: f32, after: f32) -> f32 {
    6.0 / 32.0 * (before + after) + 20.0 / 32.0 * here
}

/// Returns the value between the two central ones of four small pixels.
#[inline(always)]
fn between(a: f32, b: f32, c: f32, d: f32) -> f32 {
    1.0 / 32.0 * (a + d) + 15.0 / 32.0 * (b + c)
}
