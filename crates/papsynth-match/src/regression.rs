//! Regression of parameters on statistics, with calibrated intervals.
//!
//! Semi-automatic approximate Bayesian computation (Fearnhead and Prangle, doi:10.1111/j.1467-9868.2011.01010.x): a
//! first, linear regression reduces all statistics to one summary per parameter. A second, nonlinear regression
//! predicts the parameters from the summaries. Intervals are from cross-conformal prediction
//! (doi:10.1007/s10472-013-9368-4), normalised by the expected error (Papadopoulos and Haralambous,
//! doi:10.1016/j.neunet.2011.05.008). The held-out rows are held out of all steps: scaling, both regressions, and the
//! choice of their penalties.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use papsynth_judge::{Control, Phase};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use portable_numerics::statistics::{deviation, mean};

use crate::error::Error;

/// A value with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Value.
    pub value: f64,
    /// Lower limit of the interval.
    pub low: f64,
    /// Upper limit of the interval.
    pub high: f64,
}

/// A parameter is not identified if its interval is wider than this fraction of its range.
pub const WIDEST: f64 = 0.5;

/// Fraction of the intervals that contain the true value.
const CONFIDENCE: f64 = 0.95;

/// Scaled statistics are clipped to this number of standard deviations.
const FARTHEST: f64 = 4.0;

/// Added to errors before the logarithm, so that an error that is small by chance has little influence.
const LEAST_MISS: f64 = 0.02;

/// Standardises statistics. Unknown values become the mean, and values are clipped to the range of the rows.
///
/// Holds mean, standard deviation, minimum and maximum of each statistic.
#[derive(Debug, Clone)]
pub(crate) struct Scaler(Vec<[f64; 4]>);

impl Scaler {
    pub(crate) fn new(rows: &[&[f64]]) -> Self {
        let column = |c: usize| {
            let known: Vec<f64> = rows.iter().map(|r| r[c]).filter(|v| v.is_finite()).collect();
            let [mean, sd] = [mean(&known), deviation(&known)].map(|v| if v.is_finite() { v } else { 0.0 });
            let [low, high] = min_max(&known);
            [mean, sd, low, high]
        };
        Self((0..rows.first().map_or(0, |r| r.len())).map(column).collect())
    }

    pub(crate) fn scaled(&self, row: &[f64]) -> Vec<f64> {
        let one = |(value, [mean, sd, low, high]): (&f64, &[f64; 4])| {
            if value.is_finite() && *sd > 0.0 {
                ((value.clamp(*low, *high) - mean) / sd).clamp(-FARTHEST, FARTHEST)
            } else {
                0.0
            }
        };
        row.iter().zip(&self.0).map(one).collect()
    }
}

/// A regression of parameters, as positions in their ranges, on statistics.
#[derive(Debug, Clone)]
pub struct Regression {
    predictor: Predictor,
    intervals: Vec<IntervalModel>,
    explained: Vec<f64>,
}

impl Regression {
    /// Fits rows of positions to rows of statistics.
    #[must_use]
    pub fn new(statistics: &[Vec<f64>], places: &[Vec<f64>]) -> Self {
        // Only the stop flag causes an error, and it is never set here.
        Self::new_with(statistics, places, &Control::NONE).unwrap_or_else(|_| unreachable!())
    }

