//! New outlines drawn from the statistics of old ones.

use portable_numerics::random::{Normals, direction, normal};
use rand_core::Rng;

use crate::Error;
use crate::crossing::self_intersects;
use crate::descriptors::{Descriptors, modulus, multiply, unit};
use crate::outline::Point;
use crate::sample::Bend;
use crate::statistics::{Residual, ShapeStatistics, add_scaled, finest_coarse, order, terms};
use crate::steps::from_steps;

/// Tries of a draw before it gives up. The paper's model, the worst in use, fails less than half of the time.
const TRIES: u32 = 200;
/// Points per harmonic at which a draw is looked at for crossings: a sixteenth of the finest wave.
const CHECKS_PER_HARMONIC: usize = 16;
/// Fewest points at which it is looked at.
const FEWEST_CHECKS: usize = 64;
/// Harmonics of the modulation of roughness, as a share of the curve's: at an eighth (5 of 40) the patches of rough and smooth outline
/// are as long as real ones.
const MODULATION_SHARE: usize = 8;

/// Fewest harmonics at which roughness can vary along the outline.
pub(crate) const LEAST_FOR_LOCAL: usize = 16;

/// A population of shapes, from which new ones are drawn.
///
/// Made by [`ShapeModel::fit`] or from stored numbers by [`ShapeModel::from_statistics`].
#[derive(Clone, Debug, PartialEq)]
pub struct ShapeModel {
    statistics: ShapeStatistics,
    bends: Vec<Bend>,
    modulation: Option<Modulation>,
}

/// A shape drawn from a model.
#[derive(Clone, Debug, PartialEq)]
pub struct Draw {
    /// The outline: centred, positive area, random rotation, |u₁| as asked for.
    pub descriptors: Descriptors,
    /// Tries thrown away before it, because they crossed themselves or ran the wrong way round.
    pub rejected: u32,
}

impl ShapeModel {
    /// A model of given statistics.
    ///
    /// # Errors
    ///
    /// If the numbers are out of range or do not fit together.
    pub fn from_statistics(statistics: ShapeStatistics) -> Result<Self, Error> {
        statistics.check()?;
        let bends = statistics.components.iter().filter_map(|c| c.bend()).collect();
        let modulation = Modulation::new(&statistics);
        Ok(Self { statistics, bends, modulation })
    }

    /// The numbers behind the model; they hold no outline it was fitted to.
    pub fn statistics(&self) -> &ShapeStatistics {
        &self.statistics
    }

    /// A radius |u₁| in px, log-normal as in the outlines fitted.
    pub fn draw_radius<R: Rng + ?Sized>(&self, rng: &mut R) -> f64 {
        libm::exp(self.statistics.ln_radius_mean + self.statistics.ln_radius_sd * normal(rng))
    }

    /// A new shape of radius |u₁| = `radius_px`, in a random rotation.
    ///
    /// Draws that cross themselves or enclose a negative area are rejected, counted, and repeated.
    ///
    /// # Errors
    ///
    /// If `radius_px` is not positive and finite, or 200 tries in a row are rejected.
    pub fn draw<R: Rng + ?Sized>(&self, radius_px: f64, rng: &mut R) -> Result<Draw, Error> {
        if !(radius_px.is_finite() && radius_px > 0.0) {
            return Err(Error::Parameter { field: "radius_px", value: radius_px, accepted: "positive and finite" });
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
            // A first harmonic of 0 ends here too.
            let Ok(descriptors) = Descriptors::from_harmonics(terms) else {
                continue;
            };
            if descriptors.area() > 0.0 && !self_intersects(&descriptors.outline(checks)) {
                return Ok(Draw { descriptors, rejected });
            }
        }
        Err(Error::NoSimpleOutline { tries: TRIES, harmonics })
    }

    /// Descriptors u₋ₕ … uₕ of a normalised shape, not looked at yet.
    fn draw_terms<R: Rng + ?Sized>(&self, rng: &mut R) -> Vec<Point> {
        let of = &self.statistics;
        let mut normals = Normals::new(rng);
        let draw = |&sd: &f64| if sd > 0.0 { sd * normals.draw() } else { 0.0 };
        let mut deviation: Vec<f64> = of.residual_sd.iter().map(draw).collect();
        if of.residual == Residual::Steps {
            from_steps(&mut deviation);
        }
        for (component, bend) in of.components.iter().zip(&self.bends) {
            add_scaled(&mut deviation, &component.loading, bend.apply(normals.draw()));
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

/// Roughness that varies along the outline: the fine detail of a curve multiplied by 1 + σf(t), f a random periodic function of variance 1.
#[derive(Clone, Debug, PartialEq)]
struct Modulation {
    /// σ for each real and imaginary part of the harmonics of f.
    sd: f64,
    /// Highest harmonic of f.
    reach: usize,
    /// What each term u₋ₕ … uₕ is multiplied by afterwards, so that its mean square stays; 0 for the form, which is left alone.
    gains: Vec<f64>,
}

impl Modulation {
    fn new(statistics: &ShapeStatistics) -> Option<Self> {
        let sigma = statistics.local_roughness;
        let harmonics = statistics.harmonics;
        if sigma == 0.0 || harmonics < LEAST_FOR_LOCAL {
            return None;
        }
        let reach = harmonics / MODULATION_SHARE;
        // Σ over ±m of E|fₘ|² = 1, with real and imaginary part alike.
        let sd = sigma / (4.0 * reach as f64).sqrt();
        let coarse = finest_coarse(harmonics);
        let detail = |place: usize| place.abs_diff(harmonics) > coarse;
        let powers: Vec<f64> = statistics
            .powers()
            .into_iter()
            .enumerate()
            .map(|(place, power)| if detail(place) { power } else { 0.0 })
            .collect();
        let gains = (0..powers.len())
            .map(|place| {
                let near = place.saturating_sub(reach)..=(place + reach).min(2 * harmonics);
                let others = powers[near].iter().sum::<f64>() - powers[place];
                let modulated = powers[place] + 2.0 * sd * sd * others;
                if powers[place] > 0.0 { (powers[place] / modulated).sqrt() } else { 0.0 }
            })
            .collect();
        Some(Self { sd, reach, gains })
    }

    /// The product of two curves is the convolution of their harmonics.
    fn apply<R: Rng + ?Sized>(&self, terms: &mut [Point], normals: &mut Normals<'_, R>) {
        let reach = self.reach;
        let mut factor = vec![[0.0, 0.0]; 2 * reach + 1];
        factor[reach] = [1.0, 0.0];
        for m in 1..=reach {
            let (re, im) = (self.sd * normals.draw(), self.sd * normals.draw());
            factor[reach + m] = [re, im];
            factor[reach - m] = [re, -im];
        }
        let mut modulated = vec![[0.0, 0.0]; terms.len()];
        for (place, &u) in terms.iter().enumerate().filter(|&(place, _)| self.gains[place] > 0.0) {
            // Place of the first product; what falls outside the curve's harmonics is lost.
            let first = place.saturating_sub(reach);
            let skipped = reach.saturating_sub(place);
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
