//! Draws new outlines from the statistics of a population.

use portable_numerics::random::{Normals, direction, normal};
use rand_core::Rng;

use crate::Error;
use crate::crossing::self_intersects;
use crate::descriptors::{Descriptors, modulus, multiply, unit};
use crate::outline::Point;
use crate::sample::FleishmanPolynomial;
use crate::statistics::{Residual, ShapeStatistics, add_scaled, finest_coarse, order, terms};
use crate::steps::from_steps;

/// Maximum number of attempts of a draw. The paper's model, the worst in use, fails in less than half of its attempts.
const TRIES: u32 = 200;
/// Points per harmonic of the self-intersection check: a sixteenth of the shortest wavelength.
const CHECKS_PER_HARMONIC: usize = 16;
/// Minimum number of points of the self-intersection check.
const FEWEST_CHECKS: usize = 64;
/// Ratio of the harmonics of the curve and of the roughness modulation: at 8 (5 of 40), rough and smooth parts of an
/// outline are as long as real ones.
const MODULATION_RATIO: usize = 8;

/// Minimum number of harmonics for roughness that varies along the outline.
pub(crate) const MIN_HARMONICS_FOR_LOCAL: usize = 16;

/// A statistical model of a population of shapes.
///
/// Created by [`ShapeModel::fit`], or from stored statistics by [`ShapeModel::from_statistics`].
#[derive(Clone, Debug, PartialEq)]
pub struct ShapeModel {
    statistics: ShapeStatistics,
    polynomials: Vec<FleishmanPolynomial>,
    modulation: Option<Modulation>,
}

/// A shape drawn from a model.
#[derive(Clone, Debug, PartialEq)]
pub struct DrawnShape {
    /// The outline: centred, with positive area, random rotation and the requested |u₁|.
    pub descriptors: Descriptors,
    /// Number of rejected attempts, which intersected themselves or had negative area.
    pub rejected: u32,
}

impl ShapeModel {
    /// Creates a model from statistics.
    ///
    /// # Errors
    ///
    /// If the numbers are out of range or inconsistent.
    pub fn from_statistics(statistics: ShapeStatistics) -> Result<Self, Error> {
        let polynomials = statistics.checked()?;
        let modulation = Modulation::new(&statistics);
        Ok(Self { statistics, polynomials, modulation })
    }

    /// Returns the statistics of the model, which contain no training outline.
    pub fn statistics(&self) -> &ShapeStatistics {
        &self.statistics
    }

    /// Draws a radius |u₁|, in px, from the log-normal distribution of the training outlines.
    pub fn draw_radius<R: Rng + ?Sized>(&self, rng: &mut R) -> f64 {
        libm::exp(self.statistics.ln_radius_mean + self.statistics.ln_radius_sd * normal(rng))
    }

    /// Draws a shape of radius |u₁| = `radius_px`, in a random rotation.
    ///
    /// Attempts that intersect themselves or have negative area are rejected, counted, and repeated.
    ///
    /// # Errors
    ///
    /// If `radius_px` is not positive and finite, or 200 attempts are rejected.
    pub fn draw<R: Rng + ?Sized>(&self, radius_px: f64, rng: &mut R) -> Result<DrawnShape, Error> {
        if !(radius_px.is_finite() && radius_px > 0.0) {
            return Err(Error::Parameter {
                field: "radius_px",
                value: radius_px,
                accepted: "a positive finite number",
            });
        }
        let harmonics = self.statistics.harmonics;
        let checks = (CHECKS_PER_HARMONIC * harmonics).max(FEWEST_CHECKS);
        for rejected in 0..TRIES {
            let mut terms = self.draw_terms(rng);
            let size = modulus(terms[harmonics + 1]);
            let turn = unit(direction(rng));
            let scale = [turn[0] * radius_px / size, turn[1] * radius_px / size];
            for u in &mut terms {
                *u = multiply(*u, scale);
            }
            // Fails if the first harmonic is 0.
            let Ok(descriptors) = Descriptors::from_harmonics(terms) else {
                continue;
            };
            if descriptors.area() > 0.0 && !self_intersects(&descriptors.outline(checks)) {
                return Ok(DrawnShape { descriptors, rejected });
            }
        }
        Err(Error::NoSimpleOutline { tries: TRIES, harmonics })
    }

