//! Exact Poisson deviates: branch-free blocks, and a slow path for the few pixels that need it.

use portable_numerics::elementary::exp_f64;
use portable_numerics::random::{SplitMix64, normal, open_uniform, open_unit};

use crate::hash::{BLOCK, Block, PerPixel, Stream};

/// Means below this use inversion, larger means use a normal proposal. Both are exact.
const INVERSION_BELOW: f32 = 10.0;

/// Larger means count as this one, 2²⁴. It exceeds any full-well capacity, and counts up to it are exact in single
/// precision.
const LARGEST_MEAN: f32 = 16_777_216.0;

/// Number of terms of inversion: the probability of a larger count is below 1e-24.
const INVERSION_TERMS: usize = 64;

/// Returns one Poisson deviate per mean. Negative means and NaN count as 0.
#[inline(always)]
pub(crate) fn poisson(means: &PerPixel<f32>, block: &Block<'_>) -> PerPixel<f32> {
    let mut means = *means;
    for mean in &mut *means {
        *mean = clamp_to_zero(*mean).min(LARGEST_MEAN);
    }
    let (least, most) = extremes(&means);
    if most < INVERSION_BELOW {
        return by_inversion(&means, &block.places, &block.words(Stream::Fine));
    }
    let mut counts = from_normals(&means, block);
    if least < INVERSION_BELOW {
        let mut small = means;
        for mean in &mut *small {
            *mean = if *mean < INVERSION_BELOW { *mean } else { 0.0 };
        }
        let summed = by_inversion(&small, &block.places, &block.words(Stream::Fine));
        for i in 0..BLOCK {
            counts[i] = if means[i] < INVERSION_BELOW { summed[i] } else { counts[i] };
        }
    }
    counts
}

/// Returns `mean`, or +0 if it is negative, -0 or NaN.
#[inline(always)]
pub(crate) fn clamp_to_zero(mean: f32) -> f32 {
    if mean > 0.0 { mean } else { 0.0 }
}

/// Returns the smallest and largest of non-negative numbers. Their bit patterns have the same order, and integer
/// comparison vectorises.
#[inline(always)]
fn extremes(means: &PerPixel<f32>) -> (f32, f32) {
    let (mut least, mut most) = (u32::MAX, 0);
    for mean in &**means {
        least = least.min(mean.to_bits());
        most = most.max(mean.to_bits());
    }
    (f32::from_bits(least), f32::from_bits(most))
}

/// Returns deviates by inversion: the number of cumulative probabilities below a uniform deviate.
#[inline(always)]
fn by_inversion(means: &PerPixel<f32>, high: &PerPixel<u32>, low: &PerPixel<u32>) -> PerPixel<f32> {
    const STEP: f64 = 1.0 / 4_294_967_296.0;
    let mut counts = PerPixel([0.0; BLOCK]);
    // Smaller groups than elsewhere, because the slowest pixel determines the time of its group.
    const FEW: usize = 16;
    for at in (0..BLOCK).step_by(FEW) {
        let (mut mean, mut uniform, mut term) = ([0.0; FEW], [0.0; FEW], [0.0; FEW]);
        for i in 0..FEW {
            mean[i] = f64::from(means[at + i]);
            uniform[i] = (f64::from(high[at + i]) + (f64::from(low[at + i]) + 0.5) * STEP) * STEP;
            term[i] = exp_f64(-mean[i]);
        }
        let mut sum = term;
        let mut count = [0_u64; FEW];
        for k in 1..INVERSION_TERMS {
            let inverse = 1.0 / k as f64;
            let mut exceeding = 0;
            for i in 0..FEW {
                let more = u64::from(uniform[i] > sum[i]);
                count[i] += more;
                exceeding |= more;
                term[i] *= mean[i] * inverse;
                sum[i] += term[i];
            }
            if exceeding == 0 {
                break;
            }
        }
        for i in 0..FEW {
            counts[at + i] = count[i] as f32;
        }
    }
    counts
}

