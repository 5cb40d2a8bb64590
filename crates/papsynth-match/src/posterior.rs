//! The distribution of the parameters of fields, given their statistics.
//!
//! The statistics of a field are a quadratic function of its parameters, fitted to simulated samples by ridge
//! regression, with normal errors. The parameters of fields are normal around their mean, with standard deviations
//! between fields from an EM algorithm. The mean is that of the largest posterior density, by damped Gauss–Newton
//! steps, and so are the parameters of each field. Samples that are simulated around the result correct the function
//! where it matters, for all fields together and for each field: indirect inference (Gourieroux, Monfort and Renault,
//! doi:10.1002/jae.3950080507).

use nalgebra::{DMatrix, DVector};
use papsynth_judge::Phase;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::error::Error;
use crate::regression::{Features, Scaler, weighted_mean};

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

/// Simulated samples: statistics, positions of the parameters in their ranges, fields and rounds.
#[derive(Debug, Clone, Default)]
pub(crate) struct Rows {
    pub(crate) statistics: Vec<Vec<f64>>,
    pub(crate) places: Vec<Vec<f64>>,
    /// The field around whose parameters each sample was drawn; none for the samples from the complete ranges.
    pub(crate) fields: Vec<Option<usize>>,
    /// The round of each sample; 0 for the samples from the complete ranges.
    pub(crate) rounds: Vec<i32>,
}

/// Weight of the samples of a round, relative to those of the next one: for slopes and for the mean. Slopes change
/// slowly over the ranges, so all samples serve; the mean has to be that of samples like the real fields.
const OLDER: f64 = 0.75;
const OLDER_MEAN: f64 = 0.65;

impl Rows {
    fn weights(&self, older: f64) -> Vec<f64> {
        let last = self.rounds.iter().copied().max().unwrap_or(0);
        self.rounds.iter().map(|round| libm::pow(older, f64::from(last - round))).collect()
    }
}

/// Standard deviation of a uniform distribution over 0 to 1.
pub(crate) const PRIOR_SD: f64 = 0.288_675_134_594_812_9;

/// Usual standard deviation of the means around the initial recipe. Smaller than that of the range: what the fields
/// hardly show stays near the initial recipe. The intervals do not use it.
pub(crate) const NEAR_SD: f64 = 0.12;

/// The same for the blur of EDF images: 7 %. Their focus does not change it, and a few fields determine it badly,
/// because soft borders of nuclei look like blur.
pub(crate) const FUSED_SD: f64 = 0.03;

/// Steps of the EM algorithm, and of the search for the mean after each round.
const EM_STEPS: usize = 100;
const STEPS: usize = 4;

/// Largest change of a mean in a step.
const LARGEST_STEP: f64 = 0.08;

/// Prior of the variance between fields: as that of this number of fields with this standard deviation.
const PRIOR_FIELDS: f64 = 1.0;
const PRIOR_SPREAD: f64 = 0.1;

/// Weight of the diagonal in the covariance of the errors, which has more elements than there are samples.
const DIAGONAL: f64 = 0.5;

/// Standard deviation of what no recipe can match, relative to that of a statistic between fields.
const MISFIT: f64 = 0.3;

/// Smaller coefficients than this, in standard errors, are zero.
const LEAST_SLOPE: f64 = 2.5;

/// Larger differences of a statistic than this, in standard deviations, are misfit.
const FARTHEST: f64 = 2.0;

/// Statistics as functions of the parameters, with the covariance of their errors.
pub(crate) struct Response {
    scaler: Scaler,
    /// Coefficients of 1 and of [`features`], one row per statistic.
    factors: DMatrix<f64>,
    /// The same without coefficients that may be chance.
    certain: DMatrix<f64>,
    /// Covariance of the errors of a sample.
    errors: DMatrix<f64>,
    /// Mean difference of the latest samples from the function, and the number of these samples.
    offset: DVector<f64>,
    latest: f64,
    /// Further mean difference of the samples around each field, and the variances of the errors of these means.
    of_fields: Vec<DVector<f64>>,
    unsure: DVector<f64>,
}

/// Returns positions relative to the centres of their ranges, and their centred squares.
fn features(places: &[f64]) -> Vec<f64> {
    let about = |p: &f64| 2.0 * p - 1.0;
    places.iter().map(about).chain(places.iter().map(|p| about(p) * about(p) - 1.0 / 3.0)).collect()
}