    /// As [`new`](Self::new), with progress reports and a stop flag. The phase is "fitting regressions".
    ///
    /// # Errors
    /// [`Error::Stopped`] if the stop flag is set.
    pub fn new_with(statistics: &[Vec<f64>], places: &[Vec<f64>], control: &Control) -> Result<Self, Error> {
        let (n, columns) = (statistics.len(), places.first().map_or(0, Vec::len));
        let phase = control.phase("fitting regressions", (2 * (FOLDS + 1) + 1) * columns);
        // Fit number FOLDS uses all rows.
        let without = |fold: usize| {
            Predictor::new(statistics, places, &(0..n).filter(|i| i % FOLDS != fold).collect::<Vec<_>>(), &phase)
        };
        let mut fits: Vec<Predictor> = (0..=FOLDS).into_par_iter().map(without).collect::<Result<_, Error>>()?;
        // Each row is predicted by the fit without it.
        let summaries: Vec<Vec<f64>> = (0..n).map(|row| fits[row % FOLDS].summary(&statistics[row])).collect();
        let values: Vec<Vec<f64>> = (0..n).map(|row| fits[row % FOLDS].values(&summaries[row])).collect();
        let predictor = fits.swap_remove(FOLDS);
        let missed = |c: usize| -> Vec<f64> { values.iter().zip(places).map(|(v, p)| (v[c] - p[c]).abs()).collect() };
        // Positions are uniform over 0 to 1, with variance 1/12.
        let explained = |c| 1.0 - 12.0 * missed(c).iter().map(|m| m * m).sum::<f64>() / n.max(1) as f64;
        let column = |c: usize| values.iter().map(|v| v[c]).collect::<Vec<_>>();
        let interval = |c| -> Result<IntervalModel, Error> {
            let model = IntervalModel::new(&summaries, c, &column(c), &missed(c));
            phase.step()?;
            Ok(model)
        };
        let intervals = (0..columns).into_par_iter().map(interval).collect::<Result<_, Error>>()?;
        Ok(Self { predictor, intervals, explained: (0..columns).map(explained).collect() })
    }

    /// Returns the positions for statistics, with their intervals, within 0 to 1.
    #[must_use]
    pub fn estimate(&self, statistics: &[f64]) -> Vec<Estimate> {
        let summary = self.predictor.summary(statistics);
        let values = self.predictor.values(&summary);
        let with = |(c, (value, model)): (usize, (f64, &IntervalModel))| {
            model.interval(value, model.usual(&bent(&summary, c)))
        };
        values.into_iter().zip(&self.intervals).enumerate().map(with).collect()
    }

    /// Returns the explained fraction of the variance of each parameter, on held-out rows.
    #[must_use]
    pub fn explained(&self) -> &[f64] {
        &self.explained
    }
}

/// Predicts values without intervals.
#[derive(Debug, Clone)]
struct Predictor {
    scaler: Scaler,
    first: Vec<Ridge>,
    second: Vec<Ridge>,
}

impl Predictor {
    fn new(statistics: &[Vec<f64>], places: &[Vec<f64>], kept: &[usize], phase: &Phase) -> Result<Self, Error> {
        let of_kept: Vec<&[f64]> = kept.iter().map(|i| statistics[*i].as_slice()).collect();
        let scaler = Scaler::new(&of_kept);
        let columns = places.first().map_or(0, Vec::len);
        let column = |c: usize| -> Vec<f64> { kept.iter().map(|i| places[*i][c]).collect() };
        let rows: Vec<Vec<f64>> = of_kept.iter().map(|r| scaler.scaled(r)).collect();
        let first = |c: usize| -> Result<Ridge, Error> {
            phase.step()?;
            Ok(weighted(&rows, &column(c)))
        };
        let first: Vec<Ridge> = (0..columns).map(first).collect::<Result<_, Error>>()?;
        let summaries: Vec<Vec<f64>> =
            (0..kept.len()).map(|i| first.iter().map(|r| of_one_scale(r.unseen[i])).collect()).collect();
        let second = |c: usize| {
            phase.step()?;
            let rows: Vec<Vec<f64>> = summaries.iter().map(|s| bent(s, c)).collect();
            Ok(Features::new(&rows).best(&column(c)))
        };
        let second = (0..columns).map(second).collect::<Result<_, Error>>()?;
        Ok(Self { scaler, first, second })
    }

    fn summary(&self, statistics: &[f64]) -> Vec<f64> {
        let row = self.scaler.scaled(statistics);
        self.first.iter().map(|r| of_one_scale(r.predict(&row))).collect()
    }

    fn values(&self, summary: &[f64]) -> Vec<f64> {
        self.second.iter().enumerate().map(|(c, r)| r.predict(&bent(summary, c)).clamp(0.0, 1.0)).collect()
    }
}

