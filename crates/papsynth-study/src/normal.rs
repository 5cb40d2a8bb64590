//! The normal distribution and Student's t.

use std::f64::consts::{FRAC_2_PI, PI, SQRT_2};

/// Standard normal deviate that a two-sided interval of 95 % reaches to: Φ⁻¹(.975).
pub(crate) const Z_95: f64 = 1.959_963_984_540_054;

/// Halvings of a bracket, after which it is as narrow as two numbers can be.
const HALVINGS: u32 = 200;

/// Farther out than any deviate that is asked for: corrected rates of a million trials lie within 6.
const FARTHEST: f64 = 1e4;

/// φ(x), the density.
pub(crate) fn density(x: f64) -> f64 {
    libm::exp(-0.5 * x * x) / (2.0 * PI).sqrt()
}

/// Φ(x), the probability of less than x.
fn probability(x: f64) -> f64 {
    0.5 * libm::erfc(-x / SQRT_2)
}

/// Φ⁻¹(p): the deviate that a fraction `p`, 0 to 1, lies below.
pub(crate) fn deviate(p: f64) -> f64 {
    inverse(probability, p)
}

/// The deviate of Student's t with `freedom` degrees that a fraction `p` lies below.
pub(crate) fn student(p: f64, freedom: u64) -> f64 {
    inverse(|t| 0.5 * (1.0 + within(t, freedom)), p)
}

/// P(|T| < t), signed as t: the finite series for whole degrees of freedom (Abramowitz and Stegun 26.7.3 and 26.7.4).
fn within(t: f64, freedom: u64) -> f64 {
    let ratio = t / (freedom as f64).sqrt();
    let cosine = 1.0 / (1.0 + ratio * ratio).sqrt();
    let sine = ratio * cosine;
    let (mut term, mut sum) = (1.0, 0.0);
    let odd = freedom % 2 == 1;
    // Of odd degrees the terms are cos, 2/3 cos³, …; of even ones 1, 1/2 cos², ….
    let first = if odd { 1 } else { 0 };
    for power in (first..freedom.saturating_sub(1)).step_by(2) {
        sum += term;
        term *= cosine * cosine * (power + 1) as f64 / (power + 2) as f64;
    }
    if odd { FRAC_2_PI * (libm::atan(ratio) + sine * cosine * sum) } else { sine * sum }
}

/// Where an increasing function reaches a value, by halving.
fn inverse(function: impl Fn(f64) -> f64, value: f64) -> f64 {
    let (mut low, mut high) = (-FARTHEST, FARTHEST);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if function(middle) < value { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviates_are_those_of_the_tables() {
        for (p, z) in [(0.975, Z_95), (0.5, 0.0), (0.841_344_746_068_542_9, 1.0), (1e-6, -4.753_424_308_822_899)] {
            assert!((deviate(p) - z).abs() < 1e-9, "{p}: {}", deviate(p));
        }
        // Two-sided 95 % of Student's t.
        for (freedom, t) in [(1, 12.706_204_736), (2, 4.302_652_730), (5, 2.570_581_836), (6, 2.446_911_851)] {
            assert!((student(0.975, freedom) - t).abs() < 1e-6, "{freedom}: {}", student(0.975, freedom));
        }
        assert!((student(0.975, 100_000) - Z_95).abs() < 1e-4);
    }

    #[test]
    fn deviates_turn_probabilities_round() {
        for k in 1..200 {
            let p = f64::from(k) / 200.0;
            assert!((probability(deviate(p)) - p).abs() < 1e-14);
        }
    }
}