impl Response {
    /// Fits the function to simulated samples.
    ///
    /// # Errors
    /// [`Error::Stopped`] if the stop flag is set.
    pub(crate) fn new(rows: &Rows, phase: &Phase) -> Result<Self, Error> {
        let Rows { statistics, places, .. } = rows;
        let weights = rows.weights(OLDER);
        let scaler = Scaler::new(&statistics.iter().map(Vec::as_slice).collect::<Vec<_>>(), &weights);
        let scaled: Vec<Vec<f64>> = statistics.iter().map(|row| scaler.scaled(row)).collect();
        let (n, count) = (statistics.len(), scaled.first().map_or(0, Vec::len));
        let raw: Vec<Vec<f64>> = places.iter().map(|p| features(p)).collect();
        let width = raw.first().map_or(0, Vec::len);
        let centre = |j: usize| weighted_mean(raw.iter().zip(&weights).map(|(r, w)| (r[j], *w)));
        let centres: Vec<f64> = (0..width).map(centre).collect();
        let rows_of: Vec<Vec<f64>> =
            raw.iter().map(|row| row.iter().zip(&centres).map(|(x, c)| x - c).collect()).collect();
        phase.check()?;
        let all = Features::new(&rows_of, &weights);
        let fits: Vec<_> = (0..count)
            .into_par_iter()
            .map(|c| all.best(&scaled.iter().map(|row| row[c]).collect::<Vec<f64>>()))
            .collect();
        phase.check()?;
        let total: f64 = weights.iter().sum();
        let variance =
            |values: &dyn Fn(usize) -> f64| weighted_mean((0..n).map(|i| (values(i) * values(i), weights[i])));
        let of_feature: Vec<f64> = (0..width).map(|j| variance(&|i| rows_of[i][j])).collect();
        let factors = DMatrix::from_fn(count, width + 1, |c, j| match j {
            0 => fits[c].mean - fits[c].factors.iter().zip(&centres).map(|(f, x)| f * x).sum::<f64>(),
            _ => fits[c].factors[j - 1],
        });
        // Coefficients that may be chance would be information about parameters without influence.
        let errors: Vec<f64> = (0..count).map(|c| variance(&|i| scaled[i][c] - fits[c].unseen[i]) / total).collect();
        let certain = DMatrix::from_fn(count, width + 1, |c, j| {
            let least = |j: usize| LEAST_SLOPE * (errors[c] / of_feature[j].max(1e-12)).sqrt();
            if j > 0 && factors[(c, j)].abs() < least(j - 1) { 0.0 } else { factors[(c, j)] }
        });
        let rest = |i: usize, c: usize| scaled[i][c] - fits[c].unseen[i];
        let weighted = DMatrix::from_fn(n, count, |i, c| (weights[i] / total).sqrt() * rest(i, c));
        let mut covariance = weighted.tr_mul(&weighted);
        let diagonal = covariance.diagonal();
        covariance *= 1.0 - DIAGONAL;
        for c in 0..count {
            covariance[(c, c)] = diagonal[c] + 1e-6;
        }
        let near = rows.weights(OLDER_MEAN);
        let function =
            |i: usize, c: usize| factors[(c, 0)] + (0..width).map(|j| factors[(c, j + 1)] * raw[i][j]).sum::<f64>();
        let off: Vec<Vec<f64>> = (0..n).map(|i| (0..count).map(|c| scaled[i][c] - function(i, c)).collect()).collect();
        let mean_of = |of: &dyn Fn(usize) -> bool| {
            DVector::from_fn(count, |c, _| weighted_mean((0..n).filter(|i| of(*i)).map(|i| (off[i][c], near[i]))))
        };
        let number_of = |of: &dyn Fn(usize) -> bool| {
            let [sum, squares] =
                (0..n).filter(|i| of(*i)).fold([0.0; 2], |[s, q], i| [s + near[i], q + near[i] * near[i]]);
            sum * sum / squares.max(1e-12)
        };
        let offset = if rows.rounds.last() == Some(&0) { DVector::zeros(count) } else { mean_of(&|_| true) };
        let fields = rows.fields.iter().flatten().max().map_or(0, |last| last + 1);
        let mut of_fields: Vec<DVector<f64>> =
            (0..fields).map(|f| mean_of(&|i| rows.fields[i] == Some(f)) - &offset).collect();
        let mut unsure = DVector::zeros(count);
        let samples: Vec<f64> = (0..fields).map(|f| number_of(&|i| rows.fields[i] == Some(f)).max(1.0)).collect();
        for c in 0..count {
            // Differences as between samples of one field are chance.
            let of_chance: Vec<f64> = samples.iter().map(|number| diagonal[c] / number).collect();
            let excess = of_fields.iter().zip(&of_chance).map(|(own, chance)| own[c] * own[c] - chance);
            let variance = (excess.sum::<f64>() / fields.max(1) as f64).max(0.0);
            for (own, chance) in of_fields.iter_mut().zip(&of_chance) {
                let kept = variance / (variance + chance).max(1e-12);
                own[c] *= kept;
                unsure[c] += kept * chance / fields as f64;
            }
        }
        let latest = number_of(&|_| true);
        Ok(Self { scaler, factors, certain, errors: covariance, offset, latest, of_fields, unsure })
    }

