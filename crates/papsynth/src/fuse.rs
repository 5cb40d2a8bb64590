//! The noise of a picture that was fused of several planes: neighbouring pixels share some of it.
//!
//! On the empty slide planes are fused by weights that change slowly from pixel to pixel, after filters and shifts by parts of
//! a pixel, which leave noise correlated. Where there is structure the sharpest plane is taken, another one a few pixels on, and
//! less is shared. What neighbours share is measured on real pictures of extended focus.

use crate::scene::Fusion;

/// Filters what noise has added to the expected grey levels so that neighbours correlate as they should. Its variance
/// stays what it was, but just below the largest grey level. Grey levels and expected ones come with the first number of bits and leave with the second.
pub(crate) fn correlate(
    grey: &mut [u16],
    expected: &mut [f32],
    width: usize,
    channels: usize,
    fusion: &Fusion,
    bits: [u32; 2],
) {
    let row = width * channels;
    if row == 0 {
        return;
    }
    let [before, top] = bits.map(|bits| ((1_u32 << bits.min(16)) - 1) as f32);
    let scale = top / before;
    let own: Vec<f32> = grey.iter().zip(&*expected).map(|(grey, mean)| scale * (f32::from(*grey) - mean)).collect();
    expected.iter_mut().for_each(|mean| *mean *= scale);
    let expected = &*expected;
    let variance = own.iter().map(|n| f64::from(n * n)).sum::<f64>() / own.len() as f64;
    // Rounding adds noise that neighbours do not share.
    let diluted = 1.0 + ROUNDING / variance.max(ROUNDING);
    let correlation = fusion.noise_correlation.map(|asked| (asked * diluted).min(MOST));
    let [across, down] = [0, 1].map(|axis| kernel(correlation[axis], SECOND[axis]));
    let structure = structure(expected, width, channels);
    let half = (HALF_ALONE * variance) as f32;
    let centre = across[0] * down[0];
    let mut noise = own.clone();
    for (noise, line) in noise.chunks_exact_mut(row).zip(own.chunks_exact(row)) {
        for (i, value) in noise.iter_mut().enumerate() {
            let (x, channel) = (i / channels, i % channels);
            *value = filtered(across, |step| line[mirrored(x, step, width) * channels + channel]);
        }
    }
    let height = noise.len() / row;
    let mut shared = vec![0.0; noise.len()];
    for (y, shared) in shared.chunks_exact_mut(row).enumerate() {
        let rows: [usize; 5] = core::array::from_fn(|k| mirrored(y, k as i64 - 2, height) * row);
        for (x, value) in shared.iter_mut().enumerate() {
            *value = filtered(down, |step| noise[rows[(step + 2) as usize] + x]);
        }
    }
    // To first order this changes the correlation along the diagonals alone.
    let skew = (0.5 * fusion.noise_skew) as f32;
    // What is left of noise so many steps below the largest grey level, when planes are clipped there before they are fused.
    let per_level = (STEPS as f64 / (REACH * (PLANE_NOISE * variance.sqrt()).max(1e-6))) as f32;
    let remaining: [f32; STEPS + 1] =
        core::array::from_fn(|step| deviation_below(REACH * step as f64 / STEPS as f64) as f32);
    for (y, grey) in grey.chunks_exact_mut(row).enumerate() {
        let [above, below] = [-1, 1].map(|step| mirrored(y, step, height) * row);
        for (i, grey) in grey.iter_mut().enumerate() {
            let (x, channel) = (i / channels, i % channels);
            let [left, right] = [-1, 1].map(|step| mirrored(x, step, width) * channels + channel);
            let diagonals = shared[below + right] + shared[above + left] - shared[below + left] - shared[above + right];
            let at = y * row + i;
            let alone = structure[at] / (structure[at] + half).max(f32::MIN_POSITIVE);
            let rest = 1.0 - alone;
            // The pixel's own noise is a part of what it shares, so that variances do not simply add.
            let norm = (alone * alone + rest * rest + 2.0 * alone * rest * centre).sqrt();
            let step = ((top - expected[at]).max(0.0) * per_level) as usize;
            let value = remaining[step.min(STEPS)] * (alone * own[at] + rest * (shared[at] + skew * diagonals)) / norm;
            *grey = (expected[at] + value + 0.5).clamp(0.0, top) as u16;
        }
    }
}

