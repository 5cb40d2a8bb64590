use multiversion::multiversion;
use portable_numerics::random::uniform;
use rand_core::Rng;

use crate::source::LANES;

/// Draws the outcome of a number of random tries, from the costs and weights of all candidates.
///
/// Each try selects a candidate with probability proportional to its weight. The outcome is the first candidate with a
/// cost of at most `enough`, otherwise the first of those with the least cost. Returns `None` if that is not below
/// `least`.
pub(crate) fn outcome_of_tries<R: Rng + ?Sized>(
    costs: &[f32],
    weights: &[f32],
    enough: f32,
    least: f32,
    tries: usize,
    rng: &mut R,
) -> Option<usize> {
    // With candidates sorted by cost, each covers an interval of 0..1 proportional to its weight. A try is a uniform
    // number; the best of n tries is their minimum, which is below x with probability 1 - (1 - x)ⁿ.
    #[expect(clippy::cast_precision_loss, reason = "far below 2^53 tries")]
    let least_of_tries = -libm::expm1(libm::log1p(-uniform(rng)) / tries as f64);
    let mut left = least_of_tries * level(costs, weights, f32::NEG_INFINITY, f32::INFINITY).0;
    // Candidates with a cost of at most `enough` form one level, and so do candidates of equal cost: which of them
    // comes first only depends on their weights.
    let (mut above, mut to) = (f32::NEG_INFINITY, enough);
    loop {
        let (weight, next) = level(costs, weights, above, to);
        if left < weight {
            return one_of_level(costs, weights, above, to, weight * uniform(rng));
        }
        if next >= least {
            return None;
        }
        left -= weight;
        (above, to) = (to, next);
    }
}

/// Returns the candidate at the cumulative weight `at`, among those with costs above `above` and up to `to`.
fn one_of_level(costs: &[f32], weights: &[f32], above: f32, to: f32, mut at: f64) -> Option<usize> {
    let mut last = None;
    for slot in slots_between(costs, above, to).filter(|&slot| weights[slot] > 0.0) {
        last = Some(slot);
        at -= f64::from(weights[slot]);
        if at < 0.0 {
            break;
        }
    }
    last
}

/// Returns the slots with costs above `above` and up to `to`.
pub(crate) fn slots_between(costs: &[f32], above: f32, to: f32) -> impl Iterator<Item = usize> {
    let blocks = costs.as_chunks::<LANES>().0.iter().enumerate();
    // This vectorised test skips nearly all blocks.
    let blocks = blocks.filter(move |(_, costs)| costs.iter().fold(false, |any, &cost| any | (cost <= to)));
    blocks.flat_map(move |(block, costs)| {
        let within = move |&lane: &usize| costs[lane] > above && costs[lane] <= to;
        (0..LANES).filter(within).map(move |lane| block * LANES + lane)
    })
}

/// Returns the total weight of costs above `above` and up to `to`, and the least cost above `to`.
#[multiversion(targets = "simd")]
fn level(costs: &[f32], weights: &[f32], above: f32, to: f32) -> (f64, f32) {
    let (mut sums, mut next) = ([0.0; LANES], [f32::INFINITY; LANES]);
    for (costs, weights) in costs.as_chunks::<LANES>().0.iter().zip(weights.as_chunks::<LANES>().0) {
        for lane in 0..LANES {
            let (cost, weight) = (costs[lane], weights[lane]);
            sums[lane] += if (cost > above) & (cost <= to) { weight } else { 0.0 };
            next[lane] = if (cost > to) & (cost < next[lane]) { cost } else { next[lane] };
        }
    }
    (sums.iter().map(|&s: &f32| f64::from(s)).sum(), next.into_iter().fold(f32::INFINITY, f32::min))
}

/// Replaces each x by exp(least - x), where `least` is the smallest.
#[multiversion(targets = "simd")]
pub(crate) fn exp_below(xs: &mut [f32], least: f32) {
    for x in xs {
        // e⁻ˣ = 1 / (e^(x/16))¹⁶, with six terms of the series: error below 2 · 10⁻⁶ up to x = 2, 5 · 10⁻⁴ up to 8.
        let y = (*x - least) * (1.0 / 16.0);
        let root = 1.0 + y * (1.0 + y * (1.0 / 2.0 + y * (1.0 / 6.0 + y * (1.0 / 24.0 + y * (1.0 / 120.0)))));
        let square = root * root;
        let fourth = square * square;
        let eighth = fourth * fourth;
        *x = 1.0 / (eighth * eighth);
    }
}

