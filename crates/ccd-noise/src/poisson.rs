//! Poisson deviates: whole blocks without a branch, and an exact finish for the few that need it.

use portable_numerics::elementary::exp_f64;
use portable_numerics::random::{SplitMix64, open_uniform, open_unit};

use crate::hash::{BLOCK, Block, Stream};

/// Below this mean a deviate is found by summing probabilities, above it from a normal deviate.
/// Both are exact; here they take about the same time.
const SUMMED_BELOW: f32 = 20.0;

/// Larger means are taken as this one. It is beyond any full well, and counts up to it are exact in
/// single precision.
const LARGEST_MEAN: f32 = 16_777_216.0;

/// Counts of probability above 1e-24 at the means that are summed.
const SUMMED_TERMS: usize = 96;

/// One Poisson deviate for each mean, from a normal one. Negative means and those that are no number count as 0.
#[inline(always)]
pub(crate) fn poisson(means: &[f32; BLOCK], normals: &[f32; BLOCK], block: &Block<'_>) -> [f32; BLOCK] {
    let chances = block.words(Stream::Chance);
    let mut means = *means;
    for mean in &mut means {
        *mean = at_least_nothing(*mean).min(LARGEST_MEAN);
    }
    let (least, most) = extremes(&means);
    if most < SUMMED_BELOW {
        return summed(&means, &chances, &block.words(Stream::Fine));
    }
    let mut counts = from_normals(&means, normals, &chances, block);
    if least < SUMMED_BELOW {
        let mut small = means;
        for mean in &mut small {
            *mean = if *mean < SUMMED_BELOW { *mean } else { 0.0 };
        }
        let summed = summed(&small, &chances, &block.words(Stream::Fine));
        for i in 0..BLOCK {
            counts[i] = if means[i] < SUMMED_BELOW { summed[i] } else { counts[i] };
        }
    }
    counts
}

/// `mean`, or +0 where it is negative, -0 or no number.
#[inline(always)]
pub(crate) fn at_least_nothing(mean: f32) -> f32 {
    if mean > 0.0 { mean } else { 0.0 }
}

/// Least and greatest of numbers of positive sign. Their bits are ordered as they are, and the order
/// in which integers are compared does not matter, so that they are compared side by side.
#[inline(always)]
fn extremes(means: &[f32; BLOCK]) -> (f32, f32) {
    let (mut least, mut most) = (u32::MAX, 0);
    for mean in means {
        least = least.min(mean.to_bits());
        most = most.max(mean.to_bits());
    }
    (f32::from_bits(least), f32::from_bits(most))
}

/// Inversion: the number of partial sums of the distribution that a uniform deviate of 53 bits
/// exceeds.
#[inline(always)]
fn summed(means: &[f32; BLOCK], high: &[u32; BLOCK], low: &[u32; BLOCK]) -> [f32; BLOCK] {
    const STEP: f64 = 1.0 / 4_294_967_296.0;
    let mut counts = [0.0; BLOCK];
    // Fewer at a time than elsewhere: the slowest pixel of them decides.
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
        for k in 1..SUMMED_TERMS {
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

/// Ahrens and Dieter's PD (doi:10.1145/355993.355997): K = ⌊µ + √µ·z⌋ is a Poisson deviate but for
/// the lack of skewness. Where K falls short of µ it is given up with a probability of nearly
/// (µ - K)³/6µ², 0.13/√µ on the whole, for a deviate from what is missing above µ.
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
        let mean = means[i].max(SUMMED_BELOW);
        // The integer part is kept aside, so that the rest keeps its digits.
        let whole = mean.floor();
        let part = mean - whole;
        let step = (part + mean.sqrt() * normals[i]).floor();
        counts[i] = whole + step;
        let short = part - step;
        // The squeeze: certain to be kept, for K >= µ in any case.
        let kept = short * short * short <= 6.0 * mean * mean * open_unit(chances[i]);
        open[i] = u32::from(!(kept & (counts[i] >= 0.0)));
    }
    for at in (0..BLOCK).step_by(16) {
        if open[at..at + 16].iter().fold(0, |any, o| any | o) == 0 {
            continue;
        }
        for i in at..at + 16 {
            if open[i] != 0 && means[i] >= SUMMED_BELOW {
                counts[i] = finish(means[i], counts[i], open_unit(chances[i]), block.rare(i));
            }
        }
    }
    counts
}

/// What the squeeze left open, for one pixel: the quotient test, and if `count` fails it, a deviate
/// from the excess of the Poisson distribution over that of the proposals.
#[cold]
#[inline(never)]
#[expect(clippy::cast_possible_truncation, reason = "counts are exact in single precision")]
fn finish(mean: f32, count: f32, chance: f32, mut words: SplitMix64) -> f32 {
    let law = Law::new(mean);
    let count = f64::from(count);
    if count >= 0.0 && 1.0 - f64::from(chance) <= law.ratio(count) {
        return count as f32;
    }
    // Under a double exponential centred where the excess is greatest.
    loop {
        let height = open_uniform(&mut words);
        let side = 2.0 * open_uniform(&mut words) - 1.0;
        let from_centre = -libm::log(height);
        let t = EXCESS_CENTRE + if side < 0.0 { -from_centre } else { from_centre };
        if t <= EXCESS_START {
            continue;
        }
        let count = (law.mean + law.root * t).floor();
        let excess = law.proposed(count) * (law.ratio(count) - 1.0);
        if side.abs() * EXCESS_BOUND * height <= excess * law.mean {
            return count as f32;
        }
    }
}