    /// Returns the statistics of a field.
    fn at(&self, places: &[f64]) -> DVector<f64> {
        let row = DVector::from_iterator(2 * places.len() + 1, std::iter::once(1.0).chain(features(places)));
        &self.factors * row + &self.offset
    }

    /// Returns the statistics near the parameters of a field, which are `apart` from the mean.
    fn local(&self, field: usize, places: &[f64], apart: &DVector<f64>, varies: &[bool]) -> Local {
        let moving: Vec<usize> = (0..varies.len()).filter(|c| varies[*c]).collect();
        let slopes = slopes(&self.certain, places).select_columns(&moving);
        let base = self.at(places) - &slopes * apart.select_rows(&moving);
        let base = self.of_fields.get(field).map_or(base.clone(), |own| base + own);
        Local { slopes, base }
    }

    /// Returns the parameters of fields from their statistics, each the mean of `samples` samples. The search
    /// begins at `start`.
    pub(crate) fn posterior(
        &self,
        fields: &[Vec<f64>],
        samples: usize,
        start: &Posterior,
        prior: &Knowledge,
    ) -> Posterior {
        let (count, columns, varies) = (fields.len(), prior.varies.len(), prior.varies);
        let seen: Vec<DVector<f64>> = fields.iter().map(|s| DVector::from_vec(self.scaler.scaled(s))).collect();
        let average: DVector<f64> = seen.iter().sum::<DVector<f64>>() / count as f64;
        let inverse = |m: DMatrix<f64>| {
            let size = m.nrows();
            m.cholesky().map_or_else(|| DMatrix::identity(size, size), |c| c.inverse())
        };
        let of_field = inverse(&self.errors / samples as f64 + DMatrix::from_diagonal(&self.unsure));
        let sampled = 1.0 / (count * samples) as f64 + 1.0 / self.latest;

        let mut means = start.means.clone();
        let mut apart: Vec<DVector<f64>> =
            start.fields.iter().map(|f| DVector::from_fn(columns, |c, _| f[c] - means[c])).collect();
        let mut variances = DVector::zeros(columns);
        let mut unsure = DVector::zeros(columns);
        let mut covariance = DMatrix::identity(columns, columns);
        let place = |mean: f64, off: f64| (mean + off).clamp(0.0, 1.0);
        for _ in 0..STEPS {
            let all = slopes(&self.factors, &means);
            let certain = slopes(&self.certain, &means);
            let places = |a: &DVector<f64>| -> Vec<f64> { (0..columns).map(|c| place(means[c], a[c])).collect() };
            let local: Vec<Local> = (0..count).map(|f| self.local(f, &places(&apart[f]), &apart[f], varies)).collect();
            (apart, variances, unsure) = deviations(&local, &of_field, &seen, &average, &apart, varies);
            let expected: Vec<DVector<f64>> = (0..count).map(|f| self.at(&places(&apart[f]))).collect();
            let expected: DVector<f64> = expected.iter().sum::<DVector<f64>>() / count as f64;
            let rest = &average - expected;
            let mut of_mean = &self.errors * sampled;
            for (c, r) in rest.iter().enumerate() {
                let own = self.errors[(c, c)];
                let usual = own * (sampled + MISFIT * MISFIT);
                // The influence of larger differences does not grow.
                of_mean[(c, c)] += usual.max(r * r / (FARTHEST * FARTHEST)) - own * sampled;
            }
            let of_mean = inverse(of_mean);
            let weight = all.transpose() * &of_mean;
            let own = DMatrix::from_diagonal_element(columns, columns, 1.0 / (PRIOR_SD * PRIOR_SD));
            covariance = inverse(certain.transpose() * of_mean * &certain + &own);
            let near = DVector::from_fn(columns, |c, _| 1.0 / (prior.near[c] * prior.near[c]));
            let pull = DVector::from_fn(columns, |c, _| (prior.means[c] - means[c]) * near[c]);
            let own = DMatrix::from_diagonal(&near);
            let step = inverse(&weight * &all + own) * (&weight * rest + pull);
            for c in 0..columns {
                means[c] = place(means[c], step[c].clamp(-LARGEST_STEP, LARGEST_STEP));
            }
        }
        Posterior {
            errors: (0..columns).map(|c| covariance[(c, c)].max(0.0).sqrt().min(PRIOR_SD)).collect(),
            spreads: variances.iter().map(|v: &f64| v.sqrt()).collect(),
            fields: apart.iter().map(|a| (0..columns).map(|c| place(means[c], a[c])).collect()).collect(),
            difference_errors: unsure.iter().map(|v: &f64| v.max(0.0).sqrt()).collect(),
            means,
        }
    }
}

