//! Statistics of answers: Table 1 of the paper, intervals, signal detection.

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_2_PI, PI, SQRT_2};

use serde::Serialize;

use crate::design::TrialDesign;

/// Default half-width of the interval of a fraction: ±5 points.
pub const DEFAULT_HALF_WIDTH: f64 = 0.05;

/// The four counts of Table 1. As in the paper, a real image is a positive and a synthetic one a negative.
///
/// For two alternatives, a positive is a pair with the real image on the left.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Counts {
    /// True positives: real, judged real.
    pub tp: u64,
    /// False positives: synthetic, judged real.
    pub fp: u64,
    /// True negatives: synthetic, judged synthetic.
    pub tn: u64,
    /// False negatives: real, judged synthetic.
    #[serde(rename = "fn")]
    pub fn_: u64,
}

impl Counts {
    pub(crate) fn count(&mut self, is_positive: bool, said_positive: bool) {
        let cell = match (is_positive, said_positive) {
            (true, true) => &mut self.tp,
            (false, true) => &mut self.fp,
            (false, false) => &mut self.tn,
            (true, false) => &mut self.fn_,
        };
        *cell += 1;
    }

    /// Returns the sum of the counts.
    #[must_use]
    pub fn plus(self, other: Self) -> Self {
        Self { tp: self.tp + other.tp, fp: self.fp + other.fp, tn: self.tn + other.tn, fn_: self.fn_ + other.fn_ }
    }

    /// Number of answers.
    #[must_use]
    pub fn trials(&self) -> u64 {
        self.tp + self.fp + self.tn + self.fn_
    }

    /// TP / (TP + FN): fraction of real images judged real.
    #[must_use]
    pub fn sensitivity(&self) -> Proportion {
        Proportion { hits: self.tp, total: self.tp + self.fn_ }
    }

    /// TN / (TN + FP): fraction of synthetic images judged synthetic.
    #[must_use]
    pub fn specificity(&self) -> Proportion {
        Proportion { hits: self.tn, total: self.tn + self.fp }
    }

    /// (TP + TN) / all: fraction of correct answers.
    #[must_use]
    pub fn accuracy(&self) -> Proportion {
        Proportion { hits: self.tp + self.tn, total: self.trials() }
    }

    /// Sensitivity d′ and criterion c of signal detection.
    ///
    /// H = (TP + ½) / (TP + FN + 1) and F = (FP + ½) / (FP + TN + 1): the log-linear correction (Hautus 1995,
    /// [doi:10.3758/BF03203619](https://doi.org/10.3758/BF03203619)), applied to all rates, also other than 0 and 1.
    /// Then d′ = Φ⁻¹(H) − Φ⁻¹(F), divided by √2 for two alternatives, and c = −(Φ⁻¹(H) + Φ⁻¹(F)) / 2: negative for
    /// a bias to "real" (or "left"). The interval of d′ is that of Gourevitch and Galanter (1967,
    /// [doi:10.1007/BF02289402](https://doi.org/10.1007/BF02289402)).
    #[must_use]
    pub fn detection(&self, task: TrialDesign) -> Detection {
        let rate = |hits: u64, of: u64| (hits as f64 + 0.5) / (of as f64 + 1.0);
        let (positives, negatives) = (self.tp + self.fn_, self.fp + self.tn);
        let (hits, alarms) = (rate(self.tp, positives), rate(self.fp, negatives));
        let (z_hits, z_alarms) = (deviate(hits), deviate(alarms));
        let variance = |rate: f64, z: f64, of: u64| {
            let height = density(z);
            rate * (1.0 - rate) / ((of as f64 + 1.0) * height * height)
        };
        let scale = match task {
            TrialDesign::YesNo => 1.0,
            TrialDesign::TwoAlternatives => FRAC_1_SQRT_2,
        };
        let d_prime = scale * (z_hits - z_alarms);
        let error = scale * (variance(hits, z_hits, positives) + variance(alarms, z_alarms, negatives)).sqrt();
        Detection {
            d_prime,
            d_prime_interval: Interval { low: d_prime - Z_95 * error, high: d_prime + Z_95 * error },
            criterion: -0.5 * (z_hits + z_alarms),
        }
    }
}