    /// Draws descriptors u₋ₕ … uₕ of a normalised shape, without checks.
    fn draw_terms<R: Rng + ?Sized>(&self, rng: &mut R) -> Vec<Point> {
        let of = &self.statistics;
        let mut normals = Normals::new(rng);
        let draw = |&sd: &f64| if sd > 0.0 { sd * normals.draw() } else { 0.0 };
        let mut deviation: Vec<f64> = of.residual_sd.iter().map(draw).collect();
        if of.residual == Residual::Steps {
            from_steps(&mut deviation);
        }
        for (component, polynomial) in of.components.iter().zip(&self.polynomials) {
            add_scaled(&mut deviation, &component.loading, polynomial.apply(normals.draw()));
        }
        if of.roughness_sd > 0.0 {
            // Mean square 1: E e^{2(σz − σ²)} = 1.
            let sd = of.roughness_sd;
            let factor = libm::exp(sd * normals.draw() - sd * sd);
            for (k, value) in deviation.iter_mut().enumerate() {
                if order(k, of.harmonics) > 1 {
                    *value *= factor;
                }
            }
        }
        add_scaled(&mut deviation, &of.mean, 1.0);
        let mut terms = terms(&deviation);
        if let Some(modulation) = &self.modulation {
            modulation.apply(&mut terms, &mut normals);
        }
        terms
    }
}

/// Roughness that varies along the outline: the fine detail is multiplied by 1 + σf(t), where f is a random periodic
/// function of variance 1.
#[derive(Clone, Debug, PartialEq)]
struct Modulation {
    /// Standard deviation of the real and imaginary parts of the harmonics of σf.
    sd: f64,
    /// Highest harmonic of f.
    order_max: usize,
    /// Factor of each term u₋ₕ … uₕ that restores its mean square; 0 for coarse terms, which are not modulated.
    gains: Vec<f64>,
}

impl Modulation {
    fn new(statistics: &ShapeStatistics) -> Option<Self> {
        let sigma = statistics.local_roughness;
        let harmonics = statistics.harmonics;
        if sigma == 0.0 || harmonics < MIN_HARMONICS_FOR_LOCAL {
            return None;
        }
        let order_max = harmonics / MODULATION_RATIO;
        // Σ over ±m of E|fₘ|² = 1, with equal real and imaginary parts.
        let sd = sigma / (4.0 * order_max as f64).sqrt();
        let coarse = finest_coarse(harmonics);
        let detail = |index: usize| index.abs_diff(harmonics) > coarse;
        let powers: Vec<f64> = statistics
            .powers()
            .into_iter()
            .enumerate()
            .map(|(index, power)| if detail(index) { power } else { 0.0 })
            .collect();
        let gains = (0..powers.len())
            .map(|index| {
                let near = index.saturating_sub(order_max)..=(index + order_max).min(2 * harmonics);
                let others = powers[near].iter().sum::<f64>() - powers[index];
                let modulated = powers[index] + 2.0 * sd * sd * others;
                if powers[index] > 0.0 { (powers[index] / modulated).sqrt() } else { 0.0 }
            })
            .collect();
        Some(Self { sd, order_max, gains })
    }

    /// Modulates the detail: the product of two curves is the convolution of their harmonics.
    fn apply<R: Rng + ?Sized>(&self, terms: &mut [Point], normals: &mut Normals<'_, R>) {
        let order_max = self.order_max;
        let mut factor = vec![[0.0, 0.0]; 2 * order_max + 1];
        factor[order_max] = [1.0, 0.0];
        for m in 1..=order_max {
            let (re, im) = (self.sd * normals.draw(), self.sd * normals.draw());
            factor[order_max + m] = [re, im];
            factor[order_max - m] = [re, -im];
        }
        let mut modulated = vec![[0.0, 0.0]; terms.len()];
        for (index, &u) in terms.iter().enumerate().filter(|&(index, _)| self.gains[index] > 0.0) {
            // Index of the first product; products beyond the harmonics of the curve are dropped.
            let first = index.saturating_sub(order_max);
            let skipped = order_max.saturating_sub(index);
            for (sum, &f) in modulated[first..].iter_mut().zip(&factor[skipped..]) {
                let product = multiply(u, f);
                *sum = [sum[0] + product[0], sum[1] + product[1]];
            }
        }
        for ((u, sum), &gain) in terms.iter_mut().zip(modulated).zip(&self.gains) {
            if gain > 0.0 {
                *u = [gain * sum[0], gain * sum[1]];
            }
        }
    }
}