/// Below this many standard deviations there is no excess, for means of 10 or more.
const EXCESS_START: f64 = -0.6744;
/// Where the excess is greatest, in standard deviations.
const EXCESS_CENTRE: f64 = 1.8;
/// The greatest value of µ · excess / exp_f64(-|t - centre|).
const EXCESS_BOUND: f64 = 0.1069;

/// The distribution wanted and that of the proposals, for one mean of 10 or more.
struct Law {
    mean: f64,
    root: f64,
}

impl Law {
    fn new(mean: f32) -> Self {
        let mean = f64::from(mean);
        Self { mean, root: mean.sqrt() }
    }

    /// The probability that ⌊µ + √µ·z⌋ = k for a normal z.
    fn proposed(&self, count: f64) -> f64 {
        let x = self.middle(count);
        let density = exp_f64(-0.5 * x * x) / (core::f64::consts::TAU * self.mean).sqrt();
        density * self.bin(x)
    }

    /// That of k electrons, µᵏ e⁻µ / k!, divided by that of its proposal.
    fn ratio(&self, count: f64) -> f64 {
        let x = self.middle(count);
        let normal = 0.5 * x * x;
        if count < 10.0 {
            let factorial = (1..=10).map(f64::from).take_while(|&k| k <= count).product::<f64>();
            let poisson = exp_f64(count * libm::log(self.mean) - self.mean + normal) / factorial;
            return poisson * (core::f64::consts::TAU * self.mean).sqrt() / self.bin(x);
        }
        // Stirling's series; from 10 on it is exact to 6e-11.
        let inverse = 1.0 / count;
        let square = inverse * inverse;
        let stirling = inverse * (1.0 / 12.0 - square * (1.0 / 360.0 - square * (1.0 / 1260.0)));
        let short = self.mean - count;
        let exponent = count * libm::log1p(short * inverse) - short - stirling + normal;
        exp_f64(exponent) * (self.mean * inverse).sqrt() / self.bin(x)
    }

    /// The middle of the bin of proposals that stand for a count, in standard deviations.
    fn middle(&self, count: f64) -> f64 {
        (count + 0.5 - self.mean) / self.root
    }

    /// The mean of the normal density over that bin, of width h = 1/√µ, divided by its value in
    /// the middle: the series in h, exact to 1e-9.
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

    fn counts_around(law: &Law, from: f64, to: f64) -> impl Iterator<Item = f64> {
        let first = (law.mean + from * law.root).floor().max(0.0);
        let last = (law.mean + to * law.root).floor();
        core::iter::successors(Some(first), |k| Some(k + 1.0)).take_while(move |&k| k <= last)
    }

    #[test]
    fn both_laws_are_what_they_say() {
        for mean in MEANS {
            let law = Law::new(mean);
            for k in counts_around(&law, -6.0, 6.0) {
                let [low, high] = [k, k + 1.0].map(|k| (k - law.mean) / law.root);
                let tail = |x: f64| 0.5 * libm::erfc(x.abs() / core::f64::consts::SQRT_2);
                let bin =
                    if low < 0.0 && high > 0.0 { 1.0 - tail(low) - tail(high) } else { (tail(low) - tail(high)).abs() };
                assert!((law.proposed(k) / bin - 1.0).abs() < 2e-7, "{mean}: {k}");
                let wanted = libm::exp(k * libm::log(law.mean) - law.mean - libm::lgamma(k + 1.0));
                let got = law.proposed(k) * law.ratio(k);
                assert!((got / wanted - 1.0).abs() < 1e-8, "{mean}: {k}");
            }
        }
    }

    /// What makes the finish exact: the squeeze keeps only what the quotient would keep, there is
    /// no excess where none is drawn, and where it is drawn it stays below its bound.
    #[test]
    fn the_squeeze_and_the_bound_hold() {
        for mean in MEANS {
            let law = Law::new(mean);
            for k in counts_around(&law, -9.0, 9.0) {
                let short = law.mean - k;
                let squeeze = 1.0 - short * short * short / (6.0 * law.mean * law.mean);
                assert!(squeeze.min(1.0) <= law.ratio(k) + 1e-9, "{mean}: {k}");
                let [low, high] = [k, k + 1.0].map(|k| (k - law.mean) / law.root);
                let excess = law.proposed(k) * (law.ratio(k) - 1.0);
                if low < EXCESS_START {
                    assert!(excess <= 1e-12, "{mean}: {k}");
                } else {
                    let farthest = (low - EXCESS_CENTRE).abs().max((high - EXCESS_CENTRE).abs());
                    let bound = EXCESS_BOUND / law.mean * libm::exp(-farthest);
                    assert!(excess <= bound, "{mean}: {k}");
                }
            }
        }
    }
}