/// Measures of signal detection.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Detection {
    /// Distance between real and synthetic in standard deviations; 0 if they are not distinguished.
    pub d_prime: f64,
    /// 95 % interval of d′.
    pub d_prime_interval: Interval,
    /// Bias; 0 without bias.
    pub criterion: f64,
}

/// A fraction of counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Proportion {
    /// Number of hits.
    pub hits: u64,
    /// Number of trials.
    pub total: u64,
}

/// An interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Proportion {
    pub(crate) fn count(&mut self, is_hit: bool) {
        self.hits += u64::from(is_hit);
        self.total += 1;
    }

    /// The fraction; `None` without trials.
    #[must_use]
    pub fn value(&self) -> Option<f64> {
        (self.total > 0).then(|| self.hits as f64 / self.total as f64)
    }

    /// Wilson's score interval of 95 %
    /// ([doi:10.1080/01621459.1927.10502953](https://doi.org/10.1080/01621459.1927.10502953)): (p + z²/2n ± z
    /// √(p(1−p)/n + z²/4n²)) / (1 + z²/n). It is 0 to 1 without trials.
    #[must_use]
    pub fn wilson(&self) -> Interval {
        let Some(p) = self.value() else { return Interval { low: 0.0, high: 1.0 } };
        let n = self.total as f64;
        let z2 = Z_95 * Z_95;
        let centre = (p + z2 / (2.0 * n)) / (1.0 + z2 / n);
        let half = Z_95 * (p * (1.0 - p) / n + z2 / (4.0 * n * n)).sqrt() / (1.0 + z2 / n);
        // Keeps the ends in 0 to 1, and the fraction between them, in spite of rounding.
        Interval { low: (centre - half).clamp(0.0, p), high: (centre + half).clamp(p, 1.0) }
    }
}

impl Serialize for Proportion {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Shown {
            hits: u64,
            total: u64,
            value: Option<f64>,
            wilson_95: Interval,
        }
        Shown { hits: self.hits, total: self.total, value: self.value(), wilson_95: self.wilson() }
            .serialize(serializer)
    }
}

/// Returns the number of trials for a half-width of the 95 % interval of a fraction near ½: z² / 4w², rounded; 384 for
/// ±5 points. Wilson's interval is slightly narrower.
#[must_use]
pub fn trials_for(half_width: f64) -> u64 {
    let exact = Z_95 * Z_95 / (4.0 * half_width * half_width);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive; saturates")]
    let whole = (exact + 0.5) as u64;
    whole
}

/// Returns the mean over subjects and Student's 95 % interval, as the paper for sensitivity; `None` for fewer than two
/// subjects.
pub(crate) fn mean_over_subjects(values: &[f64]) -> Option<(f64, Interval)> {
    let n = values.len() as f64;
    if values.len() < 2 {
        return None;
    }
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
    let error = (squares / (n - 1.0) / n).sqrt();
    let half = student(0.975, values.len() as u64 - 1) * error;
    Some((mean, Interval { low: mean - half, high: mean + half }))
}

/// Standard normal deviate of a two-sided 95 % interval: Φ⁻¹(.975).
const Z_95: f64 = 1.959_963_984_540_054;

/// Bisections of a bracket until it is as narrow as floating point allows.
const HALVINGS: u32 = 200;

/// Bound of all deviates; those of corrected rates of a million trials are below 6.
const MAX_DEVIATE: f64 = 1e4;

/// φ(x), the density.
fn density(x: f64) -> f64 {
    libm::exp(-0.5 * x * x) / (2.0 * PI).sqrt()
}

/// Φ(x), the cumulative probability.
fn probability(x: f64) -> f64 {
    0.5 * libm::erfc(-x / SQRT_2)
}

/// Φ⁻¹(p), the quantile of `p`, 0 to 1.
fn deviate(p: f64) -> f64 {
    inverse(probability, p)
}

/// The quantile of Student's t with `freedom` degrees of freedom.
fn student(p: f64, freedom: u64) -> f64 {
    inverse(|t| 0.5 * (1.0 + within(t, freedom)), p)
}

