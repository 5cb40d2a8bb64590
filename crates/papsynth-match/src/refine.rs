//! Search for the recipe with the smallest distance between simulated and real windows.

use argmin::core::{CostFunction, Executor, Gradient, State};
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;
use papsynth_judge::Control;
use rayon::prelude::*;

use crate::error::Error;
use crate::regression::{Estimate, Features, Scaler};
use crate::table::SimulationTable;

/// Beyond this difference, in standard errors, the loss is linear, so that statistics that no recipe can match have
/// less weight.
const LINEAR_FROM: f64 = 3.0;

/// Maximum number of iterations of the optimiser.
const STEPS: u64 = 200;

/// Number of gradients that the optimiser stores.
const MEMORY: usize = 7;

/// Weight of the distance from the estimate of the regression.
const PRIOR_WEIGHT: f64 = 1.0;

/// A quadratic model of the statistics as functions of the positions of parameters, with its standard errors.
pub(crate) struct Forward {
    scaler: Scaler,
    /// Coefficients of 1, positions and their squares, for each statistic.
    factors: Vec<Vec<f64>>,
    /// Standard error of each scaled statistic.
    errors: Vec<f64>,
}

/// Minimum standard error of a statistic, in standard deviations over the table.
const LEAST_ERROR: f64 = 0.05;

impl Forward {
    pub(crate) fn new(table: &SimulationTable, control: &Control) -> Result<Self, Error> {
        let scaler = Scaler::new(&table.statistics.iter().map(Vec::as_slice).collect::<Vec<_>>());
        let statistics: Vec<Vec<f64>> = table.statistics.iter().map(|r| scaler.scaled(r)).collect();
        let rows: Vec<Vec<f64>> = table.places.iter().map(|p| features(p)).collect();
        let features = Features::new(&rows);
        let fit = |c: usize| {
            let y: Vec<f64> = statistics.iter().map(|s| s[c]).collect();
            control.check()?;
            let ridge = features.best(&y);
            let factors: Vec<f64> = std::iter::once(ridge.mean).chain(ridge.factors).collect();
            Ok((factors, ridge.error.sqrt().max(LEAST_ERROR)))
        };
        let fits: Vec<(Vec<f64>, f64)> =
            (0..table.names.len()).into_par_iter().map(fit).collect::<Result<_, Error>>()?;
        let (factors, errors) = fits.into_iter().unzip();
        Ok(Self { scaler, factors, errors })
    }

    fn at(&self, statistic: usize, features: &[f64]) -> f64 {
        let factors = &self.factors[statistic];
        factors[0] + factors[1..].iter().zip(features).map(|(a, b)| a * b).sum::<f64>()
    }

    /// Returns the difference of each statistic from that of the real fields, in standard errors; NaN if one is
    /// unknown.
    pub(crate) fn apart(&self, real: &[f64], simulated: &[f64]) -> Vec<f64> {
        let (a, b) = (self.scaler.scaled(real), self.scaler.scaled(simulated));
        let known = real.iter().zip(simulated).map(|(x, y)| x.is_finite() && y.is_finite());
        let off = a.iter().zip(&b).zip(&self.errors).map(|((a, b), e)| (b - a) / e);
        known.zip(off).map(|(known, off)| if known { off } else { f64::NAN }).collect()
    }
}

/// Returns the root mean square of differences; the loss of large differences is linear.
pub(crate) fn distance(apart: &[f64]) -> f64 {
    let known: Vec<f64> = apart.iter().filter(|z| z.is_finite()).map(|z| robust(*z)).collect();
    portable_numerics::statistics::mean(&known).sqrt()
}

fn robust(z: f64) -> f64 {
    let a = z.abs();
    if a < LINEAR_FROM { z * z } else { LINEAR_FROM * (2.0 * a - LINEAR_FROM) }
}

fn robust_slope(z: f64) -> f64 {
    if z.abs() < LINEAR_FROM { 2.0 * z } else { 2.0 * LINEAR_FROM * z.signum() }
}

/// Returns positions relative to the centres of their ranges, and their centred squares.
fn features(places: &[f64]) -> Vec<f64> {
    let about = |p: &f64| 2.0 * p - 1.0;
    places.iter().map(about).chain(places.iter().map(|p| about(p) * about(p) - 1.0 / 3.0)).collect()
}

