//! Power of absorbance against frequency.

use rustfft::num_complex::Complex32;
use rustfft::{Fft, FftPlannerScalar};
use std::sync::Arc;

use crate::number::{single, whole};

/// Side of the windows whose spectra are averaged, pixels.
const SIDE: usize = 256;

/// Rings of frequency, cycles a pixel, each by half an octave beyond the one before.
pub(crate) const RINGS: usize = 12;

/// Lowest frequency of the lowest ring.
const LOWEST: f64 = 1.0 / 128.0;

/// The slope is measured between these frequencies, cycles a pixel: below lie whole cells, above noise.
const MEASURED: [f64; 2] = [0.02, 0.15];

/// Middle of each ring, cycles a pixel.
#[must_use]
pub fn frequencies() -> [f64; RINGS] {
    std::array::from_fn(|i| LOWEST * libm::exp2((i as f64 + 0.5) / 2.0))
}

/// Logarithm to base 10 of the mean power a square cycle in each ring, of windows with a cosine's rim; NaN where a small picture has
/// no such frequency.
pub(crate) fn rings(image: &[f32], width: usize) -> [f64; RINGS] {
    let height = image.len() / width;
    // The largest power of two that fits: windows never overlap.
    let side = [SIDE, width, height].into_iter().min().unwrap_or(1);
    let side = if side.is_power_of_two() { side } else { side.next_power_of_two() / 2 };
    let transform = FftPlannerScalar::new().plan_fft_forward(side);
    let rim: Vec<f32> = (0..side)
        .map(|i| single(0.5 - 0.5 * libm::cos(2.0 * std::f64::consts::PI * (i as f64 + 0.5) / side as f64)))
        .collect();
    let (mut sums, mut counts) = ([0.0; RINGS], [0.0; RINGS]);
    for top in (0..=height - side).step_by(side) {
        for left in (0..=width - side).step_by(side) {
            let power = power(&|x, y| image[(top + y) * width + left + x], side, &rim, &transform);
            add(&power, side, &mut sums, &mut counts);
        }
    }
    std::array::from_fn(|i| if counts[i] > 0.0 { libm::log10((sums[i] / counts[i]).max(1e-12)) } else { f64::NAN })
}

/// |F|² of a window, normalised so that its mean over all frequencies is the variance.
fn power(at: &dyn Fn(usize, usize) -> f32, side: usize, rim: &[f32], transform: &Arc<dyn Fft<f32>>) -> Vec<f32> {
    let mean = (0..side).flat_map(|y| (0..side).map(move |x| (x, y))).map(|(x, y)| f64::from(at(x, y))).sum::<f64>()
        / (side * side) as f64;
    let mut rows: Vec<Complex32> = (0..side)
        .flat_map(|y| (0..side).map(move |x| (x, y)))
        .map(|(x, y)| Complex32::new((at(x, y) - single(mean)) * rim[x] * rim[y], 0.0))
        .collect();
    transform.process(&mut rows);
    let mut columns: Vec<Complex32> = (0..side).flat_map(|x| rows[x..].iter().step_by(side).copied()).collect();
    transform.process(&mut columns);
    let weight: f32 = rim.iter().map(|r| r * r).sum();
    columns.iter().map(|c| c.norm_sqr() / (weight * weight)).collect()
}

fn add(power: &[f32], side: usize, sums: &mut [f64; RINGS], counts: &mut [f64; RINGS]) {
    let frequency = |i: usize| i.min(side - i) as f64 / side as f64;
    for (i, value) in power.iter().enumerate() {
        let (u, v) = (frequency(i % side), frequency(i / side));
        let ring = 2.0 * libm::log2((u * u + v * v).sqrt().max(1e-9) / LOWEST);
        if ring >= 0.0 && whole(ring) < RINGS {
            sums[whole(ring)] += f64::from(*value);
            counts[whole(ring)] += 1.0;
        }
    }
}

/// The exponent of the power law through the rings between whole cells and noise.
pub(crate) fn slope(rings: &[f64; RINGS]) -> f64 {
    let points: Vec<(f64, f64)> = frequencies()
        .iter()
        .zip(rings)
        .filter(|(f, p)| **f >= MEASURED[0] && **f <= MEASURED[1] && p.is_finite())
        .map(|(f, p)| (libm::log10(*f), *p))
        .collect();
    let n = points.len() as f64;
    let (mx, my) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
    let (xy, xx) =
        points.iter().fold((0.0, 0.0), |(xy, xx), (x, y)| (xy + (x - mx) * (y - my), xx + (x - mx) * (x - mx)));
    if points.len() < 2 { f64::NAN } else { xy / xx }
}

#[cfg(test)]
mod tests {
    use rand_core::SeedableRng;
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;
    use portable_numerics::random::below;

    #[test]
    fn white_noise_is_flat_and_has_its_variance() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(3);
        // Uniform over ±1: variance 1/3.
        let image: Vec<f32> = (0..512 * 256).map(|_| single(below(200_001, &mut rng) as f64 / 1e5 - 1.0)).collect();
        let rings = rings(&image, 512);
        // From here on a ring has 300 coefficients: an error of 6 %.
        for ring in &rings[6..] {
            assert!((ring - libm::log10(1.0 / 3.0)).abs() < 0.08, "{rings:?}");
        }
        assert!(slope(&rings).abs() < 0.15);
    }

    #[test]
    fn a_wave_is_in_the_ring_of_its_frequency() {
        let image: Vec<f32> =
            (0..256 * 256).map(|i| single(libm::sin(std::f64::consts::TAU * 0.11 * (i % 256) as f64))).collect();
        let rings = rings(&image, 256);
        let loudest = (0..RINGS).max_by(|a, b| rings[*a].total_cmp(&rings[*b])).unwrap();
        let middle = frequencies()[loudest];
        assert!(middle / 0.11 < libm::exp2(0.25) && 0.11 / middle < libm::exp2(0.25), "{middle}");
    }

    #[test]
    fn the_slope_is_the_exponent() {
        let rings = frequencies().map(|f| 1.5 - 3.2 * libm::log10(f));
        assert!((slope(&rings) + 3.2).abs() < 1e-9);
        assert!(slope(&[f64::NAN; RINGS]).is_nan());
    }
}