/// P(|T| < t), signed as t: the finite series for whole degrees of freedom (Abramowitz and Stegun 26.7.3 and 26.7.4).
fn within(t: f64, freedom: u64) -> f64 {
    let ratio = t / (freedom as f64).sqrt();
    let cosine = 1.0 / (1.0 + ratio * ratio).sqrt();
    let sine = ratio * cosine;
    let (mut term, mut sum) = (1.0, 0.0);
    let odd = freedom % 2 == 1;
    // Terms for odd degrees: cos, 2/3 cos³, …; for even degrees: 1, 1/2 cos², ….
    let first = if odd { 1 } else { 0 };
    for power in (first..freedom.saturating_sub(1)).step_by(2) {
        sum += term;
        term *= cosine * cosine * (power + 1) as f64 / (power + 2) as f64;
    }
    if odd { FRAC_2_PI * (libm::atan(ratio) + sine * cosine * sum) } else { sine * sum }
}

/// Inverts an increasing function by bisection.
fn inverse(function: impl Fn(f64) -> f64, value: f64) -> f64 {
    let (mut low, mut high) = (-MAX_DEVIATE, MAX_DEVIATE);
    for _ in 0..HALVINGS {
        let centre = 0.5 * (low + high);
        if function(centre) < value { low = centre } else { high = centre }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_equal_published_tables() {
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
    fn quantiles_invert_probabilities() {
        for k in 1..200 {
            let p = f64::from(k) / 200.0;
            assert!((probability(deviate(p)) - p).abs() < 1e-14);
        }
    }

    /// Table 1 of the paper: counts, and sensitivity and specificity as printed.
    const TABLE_1: [([u64; 4], [f64; 2]); 7] = [
        ([35, 29, 37, 17], [0.67, 0.56]),
        ([39, 29, 29, 21], [0.65, 0.50]),
        ([50, 16, 38, 14], [0.78, 0.70]),
        ([49, 20, 36, 13], [0.79, 0.64]),
        ([51, 17, 39, 11], [0.82, 0.70]),
        ([58, 32, 21, 7], [0.89, 0.40]),
        ([37, 31, 24, 26], [0.54, 0.48]),
    ];

    fn row(subject: usize) -> Counts {
        let [tp, fp, tn, fn_] = TABLE_1[subject].0;
        Counts { tp, fp, tn, fn_ }
    }

    fn rounded(value: f64, digits: f64) -> f64 {
        (value * digits).round() / digits
    }

    #[test]
    fn the_six_subjects_of_the_paper_are_reproduced() {
        for (subject, (_, [sensitivity, specificity])) in TABLE_1.iter().enumerate().take(6) {
            let counts = row(subject);
            assert_eq!(counts.trials(), 118);
            assert_eq!(rounded(counts.sensitivity().value().unwrap(), 100.0), *sensitivity, "subject {}", subject + 1);
            assert_eq!(rounded(counts.specificity().value().unwrap(), 100.0), *specificity, "subject {}", subject + 1);
        }
    }

    #[test]
    fn the_random_row_of_the_paper_is_misprinted() {
        // Its counts give .59 and .44; .54 and .48 are printed.
        let counts = row(6);
        assert_eq!(counts.trials(), 118);
        assert_eq!(rounded(counts.sensitivity().value().unwrap(), 100.0), 0.59);
        assert_eq!(rounded(counts.specificity().value().unwrap(), 100.0), 0.44);
        // The printed values are the predictive values of these counts.
        assert_eq!(rounded(37.0 / (37.0 + 31.0), 100.0), 0.54);
        assert_eq!(rounded(24.0 / (24.0 + 26.0), 100.0), 0.48);
    }

    #[test]
    fn the_mean_sensitivity_of_the_paper_and_its_interval_are_reproduced() {
        // "Mean: 0.7667, 95% confidence interval [0.671, 0.863]", of the printed numbers.
        let printed = TABLE_1[..6].iter().map(|(_, [sensitivity, _])| *sensitivity).collect::<Vec<_>>();
        let (mean, Interval { low, high }) = mean_over_subjects(&printed).unwrap();
        assert_eq!([rounded(mean, 1e4), rounded(low, 1e3), rounded(high, 1e3)], [0.7667, 0.671, 0.863]);
        assert!(mean_over_subjects(&printed[..1]).is_none());
    }

    #[test]
    fn wilson_intervals_solve_their_equation() {
        // The ends are the p with |p̂ − p| = z √(p(1−p)/n).
        for of in [1, 2, 7, 118, 5000] {
            for hits in (0..=of).step_by(1 + usize::try_from(of / 9).unwrap()) {
                let proportion = Proportion { hits, total: of };
                let (value, Interval { low, high }) = (proportion.value().unwrap(), proportion.wilson());
                assert!(0.0 <= low && low <= value && value <= high && high <= 1.0);
                for end in [low, high] {
                    let deviation = Z_95 * (end * (1.0 - end) / of as f64).sqrt();
                    assert!(((value - end).abs() - deviation).abs() < 1e-9, "{hits} of {of}: {end}");
                }
            }
        }
        assert_eq!(Proportion::default().wilson(), Interval { low: 0.0, high: 1.0 });
        assert_eq!(Proportion::default().value(), None);
    }

    #[test]
    fn d_prime_and_criterion() {
        let detect = |tp, fp, tn, fn_, task| Counts { tp, fp, tn, fn_ }.detection(task);
        // Computed by hand: H = 35.5/53, F = 29.5/67.
        let first = row(0).detection(TrialDesign::YesNo);
        let (z_hits, z_alarms) = (deviate(35.5 / 53.0), deviate(29.5 / 67.0));
        assert!((first.d_prime - (z_hits - z_alarms)).abs() < 1e-12);
        assert!((first.d_prime - 0.589).abs() < 1e-3 && (first.criterion + 0.144).abs() < 1e-3, "{first:?}");
        // d′ is 0 at chance and finite for perfect answers; a bias to "real" gives a criterion below 0.
        assert!(detect(30, 30, 30, 30, TrialDesign::YesNo).d_prime.abs() < 1e-12);
        let perfect = detect(59, 0, 59, 0, TrialDesign::YesNo);
        assert!(perfect.d_prime.is_finite() && perfect.d_prime > 4.0 && perfect.criterion.abs() < 1e-12);
        assert!(detect(59, 59, 0, 0, TrialDesign::YesNo).criterion < -2.0);
        assert!(detect(0, 0, 0, 0, TrialDesign::YesNo).d_prime == 0.0);
        // Two alternatives are easier by √2: the same counts give a smaller d′.
        let two = detect(50, 16, 38, 14, TrialDesign::TwoAlternatives).d_prime;
        let one = detect(50, 16, 38, 14, TrialDesign::YesNo).d_prime;
        assert!((one / two - SQRT_2).abs() < 1e-12);
    }

    #[test]
    fn the_interval_of_d_prime_covers() {
        use portable_numerics::random::uniform;
        use rand_core::SeedableRng;
        // Simulated observers with d′ = 1: 95 % of 2000 intervals contain it, within 4 standard errors.
        let mut rng = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(11);
        let [real, synthetic] = [0.691_462_461, 0.308_537_539];
        let (mut covered, runs) = (0, 2000);
        for _ in 0..runs {
            let mut counts = Counts::default();
            for trial in 0..118 {
                let is_real = trial % 2 == 0;
                let u = uniform(&mut rng);
                counts.count(is_real, u < if is_real { real } else { synthetic });
            }
            let Interval { low, high } = counts.detection(TrialDesign::YesNo).d_prime_interval;
            covered += i32::from(low <= 1.0 && 1.0 <= high);
        }
        let error = (0.95_f64 * 0.05 / f64::from(runs)).sqrt();
        assert!((f64::from(covered) / f64::from(runs) - 0.95).abs() < 4.0 * error, "{covered} of {runs}");
    }

    #[test]
    fn a_half_width_of_five_points_needs_384_trials() {
        assert_eq!(trials_for(DEFAULT_HALF_WIDTH), 384);
        let Interval { low, high } = Proportion { hits: 192, total: 384 }.wilson();
        assert!(high - low <= 2.0 * DEFAULT_HALF_WIDTH);
        assert!(trials_for(0.0) == u64::MAX);
    }
}