/// Rejection from a transformed normal deviate z: K = ⌊µ + √µ·z + (z² + 2)/6⌋, the Cornish–Fisher expansion of the
/// Poisson distribution, whose probabilities differ by about (3z² - z⁴)/72µ. A K is rejected with a probability of
/// 0.024/µ on average; a deviate from the excess of the Poisson distribution over that of K replaces it.
#[inline(always)]
fn from_normals(means: &PerPixel<f32>, block: &Block<'_>) -> PerPixel<f32> {
    let normals = block.normals(Stream::Shot);
    let mut counts = PerPixel([0.0; BLOCK]);
    let mut open = PerPixel([0_u32; BLOCK]);
    for i in 0..BLOCK {
        let mean = means[i].max(INVERSION_BELOW);
        // The integer part is separated, so that the fraction keeps full precision.
        let whole = mean.floor();
        let part = mean - whole;
        let square = normals[i] * normals[i];
        let step = (part + mean.sqrt() * normals[i] + (square + 2.0) * (1.0 / 6.0)).floor();
        counts[i] = whole + step;
        // Squeeze test: acceptance is certain.
        open[i] = u32::from(square * square > SQUEEZE * mean * open_unit(block.places[i]));
    }
    for at in (0..BLOCK).step_by(16) {
        if open[at..at + 16].iter().fold(0, |any, o| any | o) == 0 {
            continue;
        }
        for i in at..at + 16 {
            if open[i] != 0 && means[i] >= INVERSION_BELOW {
                counts[i] = exact_count(means[i], counts[i], open_unit(block.places[i]), block.rare(i));
            }
        }
    }
    counts
}

/// The probability of rejection is below z⁴ / (28µ) for every z of a count.
const SQUEEZE: f32 = 28.0;

/// The Poisson probability of a count is at most 1 + 0.055/µ times that of its proposal.
const EXCESS: f64 = 0.055;

/// Returns the deviate of a pixel that failed the squeeze test: `count` if it passes the quotient test, otherwise a
/// deviate from the excess of the Poisson distribution over that of the proposals.
#[cold]
#[inline(never)]
#[expect(clippy::cast_possible_truncation, reason = "counts below 2²⁵ from single precision")]
fn exact_count(mean: f32, count: f32, chance: f32, mut words: SplitMix64) -> f32 {
    let proposal = Proposal::new(mean);
    if f64::from(chance) > 1.0 - proposal.ratio(f64::from(count)) {
        return count;
    }
    loop {
        let count = proposal.count(normal(&mut words));
        if open_uniform(&mut words) * EXCESS / proposal.mean <= proposal.ratio(count) - 1.0 {
            return count as f32;
        }
    }
}

/// The Poisson distribution and that of the proposals, for a mean of at least 10.
struct Proposal {
    mean: f64,
    root: f64,
}

impl Proposal {
    fn new(mean: f32) -> Self {
        let mean = f64::from(mean);
        Self { mean, root: mean.sqrt() }
    }

    /// Returns the count proposed for a normal deviate.
    fn count(&self, z: f64) -> f64 {
        (self.mean + self.root * z + (z * z + 2.0) / 6.0).floor()
    }

    /// Returns the smallest normal deviate of a count of at least 0.
    fn least(&self, count: f64) -> f64 {
        // √(3µ + 6K - 2) - 3√µ without cancellation.
        (6.0 * (count - self.mean) - 2.0) / ((3.0 * self.mean + 6.0 * count - 2.0).sqrt() + 3.0 * self.root)
    }

    /// Returns the probability of a proposal.
    fn proposed(&self, count: f64) -> f64 {
        let [low, high] = [count, count + 1.0].map(|count| self.least(count) * core::f64::consts::FRAC_1_SQRT_2);
        // Differences of the smaller tail.
        let (low, high) = if low > 0.0 { (-high, -low) } else { (low, high) };
        0.5 * (libm::erfc(-high) - libm::erfc(-low))
    }