/// Structure that has so many times the variance of noise makes half of a pixel's noise its own: fitted to how noise correlates on
/// cytoplasm and in nuclei of real pictures of extended focus.
const HALF_ALONE: f64 = 15.0;

/// Noise of a plane, relative to that of the picture it is fused to: fitted to how noise falls just below the largest grey level.
const PLANE_NOISE: f64 = 2.0;

/// Steps of the table of what is left of clipped noise, and how far it reaches, in standard deviations.
const STEPS: usize = 64;
const REACH: f64 = 4.0;

/// Standard deviation of the lesser of a normal deviate and `most`.
fn deviation_below(most: f64) -> f64 {
    let density = libm::exp(-0.5 * most * most) / (2.0 * core::f64::consts::PI).sqrt();
    let share = 0.5 * libm::erfc(-most * core::f64::consts::FRAC_1_SQRT_2);
    let (mean, square) = (most * (1.0 - share) - density, share - most * density + most * most * (1.0 - share));
    (square - mean * mean).max(0.0).sqrt()
}

/// How much there is to see about every pixel: half the mean square of differences four pixels apart, without noise.
fn structure(expected: &[f32], width: usize, channels: usize) -> Vec<f32> {
    /// Half of the distance of what is compared, and half of the width of the mean, px.
    const STEP: i64 = 2;
    const AROUND: i64 = 3;
    let row = width * channels;
    let height = expected.len() / row;
    let mut squares = vec![0.0; expected.len()];
    for y in 0..height {
        let [above, below] = [-STEP, STEP].map(|step| mirrored(y, step, height) * row);
        for i in 0..row {
            let (x, channel) = (i / channels, i % channels);
            let beside = |step: i64| expected[y * row + mirrored(x, step, width) * channels + channel];
            let (dx, dy) = (beside(STEP) - beside(-STEP), expected[below + i] - expected[above + i]);
            squares[y * row + i] = 0.25 * (dx * dx + dy * dy);
        }
    }
    let weight = 1.0 / (2 * AROUND + 1) as f32;
    let mut rows = vec![0.0; squares.len()];
    for (y, mean) in rows.chunks_exact_mut(row).enumerate() {
        for (i, mean) in mean.iter_mut().enumerate() {
            let (x, channel) = (i / channels, i % channels);
            let at = |step: i64| squares[y * row + mirrored(x, step, width) * channels + channel];
            *mean = weight * (-AROUND..=AROUND).map(at).sum::<f32>();
        }
    }
    for (y, mean) in squares.chunks_exact_mut(row).enumerate() {
        for (i, mean) in mean.iter_mut().enumerate() {
            let at = |step: i64| rows[mirrored(y, step, height) * row + i];
            *mean = weight * (-AROUND..=AROUND).map(at).sum::<f32>();
        }
    }
    squares
}

/// Variance of what rounding adds.
const ROUNDING: f64 = 1.0 / 12.0;

/// Largest correlation of neighbours that a filter of five values leaves.
const MOST: f64 = 0.5;

/// A place some steps away; beyond the border the one that a mirror shows.
fn mirrored(at: usize, step: i64, count: usize) -> usize {
    let place = (at as i64 + step).unsigned_abs();
    let last = count as u64 - 1;
    usize::try_from(if place > last { (2 * last).saturating_sub(place) } else { place }).unwrap_or(0)
}

/// Correlation of noise two pixels apart, across and down: measured on pictures of extended focus.
const SECOND: [f64; 2] = [-0.025, 0.01];

/// The symmetric filter of five values (b, a, 1, a, b) over the root of the sum of their squares that leaves neighbours a
/// correlation: ρ₁ = 2a(1 + b)/n, ρ₂ = (2b + a²)/n with n = 1 + 2a² + 2b². Its values from the middle on.
fn kernel(correlation: f64, second: f64) -> [f32; 3] {
    /// Steps of the fixed-point iteration: a fraction of a per mille is left after far fewer.
    const STEPS: usize = 60;
    let second = if correlation > 0.0 { second } else { 0.0 };
    let (mut a, mut b) = (0.0_f64, 0.0_f64);
    for _ in 0..STEPS {
        let n = 1.0 + 2.0 * a * a + 2.0 * b * b;
        let next = (correlation * n / (2.0 * (1.0 + b)), 0.5 * (second * n - a * a));
        a += 0.5 * (next.0 - a);
        b += 0.5 * (next.1 - b);
    }
    let norm = 1.0 / (1.0 + 2.0 * a * a + 2.0 * b * b).sqrt();
    [norm as f32, (norm * a) as f32, (norm * b) as f32]
}

