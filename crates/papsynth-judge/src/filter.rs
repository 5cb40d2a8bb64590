//! Filters of whole images.

use multiversion::multiversion;

use crate::number::{single, whole};

/// Taps reach so many standard deviations far.
const REACH: f64 = 3.5;

/// Convolution with a Gaussian; the image is mirrored at its border.
pub(crate) fn blur(image: &[f32], width: usize, sigma: f64) -> Vec<f32> {
    let taps = taps(sigma);
    separable(image, width, &taps, &taps)
}

/// The taps of a Gaussian from its centre outwards.
fn taps(sigma: f64) -> Vec<f32> {
    let radius = whole((REACH * sigma).ceil()).max(1);
    let weights: Vec<f64> = (0..=radius).map(|i| libm::exp(-0.5 * (i * i) as f64 / (sigma * sigma))).collect();
    let sum = weights[0] + 2.0 * weights[1..].iter().sum::<f64>();
    weights.iter().map(|w| single(w / sum)).collect()
}

/// Convolution with symmetric taps along rows and along columns, each given from its centre outwards.
fn separable(image: &[f32], width: usize, across: &[f32], down: &[f32]) -> Vec<f32> {
    let height = image.len() / width.max(1);
    let mut rows = vec![0.0; image.len()];
    let reach = across.len() - 1;
    let mut padded = vec![0.0; width + 2 * reach];
    for (from, to) in image.chunks_exact(width).zip(rows.chunks_exact_mut(width)) {
        for (i, value) in padded.iter_mut().enumerate() {
            *value = from[mirrored(i, reach, width)];
        }
        along(&padded, across, to);
    }
    let mut out = vec![0.0; image.len()];
    for (y, to) in out.chunks_exact_mut(width).enumerate() {
        let row = |offset: usize, sign: bool| {
            let at = if sign { mirrored(y + down.len() - 1 + offset, down.len() - 1, height) } else { mirrored(y + down.len() - 1 - offset, down.len() - 1, height) };
            &rows[at * width..(at + 1) * width]
        };
        scale(row(0, true), down[0], to);
        for (i, tap) in down.iter().enumerate().skip(1) {
            add(row(i, false), row(i, true), *tap, to);
        }
    }
    out
}

/// The index in `0..length` that stands for `i - reach` when the border is a mirror.
fn mirrored(i: usize, reach: usize, length: usize) -> usize {
    let period = 2 * length;
    // So many periods are added that nothing is negative.
    let place = (i + period * (reach / period + 1) - reach) % period;
    if place < length { place } else { period - 1 - place }
}

#[multiversion(targets = "simd")]
fn along(padded: &[f32], taps: &[f32], to: &mut [f32]) {
    let reach = taps.len() - 1;
    let width = to.len();
    for (value, centre) in to.iter_mut().zip(&padded[reach..]) {
        *value = centre * taps[0];
    }
    for (i, tap) in taps.iter().enumerate().skip(1) {
        let (before, after) = (&padded[reach - i..][..width], &padded[reach + i..][..width]);
        for ((value, a), b) in to.iter_mut().zip(before).zip(after) {
            *value += (a + b) * tap;
        }
    }
}

#[multiversion(targets = "simd")]
fn scale(from: &[f32], tap: f32, to: &mut [f32]) {
    for (value, v) in to.iter_mut().zip(from) {
        *value = v * tap;
    }
}

#[multiversion(targets = "simd")]
fn add(a: &[f32], b: &[f32], tap: f32, to: &mut [f32]) {
    for ((value, a), b) in to.iter_mut().zip(a).zip(b) {
        *value += (a + b) * tap;
    }
}

/// Half the differences of the neighbours right and left, and below and above; one-sided at the border.
pub(crate) fn gradient(image: &[f32], width: usize) -> [Vec<f32>; 2] {
    let height = image.len() / width.max(1);
    let mut across = vec![0.0; image.len()];
    let mut down = vec![0.0; image.len()];
    for y in 0..height {
        let row = &image[y * width..(y + 1) * width];
        let (above, below) = (&image[y.saturating_sub(1) * width..][..width], &image[(y + 1).min(height - 1) * width..][..width]);
        let (to_x, to_y) = (&mut across[y * width..(y + 1) * width], &mut down[y * width..(y + 1) * width]);
        for x in 0..width {
            to_x[x] = 0.5 * (row[(x + 1).min(width - 1)] - row[x.saturating_sub(1)]);
            to_y[x] = 0.5 * (below[x] - above[x]);
        }
    }
    [across, down]
}

/// The length of the gradient.
pub(crate) fn slope(image: &[f32], width: usize) -> Vec<f32> {
    let [across, down] = gradient(image, width);
    across.iter().zip(&down).map(|(x, y)| (x * x + y * y).sqrt()).collect()
}

/// Every other pixel of every other row, after a blur that leaves nothing to alias.
pub(crate) fn halved(image: &[f32], width: usize) -> (Vec<f32>, usize) {
    let smooth = blur(image, width, 1.0);
    let rows = smooth.chunks_exact(width).step_by(2);
    (rows.flat_map(|row| row.iter().step_by(2).copied()).collect(), width.div_ceil(2))
}