/// Returns the derivatives of statistics by the parameters, from the coefficients of 1 and of [`features`].
fn slopes(factors: &DMatrix<f64>, places: &[f64]) -> DMatrix<f64> {
    let count = places.len();
    DMatrix::from_fn(factors.nrows(), count, |c, i| {
        2.0 * factors[(c, 1 + i)] + 4.0 * (2.0 * places[i] - 1.0) * factors[(c, 1 + count + i)]
    })
}

/// The statistics near the parameters of a field.
struct Local {
    /// Derivatives by the parameters that differ between fields.
    slopes: DMatrix<f64>,
    /// The statistics there, minus those that the derivatives explain.
    base: DVector<f64>,
}

/// Returns the differences of the parameters of each field from their mean, their variances between fields, and the
/// variances of the errors of the differences. `before` are the differences where the statistics are known.
fn deviations(
    local: &[Local],
    weight: &DMatrix<f64>,
    seen: &[DVector<f64>],
    average: &DVector<f64>,
    before: &[DVector<f64>],
    varies: &[bool],
) -> (Vec<DVector<f64>>, DVector<f64>, DVector<f64>) {
    let columns = varies.len();
    let moving: Vec<usize> = (0..columns).filter(|c| varies[*c]).collect();
    // What no field can match does not matter.
    let base: DVector<f64> = local.iter().map(|l| &l.base).sum::<DVector<f64>>() / local.len() as f64;
    let parts: Vec<(DMatrix<f64>, DVector<f64>)> = local
        .iter()
        .zip(seen)
        .map(|(l, seen)| {
            let back = l.slopes.transpose() * weight;
            (&back * &l.slopes, back * (seen - average - (&l.base - &base)))
        })
        .collect();
    let mut variances = DVector::from_element(moving.len(), PRIOR_SPREAD * PRIOR_SPREAD);
    let mut apart = vec![DVector::zeros(moving.len()); seen.len()];
    let mut unsure = variances.clone();
    let freedom = seen.len().saturating_sub(1) as f64;
    for _ in 0..EM_STEPS {
        let prior = DMatrix::from_diagonal(&variances.map(|v: f64| 1.0 / v.max(1e-9)));
        let solved: Option<Vec<(DVector<f64>, DVector<f64>)>> = parts
            .iter()
            .map(|(information, pull)| {
                let covariance = (information + &prior).cholesky()?.inverse();
                Some((&covariance * pull, covariance.diagonal()))
            })
            .collect();
        let Some(solved) = solved else { break };
        unsure = solved.iter().map(|(_, unsure)| unsure).sum::<DVector<f64>>() / seen.len() as f64;
        let mean: DVector<f64> = solved.iter().map(|(a, _)| a).sum::<DVector<f64>>() / seen.len() as f64;
        apart = solved.into_iter().map(|(a, _)| a - &mean).collect::<Vec<DVector<f64>>>();
        if seen.len() < 2 {
            break;
        }
        variances = DVector::from_fn(moving.len(), |c, _| {
            let squares: f64 = apart.iter().map(|a| a[c] * a[c]).sum();
            (squares + freedom * unsure[c] + PRIOR_FIELDS * PRIOR_SPREAD * PRIOR_SPREAD) / (freedom + PRIOR_FIELDS)
        });
    }
    let wide = |of: &DVector<f64>| {
        let mut all = DVector::zeros(columns);
        moving.iter().zip(of.iter()).for_each(|(c, v)| all[*c] = *v);
        all
    };
    let stepped = |a: &DVector<f64>, before: &DVector<f64>| {
        wide(a).zip_map(before, |to, from| from + (to - from).clamp(-LARGEST_STEP, LARGEST_STEP))
    };
    (apart.iter().zip(before).map(|(a, b)| stepped(a, b)).collect(), wide(&variances), wide(&unsure))
}