fn filtered([centre, first, second]: [f32; 3], value: impl Fn(i64) -> f32) -> f32 {
    centre * value(0) + first * (value(-1) + value(1)) + second * (value(-2) + value(2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Key;
    use crate::random;

    const WIDTH: usize = 320;

    /// What is left of a camera's noise of a standard deviation, in levels of the first number of bits, on what was expected; and its
    /// variance.
    fn fused(expected: impl Fn(usize) -> f32, sd: f64, skew: f64, bits: [u32; 2]) -> (Vec<f64>, f64) {
        let mut rng = Key { seed: 3, index: 0 }.stream("test", 0, "noise");
        let mut expected: Vec<f32> = (0..WIDTH * 300).map(expected).collect();
        let noisy = |e: &f32| (f64::from(*e) + 0.5 + sd * random::normal(&mut rng)) as u16;
        let mut grey: Vec<u16> = expected.iter().map(noisy).collect();
        let fusion = Fusion { first_um: 0.0, step_um: 1.0, planes: 3, noise_correlation: [0.2, 0.4], noise_skew: skew };
        correlate(&mut grey, &mut expected, WIDTH, 1, &fusion, bits);
        let noise: Vec<f64> = grey.iter().zip(&expected).map(|(g, e)| f64::from(*g) - f64::from(*e)).collect();
        let variance = product(&noise, 0);
        (noise, variance)
    }

    /// Mean product of noise and that so many pixels on.
    fn product(noise: &[f64], step: usize) -> f64 {
        let pairs = (0..noise.len() - step).filter(|i| step + 1 >= WIDTH || i % WIDTH + step < WIDTH);
        let products: Vec<f64> = pairs.map(|i| noise[i] * noise[i + step]).collect();
        products.iter().sum::<f64>() / products.len() as f64
    }

    #[test]
    fn neighbours_share_as_much_noise_as_asked_and_its_variance_stays() {
        let (noise, variance) = fused(|_| 2000.0, 30.0, 0.02, [12, 12]);
        // Some 10⁵ pixels: a standard error of .003 for each.
        assert!((variance / 900.0 - 1.0).abs() < 0.03, "{variance}");
        for (step, wanted) in [(1, 0.2), (WIDTH, 0.4), (2, SECOND[0])] {
            let found = product(&noise, step) / variance;
            assert!((found - wanted).abs() < 0.012, "{step}: {found}");
        }
        let skew = 0.5 * (product(&noise, WIDTH + 1) - product(&noise, WIDTH - 1)) / variance;
        assert!((skew - 0.02).abs() < 0.008, "{skew}");
    }

    #[test]
    fn where_there_is_structure_noise_is_the_cameras() {
        // Waves of 1900 levels.
        let waves = |i| 2000.0 + 1900.0 * libm::sin((i % WIDTH) as f64 * 0.7) as f32;
        let (noise, variance) = fused(waves, 30.0, 0.02, [12, 12]);
        assert!((variance / 900.0 - 1.0).abs() < 0.03, "{variance}");
        let down = product(&noise, WIDTH) / variance;
        assert!(down.abs() < 0.03, "{down}");
    }

    #[test]
    fn faint_noise_is_shared_too() {
        // Noise of .9 levels of 8 bits: a filter of whole levels would be undone by rounding.
        let (noise, variance) = fused(|_| 200.25 * 257.0, 0.9 * 257.0, 0.0, [16, 8]);
        assert!((variance - 0.81 - ROUNDING).abs() < 0.03, "{variance}");
        let down = product(&noise, WIDTH) / variance;
        assert!((down - 0.4).abs() < 0.03, "{down}");
    }

    #[test]
    fn clipped_noise_is_that_of_clipped_deviates() {
        let mut rng = Key { seed: 5, index: 0 }.stream("test", 0, "noise");
        for most in [0.0, 0.9, 2.0] {
            let drawn: Vec<f64> = (0..100_000).map(|_| random::normal(&mut rng).min(most)).collect();
            let mean = drawn.iter().sum::<f64>() / 1e5;
            let sd = (drawn.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / 1e5).sqrt();
            assert!((deviation_below(most) - sd).abs() < 0.01, "{most}: {sd}");
        }
        assert!((deviation_below(6.0) - 1.0).abs() < 1e-6);
    }
}
