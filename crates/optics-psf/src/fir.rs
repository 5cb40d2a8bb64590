//! The direct path: a separable sum over taps, in strips of columns that stay in the cache.

use crate::{Border, Scratch};

/// Columns of a strip. One strip of a camera frame (1038 rows) fits in the second-level cache and
/// the rows that one output row needs in the first.
const STRIP: usize = 128;

/// Pixels whose sums are held in registers while the taps go by.
const BLOCK: usize = 64;

/// A remainder is finished in blocks of this many.
const LANES: usize = 16;

/// An image and what surrounds it.
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

/// Blurs `source` into `dst`, which is larger by `margin` on each side, with the taps
/// `half[0]` at the centre and `half[k]` at ±k.
pub(crate) fn blur(source: Source<'_>, half: &[f32], margin: usize, dst: &mut [f32], scratch: &mut Scratch) {
    let dst_width = source.width + 2 * margin;
    for x in (0..dst_width).step_by(STRIP) {
        let columns = STRIP.min(dst_width - x);
        blur_strip(source, half, margin, x, columns, dst, &mut scratch.strip, &mut scratch.line);
    }
}

/// Columns `x .. x + columns` of `dst`.
#[multiversion::multiversion(targets = "simd")]
#[expect(clippy::too_many_arguments, reason = "one loop nest, cut where it is dispatched")]
fn blur_strip(
    source: Source<'_>,
    half: &[f32],
    margin: usize,
    x: usize,
    columns: usize,
    dst: &mut [f32],
    strip: &mut Vec<f32>,
    line: &mut Vec<f32>,
) {
    let (width, height, border) = (source.width, source.height(), source.border);
    let radius = half.len() - 1;
    let pitch = columns.next_multiple_of(LANES);
    let above = margin + radius;
    strip.resize((height + 2 * above) * pitch, 0.0);
    line.resize(pitch + 2 * radius, 0.0);

    // Along the rows.
    let start = x.cast_signed() - above.cast_signed();
    let taps = useful(border, radius, start + radius.cast_signed(), columns, width);
    let interior = usize::try_from(start).ok().filter(|&s| s + line.len() <= width);
    for y in 0..height {
        let out = &mut strip[(above + y) * pitch..][..pitch];
        if let Some(start) = interior {
            fir(&source.row(y)[start..], radius, 1, half, taps, out);
        } else {
            border.extend(source.row(y), start, line);
            fir(line, radius, 1, half, taps, out);
        }
    }

    // The rows beyond the image are copies of rows within, or nothing.
    for i in (0..above).chain(above + height..height + 2 * above) {
        match border.source(i.cast_signed() - above.cast_signed(), height) {
            Some(y) => strip.copy_within((above + y) * pitch..(above + y + 1) * pitch, i * pitch),
            None => strip[i * pitch..(i + 1) * pitch].fill(0.0),
        }
    }

    // Along the columns.
    let dst_width = width + 2 * margin;
    for (i, row) in dst.chunks_exact_mut(dst_width).enumerate() {
        let y = i.cast_signed() - margin.cast_signed();
        let taps = useful(border, radius, y, 1, height);
        fir(strip, (i + radius) * pitch, pitch, half, taps, &mut row[x..x + columns]);
    }
}

/// First and last tap that can meet a pixel of `0..len` from the `count` places from `from` on,
/// if beyond there is nothing.
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
/// Each pair is added before it is weighed: a mirrored image gives the mirrored result, bit for
/// bit. The smallest taps come first, which keeps the rounding small.
#[inline(always)]
fn fir(data: &[f32], centre: usize, stride: usize, half: &[f32], taps: (usize, usize), out: &mut [f32]) {
    let mut at = 0;
    let mut blocks = out.chunks_exact_mut(BLOCK);
    for block in &mut blocks {
        block.copy_from_slice(&sums::<BLOCK>(data, centre + at, stride, half, taps));
        at += BLOCK;
    }
    for block in blocks.into_remainder().chunks_mut(LANES) {
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