/// Scales a summary by the standard deviation of the range of the parameter, so that a summary with little variation
/// stays small.
fn of_one_scale(place: f64) -> f64 {
    ((place - 0.5) * 12.0_f64.sqrt()).clamp(-FARTHEST, FARTHEST)
}

/// Fits a ridge regression in which each statistic is weighted by its correlation with the parameter.
fn weighted(rows: &[Vec<f64>], y: &[f64]) -> Ridge {
    let middle = mean(y);
    let weight = |s: usize| {
        let [mut with, mut own, mut all] = [0.0; 3];
        for (row, value) in rows.iter().zip(y) {
            with += row[s] * (value - middle);
            own += row[s] * row[s];
            all += (value - middle) * (value - middle);
        }
        if own * all > 0.0 { with.abs() / (own * all).sqrt() } else { 0.0 }
    };
    let weights: Vec<f64> = (0..rows.first().map_or(0, Vec::len)).map(weight).collect();
    let of_weight: Vec<Vec<f64>> = rows.iter().map(|r| r.iter().zip(&weights).map(|(x, w)| x * w).collect()).collect();
    let mut ridge = Features::new(&of_weight).best(y);
    ridge.factors.iter_mut().zip(&weights).for_each(|(f, w)| *f *= w);
    ridge
}

/// Returns the features of the second regression: powers of the summary of the parameter, all summaries, and their
/// products with the summary of the parameter.
fn bent(summary: &[f64], own: usize) -> Vec<f64> {
    let x = summary[own];
    let few = 1.0 / (summary.len() as f64).sqrt();
    let mut row = vec![x, x * x - 1.0, x * (x * x - 3.0)];
    row.extend(summary.iter().map(|s| few * s));
    row.extend(summary.iter().map(|s| few * x * s));
    row
}

/// Half-widths of intervals.
#[derive(Debug, Clone)]
struct IntervalModel {
    /// Model of the logarithm of the expected error.
    misses: Ridge,
    /// Half-width over the expected error.
    times: f64,
}

impl IntervalModel {
    /// Fits the model to summaries, values and errors of held-out rows.
    fn new(summaries: &[Vec<f64>], own: usize, values: &[f64], missed: &[f64]) -> Self {
        let rows: Vec<Vec<f64>> = summaries.iter().map(|s| bent(s, own)).collect();
        let logarithms: Vec<f64> = missed.iter().map(|m| libm::log(m + LEAST_MISS)).collect();
        let misses = Features::new(&rows).best(&logarithms);
        // The expected error of a row is from the fit without it.
        let usual: Vec<f64> = misses.unseen.iter().map(|u| libm::exp(*u)).collect();
        let ratio = |which: &dyn Fn(usize) -> bool| {
            let mut times: Vec<f64> = (0..missed.len()).filter(|i| which(*i)).map(|i| missed[i] / usual[i]).collect();
            times.sort_unstable_by(f64::total_cmp);
            // Conformal rank: the new row is one of n + 1.
            let rank = papsynth_judge::number::whole(libm::ceil(CONFIDENCE * (times.len() as f64 + 1.0))).max(1);
            times.get(rank - 1).copied().unwrap_or(f64::INFINITY)
        };
        let mut model = Self { misses, times: ratio(&|_| true) };
        // The coverage of the reported intervals counts, which are the narrow ones.
        loop {
            let narrow = |i: usize| {
                let e = model.interval(values[i], usual[i]);
                e.high - e.low <= WIDEST
            };
            let times = ratio(&narrow);
            if times <= model.times || !(0..values.len()).any(narrow) {
                return model;
            }
            model.times = times;
        }
    }

    fn usual(&self, row: &[f64]) -> f64 {
        libm::exp(self.misses.predict(row))
    }

    fn interval(&self, value: f64, usual: f64) -> Estimate {
        let half = self.times * usual;
        Estimate { value, low: (value - half).max(0.0), high: (value + half).min(1.0) }
    }
}

/// Candidate penalties, relative to the mean square of the rows.
const PENALTIES: [f64; 11] = [1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0];

/// Number of cross-validation folds; a fold holds every tenth row.
const FOLDS: usize = 10;