/// The objective: the distance predicted by the quadratic model, corrected by its error at the last simulation.
#[derive(Clone)]
struct Objective<'a> {
    forward: &'a Forward,
    /// Index of each known statistic, and the target of its model value.
    aims: Vec<(usize, f64)>,
    /// All positions. Only those of `moving` change.
    places: Vec<f64>,
    /// Parameters to optimise, with their estimates and intervals.
    moving: Vec<(usize, Estimate)>,
}

impl Objective<'_> {
    /// Maps unbounded numbers to positions in the intervals. Returns the positions and their derivatives.
    fn bounded(&self, free: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mut places = self.places.clone();
        let mut slopes = Vec::with_capacity(free.len());
        for ((i, e), x) in self.moving.iter().zip(free) {
            let t = libm::tanh(*x);
            places[*i] = e.low + 0.5 * (1.0 + t) * (e.high - e.low);
            slopes.push(0.5 * (1.0 - t * t) * (e.high - e.low));
        }
        (places, slopes)
    }

    /// Maps positions to unbounded numbers: the inverse of `bounded`.
    fn unbounded(&self, places: &[f64]) -> Vec<f64> {
        /// Maximum distance from the centre of an interval, in half intervals: the derivative vanishes at the ends.
        const MOST: f64 = 0.98;
        let one = |(i, e): &(usize, Estimate)| {
            libm::atanh((2.0 * (places[*i] - e.low) / (e.high - e.low).max(1e-9) - 1.0).clamp(-MOST, MOST))
        };
        self.moving.iter().map(one).collect()
    }

    /// Returns the distances of the positions from their estimates, in standard errors.
    fn deviations(&self, places: &[f64]) -> impl Iterator<Item = f64> {
        // Half the interval is two standard errors.
        self.moving.iter().map(|(i, e)| 4.0 * (places[*i] - e.value) / (e.high - e.low).max(1e-9))
    }
}

impl CostFunction for Objective<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, free: &Vec<f64>) -> Result<f64, argmin::core::Error> {
        let (places, _) = self.bounded(free);
        let features = features(&places);
        let apart =
            self.aims.iter().map(|(s, aim)| robust((self.forward.at(*s, &features) - aim) / self.forward.errors[*s]));
        Ok(apart.sum::<f64>() + PRIOR_WEIGHT * self.deviations(&places).map(|z| z * z).sum::<f64>())
    }
}

impl Gradient for Objective<'_> {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;

    fn gradient(&self, free: &Vec<f64>) -> Result<Vec<f64>, argmin::core::Error> {
        let (places, slopes) = self.bounded(free);
        let all = features(&places);
        let count = places.len();
        let mut of_places = vec![0.0; count];
        for (s, aim) in &self.aims {
            let error = self.forward.errors[*s];
            let slope = robust_slope((self.forward.at(*s, &all) - aim) / error) / error;
            let factors = &self.forward.factors[*s];
            for (i, sum) in of_places.iter_mut().enumerate() {
                *sum += slope * 2.0 * (factors[1 + i] + 2.0 * all[i] * factors[1 + count + i]);
            }
        }
        let one = |(((i, e), slope), hold): ((&(usize, Estimate), f64), f64)| {
            slope * (of_places[*i] + PRIOR_WEIGHT * 2.0 * hold * 4.0 / (e.high - e.low).max(1e-9))
        };
        Ok(self.moving.iter().zip(slopes).zip(self.deviations(&places)).map(one).collect())
    }
}

/// Proposes positions for the next simulation. `seen` are the statistics of the real windows, and of windows simulated
/// at `places`.
pub(crate) fn propose(forward: &Forward, seen: [&[f64]; 2], places: &[f64], moving: &[(usize, Estimate)]) -> Vec<f64> {
    let [wanted, found] = seen.map(|values| forward.scaler.scaled(values));
    let here = features(places);
    let known = |s: &usize| seen.iter().all(|values| values[*s].is_finite());
    let aims = (0..wanted.len()).filter(known).map(|s| (s, wanted[s] - found[s] + forward.at(s, &here))).collect();
    let objective = Objective { forward, aims, places: places.to_vec(), moving: moving.to_vec() };
    let start = objective.unbounded(places);
    if start.is_empty() {
        return places.to_vec();
    }
    let solver = LBFGS::new(MoreThuenteLineSearch::new(), MEMORY);
    let best = Executor::new(objective.clone(), solver)
        .configure(|state| state.param(start.clone()).max_iters(STEPS))
        .timer(false)
        .run()
        .ok()
        .and_then(|result| result.state().get_best_param().cloned());
    objective.bounded(&best.unwrap_or(start)).0
}
