//! Moments of the grey levels, and changes of an image that impose them.

use multiversion::multiversion;

use crate::sums::single;

/// Mean and central moments of grey levels. Averages of central moments over several regions are meaningful, unlike
/// averages of skewness and kurtosis.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Moments {
    /// Mean.
    pub mean: f64,
    /// Mean of (x − mean)².
    pub variance: f64,
    /// Mean of (x − mean)³.
    pub third: f64,
    /// Mean of (x − mean)⁴.
    pub fourth: f64,
}

impl Moments {
    /// Returns the skewness, third / variance^(3/2), or 0 without variance.
    #[must_use]
    pub fn skewness(&self) -> f64 {
        if self.variance > 0.0 { finite_or(self.third / (self.variance * self.variance.sqrt()), 0.0) } else { 0.0 }
    }

    /// Returns the kurtosis, fourth / variance², or that of the normal distribution, 3, without variance.
    #[must_use]
    pub fn kurtosis(&self) -> f64 {
        if self.variance > 0.0 { finite_or(self.fourth / (self.variance * self.variance), 3.0) } else { 3.0 }
    }

    /// Measures pixels with weights.
    pub(crate) fn measure(values: &[f32], weights: &[f32], mean: f64) -> Self {
        let [mut total, mut second, mut third, mut fourth] = [0.0; 4];
        for (&value, &weight) in values.iter().zip(weights) {
            let (d, w) = (f64::from(value) - mean, f64::from(weight));
            let square = w * d * d;
            total += w;
            second += square;
            third += square * d;
            fourth += square * d * d;
        }
        let total = if total > 0.0 { total } else { 1.0 };
        Self { mean, variance: second / total, third: third / total, fourth: fourth / total }
    }
}

fn finite_or(value: f64, otherwise: f64) -> f64 {
    if value.is_finite() { value } else { otherwise }
}

/// Number of moments of the grey levels, of the orders 0 to 12: the fourth power of a cubic polynomial has degree 12.
const COUNT: usize = 13;

/// Replaces the grey levels x by a polynomial of them that gives the moments of `target`: first the skewness, along its
/// gradient, then the kurtosis, along its gradient, then mean and variance (the paper's "adjustment of the marginal
/// statistics"). If a moment is out of reach, the nearest value is taken.
pub(crate) fn impose(values: &mut [f32], target: &Moments) {
    let len = values.len() as f64;
    let [_, sum, squares, ..] = powers(values, 0.0, 1.0);
    let mean = sum / len;
    let variance = squares / len - mean * mean;
    if !(variance > 1e-12 * (squares / len) && target.variance > 0.0) {
        values.fill(single(target.mean));
        return;
    }
    let deviation = variance.sqrt();
    let skewness = target.skewness();
    // No distribution has a smaller kurtosis.
    let kurtosis = target.kurtosis().max(1.0 + skewness * skewness);

    let m = powers(values, mean, 1.0 / deviation).map(|power| power / len);
    let first = step(&m, [-1.0, -m[3], 1.0, 0.0], 3, skewness);
    change(values, mean, 1.0 / deviation, first);

    let m = powers(values, 0.0, 1.0).map(|power| power / len);
    let second = step(&m, [-m[3], -m[4], 0.0, 1.0], 4, kurtosis);
    change(values, 0.0, 1.0, second);

    let [_, sum, squares, ..] = powers(values, 0.0, 1.0);
    let mean = sum / len;
    let deviation = (squares / len - mean * mean).max(0.0).sqrt();
    let factor = if deviation > 0.0 { (target.variance.sqrt()) / deviation } else { 0.0 };
    for value in values.iter_mut() {
        *value = single(target.mean + factor * (f64::from(*value) - mean));
    }
}

/// Returns a cubic polynomial, lowest power first: x + λ · `gradient`, divided by its standard deviation. λ gives the
/// standardised moment of this order the value `target`, or the nearest one. `m` are the moments of x, with mean 0 and
/// variance 1.
fn step(m: &[f64; COUNT], gradient: [f64; 4], order: usize, target: f64) -> [f64; 4] {
    let along = |lambda: f64| {
        let mut polynomial = gradient.map(|coefficient| lambda * coefficient);
        polynomial[1] += 1.0;
        polynomial
    };
    let value = |lambda: f64| standardised(&along(lambda), m, order).0;
    let start = value(0.0);
    let direction = if target > start { 1.0 } else { -1.0 };
    let is_short = |lambda: f64| direction * (target - value(lambda)) > 0.0;
    // The moment changes monotonically up to an extremum.
    let (mut low, mut high) = (0.0, 0.0);
    let mut size = 0.01;
    let mut best = start;
    for _ in 0..24 {
        let next = high + direction * size;
        let found = value(next);
        let is_better = direction * (found - best) > 0.0;
        if !is_better {
            break;
        }
        (low, high, best) = (high, next, found);
        size *= 1.4;
        if !is_short(high) {
            break;
        }
    }
    if !is_short(high) {
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if is_short(middle) { low = middle } else { high = middle }
        }
    }
    let polynomial = along(high);
    let (_, mean, deviation) = standardised(&polynomial, m, order);
    if !(deviation > 0.0 && deviation.is_finite()) {
        return [0.0, 1.0, 0.0, 0.0];
    }
    let mut polynomial = polynomial;
    polynomial[0] -= mean;
    polynomial.map(|coefficient| coefficient / deviation)
}