/// Minimum eigenvalue, relative to the largest one.
const LEAST: f64 = 1e-12;

/// Singular value decomposition of rows of features, X = U S Vᵀ, for several regressions.
pub(crate) struct Features {
    /// U: one row per row.
    turned: DMatrix<f64>,
    /// S².
    squares: DVector<f64>,
    /// V S⁻¹: one row per feature.
    back: DMatrix<f64>,
    scale: f64,
}

/// Coefficients of features, and the prediction of each row from the other folds.
#[derive(Debug, Clone)]
pub(crate) struct Ridge {
    pub(crate) mean: f64,
    pub(crate) factors: Vec<f64>,
    pub(crate) unseen: Vec<f64>,
    /// Mean squared error of held-out rows.
    pub(crate) error: f64,
}

impl Features {
    /// Decomposes rows of the same length.
    pub(crate) fn new(rows: &[Vec<f64>]) -> Self {
        let (n, p) = (rows.len(), rows.first().map_or(0, Vec::len));
        let x = DMatrix::from_fn(n, p, |i, j| rows[i][j]);
        let scale = x.norm_squared() / n.max(1) as f64;
        // Uses the smaller one of XᵀX and XXᵀ: both have the eigenvalues S².
        let few = p <= n;
        let eigen = SymmetricEigen::new(if few { x.tr_mul(&x) } else { &x * x.transpose() });
        let most = eigen.eigenvalues.iter().copied().fold(0.0, f64::max);
        let kept: Vec<usize> = (0..eigen.eigenvalues.len()).filter(|i| eigen.eigenvalues[*i] > LEAST * most).collect();
        let squares = DVector::from_iterator(kept.len(), kept.iter().map(|i| eigen.eigenvalues[*i]));
        let own = eigen.eigenvectors.select_columns(&kept);
        let over = |mut m: DMatrix<f64>, divisors: &DVector<f64>| {
            m.column_iter_mut().zip(divisors.iter()).for_each(|(mut column, by)| column.scale_mut(1.0 / by));
            m
        };
        let roots = squares.map(f64::sqrt);
        let (turned, back) = if few {
            (over(&x * &own, &roots), over(own, &roots))
        } else {
            (own.clone(), over(x.tr_mul(&own), &squares))
        };
        Self { turned, squares, back, scale }
    }

    /// Fits a ridge regression with the penalty of the smallest error on held-out rows.
    pub(crate) fn best(&self, y: &[f64]) -> Ridge {
        let mean = mean(y);
        let centred = DVector::from_iterator(y.len(), y.iter().map(|v| v - mean));
        let turned = self.turned.tr_mul(&centred);
        let mut best = Ridge { mean, factors: vec![0.0; self.back.nrows()], unseen: Vec::new(), error: f64::MAX };
        for penalty in PENALTIES {
            let kept = self.squares.map(|s| s / (s + penalty * self.scale));
            let unseen = self.unseen(y, &centred, &turned, &kept);
            let error = unseen.iter().zip(y).map(|(u, v)| (u - v) * (u - v)).sum::<f64>() / y.len() as f64;
            if error < best.error {
                let factors = (&self.back * turned.component_mul(&kept)).iter().copied().collect();
                best = Ridge { mean, factors, unseen, error };
            }
        }
        best
    }

    /// Returns the prediction of the rows of each fold from the other folds. Leave-one-out would bias the next
    /// regression: the mean of the other rows is low if a row is high.
    fn unseen(&self, y: &[f64], centred: &DVector<f64>, turned: &DVector<f64>, kept: &DVector<f64>) -> Vec<f64> {
        let mut unseen = y.to_vec();
        let rest = centred - &self.turned * turned.component_mul(kept);
        for fold in 0..FOLDS.min(y.len()) {
            let rows: Vec<usize> = (fold..y.len()).step_by(FOLDS).collect();
            let own = self.turned.select_rows(&rows);
            let scaled = DMatrix::from_fn(rows.len(), kept.len(), |i, j| own[(i, j)] * kept[j]);
            let of_fold = DVector::from_iterator(rows.len(), rows.iter().map(|i| rest[*i]));
            // Removes the influence of the fold on its predictions: exact for a given mean.
            let others = DMatrix::identity(rows.len(), rows.len()) - scaled * own.transpose();
            if let Some(rest) = others.cholesky().map(|c| c.solve(&of_fold)) {
                for (i, r) in rows.iter().zip(rest.iter()) {
                    unseen[*i] = y[*i] - r;
                }
            }
        }
        unseen
    }
}

