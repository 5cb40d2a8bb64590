//! Image filters.

use multiversion::multiversion;

use crate::number::{single, whole};

/// Radius of the kernel, standard deviations.
const REACH: f64 = 3.5;

/// Convolves an image with a Gaussian. The border is a mirror.
pub(crate) fn blur(image: &[f32], width: usize, sigma: f64) -> Vec<f32> {
    separable(image, width, &taps(sigma), mirrored)
}

/// Returns the taps of a Gaussian, from the centre outwards.
fn taps(sigma: f64) -> Vec<f32> {
    let radius = whole((REACH * sigma).ceil()).max(1);
    let weights: Vec<f64> = (0..=radius).map(|i| libm::exp(-0.5 * (i * i) as f64 / (sigma * sigma))).collect();
    let sum = weights[0] + 2.0 * weights[1..].iter().sum::<f64>();
    weights.iter().map(|w| single(w / sum)).collect()
}

/// Convolves rows and columns with symmetric taps, given from the centre outwards. `place(i, reach, length)` returns
/// the index in
/// `0..length` that replaces `i - reach`.
pub fn separable(image: &[f32], width: usize, taps: &[f32], place: fn(usize, usize, usize) -> usize) -> Vec<f32> {
    let height = image.len() / width.max(1);
    let mut rows = vec![0.0; image.len()];
    let reach = taps.len() - 1;
    let mut padded = vec![0.0; width + 2 * reach];
    for (from, to) in image.chunks_exact(width).zip(rows.chunks_exact_mut(width)) {
        for (i, value) in padded.iter_mut().enumerate() {
            *value = from[place(i, reach, width)];
        }
        weighted_sum(|i| &padded[i..][..width], taps, to);
    }
    let mut out = vec![0.0; image.len()];
    for (y, to) in out.chunks_exact_mut(width).enumerate() {
        weighted_sum(|i| &rows[place(y + i, reach, height) * width..][..width], taps, to);
    }
    out
}

/// Returns the index in `0..length` that replaces `i - reach` if the border is a mirror.
fn mirrored(i: usize, reach: usize, length: usize) -> usize {
    let period = 2 * length;
    // Added periods keep the index from becoming negative.
    let place = (i + period * (reach / period + 1) - reach) % period;
    if place < length { place } else { period - 1 - place }
}

/// Sums shifted values, weighted by the taps. Shifts are 0 to twice the radius.
fn weighted_sum<'a>(shifted: impl Fn(usize) -> &'a [f32], taps: &[f32], to: &mut [f32]) {
    let reach = taps.len() - 1;
    scale(shifted(reach), taps[0], to);
    for (i, tap) in taps.iter().enumerate().skip(1) {
        add(shifted(reach - i), shifted(reach + i), *tap, to);
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

/// Returns the horizontal and the vertical gradient by central differences; one-sided at the border.
pub(crate) fn gradient(image: &[f32], width: usize) -> [Vec<f32>; 2] {
    let height = image.len() / width.max(1);
    let mut across = vec![0.0; image.len()];
    let mut down = vec![0.0; image.len()];
    for y in 0..height {
        let row = &image[y * width..(y + 1) * width];
        let (above, below) =
            (&image[y.saturating_sub(1) * width..][..width], &image[(y + 1).min(height - 1) * width..][..width]);
        let (to_x, to_y) = (&mut across[y * width..(y + 1) * width], &mut down[y * width..(y + 1) * width]);
        for x in 0..width {
            to_x[x] = 0.5 * (row[(x + 1).min(width - 1)] - row[x.saturating_sub(1)]);
            to_y[x] = 0.5 * (below[x] - above[x]);
        }
    }
    [across, down]
}

/// Returns the magnitude of the gradient.
pub(crate) fn slope(image: &[f32], width: usize) -> Vec<f32> {
    let [across, down] = gradient(image, width);
    across.iter().zip(&down).map(|(x, y)| (x * x + y * y).sqrt()).collect()
}

/// Halves the resolution, after a blur against aliasing.
pub(crate) fn halved(image: &[f32], width: usize) -> (Vec<f32>, usize) {
    let smooth = blur(image, width, 1.0);
    let rows = smooth.chunks_exact(width).step_by(2);
    (rows.flat_map(|row| row.iter().step_by(2).copied()).collect(), width.div_ceil(2))
}

#[cfg(test)]
mod tests {
    use rand_core::{Rng, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;

    fn noise(count: usize, seed: u64) -> Vec<f32> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        (0..count).map(|_| f32::from(u16::try_from(rng.next_u64() >> 48).unwrap()) / 65_535.0).collect()
    }

    #[test]
    fn a_blur_equals_direct_convolution_with_a_mirrored_border() {
        let (width, height) = (9, 7);
        let image = noise(width * height, 2);
        for sigma in [0.5, 1.3, 6.0] {
            let taps = taps(sigma);
            let fast = blur(&image, width, sigma);
            let reach = i64::try_from(taps.len()).unwrap() - 1;
            let mirror = |i: i64, n: i64| {
                let i = i.rem_euclid(2 * n);
                usize::try_from(if i < n { i } else { 2 * n - 1 - i }).unwrap()
            };
            for (i, value) in fast.iter().enumerate() {
                let (x, y) = ((i % width) as i64, (i / width) as i64);
                let mut sum = 0.0;
                for dy in -reach..=reach {
                    for dx in -reach..=reach {
                        let weight = |d: i64| f64::from(taps[usize::try_from(d.abs()).unwrap()]);
                        sum +=
                            weight(dx) * weight(dy) * f64::from(image[mirror(y + dy, 7) * width + mirror(x + dx, 9)]);
                    }
                }
                assert!((f64::from(*value) - sum).abs() < 1e-5, "sigma {sigma}, pixel {i}: {value}, not {sum}");
            }
        }
    }

    #[test]
    fn a_constant_is_unchanged_and_a_ramp_has_its_gradient() {
        assert!(blur(&[0.7; 64], 8, 2.0).iter().all(|v| (v - 0.7).abs() < 1e-6));
        let ramp: Vec<f32> = (0..64_u8).map(|i| 3.0 * f32::from(i % 8) - 2.0 * f32::from(i / 8)).collect();
        let [across, down] = gradient(&ramp, 8);
        assert_eq!((across[27], down[27]), (3.0, -2.0));
        assert!((slope(&ramp, 8)[27] - 13.0_f32.sqrt()).abs() < 1e-6);
        let (half, width) = halved(&[0.25; 15 * 9], 15);
        assert_eq!((width, half.len()), (8, 8 * 5));
    }
}