/// What is known of the parameters before any field is seen.
pub(crate) struct Knowledge<'a> {
    /// Means over the fields.
    pub(crate) means: &'a [f64],
    /// Standard deviations of the means.
    pub(crate) near: &'a [f64],
    /// Which parameters differ between fields.
    pub(crate) varies: &'a [bool],
}

/// Parameters of fields, as positions in their ranges.
#[derive(Debug, Clone)]
pub(crate) struct Posterior {
    /// Means over the fields.
    pub(crate) means: Vec<f64>,
    /// Their standard errors.
    pub(crate) errors: Vec<f64>,
    /// Standard deviations between fields.
    pub(crate) spreads: Vec<f64>,
    /// Parameters of each field.
    pub(crate) fields: Vec<Vec<f64>>,
    /// Standard errors of the differences of a field from the mean: with the differences themselves they give the
    /// standard deviations between fields.
    pub(crate) difference_errors: Vec<f64>,
}

impl Posterior {
    /// Returns fields of the same parameters, before any statistic is seen.
    pub(crate) fn prior(means: &[f64], fields: usize) -> Self {
        Self {
            means: means.to_vec(),
            errors: vec![PRIOR_SD; means.len()],
            spreads: vec![PRIOR_SPREAD; means.len()],
            fields: vec![means.to_vec(); fields],
            difference_errors: vec![0.0; means.len()],
        }
    }

    /// Returns the same with the parameters of all fields changed by `shift`.
    pub(crate) fn shifted(&self, shift: &[f64]) -> Self {
        let add = |places: &Vec<f64>| places.iter().zip(shift).map(|(p, s)| (p + s).clamp(0.0, 1.0)).collect();
        Self { means: add(&self.means), fields: self.fields.iter().map(add).collect(), ..self.clone() }
    }
}

/// Half the width of a 95 % interval, in standard errors: 1.96, times a factor from trials (`examples/recover.rs`),
/// because the function of the statistics is itself an estimate.
const HALF_WIDTH: f64 = 1.65 * 1.96;

/// The mean over fields has no information about a parameter if its standard error is larger than this fraction of that
/// of the range.
const INVISIBLE: f64 = 0.9;

impl Posterior {
    /// Returns the mean of a parameter over the fields, with its interval.
    pub(crate) fn mean(&self, column: usize) -> Estimate {
        let (value, half) = (self.means[column], HALF_WIDTH * self.errors[column]);
        Estimate { value, low: (value - half).max(0.0), high: (value + half).min(1.0) }
    }