impl Ridge {
    /// Predicts the value of a row of features.
    pub(crate) fn predict(&self, row: &[f64]) -> f64 {
        self.mean + self.factors.iter().zip(row).map(|(f, x)| f * x).sum::<f64>()
    }
}

/// Returns minimum and maximum.
pub(crate) fn min_max(values: &[f64]) -> [f64; 2] {
    values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(*v), high.max(*v)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use portable_numerics::random::uniform;
    use rand_core::SeedableRng;

    /// Noisy nonlinear statistics of two parameters, and a third parameter without influence.
    fn rows(seed: u64, count: usize) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
        let mut rng = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut one = || uniform(&mut rng);
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
    fn intervals_have_their_coverage_and_undetermined_parameters_have_wide_ones() {
        const TABLES: u64 = 8;
        const TRIALS: usize = 200;
        let (mut inside, mut width, mut explained) = ([0.0; 3], [0.0; 3], [0.0; 3]);
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
            for (sum, part) in explained.iter_mut().zip(regression.explained()) {
                *sum += part / TABLES as f64;
            }
        }
        // Standard error: 0.7 % from eight quantiles of 150 rows, and 0.5 % from the trials.
        assert!(inside.iter().all(|part| (0.92..=0.98).contains(part)), "{inside:?}");
        assert!(explained[0] > 0.95 && explained[1] > 0.95 && explained[2] < 0.1, "{explained:?}");
        assert!(width[0] < 0.25 && width[1] < 0.2 && width[2] > 0.85, "{width:?}");
    }

    /// With fewer and with more features than rows.
    #[test]
    fn the_error_on_unseen_rows_is_that_of_leaving_them_out() {
        for (n, p) in [(25, 4), (25, 40)] {
            let at = |i: usize, j: usize| ((i * i + 3 * j) % 7) as f64 + libm::sin((i * (j + 1)) as f64);
            let rows: Vec<Vec<f64>> = (0..n).map(|i| (0..p).map(|j| at(i, j)).collect()).collect();
            let y: Vec<f64> = rows.iter().enumerate().map(|(i, r)| r[0] + f64::from(u8::from(i % 3 == 0))).collect();
            let found = Features::new(&rows).best(&y);
            let mean = mean(&y);
            let scale = rows.iter().flatten().map(|v| v * v).sum::<f64>() / n as f64;
            // Direct computation for each penalty, without the fold and with the mean of all rows.
            let factors = |penalty: f64, kept: &dyn Fn(usize) -> bool| {
                let kept: Vec<usize> = (0..n).filter(|i| kept(*i)).collect();
                let x = DMatrix::from_fn(kept.len(), p, |i, j| rows[kept[i]][j]);
                let t = DVector::from_iterator(kept.len(), kept.iter().map(|i| y[*i] - mean));
                let g = x.tr_mul(&x) + DMatrix::identity(p, p) * (penalty * scale);
                g.lu().solve(&x.tr_mul(&t)).unwrap()
            };
            let tell = |f: &DVector<f64>, row: usize| mean + rows[row].iter().zip(f).map(|(a, b)| a * b).sum::<f64>();
            let right = |penalty: &f64| {
                let all = factors(*penalty, &|_| true);
                (0..n).all(|i| {
                    let others = factors(*penalty, &|j| j % FOLDS != i % FOLDS);
                    (tell(&others, i) - found.unseen[i]).abs() < 1e-6
                        && (tell(&all, i) - found.predict(&rows[i])).abs() < 1e-6
                })
            };
            assert!(PENALTIES.iter().any(right), "{n} rows of {p}");
        }
    }
}
