//! Exact Poisson deviates: branch-free blocks, and a slow path for the few pixels that need it.

use portable_numerics::elementary::exp_f64;
use portable_numerics::random::{SplitMix64, open_uniform, open_unit};

use crate::hash::{BLOCK, Block, Stream};

/// Means below this use inversion, larger means use a normal proposal. Both are exact and equally fast at this mean.
const INVERSION_BELOW: f32 = 20.0;

/// Larger means count as this one, 2²⁴. It exceeds any full-well capacity, and counts up to it are exact in single
/// precision.
const LARGEST_MEAN: f32 = 16_777_216.0;

/// Number of terms of inversion: the probability of a larger count is below 1e-24.
const INVERSION_TERMS: usize = 96;

/// Returns one Poisson deviate per mean, from normal deviates. Negative means and NaN count as 0.
#[inline(always)]
pub(crate) fn poisson(means: &[f32; BLOCK], normals: &[f32; BLOCK], block: &Block<'_>) -> [f32; BLOCK] {
    let chances = block.words(Stream::Chance);
    let mut means = *means;
    for mean in &mut means {
        *mean = clamp_to_zero(*mean).min(LARGEST_MEAN);
    }
    let (least, most) = extremes(&means);
    if most < INVERSION_BELOW {
        return by_inversion(&means, &chances, &block.words(Stream::Fine));
    }
    let mut counts = from_normals(&means, normals, &chances, block);
    if least < INVERSION_BELOW {
        let mut small = means;
        for mean in &mut small {
            *mean = if *mean < INVERSION_BELOW { *mean } else { 0.0 };
        }
        let summed = by_inversion(&small, &chances, &block.words(Stream::Fine));
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
fn extremes(means: &[f32; BLOCK]) -> (f32, f32) {
    let (mut least, mut most) = (u32::MAX, 0);
    for mean in means {
        least = least.min(mean.to_bits());
        most = most.max(mean.to_bits());
    }
    (f32::from_bits(least), f32::from_bits(most))
}

/// Returns deviates by inversion: the number of cumulative probabilities below a uniform deviate.
#[inline(always)]
fn by_inversion(means: &[f32; BLOCK], high: &[u32; BLOCK], low: &[u32; BLOCK]) -> [f32; BLOCK] {
    const STEP: f64 = 1.0 / 4_294_967_296.0;
    let mut counts = [0.0; BLOCK];
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

/// Ahrens and Dieter's method PD (doi:10.1145/355993.355997): K = ⌊µ + √µ·z⌋ is a Poisson deviate except for the missing
/// skewness. A K below µ is rejected with a probability of nearly (µ - K)³/6µ², 0.13/√µ on average, and replaced by a
/// deviate from the remaining probability above µ.
#[inline(always)]
fn from_normals(
    means: &[f32; BLOCK],
    normals: &[f32; BLOCK],
    chances: &[u32; BLOCK],
    block: &Block<'_>,
) -> [f32; BLOCK] {
    let mut counts = [0.0; BLOCK];
    let mut open = [0_u32; BLOCK];
    for i in 0..BLOCK {
        let mean = means[i].max(INVERSION_BELOW);
        // The integer part is separated, so that the fraction keeps full precision.
        let whole = mean.floor();
        let part = mean - whole;
        let step = (part + mean.sqrt() * normals[i]).floor();
        counts[i] = whole + step;
        let short = part - step;
        // Squeeze test: acceptance is certain, always for K >= µ.
        let accepted = short * short * short <= 6.0 * mean * mean * open_unit(chances[i]);
        open[i] = u32::from(!(accepted & (counts[i] >= 0.0)));
    }
    for at in (0..BLOCK).step_by(16) {
        if open[at..at + 16].iter().fold(0, |any, o| any | o) == 0 {
            continue;
        }
        for i in at..at + 16 {
            if open[i] != 0 && means[i] >= INVERSION_BELOW {
                counts[i] = exact_count(means[i], counts[i], open_unit(chances[i]), block.rare(i));
            }
        }
    }
    counts
}

/// Returns the deviate of a pixel that the squeeze test did not accept: `count` if it passes the quotient test, otherwise
/// a deviate from the excess of the Poisson distribution over that of the proposals.
#[cold]
#[inline(never)]
#[expect(clippy::cast_possible_truncation, reason = "counts below 2²⁴ are exact in single precision")]
fn exact_count(mean: f32, count: f32, chance: f32, mut words: SplitMix64) -> f32 {
    let quotient = PoissonQuotient::new(mean);
    let count = f64::from(count);
    if count >= 0.0 && 1.0 - f64::from(chance) <= quotient.ratio(count) {
        return count as f32;
    }
    // Rejection from a double exponential distribution centred at the maximum of the excess.
    loop {
        let height = open_uniform(&mut words);
        let side = 2.0 * open_uniform(&mut words) - 1.0;
        let from_centre = -libm::log(height);
        let t = EXCESS_CENTRE + if side < 0.0 { -from_centre } else { from_centre };
        if t <= EXCESS_START {
            continue;
        }
        let count = (quotient.mean + quotient.root * t).floor();
        let excess = quotient.proposed(count) * (quotient.ratio(count) - 1.0);
        if side.abs() * EXCESS_BOUND * height <= excess * quotient.mean {
            return count as f32;
        }
    }
}

/// Lower limit of the excess in standard deviations, for means of at least 10.
const EXCESS_START: f64 = -0.6744;
/// Position of the maximum of the excess, in standard deviations.
const EXCESS_CENTRE: f64 = 1.8;
/// Maximum of µ · excess / exp(-|t - centre|).
const EXCESS_BOUND: f64 = 0.1069;

/// The Poisson distribution and that of the proposals, for a mean of at least 10.
struct PoissonQuotient {
    mean: f64,
    root: f64,
}

impl PoissonQuotient {
    fn new(mean: f32) -> Self {
        let mean = f64::from(mean);
        Self { mean, root: mean.sqrt() }
    }

    /// Returns the probability of ⌊µ + √µ·z⌋ = k for a standard normal z.
    fn proposed(&self, count: f64) -> f64 {
        let x = self.centre(count);
        let density = exp_f64(-0.5 * x * x) / (core::f64::consts::TAU * self.mean).sqrt();
        density * self.bin(x)
    }

    /// Returns the Poisson probability of k, µᵏ e⁻µ / k!, divided by that of its proposal.
    fn ratio(&self, count: f64) -> f64 {
        let x = self.centre(count);
        let normal = 0.5 * x * x;
        if count < 10.0 {
            let factorial = (1..=10).map(f64::from).take_while(|&k| k <= count).product::<f64>();
            let poisson = exp_f64(count * libm::log(self.mean) - self.mean + normal) / factorial;
            return poisson * (core::f64::consts::TAU * self.mean).sqrt() / self.bin(x);
        }
        // Stirling's series; its error is below 6e-11 for counts of at least 10.
        let inverse = 1.0 / count;
        let square = inverse * inverse;
        let stirling = inverse * (1.0 / 12.0 - square * (1.0 / 360.0 - square * (1.0 / 1260.0)));
        let short = self.mean - count;
        let exponent = count * libm::log1p(short * inverse) - short - stirling + normal;
        exp_f64(exponent) * (self.mean * inverse).sqrt() / self.bin(x)
    }

    /// Returns the centre of the bin of proposals for a count, in standard deviations.
    fn centre(&self, count: f64) -> f64 {
        (count + 0.5 - self.mean) / self.root
    }

    /// Returns the mean of the normal density over the bin of width h = 1/√µ, divided by its value at the centre: a
    /// series in h with an error below 1e-9.
    fn bin(&self, x: f64) -> f64 {
        let (x2, h2) = (x * x, 1.0 / self.mean);
        let second = x2 - 1.0;
        let fourth = (x2 - 6.0) * x2 + 3.0;
        let sixth = ((x2 - 15.0) * x2 + 45.0) * x2 - 15.0;
        1.0 + h2 * (second / 24.0 + h2 * (fourth / 1920.0 + h2 * (sixth / 322_560.0)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MEANS: [f32; 9] = [20.0, 20.7, 31.3, 50.0, 123.4, 1e3, 17_850.0, 3e5, 1e6];

    fn counts_around(quotient: &PoissonQuotient, from: f64, to: f64) -> impl Iterator<Item = f64> {
        let first = (quotient.mean + from * quotient.root).floor().max(0.0);
        let last = (quotient.mean + to * quotient.root).floor();
        core::iter::successors(Some(first), |k| Some(k + 1.0)).take_while(move |&k| k <= last)
    }

    #[test]
    fn proposal_and_poisson_probabilities_are_correct() {
        for mean in MEANS {
            let quotient = PoissonQuotient::new(mean);
            for k in counts_around(&quotient, -6.0, 6.0) {
                let [low, high] = [k, k + 1.0].map(|k| (k - quotient.mean) / quotient.root);
                let tail = |x: f64| 0.5 * libm::erfc(x.abs() / core::f64::consts::SQRT_2);
                let bin =
                    if low < 0.0 && high > 0.0 { 1.0 - tail(low) - tail(high) } else { (tail(low) - tail(high)).abs() };
                assert!((quotient.proposed(k) / bin - 1.0).abs() < 2e-7, "{mean}: {k}");
                let wanted = libm::exp(k * libm::log(quotient.mean) - quotient.mean - libm::lgamma(k + 1.0));
                let got = quotient.proposed(k) * quotient.ratio(k);
                assert!((got / wanted - 1.0).abs() < 1e-8, "{mean}: {k}");
            }
        }
    }

    /// The method is exact if the squeeze test accepts only what the quotient test accepts, if there is no excess below
    /// its lower limit, and if the excess stays below its bound.
    #[test]
    fn squeeze_and_bound_hold() {
        for mean in MEANS {
            let quotient = PoissonQuotient::new(mean);
            for k in counts_around(&quotient, -9.0, 9.0) {
                let short = quotient.mean - k;
                let squeeze = 1.0 - short * short * short / (6.0 * quotient.mean * quotient.mean);
                assert!(squeeze.min(1.0) <= quotient.ratio(k) + 1e-9, "{mean}: {k}");
                let [low, high] = [k, k + 1.0].map(|k| (k - quotient.mean) / quotient.root);
                let excess = quotient.proposed(k) * (quotient.ratio(k) - 1.0);
                if low < EXCESS_START {
                    assert!(excess <= 1e-12, "{mean}: {k}");
                } else {
                    let farthest = (low - EXCESS_CENTRE).abs().max((high - EXCESS_CENTRE).abs());
                    let bound = EXCESS_BOUND / quotient.mean * libm::exp(-farthest);
                    assert!(excess <= bound, "{mean}: {k}");
                }
            }
        }
    }
}
