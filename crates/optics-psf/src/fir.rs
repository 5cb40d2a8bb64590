//! Direct convolution: a separable sum over taps, in strips of columns that fit in the cache.

use crate::{Border, Scratch};

/// Smallest number of columns of a strip. A strip of a camera frame (1038 rows) fits in the second-level cache.
const STRIP: usize = 256;

/// Pixels of a strip that fit in the second-level cache.
const SECOND_LEVEL: usize = 1 << 18;

/// Pixels that fit in the first-level cache; the inputs of one output row should fit.
const FIRST_LEVEL: usize = 1 << 13;

/// Pixels whose sums stay in registers during the loop over taps.
const BLOCK: usize = 64;

/// Block size of the remainder.
const LANES: usize = 16;

/// An image with its border mode.
#[derive(Clone, Copy)]
pub(crate) struct Source<'a> {
    pub(crate) pixels: &'a [f32],
    pub(crate) width: usize,
    pub(crate) border: Border,
}

impl Source<'_> {
    pub(crate) fn height(&self) -> usize {
        self.pixels.len() / self.width
    }

    pub(crate) fn row(&self, y: usize) -> &[f32] {
        &self.pixels[y * self.width..][..self.width]
    }
}

/// Blurs `source`, enlarged by `margin` on each side. `half[0]` is the central tap, `half[k]` the taps at ±k. `dst`
/// receives as many rows as it holds, from row `first` of `source`, which may be negative.
pub(crate) fn blur(
    source: Source<'_>,
    half: &[f32],
    margin: usize,
    first: isize,
    dst: &mut [f32],
    scratch: &mut Scratch,
) {
    let dst_width = source.width + 2 * margin;
    let rows = dst.len() / dst_width.max(1) + 2 * (half.len() - 1);
    let wide = (SECOND_LEVEL / rows.max(1)).min(FIRST_LEVEL / (2 * half.len() - 1)).max(STRIP) / BLOCK * BLOCK;
    for x in (0..dst_width).step_by(wide) {
        let columns = wide.min(dst_width - x);
        blur_strip(source, half, margin, first, x, columns, dst, &mut scratch.strip, &mut scratch.line);
    }
}

/// Computes the columns `x .. x + columns` of `dst`.
#[multiversion::multiversion(targets = "simd")]
#[expect(clippy::too_many_arguments, reason = "one loop nest, split for multiversioning")]
fn blur_strip(
    source: Source<'_>,
    half: &[f32],
    margin: usize,
    first: isize,
    x: usize,
    columns: usize,
    dst: &mut [f32],
    strip: &mut Vec<f32>,
    line: &mut Vec<f32>,
) {
    let (width, height, border) = (source.width, source.height(), source.border);
    let radius = half.len() - 1;
    let pitch = columns.next_multiple_of(LANES);
    let dst_width = width + 2 * margin;
    let strip = resized(strip, (dst.len() / dst_width + 2 * radius) * pitch);
    let line = resized(line, pitch + 2 * radius);

    // Convolves along the rows that `dst` needs.
    let start = x.cast_signed() - (margin + radius).cast_signed();
    let taps = useful(border, radius, start + radius.cast_signed(), columns, width);
    let interior = usize::try_from(start).ok().filter(|&s| s + line.len() <= width);
    let mut extension = border.extension(width, start, line);
    let above = first - radius.cast_signed();
    for (out, y) in strip.chunks_exact_mut(pitch).zip(above..) {
        match (border.source(y, height), interior) {
            (None, _) => out.fill(0.0),
            (Some(y), Some(start)) => fir(&source.row(y)[start..], radius, 1, half, taps, out),
            (Some(y), None) => {
                fir(extension.of(source.row(y)), radius, 1, half, taps, out);
            }
        }
    }

    // Convolves along the columns.
    for (i, row) in dst.chunks_exact_mut(dst_width).enumerate() {
        let y = first + i.cast_signed();
        let taps = useful(border, radius, y, 1, height);
        fir(strip, (i + radius) * pitch, pitch, half, taps, &mut row[x..x + columns]);
    }
}

/// Returns the first `len` values of a growing buffer. Old values are not cleared.
fn resized(memory: &mut Vec<f32>, len: usize) -> &mut [f32] {
    if memory.len() < len {
        memory.resize(len, 0.0);
    }
    &mut memory[..len]
}

/// Returns the first and last tap that reach a pixel of `0..len` from `count` positions starting at `from`. With other
/// borders than zero, all taps count.
#[inline(always)]
fn useful(border: Border, radius: usize, from: isize, count: usize, len: usize) -> (usize, usize) {
    if border != Border::Zero {
        return (0, radius);
    }
    let last = from + count.cast_signed() - 1;
    let end = len.cast_signed() - 1;
    let nearest = (-last).max(from - end).max(0).cast_unsigned();
    let farthest = last.max(end - from).max(0).cast_unsigned();
    (nearest.min(radius), farthest.min(radius))
}

/// `out[i] = ∑ₖ half[k] · (data[centre + i - k·stride] + data[centre + i + k·stride])`.
///
/// Adds the two pixels of a pair before weighting: a mirrored image gives the mirrored result, bit for bit. The
/// smallest taps come first, which reduces rounding errors.
#[inline(always)]
fn fir(data: &[f32], centre: usize, stride: usize, half: &[f32], taps: (usize, usize), out: &mut [f32]) {
    let mut at = 0;
    let mut blocks = out.chunks_exact_mut(BLOCK);
    for block in &mut blocks {
        block.copy_from_slice(&sums::<BLOCK>(data, centre + at, stride, half, taps));
        at += BLOCK;
    }
    let rest = blocks.into_remainder().len();
    if rest == 0 {
        return;
    }
    if let Some(at) = out.len().checked_sub(BLOCK) {
        // Recomputes the end of the row with a full block, instead of a remainder.
        out[at..].copy_from_slice(&sums::<BLOCK>(data, centre + at, stride, half, taps));
        return;
    }
    for block in out.chunks_mut(LANES) {
        let sums = sums::<LANES>(data, centre + at, stride, half, taps);
        block.copy_from_slice(&sums[..block.len()]);
        at += LANES;
    }
}

#[inline(always)]
fn sums<const N: usize>(
    data: &[f32],
    centre: usize,
    stride: usize,
    half: &[f32],
    (first, last): (usize, usize),
) -> [f32; N] {
    let mut sum = [0.0; N];
    for k in (first.max(1)..=last).rev() {
        let weight = half[k];
        let before = &data[centre - k * stride..][..N];
        let after = &data[centre + k * stride..][..N];
        for i in 0..N {
            sum[i] += weight * (before[i] + after[i]);
        }
    }
    if first == 0 {
        let here = &data[centre..][..N];
        for i in 0..N {
            sum[i] += half[0] * here[i];
        }
    }
    sum
}
