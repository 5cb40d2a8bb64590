//! From an estimate to the recipe whose simulated windows come nearest to the real ones.

use argmin::core::{CostFunction, Executor, Gradient, State};
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;
use papsynth_judge::Control;
use rayon::prelude::*;

use crate::error::Error;
use crate::regression::{Estimate, Features, Scaler};
use crate::table::SimulationTable;

/// Statistics further apart than so many standard errors count in proportion: what a recipe cannot show must not bend the rest.
const FAR: f64 = 3.0;

/// Steps of the optimiser, and gradients that it remembers.
const STEPS: u64 = 200;
const MEMORY: usize = 7;

/// How strongly the place is held near that of the regression.
const HOLD: f64 = 1.0;

/// What windows are like as a function of the places of parameters: a parabola through the table, and how far recipes lie from it.
pub(crate) struct Forward {
    scaler: Scaler,
    /// Factors of 1, places and their squares, statistic by statistic.
    factors: Vec<Vec<f64>>,
    /// Standard error of each scaled statistic.
    errors: Vec<f64>,
}

/// Least standard error of a statistic, in its standard deviations over the table: nothing follows a parabola more closely.
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

    /// How many standard errors each statistic lies from that of the real fields; NaN where either is unknown.
    pub(crate) fn apart(&self, real: &[f64], simulated: &[f64]) -> Vec<f64> {
        let (a, b) = (self.scaler.scaled(real), self.scaler.scaled(simulated));
        let known = real.iter().zip(simulated).map(|(x, y)| x.is_finite() && y.is_finite());
        let off = a.iter().zip(&b).zip(&self.errors).map(|((a, b), e)| (b - a) / e);
        known.zip(off).map(|(known, off)| if known { off } else { f64::NAN }).collect()
    }
}

/// Root of the mean square of distances, far ones in proportion.
pub(crate) fn distance(apart: &[f64]) -> f64 {
    let known: Vec<f64> = apart.iter().filter(|z| z.is_finite()).map(|z| robust(*z)).collect();
    portable_numerics::statistics::mean(&known).sqrt()
}

fn robust(z: f64) -> f64 {
    let a = z.abs();
    if a < FAR { z * z } else { FAR * (2.0 * a - FAR) }
}

fn robust_slope(z: f64) -> f64 {
    if z.abs() < FAR { 2.0 * z } else { 2.0 * FAR * z.signum() }
}

/// Places about the middle of their ranges and their squares.
fn features(places: &[f64]) -> Vec<f64> {
    let about = |p: &f64| 2.0 * p - 1.0;
    places.iter().map(about).chain(places.iter().map(|p| about(p) * about(p) - 1.0 / 3.0)).collect()
}

/// What is minimised: the distance that the parabolas tell, with what they were wrong by at the last simulation taken off.
#[derive(Clone)]
struct Objective<'a> {
    forward: &'a Forward,
    /// Statistics that count, and where they should be by the parabolas.
    aims: Vec<(usize, f64)>,
    /// All places; those that do not move keep theirs.
    places: Vec<f64>,
    /// Those that move, with the ends of their intervals and where the regression saw them.
    moving: Vec<(usize, Estimate)>,
}

impl Objective<'_> {
    /// Places within the intervals, from numbers without bounds; with the slopes.
    fn inside(&self, free: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mut places = self.places.clone();
        let mut slopes = Vec::with_capacity(free.len());
        for ((i, e), x) in self.moving.iter().zip(free) {
            let t = libm::tanh(*x);
            places[*i] = e.low + 0.5 * (1.0 + t) * (e.high - e.low);
            slopes.push(0.5 * (1.0 - t * t) * (e.high - e.low));
        }
        (places, slopes)
    }

    fn outside(&self, places: &[f64]) -> Vec<f64> {
        /// Not further than this towards the ends: there the slope is gone.
        const MOST: f64 = 0.98;
        let one = |(i, e): &(usize, Estimate)| {
            libm::atanh((2.0 * (places[*i] - e.low) / (e.high - e.low).max(1e-9) - 1.0).clamp(-MOST, MOST))
        };
        self.moving.iter().map(one).collect()
    }

    fn hold(&self, places: &[f64]) -> impl Iterator<Item = f64> {
        // Half an interval is two standard errors.
        self.moving.iter().map(|(i, e)| 4.0 * (places[*i] - e.value) / (e.high - e.low).max(1e-9))
    }
}

impl CostFunction for Objective<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, free: &Vec<f64>) -> Result<f64, argmin::core::Error> {
        let (places, _) = self.inside(free);
        let features = features(&places);
        let apart =
            self.aims.iter().map(|(s, aim)| robust((self.forward.at(*s, &features) - aim) / self.forward.errors[*s]));
        Ok(apart.sum::<f64>() + HOLD * self.hold(&places).map(|z| z * z).sum::<f64>())
    }
}

impl Gradient for Objective<'_> {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;

    fn gradient(&self, free: &Vec<f64>) -> Result<Vec<f64>, argmin::core::Error> {
        let (places, slopes) = self.inside(free);
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
            slope * (of_places[*i] + HOLD * 2.0 * hold * 4.0 / (e.high - e.low).max(1e-9))
        };
        Ok(self.moving.iter().zip(slopes).zip(self.hold(&places)).map(one).collect())
    }
}

/// The next place to try from one whose windows were simulated; `seen` are the statistics of the real windows and of those.
pub(crate) fn propose(forward: &Forward, seen: [&[f64]; 2], places: &[f64], moving: &[(usize, Estimate)]) -> Vec<f64> {
    let [wanted, found] = seen.map(|values| forward.scaler.scaled(values));
    let here = features(places);
    let known = |s: &usize| seen.iter().all(|values| values[*s].is_finite());
    let aims = (0..wanted.len()).filter(known).map(|s| (s, wanted[s] - found[s] + forward.at(s, &here))).collect();
    let told = Objective { forward, aims, places: places.to_vec(), moving: moving.to_vec() };
    let start = told.outside(places);
    if start.is_empty() {
        return places.to_vec();
    }
    let solver = LBFGS::new(MoreThuenteLineSearch::new(), MEMORY);
    let best = Executor::new(told.clone(), solver)
        .configure(|state| state.param(start.clone()).max_iters(STEPS))
        .timer(false)
        .run()
        .ok()
        .and_then(|result| result.state().get_best_param().cloned());
    told.inside(&best.unwrap_or(start)).0
}
