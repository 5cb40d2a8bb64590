//! Roughness: what the fine detail of outlines has beyond a normal field that is alike from shape to shape and all along the outline.

use portable_numerics::statistics::deviation;

use crate::descriptors::Descriptors;
use crate::model::LEAST_FOR_LOCAL;
use crate::statistics::{ShapeStatistics, finest_coarse, order, terms};

/// Places per harmonic at which detail is looked at.
const PLACES_PER_HARMONIC: usize = 8;

/// The fine detail of a training set: what the terms with |l| above [`finest_coarse`] add to each outline.
///
/// Few components reach so far, so a draw makes its detail from the residuals: a normal field, alike all along the outline
/// and from shape to shape. What real detail has beyond that is roughness.
pub(crate) struct Fine {
    harmonics: usize,
    /// Coordinates of the detail, the rest set to 0.
    details: Vec<Vec<f64>>,
    /// Mean square of each outline's detail.
    energies: Vec<f64>,
}

impl Fine {
    /// None if an outline has no detail at all.
    pub(crate) fn new(deviations: &[Vec<f64>], harmonics: usize) -> Option<Self> {
        let coarse = finest_coarse(harmonics);
        let detail = |(k, &v): (usize, &f64)| if order(k, harmonics) > coarse { v } else { 0.0 };
        let details: Vec<Vec<f64>> =
            deviations.iter().map(|row| row.iter().enumerate().map(detail).collect()).collect();
        let energies: Vec<f64> = details.iter().map(|row| dot(row, row)).collect();
        let there = energies.iter().all(|&e| e > 0.0);
        there.then_some(Self { harmonics, details, energies })
    }

    /// Spread of the logarithm of a shape's root-mean-square detail, beyond what chance gives draws without roughness.
    pub(crate) fn roughness_sd(&self, of: &ShapeStatistics) -> f64 {
        let logs: Vec<f64> = self.energies.iter().map(|e| libm::log(*e) / 2.0).collect();
        let spread = deviation(&logs);
        // The energy of a normal draw has mean tr Σ and variance 2 tr Σ², Σ being the loadings' products and, on the
        // diagonal, the residual variances. (Tails of the scores add to this variance, but little to that of its logarithm.)
        let coarse = finest_coarse(self.harmonics);
        let is_fine = |k: usize| order(k, self.harmonics) > coarse;
        let loadings: Vec<Vec<f64>> = of
            .components
            .iter()
            .map(|c| c.loading.iter().enumerate().map(|(k, &v)| if is_fine(k) { v } else { 0.0 }).collect())
            .collect();
        let mut residual = of.residual_squares();
        residual.iter_mut().enumerate().filter(|&(k, _)| !is_fine(k)).for_each(|(_, v)| *v = 0.0);
        let mut mean: f64 = residual.iter().sum();
        let mut variance = 2.0 * dot(&residual, &residual);
        for (k, a) in loadings.iter().enumerate() {
            let square = dot(a, a);
            mean += square;
            variance += 2.0 * square * square;
            variance += a.iter().zip(&residual).map(|(v, r)| 4.0 * v * v * r).sum::<f64>();
            for b in &loadings[..k] {
                let product = dot(a, b);
                variance += 4.0 * product * product;
            }
        }
        // It behaves as a χ² of so many degrees of freedom; the variance of ½ ln χ² is ψ₁(ν/2) / 4.
        let freedom = 2.0 * mean * mean / variance;
        let chance = trigamma(freedom / 2.0) / 4.0;
        (spread * spread - chance).max(0.0).sqrt().min(1.0)
    }

    /// Modulation of the detail along the outline, from how much its fourth moment exceeds that of an even normal field.
    pub(crate) fn local_roughness(&self) -> f64 {
        if self.harmonics < LEAST_FOR_LOCAL {
            return 0.0;
        }
        let places = PLACES_PER_HARMONIC * self.harmonics;
        let mut fourth = 0.0;
        for (row, energy) in self.details.iter().zip(&self.energies) {
            let Ok(detail) = Descriptors::from_harmonics(terms(row)) else {
                return 0.0;
            };
            for h in detail.outline(places) {
                let square = (h[0] * h[0] + h[1] * h[1]) / energy;
                fourth += square * square;
            }
        }
        // An even normal field of complex numbers has E|h|⁴ = 2 (E|h|²)²; modulated by 1 + σf with f a standard normal,
        // this grows by (1 + 6s + 3s²) / (1 + s)², s = σ². Solved for s: √(2 / (3 − growth)) − 1.
        let even = 2.0 * places as f64 * self.details.len() as f64;
        let growth = (fourth / even).clamp(1.0, GREATEST_GROWTH);
        ((2.0 / (3.0 - growth)).sqrt() - 1.0).sqrt()
    }
}

/// Growth of the fourth moment at a modulation of 1: (1 + 6 + 3) / 4.
const GREATEST_GROWTH: f64 = 2.5;

/// ψ₁(x) by recurrence and its asymptotic series; 1e-8 for x >= 1/2.
fn trigamma(x: f64) -> f64 {
    let mut sum = 0.0;
    let mut x = x;
    while x < 8.0 {
        sum += 1.0 / (x * x);
        x += 1.0;
    }
    let y = 1.0 / (x * x);
    sum + 1.0 / x + y / 2.0 + y / x * (1.0 / 6.0 - y * (1.0 / 30.0 - y / 42.0))
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}