    /// Returns the Poisson probability, µᵏ e⁻µ / k!.
    fn poisson(&self, count: f64) -> f64 {
        if count < 10.0 {
            let factorial = (1..=10).map(f64::from).take_while(|&k| k <= count).product::<f64>();
            return exp_f64(count * libm::log(self.mean) - self.mean) / factorial;
        }
        // Stirling's series; its error is below 6e-11 for counts of at least 10.
        let inverse = 1.0 / count;
        let square = inverse * inverse;
        let stirling = inverse * (1.0 / 12.0 - square * (1.0 / 360.0 - square * (1.0 / 1260.0)));
        let short = self.mean - count;
        let exponent = count * libm::log1p(short * inverse) - short - stirling;
        exp_f64(exponent) / (core::f64::consts::TAU * count).sqrt()
    }

    /// Returns the Poisson probability of a count divided by that of its proposal.
    fn ratio(&self, count: f64) -> f64 {
        if count < 0.0 { 0.0 } else { self.poisson(count) / self.proposed(count) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MEANS: [f32; 11] = [10.0, 10.4, 13.7, 20.0, 31.3, 50.0, 123.4, 1e3, 17_850.0, 3e5, 1.6e7];

    /// Returns the counts whose normal deviates are within a range.
    fn counts_around(proposal: &Proposal, from: f64, to: f64) -> impl Iterator<Item = f64> {
        let first = proposal.count(from).max(0.0);
        let last = proposal.count(to);
        core::iter::successors(Some(first), |k| Some(k + 1.0)).take_while(move |&k| k <= last)
    }

    #[test]
    fn proposal_and_poisson_probabilities_are_correct() {
        for mean in MEANS {
            let proposal = Proposal::new(mean);
            let (mut sum, mut rejected) = (0.0, 0.0);
            for k in counts_around(&proposal, -6.0, 6.0) {
                let proposed = proposal.proposed(k);
                sum += proposed;
                rejected += (proposed - proposal.poisson(k)).max(0.0);
                for z in [proposal.least(k) + 1e-9, proposal.least(k + 1.0) - 1e-9] {
                    assert_eq!(proposal.count(z), k, "{mean}");
                }
                let wanted = libm::exp(k * libm::log(proposal.mean) - proposal.mean - libm::lgamma(k + 1.0));
                assert!((proposal.poisson(k) / wanted - 1.0).abs() < (1e-14 * k).max(1e-8), "{mean}: {k}");
            }
            let negative = 0.5 * libm::erfc(-proposal.least(0.0) * core::f64::consts::FRAC_1_SQRT_2);
            assert!((sum + negative - 1.0).abs() < 1e-8, "{mean}: {sum}");
            assert!((0.022..0.025).contains(&(rejected * proposal.mean)), "{mean}: {rejected}");
        }
    }

    /// The method is exact if the squeeze test accepts only what the quotient test accepts, and if the excess stays
    /// below its bound. Normal deviates in single precision are below 6.8.
    #[test]
    fn squeeze_and_bound_hold() {
        for mean in MEANS {
            let proposal = Proposal::new(mean);
            for k in counts_around(&proposal, -6.9, 6.9) {
                let [low, high] = [k, k + 1.0].map(|k| proposal.least(k));
                let smallest = if low < 0.0 && high > 0.0 { 0.0 } else { low.abs().min(high.abs()) };
                let squeeze = smallest * smallest * smallest * smallest / (f64::from(SQUEEZE) * proposal.mean);
                let ratio = proposal.ratio(k);
                assert!(1.0 - squeeze <= ratio + 1e-9, "{mean}: {k}");
                assert!(ratio - 1.0 <= EXCESS / proposal.mean, "{mean}: {k}");
            }
            // All deviates of counts below 0 are open to rejection.
            let least = proposal.least(0.0);
            assert!(least < -6.9 || least * least * least * least > f64::from(SQUEEZE) * proposal.mean, "{mean}");
        }
    }
}