/// Returns the standardised moment of an order of a polynomial of x, its mean and its standard deviation.
fn standardised(polynomial: &[f64; 4], m: &[f64; COUNT], order: usize) -> (f64, f64, f64) {
    let expected = |power: &[f64; COUNT]| power.iter().zip(m).map(|(a, b)| a * b).sum::<f64>();
    let mut centred = [0.0; COUNT];
    centred[..4].copy_from_slice(polynomial);
    let mean = expected(&centred);
    centred[0] -= mean;
    let linear = centred;
    let mut variance = 0.0;
    for power in 2..=order {
        let mut product = [0.0; COUNT];
        for (i, &a) in linear[..4].iter().enumerate() {
            for (j, &b) in centred[..COUNT - i].iter().enumerate() {
                product[i + j] += a * b;
            }
        }
        centred = product;
        if power == 2 {
            variance = expected(&centred);
        }
    }
    let deviation = variance.max(0.0).sqrt();
    let scale = (0..order).fold(1.0, |scale, _| scale * deviation);
    (if scale > 0.0 { expected(&centred) / scale } else { f64::NAN }, mean, deviation)
}

/// Returns the sums of all powers of (x − mean) · factor.
#[multiversion(targets = "simd")]
fn powers(values: &[f32], mean: f64, factor: f64) -> [f64; COUNT] {
    const LANES: usize = 8;
    let mut sums = [[0.0_f64; LANES]; COUNT];
    let (whole, rest) = values.as_chunks::<LANES>();
    for values in whole {
        let mut x = [0.0; LANES];
        for l in 0..LANES {
            x[l] = (f64::from(values[l]) - mean) * factor;
        }
        let mut power = [1.0; LANES];
        for sum in &mut sums {
            for l in 0..LANES {
                sum[l] += power[l];
                power[l] *= x[l];
            }
        }
    }
    let mut totals = sums.map(|sum| sum.iter().sum());
    for &value in rest {
        let x = (f64::from(value) - mean) * factor;
        let mut power = 1.0;
        for total in &mut totals {
            *total += power;
            power *= x;
        }
    }
    totals
}

/// Replaces each grey level by a polynomial of (x − mean) · factor.
#[multiversion(targets = "simd")]
fn change(values: &mut [f32], mean: f64, factor: f64, [a, b, c, d]: [f64; 4]) {
    for value in values {
        let x = (f64::from(*value) - mean) * factor;
        *value = single(a + x * (b + x * (c + x * d)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use portable_numerics::random::Ziggurat;
    use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

    fn noise(seed: u64) -> Vec<f32> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let ziggurat = Ziggurat::new();
        (0..8192).flat_map(|_| ziggurat.pair(&mut rng)).collect()
    }

    fn measured(values: &[f32]) -> Moments {
        let mean = values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64;
        Moments::measure(values, &vec![1.0; values.len()], mean)
    }

    fn moments(mean: f64, variance: f64, skewness: f64, kurtosis: f64) -> Moments {
        let third = skewness * variance * variance.sqrt();
        Moments { mean, variance, third, fourth: kurtosis * variance * variance }
    }

    #[test]
    fn moments_are_imposed() {
        for (skewness, kurtosis) in [(0.0, 3.0), (0.8, 4.0), (-0.8, 4.0), (0.0, 6.0), (0.3, 2.2), (1.5, 6.0)] {
            let target = moments(5.0, 4.0, skewness, kurtosis);
            let mut values = noise(7);
            (0..8).for_each(|_| impose(&mut values, &target));
            let found = measured(&values);
            assert!((found.mean - 5.0).abs() < 1e-4 && (found.variance - 4.0).abs() < 1e-4);
            assert!((found.skewness() - skewness).abs() < 0.05, "{skewness}, {kurtosis}: {found:?}");
            assert!((found.kurtosis() - kurtosis).abs() < 0.1, "{skewness}, {kurtosis}: {}", found.kurtosis());
        }
    }

    #[test]
    fn images_without_variance_become_the_mean() {
        let mut values = vec![3.0; 100];
        impose(&mut values, &moments(2.0, 1.0, 0.0, 3.0));
        assert_eq!(values, vec![2.0; 100]);
        let mut values = noise(8);
        impose(&mut values, &moments(2.0, 0.0, 0.0, 3.0));
        assert!(values.iter().all(|&v| v == 2.0));
    }

    #[test]
    fn impossible_moments_stay_finite() {
        for (skewness, kurtosis) in [(20.0, 1.0), (0.0, 1e6), (-1e4, 0.0)] {
            let mut values = noise(9);
            (0..20).for_each(|_| impose(&mut values, &moments(0.0, 1.0, skewness, kurtosis)));
            assert!(values.iter().all(|v| v.is_finite()));
            assert!((measured(&values).variance - 1.0).abs() < 1e-3);
        }
    }
}
