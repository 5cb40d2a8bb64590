//! Filters of the pyramid on the grid of frequencies. All tables are column-major, like spectra.

use core::f64::consts::{FRAC_PI_2, PI, TAU};

use crate::sums::single;

/// Returns the signed frequency of an index of the transform in radians per pixel, −π to π.
pub(crate) fn frequency(index: usize, side: usize) -> f64 {
    let signed = if 2 * index >= side { index as f64 - side as f64 } else { index as f64 };
    TAU * signed / side as f64
}

/// Returns the radial low-pass function L(r): 1 up to half the edge, 0 from the edge on, and a raised cosine of log₂ r
/// between them.
fn low_pass(r: f64, edge: f64) -> f64 {
    if 2.0 * r <= edge {
        1.0
    } else if r >= edge {
        0.0
    } else {
        libm::cos(FRAC_PI_2 * libm::log2(2.0 * r / edge))
    }
}

/// Returns the complement H(r) of [`low_pass`]: L² + H² = 1.
fn high_pass(r: f64, edge: f64) -> f64 {
    if 2.0 * r <= edge {
        0.0
    } else if r >= edge {
        1.0
    } else {
        libm::sin(FRAC_PI_2 * libm::log2(2.0 * r / edge))
    }
}

/// Computes a table of a function of the frequency (x, y) in radians per pixel.
fn table(width: usize, height: usize, value: impl Fn(f64, f64) -> f64) -> Vec<f32> {
    let along_y: Vec<f64> = (0..height).map(|ky| frequency(ky, height)).collect();
    let columns = (0..width).map(|kx| frequency(kx, width));
    columns.flat_map(|x| along_y.iter().map(move |&y| (x, y))).map(|(x, y)| single(value(x, y))).collect()
}

fn radius(x: f64, y: f64) -> f64 {
    (x * x + y * y).sqrt()
}

/// The two filters that separate the high-pass residual of an image from the scales.
#[derive(Debug, Clone)]
pub(crate) struct Split {
    pub(crate) low: Vec<f32>,
    pub(crate) high: Vec<f32>,
}

impl Split {
    pub(crate) fn new(width: usize, height: usize) -> Self {
        Self {
            low: table(width, height, |x, y| low_pass(radius(x, y), PI)),
            high: table(width, height, |x, y| high_pass(radius(x, y), PI)),
        }
    }
}

/// The filters of one scale.
#[derive(Debug, Clone)]
pub(crate) struct ScaleFilters {
    /// The low-pass filter before the next scale.
    pub(crate) low: Vec<f32>,
    /// H(r) α |cos(θ − θₖ)|^(K−1) of each orientation, with the sign of the cosine: positive in the half plane of the
    /// analytic signal.
    pub(crate) oriented: Vec<Vec<f32>>,
}

impl ScaleFilters {
    pub(crate) fn new(width: usize, height: usize, orientations: usize) -> Self {
        let low = table(width, height, |x, y| low_pass(radius(x, y), FRAC_PI_2));
        let alpha = angular_factor(orientations);
        let oriented = (0..orientations).map(|k| {
            let (sin, cos) = libm::sincos(PI * k as f64 / orientations as f64);
            table(width, height, |x, y| {
                let r = radius(x, y);
                // Frequencies from the edge of the previous low-pass filter on are not part of a scale.
                if r >= PI || 2.0 * r <= FRAC_PI_2 {
                    return 0.0;
                }
                let along = (x * cos + y * sin) / r;
                let power = (1..orientations).fold(1.0, |power, _| power * along.abs());
                (high_pass(r, FRAC_PI_2) * alpha * power).copysign(along)
            })
        });
        Self { low, oriented: oriented.collect() }
    }
}

/// Returns α with Σₖ α² cos^(2K−2)(θ − πk/K) = 1: 2^(K−1) (K−1)! / √(K (2K−2)!).
fn angular_factor(orientations: usize) -> f64 {
    let factorial = |n: usize| (1..=n).map(|i| i as f64).product::<f64>();
    let power = factorial(orientations - 1) * (1_u64 << (orientations - 1)) as f64;
    power / (orientations as f64 * factorial(2 * orientations - 2)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_of_all_filters_sum_to_one() {
        for orientations in 2..=8 {
            let (width, height) = (32, 16);
            let split = Split::new(width, height);
            let scale = ScaleFilters::new(width, height, orientations);
            for i in 0..width * height {
                let square = |v: f32| f64::from(v) * f64::from(v);
                assert!((square(split.low[i]) + square(split.high[i]) - 1.0).abs() < 1e-6);
                let sum: f64 = scale.oriented.iter().map(|filter| square(filter[i])).sum();
                let total = if split.low[i] > 0.0 { 1.0 } else { sum + square(scale.low[i]) };
                let found = sum + square(scale.low[i]);
                assert!((found - total).abs() < 1e-6, "{orientations} {i}: {found}");
            }
        }
    }

    #[test]
    fn opposite_frequencies_have_opposite_signs() {
        let side = 16;
        for filter in ScaleFilters::new(side, side, 3).oriented {
            for kx in 1..side {
                for ky in 1..side {
                    let mirrored = filter[(side - kx) * side + side - ky];
                    assert!((filter[kx * side + ky] + mirrored).abs() < 1e-6);
                }
            }
        }
    }
}
