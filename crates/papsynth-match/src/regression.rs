//! From what windows are like to the parameters of their recipe, with intervals that are held to what they say.
//!
//! Semi-automatic approximate Bayesian computation (Fearnhead and Prangle, doi:10.1111/j.1467-9868.2011.01010.x): a first
//! regression makes of all statistics one summary a parameter; a second one, that bends, goes from these to the parameter.
//! Intervals are those of cross-conformal prediction (doi:10.1007/s10472-013-9368-4), wider where unseen rows were missed by more.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::number::{deviation, mean};
use crate::ridge::{Kernel, Ridge};

/// A value with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Part of the intervals that hold the truth.
const CONFIDENCE: f64 = 0.95;

/// Statistics further from the mean of the table than so many standard deviations count as being there.
const FARTHEST: f64 = 4.0;

/// Widths of the second kernel that are tried, in standard deviations of a summary.
const WIDTHS: [f64; 3] = [1.0, 2.0, 4.0];

/// Part of a distance in the second kernel that is that of the parameter's own summary.
const OWN: f64 = 0.5;

/// How much of the second kernel is straight.
const STRAIGHT: f64 = 1.0;

/// Part of the rows about a prediction whose misses say how wide its interval is.
const NEIGHBOURS: f64 = 0.2;

/// Brings statistics to one scale; what is unknown counts as the mean.
#[derive(Debug, Clone)]
pub(crate) struct Scaler {
    means: Vec<f64>,
    deviations: Vec<f64>,
}

impl Scaler {
    pub(crate) fn new(rows: &[Vec<f64>]) -> Self {
        let columns = rows.first().map_or(0, Vec::len);
        let column = |c: usize| -> Vec<f64> { rows.iter().map(|r| r[c]).filter(|v| v.is_finite()).collect() };
        let of = |f: fn(&[f64]) -> f64| {
            (0..columns).map(|c| f(&column(c))).map(|v| if v.is_finite() { v } else { 0.0 }).collect()
        };
        Self { means: of(mean), deviations: of(deviation) }
    }

    pub(crate) fn scaled(&self, row: &[f64]) -> Vec<f64> {
        let one = |((value, mean), sd): ((&f64, &f64), &f64)| {
            if value.is_finite() && *sd > 0.0 { ((value - mean) / sd).clamp(-FARTHEST, FARTHEST) } else { 0.0 }
        };
        row.iter().zip(&self.means).zip(&self.deviations).map(one).collect()
    }
}

/// Learns parameters, as places in their ranges, from statistics.
#[derive(Debug, Clone)]
pub struct Regression {
    scaler: Scaler,
    rows: Vec<Vec<f64>>,
    first: Vec<Ridge>,
    summaries: Vec<Vec<f64>>,
    second: Vec<Second>,
}

/// The second regression of one parameter.
#[derive(Debug, Clone)]
struct Second {
    width: f64,
    ridge: Ridge,
    /// Prediction of each unseen row and by how much it missed, in the order of the predictions.
    misses: Vec<[f64; 2]>,
    /// The interval reaches so many times the neighbours' mean miss.
    reach: f64,
}

impl Regression {
    /// Learns from rows of statistics and rows of places.
    #[must_use]
    pub fn new(statistics: &[Vec<f64>], places: &[Vec<f64>]) -> Self {
        let scaler = Scaler::new(statistics);
        let rows: Vec<Vec<f64>> = statistics.iter().map(|r| scaler.scaled(r)).collect();
        let n = rows.len();
        let kernel = Kernel::new(DMatrix::from_fn(n, n, |i, j| dot(&rows[i], &rows[j])));
        let columns = places.first().map_or(0, Vec::len);
        let column = |c: usize| -> Vec<f64> { places.iter().map(|p| p[c]).collect() };
        let first: Vec<Ridge> = (0..columns).into_par_iter().map(|c| kernel.best(&column(c))).collect();
        let summaries: Vec<Vec<f64>> =
            (0..n).map(|i| first.iter().map(|r| of_one_scale(r.unseen[i])).collect()).collect();
        let second = (0..columns).into_par_iter().map(|c| Second::new(&summaries, c, &column(c))).collect();
        Self { scaler, rows, first, summaries, second }
    }

    /// The places of statistics, with their intervals, within 0 to 1.
    #[must_use]
    pub fn estimate(&self, statistics: &[f64]) -> Vec<Estimate> {
        let summary = self.summary(statistics);
        self.second.iter().enumerate().map(|(c, s)| s.estimate(&self.summaries, c, &summary)).collect()
    }

    fn summary(&self, statistics: &[f64]) -> Vec<f64> {
        let row = self.scaler.scaled(statistics);
        let kernel = DVector::from_iterator(self.rows.len(), self.rows.iter().map(|r| dot(r, &row)));
        self.first.iter().map(|r| of_one_scale(r.predict(&kernel))).collect()
    }

    /// Part of each parameter's variance over the table that unseen rows were told.
    #[must_use]
    pub fn explained(&self) -> Vec<f64> {
        // Places are spread evenly over 0 to 1.
        self.second.iter().map(|s| 1.0 - 12.0 * s.ridge.error).collect()
    }
}

/// A summary in standard deviations of the parameter's range. Not in its own: what hardly varies tells nothing, and must not be made
/// to.
fn of_one_scale(place: f64) -> f64 {
    (place - 0.5) * 12.0_f64.sqrt()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>() / a.len().max(1) as f64
}