    /// Returns whether the fields show a parameter.
    pub(crate) fn is_visible(&self, column: usize) -> bool {
        self.errors[column] < INVISIBLE * PRIOR_SD
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use papsynth_judge::Control;
    use portable_numerics::random::{normal, uniform};
    use rand_core::SeedableRng;
    use rand_xoshiro::Xoshiro256PlusPlus;

    const PARAMETERS: usize = 3;

    /// Returns noisy nonlinear statistics of two parameters; a third parameter has no influence.
    fn statistics(p: &[f64], noise: f64, rng: &mut Xoshiro256PlusPlus) -> Vec<f64> {
        let mut e = || noise * normal(rng);
        let common = e();
        vec![
            p[0] * p[0] + e() + common,
            p[0] + p[1] + e() + common,
            libm::exp(p[1]) + e(),
            e(),
            if p[0] > 0.97 { f64::NAN } else { p[0] + e() },
            3.0 * p[1] - p[0] + e(),
        ]
    }

    fn rows(rng: &mut Xoshiro256PlusPlus, rounds: &mut Rows, around: Option<&Posterior>, count: usize) {
        let round = rounds.rounds.last().map_or(0, |round| round + 1);
        for i in 0..count {
            let places: Vec<f64> = (0..PARAMETERS)
                .map(|c| match around {
                    None => uniform(rng),
                    Some(found) => (found.fields[i % found.fields.len()][c] + 0.05 * normal(rng)).clamp(0.0, 1.0),
                })
                .collect();
            rounds.statistics.push(statistics(&places, 0.1, rng));
            rounds.fields.push(around.map(|found| i % found.fields.len()));
            rounds.places.push(places);
            rounds.rounds.push(round);
        }
    }

    #[test]
    fn intervals_cover_the_mean_over_fields_and_an_invisible_parameter_is_found() {
        const TRIALS: u64 = 150;
        const FIELDS: usize = 6;
        let varies = [true, true, false];
        let (mut covered, mut width, mut spread) = ([0.0; 2], [0.0; 2], [0.0; 2]);
        let mut off = [0.0; 2];
        for seed in 0..TRIALS {
            let rng = &mut Xoshiro256PlusPlus::seed_from_u64(seed);
            // Each other trial has fields that differ.
            let apart = if seed % 2 == 0 { 0.15 } else { 0.0 };
            let centre = [0.2 + 0.6 * uniform(rng), 0.2 + 0.6 * uniform(rng)];
            let truth: Vec<[f64; 2]> =
                (0..FIELDS).map(|_| centre.map(|c| (c + apart * normal(rng)).clamp(0.0, 1.0))).collect();
            let fields: Vec<Vec<f64>> = truth.iter().map(|t| statistics(&[t[0], t[1], 0.5], 0.1, rng)).collect();
            let prior = [0.5; PARAMETERS];
            let mut found = Posterior::prior(&prior, FIELDS);
            let mut all = Rows::default();
            let phase = Control::NONE.phase("test", 1);
            for round in 0..4 {
                let around = (round > 0).then(|| found.clone());
                rows(rng, &mut all, around.as_ref(), if round == 0 { 120 } else { 30 });
                let knowledge = Knowledge { means: &prior, near: &[NEAR_SD; PARAMETERS], varies: &varies };
                found = Response::new(&all, &phase).unwrap().posterior(&fields, 1, &found, &knowledge);
            }
            assert!(!found.is_visible(2) && found.spreads[2] == 0.0, "{:?}", found.errors);
            for c in 0..2 {
                for (field, truth) in found.fields.iter().zip(&truth) {
                    off[usize::from(apart > 0.0)] += (field[c] - truth[c]).abs() / (TRIALS * FIELDS as u64) as f64;
                }
                let e = found.mean(c);
                let mean = truth.iter().map(|t| t[c]).sum::<f64>() / FIELDS as f64;
                covered[c] += f64::from(u8::from((e.low..=e.high).contains(&mean))) / TRIALS as f64;
                width[c] += (e.high - e.low) / TRIALS as f64;
                spread[usize::from(apart > 0.0)] += found.spreads[c] / TRIALS as f64;
            }
        }
        // Standard error: 1.8 %.
        assert!(covered.iter().all(|part| *part > 0.9), "{covered:?}");
        assert!(width.iter().all(|w| *w < 0.3), "{width:?}");
        assert!(spread[0] < 0.1 && (0.11..0.2).contains(&spread[1]), "{spread:?}");
        // The fields themselves, although their statistics are not linear.
        assert!(off[0] < 0.06 && off[1] < 0.06, "{off:?}");
    }

    #[test]
    fn one_field_has_no_spread_and_fields_without_statistics_keep_the_prior() {
        let rng = &mut Xoshiro256PlusPlus::seed_from_u64(1);
        let mut all = Rows::default();
        rows(rng, &mut all, None, 80);
        let response = Response::new(&all, &Control::NONE.phase("test", 1)).unwrap();
        let prior = [0.4; PARAMETERS];
        let start = Posterior::prior(&prior, 1);
        let knowledge = Knowledge { means: &prior, near: &[NEAR_SD; PARAMETERS], varies: &[true; PARAMETERS] };
        let one = response.posterior(&[vec![f64::NAN; 6]], 1, &start, &knowledge);
        assert!(one.means.iter().chain(&one.errors).all(|v| v.is_finite()), "{one:?}");
        assert_eq!(one.fields[0], one.means);
    }
}
