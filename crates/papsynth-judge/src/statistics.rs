//! Statistics of numbers.

use rand_core::Rng;

use crate::number::whole;

/// The value below which a part `q` of the values lies, between neighbours in proportion; 0 of none. Sorts the values.
pub(crate) fn quantile(values: &mut [f64], q: f64) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    of_sorted(values, q)
}

/// As [`quantile`], of values in order.
pub(crate) fn of_sorted(values: &[f64], q: f64) -> f64 {
    let Some(last) = values.len().checked_sub(1) else { return 0.0 };
    let place = q.clamp(0.0, 1.0) * last as f64;
    let i = whole(place).min(last);
    let next = values[(i + 1).min(last)];
    values[i] + (place - i as f64) * (next - values[i])
}

/// The middle value; 0 of none. Sorts the values.
pub(crate) fn median(values: &mut [f64]) -> f64 {
    quantile(values, 0.5)
}

/// Mean; 0 of none.
pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Standard deviation of a sample; 0 of fewer than two.
pub(crate) fn deviation(values: &[f64]) -> f64 {
    let m = mean(values);
    let sum: f64 = values.iter().map(|v| (v - m) * (v - m)).sum();
    (sum / values.len().saturating_sub(1).max(1) as f64).sqrt()
}

/// Pearson's correlation of pairs; 0 if either does not vary.
pub(crate) fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let (ma, mb) = (mean(a), mean(b));
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (x, y) in a.iter().zip(b) {
        ab += (x - ma) * (y - mb);
        aa += (x - ma) * (x - ma);
        bb += (y - mb) * (y - mb);
    }
    if aa * bb > 0.0 { ab / (aa * bb).sqrt() } else { 0.0 }
}

/// The probability that a score of `high` exceeds one of `low`, ties counted half: the area under the ROC curve; ½ if either is
/// empty.
#[must_use]
pub fn auc(low: &[f64], high: &[f64]) -> f64 {
    let weigh = |scores: &[f64], label: bool| scores.iter().map(|&s| (s, label, 1.0)).collect::<Vec<_>>();
    weighted_auc(&mut [weigh(low, false), weigh(high, true)].concat())
}

/// As [`auc`], of scores with their side (whether they are of the high one) and weight. Sorts them.
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

/// A whole number below `bound`, each as likely as every other to within 2⁻³².
pub(crate) fn below<R: Rng + ?Sized>(bound: usize, rng: &mut R) -> usize {
    let product = u128::from(rng.next_u64()) * bound as u128;
    usize::try_from(product >> 64).unwrap_or(0)
}

/// Puts items into an order that is as likely as every other.
pub(crate) fn shuffle<T, R: Rng + ?Sized>(items: &mut [T], rng: &mut R) {
    for i in (1..items.len()).rev() {
        items.swap(i, below(i + 1, rng));
    }
}

#[cfg(test)]
mod tests {
    use rand_core::SeedableRng;
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;

    #[test]
    fn the_auc_of_known_scores_is_known() {
        assert_eq!(auc(&[1.0, 2.0], &[3.0, 4.0]), 1.0);
        assert_eq!(auc(&[3.0, 4.0], &[1.0, 2.0]), 0.0);
        assert_eq!(auc(&[1.0, 1.0], &[1.0]), 0.5);
        assert_eq!(auc(&[0.1, 0.4, 0.35], &[0.35, 0.8]), 5.5 / 6.0 - 1.0 / 6.0);
        assert_eq!(auc(&[], &[1.0]), 0.5);
    }

    #[test]
    fn weights_stand_for_copies() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(5);
        let scores: Vec<(f64, bool, usize)> = (0..40).map(|i| (below(12, &mut rng) as f64, i % 3 == 0, below(4, &mut rng))).collect();
        let mut weighted: Vec<(f64, bool, f64)> = scores.iter().map(|(s, side, w)| (*s, *side, *w as f64)).collect();
        let copies = |side: bool| -> Vec<f64> { scores.iter().filter(|s| s.1 == side).flat_map(|s| vec![s.0; s.2]).collect() };
        assert!((weighted_auc(&mut weighted) - auc(&copies(false), &copies(true))).abs() < 1e-12);
    }

    #[test]
    fn quantiles_lie_between_neighbours() {
        assert_eq!(quantile(&mut [4.0, 1.0, 2.0, 3.0], 0.5), 2.5);
        assert_eq!(quantile(&mut [4.0, 1.0], 0.0), 1.0);
        assert_eq!(quantile(&mut [4.0, 1.0], 1.0), 4.0);
        assert_eq!(quantile(&mut [], 0.3), 0.0);
        assert_eq!((mean(&[1.0, 2.0, 6.0]), deviation(&[1.0, 3.0])), (3.0, 2.0_f64.sqrt()));
        assert!((correlation(&[1.0, 2.0, 3.0], &[5.0, 3.0, 1.0]) + 1.0).abs() < 1e-12);
    }

    #[test]
    fn every_order_is_as_likely() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(6);
        let mut counts = std::collections::BTreeMap::new();
        for _ in 0..6000 {
            let mut items = [0, 1, 2];
            shuffle(&mut items, &mut rng);
            *counts.entry(items).or_insert(0) += 1;
        }
        // Six orders of 1000 each, with a standard error of √(6000 · 1/6 · 5/6) = 29.
        assert!(counts.len() == 6 && counts.values().all(|c: &i32| (c - 1000).abs() < 4 * 29), "{counts:?}");
    }
}