/// The second kernel: straight and bent.
fn bent(a: &[f64], b: &[f64], own: usize, width: f64) -> f64 {
    let square = |(x, y): (&f64, &f64)| (x - y) * (x - y);
    let all = a.iter().zip(b).map(square).sum::<f64>() / a.len().max(1) as f64;
    let of_own = (a[own] - b[own]) * (a[own] - b[own]);
    libm::exp(-0.5 * (OWN * of_own + (1.0 - OWN) * all) / (width * width))
        + STRAIGHT * (dot(a, b) + OWN * a[own] * b[own])
}

impl Second {
    fn new(rows: &[Vec<f64>], own: usize, y: &[f64]) -> Self {
        let n = rows.len();
        let tried: Vec<(f64, Ridge)> = WIDTHS
            .into_iter()
            .map(|width| {
                (width, Kernel::new(DMatrix::from_fn(n, n, |i, j| bent(&rows[i], &rows[j], own, width))).best(y))
            })
            .collect();
        let mut tried = tried.into_iter();
        let (mut width, mut ridge) =
            tried.next().unwrap_or_else(|| (WIDTHS[0], Kernel::new(DMatrix::zeros(n, n)).best(y)));
        for (other, candidate) in tried {
            if candidate.error < ridge.error {
                (width, ridge) = (other, candidate);
            }
        }
        let mut misses: Vec<[f64; 2]> =
            ridge.unseen.iter().zip(y).map(|(u, v)| [u.clamp(0.0, 1.0), (u.clamp(0.0, 1.0) - v).abs()]).collect();
        misses.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
        let mut second = Self { width, ridge, misses, reach: 1.0 };
        let mut ratios: Vec<f64> = second.misses.iter().map(|[at, miss]| miss / second.usual(*at)).collect();
        ratios.sort_unstable_by(f64::total_cmp);
        // As many of n + 1 as the confidence asks: the new one is one of them.
        let rank = crate::number::whole(libm::ceil(CONFIDENCE * (n as f64 + 1.0))).clamp(1, n.max(1));
        second.reach = ratios.get(rank - 1).copied().unwrap_or(f64::INFINITY);
        second
    }

    /// Mean miss of the rows whose predictions are next to a place.
    fn usual(&self, at: f64) -> f64 {
        let n = self.misses.len();
        let count = crate::number::whole(NEIGHBOURS * n as f64).clamp(1, n.max(1));
        let middle = self.misses.partition_point(|m| m[0] < at);
        let from = middle.saturating_sub(count / 2).min(n - count.min(n));
        let near = &self.misses[from..(from + count).min(n)];
        // A little of the mean of all: neighbours may be right by chance.
        let all = self.misses.iter().map(|m| m[1]).sum::<f64>() / n as f64;
        0.8 * near.iter().map(|m| m[1]).sum::<f64>() / near.len().max(1) as f64 + 0.2 * all
    }

    fn estimate(&self, rows: &[Vec<f64>], own: usize, summary: &[f64]) -> Estimate {
        let kernel = DVector::from_iterator(rows.len(), rows.iter().map(|r| bent(r, summary, own, self.width)));
        let value = self.ridge.predict(&kernel).clamp(0.0, 1.0);
        let half = self.reach * self.usual(value);
        Estimate { value, low: (value - half).max(0.0), high: (value + half).min(1.0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::{Rng, SeedableRng};

    /// Statistics that bend, disturbed, of two parameters, and a third that shows in none.
    fn rows(seed: u64, count: usize) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
        let mut rng = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut one = || (rng.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
        let places: Vec<Vec<f64>> = (0..count).map(|_| vec![one(), one(), one()]).collect();
        let statistics = places
            .iter()
            .map(|p| {
                let e: Vec<f64> = (0..6).map(|_| 0.2 * (one() - 0.5)).collect();
                vec![
                    p[0] * p[0] + e[0],
                    p[0] + p[1] + e[1],
                    libm::exp(p[1]) + e[2],
                    e[3],
                    if e[4] > 0.08 { f64::NAN } else { p[0] },
                    e[5],
                ]
            })
            .collect();
        (statistics, places)
    }

    #[test]
    fn intervals_hold_what_they_say_and_what_cannot_be_told_is_wide() {
        const TABLES: u64 = 8;
        const TRIALS: usize = 200;
        let (mut inside, mut width, mut explained) = ([0.0; 3], [0.0; 3], 0.0);
        let part = 1.0 / (TABLES as f64 * TRIALS as f64);
        for seed in 0..TABLES {
            let (statistics, places) = rows(seed, 150);
            let regression = Regression::new(&statistics, &places);
            let (unseen, truth) = rows(100 + seed, TRIALS);
            for (s, t) in unseen.iter().zip(&truth) {
                for (i, e) in regression.estimate(s).iter().enumerate() {
                    inside[i] += part * f64::from(u8::from(t[i] >= e.low && t[i] <= e.high));
                    width[i] += part * (e.high - e.low);
                }
            }
            explained += regression.explained()[2] / TABLES as f64;
        }
        // Eight quantiles of 150: a standard error of .7 %, and .5 % of the trials.
        assert!(inside.iter().all(|part| (0.90..=0.98).contains(part)), "{inside:?}");
        assert!(explained < 0.25, "{explained}");
        assert!(width[0] < 0.25 && width[1] < 0.2 && width[2] > 0.85, "{width:?}");
    }
}
