//! Roughness: the variation of fine detail from shape to shape and along the outline, beyond that of a stationary
//! normal field.

use portable_numerics::statistics::deviation;

use crate::descriptors::Descriptors;
use crate::model::MIN_HARMONICS_FOR_LOCAL;
use crate::statistics::{ShapeStatistics, finest_coarse, order, terms};

/// Sample points per harmonic.
const SAMPLES_PER_HARMONIC: usize = 8;

/// The fine detail of a training set: the terms with |l| above [`finest_coarse`].
///
/// Few components contain these terms, so that drawn detail comes from the residuals: a stationary normal field, with
/// the same variance for all shapes. Roughness describes the additional variation of real detail.
pub(crate) struct DetailStatistics {
    harmonics: usize,
    /// Coordinates of each outline, with those of the coarse form set to 0.
    details: Vec<Vec<f64>>,
    /// Mean square of the detail of each outline.
    energies: Vec<f64>,
}

impl DetailStatistics {
    /// Returns none if an outline has no detail.
    pub(crate) fn new(deviations: &[Vec<f64>], harmonics: usize) -> Option<Self> {
        let coarse = finest_coarse(harmonics);
        let detail = |(k, &v): (usize, &f64)| if order(k, harmonics) > coarse { v } else { 0.0 };
        let details: Vec<Vec<f64>> =
            deviations.iter().map(|row| row.iter().enumerate().map(detail).collect()).collect();
        let energies: Vec<f64> = details.iter().map(|row| dot(row, row)).collect();
        let there = energies.iter().all(|&e| e > 0.0);
        there.then_some(Self { harmonics, details, energies })
    }

    /// Returns the standard deviation of the logarithm of the root-mean-square detail, beyond that of draws without
    /// roughness.
    pub(crate) fn roughness_sd(&self, of: &ShapeStatistics) -> f64 {
        let logs: Vec<f64> = self.energies.iter().map(|e| libm::log(*e) / 2.0).collect();
        let spread = deviation(&logs);
        // The energy of a normal draw has mean tr Σ and variance 2 tr Σ², Σ being the loadings' products and, on the
        // diagonal, the residual variances. (Tails of the scores add to this variance, but little to that of its
        // logarithm.)
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
        // Its distribution is close to χ² with ν degrees of freedom; the variance of ½ ln χ² is ψ₁(ν/2) / 4.
        let freedom = 2.0 * mean * mean / variance;
        let chance = trigamma(freedom / 2.0) / 4.0;
        (spread * spread - chance).max(0.0).sqrt().min(1.0)
    }

    /// Returns the modulation of the detail along the outline, from the excess of its fourth moment over that of a
    /// stationary normal field.
    pub(crate) fn local_roughness(&self) -> f64 {
        if self.harmonics < MIN_HARMONICS_FOR_LOCAL {
            return 0.0;
        }
        let samples = SAMPLES_PER_HARMONIC * self.harmonics;
        let mut fourth = 0.0;
        for (row, energy) in self.details.iter().zip(&self.energies) {
            let Ok(detail) = Descriptors::from_harmonics(terms(row)) else {
                return 0.0;
            };
            for h in detail.outline(samples) {
                let square = (h[0] * h[0] + h[1] * h[1]) / energy;
                fourth += square * square;
            }
        }
        // A stationary normal field of complex numbers has E|h|⁴ = 2 (E|h|²)²; modulated by 1 + σf with f a standard
        // normal, this grows by (1 + 6s + 3s²) / (1 + s)², s = σ². Solved for s: √(2 / (3 − growth)) − 1.
        let stationary = 2.0 * samples as f64 * self.details.len() as f64;
        let growth = (fourth / stationary).clamp(1.0, MAX_GROWTH);
        ((2.0 / (3.0 - growth)).sqrt() - 1.0).sqrt()
    }
}

/// Growth of the fourth moment for a modulation of 1: (1 + 6 + 3) / 4.
const MAX_GROWTH: f64 = 2.5;

/// Returns ψ₁(x) by recurrence and its asymptotic series; error below 1e-8 for x >= 1/2.
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