/// Returns whether u < exp(-x), for x ≥ 0, mostly without computing the exponential: 1 − x ≤ exp(-x) ≤ 1 / (1 + x +
/// x²/2 + x³/6).
pub(crate) fn below_exp(u: f64, x: f64) -> bool {
    // Larger than rounding errors, so that the result is exact.
    const SLACK: f64 = 1e-12;
    let above = 1.0 + x * (1.0 + x * (0.5 + x / 6.0));
    u < 1.0 - x - SLACK || (u * above < 1.0 + SLACK && u < libm::exp(-x))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use portable_numerics::random::below;
    use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

    const SEED: u64 = 0xd2a3;

    /// Reference implementation: one try after the other.
    fn reference(
        costs: &[f32],
        weights: &[f32],
        enough: f32,
        least: f32,
        tries: usize,
        rng: &mut impl Rng,
    ) -> Option<usize> {
        let mut best = (least, None);
        for _ in 0..tries {
            let mut at = uniform(rng) * weights.iter().map(|&w| f64::from(w)).sum::<f64>();
            let reached = |&w: &f32| {
                at -= f64::from(w);
                at < 0.0
            };
            let slot = weights.iter().position(reached).unwrap();
            if costs[slot] <= enough {
                return Some(slot);
            }
            if costs[slot] < best.0 {
                best = (costs[slot], Some(slot));
            }
        }
        best.1
    }

    /// Pearson's χ² test of two samples of the same size.
    pub(crate) fn assert_same_distribution(counts: &[[f64; 2]]) {
        let terms = counts.iter().filter(|[a, b]| a + b > 0.0).map(|[a, b]| (a - b) * (a - b) / (a + b));
        let (chi_square, freedom) = (terms.clone().sum::<f64>(), terms.count() as f64 - 1.0);
        assert!(freedom >= 2.0);
        // The mean and four standard deviations of the distribution.
        assert!(chi_square < freedom + 4.0 * (2.0 * freedom).sqrt(), "{chi_square} of {freedom}");
    }

    #[test]
    fn drawn_outcomes_have_the_distribution_of_single_tries() {
        const DRAWS: usize = 50_000;
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(SEED);
        // Few different costs, so that ties occur; every fifth slot is not a candidate.
        let (costs, weights): (Vec<f32>, Vec<f32>) = (0..2 * LANES)
            .map(|slot| {
                if slot % 5 == 0 {
                    (f32::INFINITY, 0.0)
                } else {
                    (below(30, &mut rng) as f32, below(100, &mut rng) as f32)
                }
            })
            .unzip();
        for (enough, least, tries) in
            [(-1.0, 99.0, 1), (-1.0, 99.0, 9), (-1.0, 4.0, 20), (2.0, 99.0, 5), (2.0, 9.0, 40)]
        {
            let mut counts = [[0.0; 2]; 2 * LANES + 1];
            for _ in 0..DRAWS {
                let fast = outcome_of_tries(&costs, &weights, enough, least, tries, &mut rng);
                counts[fast.unwrap_or(2 * LANES)][0] += 1.0;
                let reference = reference(&costs, &weights, enough, least, tries, &mut rng);
                counts[reference.unwrap_or(2 * LANES)][1] += 1.0;
            }
            assert_same_distribution(&counts);
        }
    }

    #[test]
    fn weights_are_exponentials() {
        let mut xs: Vec<f32> = (0..800).map(|i| 3.0 + i as f32 / 100.0).collect();
        xs.extend([1e6, f32::INFINITY]);
        exp_below(&mut xs, 3.0);
        for (i, &w) in xs[..800].iter().enumerate() {
            let error = (f64::from(w) * libm::exp(i as f64 / 100.0) - 1.0).abs();
            assert!(error < if i <= 200 { 2e-6 } else { 5e-4 }, "{i}: {error}");
        }
        assert_eq!(xs[800..], [0.0, 0.0]);
    }
}
