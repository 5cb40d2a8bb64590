//! Statistics that are 0 for too few values.

use portable_numerics::statistics;

/// Returns the sorted values.
pub(crate) fn sorted(values: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_unstable_by(f64::total_cmp);
    values
}

/// Returns [`statistics::quantile`]; 0 for no values. Sorts the values.
pub(crate) fn quantile(values: &mut [f64], q: f64) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    of_sorted(values, q)
}

/// As [`quantile`], for sorted values.
pub(crate) fn of_sorted(values: &[f64], q: f64) -> f64 {
    if values.is_empty() { 0.0 } else { statistics::quantile_of_sorted(values, q) }
}

/// Returns the median; 0 for no values. Sorts the values.
pub(crate) fn median(values: &mut [f64]) -> f64 {
    quantile(values, 0.5)
}

/// Returns the mean; 0 for no values.
pub(crate) fn mean(values: &[f64]) -> f64 {
    if values.is_empty() { 0.0 } else { statistics::mean(values) }
}

/// Returns the standard deviation of a sample; 0 for fewer than two values.
pub(crate) fn deviation(values: &[f64]) -> f64 {
    if values.len() < 2 { 0.0 } else { statistics::deviation(values) }
}

/// Returns the area under the ROC curve: the probability that a score of `high` exceeds one of `low`. Ties count half.
/// ½ if one slice is empty.
#[must_use]
pub fn auc(low: &[f64], high: &[f64]) -> f64 {
    let weigh = |scores: &[f64], label: bool| scores.iter().map(|&s| (s, label, 1.0)).collect::<Vec<_>>();
    weighted_auc(&mut [weigh(low, false), weigh(high, true)].concat())
}

/// Returns the slope of the least-squares line through points; NaN if `x` is constant.
pub(crate) fn line_slope(x: &[f64], y: &[f64]) -> f64 {
    let (mx, my) = (mean(x), mean(y));
    let (xy, xx) =
        x.iter().zip(y).fold((0.0, 0.0), |(xy, xx), (x, y)| (xy + (x - mx) * (y - my), xx + (x - mx) * (x - mx)));
    if xx > 0.0 { xy / xx } else { f64::NAN }
}

/// As [`auc`], for scores with side (`true`: high) and weight. Sorts the scores.
pub(crate) fn weighted_auc(scores: &mut [(f64, bool, f64)]) -> f64 {
    scores.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let (mut low, mut high, mut area) = (0.0, 0.0, 0.0);
    for tied in scores.chunk_by(|a, b| a.0 == b.0) {
        let sum = |side: bool| tied.iter().filter(|s| s.1 == side).map(|s| s.2).sum::<f64>();
        let (tied_low, tied_high) = (sum(false), sum(true));
        area += tied_high * (low + 0.5 * tied_low);
        low += tied_low;
        high += tied_high;
    }
    if low * high > 0.0 { area / (low * high) } else { 0.5 }
}

#[cfg(test)]
mod tests {
    use portable_numerics::random::below;
    use rand_core::SeedableRng;
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;

    #[test]
    fn the_auc_is_the_fraction_of_ordered_pairs_and_weights_equal_copies() {
        assert_eq!(auc(&[], &[1.0]), 0.5);
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(5);
        let scores: Vec<(f64, bool, usize)> =
            (0..40).map(|i| (below(12, &mut rng) as f64, i % 3 == 0, below(4, &mut rng))).collect();
        let mut weighted: Vec<(f64, bool, f64)> = scores.iter().map(|(s, side, w)| (*s, *side, *w as f64)).collect();
        let [low, high] = [false, true]
            .map(|side| -> Vec<f64> { scores.iter().filter(|s| s.1 == side).flat_map(|s| vec![s.0; s.2]).collect() });
        let pairs = low.iter().flat_map(|a| high.iter().map(move |b| 0.5 + 0.5 * f64::from(b.total_cmp(a) as i8)));
        let right = pairs.sum::<f64>() / (low.len() * high.len()) as f64;
        assert!((auc(&low, &high) - right).abs() < 1e-12);
        assert!((weighted_auc(&mut weighted) - right).abs() < 1e-12);
    }

    #[test]
    fn statistics_of_too_few_values_are_0() {
        assert_eq!([quantile(&mut [], 0.3), median(&mut []), mean(&[]), deviation(&[7.0])], [0.0; 4]);
    }
}
