//! The paper's comparison of nuclear texture.

use portable_numerics::random::shuffle;
use rand_core::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::{Deserialize, Serialize};

use crate::control::Control;
use crate::describe::describe;
use crate::error::Error;
use crate::number::{nearest, whole};
use crate::statistics::{deviation, line_slope, median, of_sorted, quantile, sorted};
use crate::table::FeatureTable;

/// Identifiers of the descriptors of a nucleus: logarithms of central moments 2 to 6, and entropy.
pub(crate) const DESCRIPTORS: [&str; 6] =
    ["log moment 2", "log moment 3", "log moment 4", "log moment 5", "log moment 6", "entropy, bits"];

/// Returns the [`DESCRIPTORS`] (Eqs. 17 to 19) of grey levels 0 to 255, rounded to integers.
pub(crate) fn descriptors(grey: impl Iterator<Item = f32>) -> [f64; DESCRIPTORS.len()] {
    const LEVELS: usize = 256;
    let mut parts = [0.0; LEVELS];
    let mut count = 0.0;
    for level in grey {
        parts[nearest(f64::from(level)).min(LEVELS - 1)] += 1.0;
        count += 1.0;
    }
    parts.iter_mut().for_each(|p| *p /= f64::max(count, 1.0));
    // Eq. 18: m = Σᵢ zᵢ p(zᵢ).
    let mean: f64 = parts.iter().enumerate().map(|(z, p)| z as f64 * p).sum();
    // Eq. 17: μₙ = Σᵢ (zᵢ − m)ⁿ p(zᵢ). Logarithm to base 10 of 1 + |μₙ|, with the sign of μₙ.
    let log_moment = |n: usize| {
        let power = |d: f64| (0..n).fold(1.0, |product, _| product * d);
        let moment: f64 = parts.iter().enumerate().map(|(z, p)| power(z as f64 - mean) * p).sum();
        libm::log10(1.0 + moment.abs()) * moment.signum()
    };
    // Eq. 19: H = −Σᵢ p(zᵢ) log₂ p(zᵢ), bits.
    let entropy = -parts.iter().filter(|p| **p > 0.0).map(|p| p * libm::log2(*p)).sum::<f64>();
    std::array::from_fn(|i| if i < 5 { log_moment(i + 2) } else { entropy })
}

/// Comparison of descriptors of nuclear texture: slopes of the quantiles of one side against those of the other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Moments {
    /// Nuclei of each side in a Q-Q plot.
    pub n: usize,
    /// Logarithms of central moments 2 to 6, and entropy.
    pub descriptors: Vec<Descriptor>,
}

/// One descriptor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Descriptor {
    /// Stable identifier.
    pub name: String,
    /// The descriptor in words.
    pub description: String,
    /// Slope of real quantiles against synthetic ones: above 1 if the real ones vary more. 5th, 50th and 95th
    /// percentile over draws of `n` nuclei from each side.
    pub slope: [f64; 3],
    /// Slope between two disjoint halves of the real fields: 0.25th, 50th and 99.75th percentile, widened for few
    /// fields.
    pub null_slope: [f64; 3],
    /// Synthetic median minus real median, in standard deviations of the real nuclei: 5th, 50th and 95th percentile.
    pub shift: [f64; 3],
    /// Shift between two halves of the real fields, with the percentiles of `null_slope`.
    pub null_shift: [f64; 3],
    /// Whether the medians of slope and shift are within the range between real halves.
    pub within: bool,
    /// Quantiles for the Q-Q plot: real, synthetic.
    pub quantiles: Vec<[f64; 2]>,
}

/// Returns the slope of the least-squares line through the quantiles of `y` against those of `x`, as many as the
/// shorter slice has values. NaN if `x` is constant.
#[must_use]
pub fn qq_slope(x: &[f64], y: &[f64]) -> f64 {
    let n = x.len().min(y.len());
    let quantiles = |values: &[f64]| {
        let sorted = sorted(values.iter().copied());
        (0..n).map(|i| of_sorted(&sorted, (i as f64 + 0.5) / n as f64)).collect::<Vec<_>>()
    };
    line_slope(&quantiles(x), &quantiles(y))
}

/// Number of quantiles of a Q-Q plot.
const DRAWN: usize = 60;

/// Percentiles of the range between real halves: 1 of 200 is outside. There are twelve correlated numbers: slopes and
/// shifts of six descriptors.
const BAND: [f64; 3] = [0.0025, 0.5, 0.9975];

/// Returns the factor that widens the range between halves of so many fields, because few fields underestimate the
/// variation. It is the ratio of the 99.75th percentiles of Student's distribution, with `fields − 1` degrees of
/// freedom, and of the normal one.
fn widening(fields: usize) -> f64 {
    /// Of 2 to 8 fields.
    const FEW: [f64; 7] = [45.4, 5.02, 2.65, 1.99, 1.7, 1.54, 1.44];
    /// (z² + 1)/4 and (5z⁴ + 16z² + 3)/96, z the normal percentile: the ratio's expansion in 1/degrees of freedom.
    const MANY: [f64; 2] = [2.22, 4.58];
    let freedom = fields as f64 - 1.0;
    FEW.get(fields.saturating_sub(2)).copied().unwrap_or(1.0 + (MANY[0] + MANY[1] / freedom) / freedom)
}

/// Minimum number of nuclei of a side.
const LEAST: usize = 8;

/// Compares `n` nuclei of each side, `draws` times; all nuclei if `n` is 0. None if there are too few.
pub(crate) fn compare(
    real: &[FeatureTable],
    synthetic: &[FeatureTable],
    n: usize,
    draws: usize,
    seed: u64,
    control: &Control,
) -> Result<Option<Moments>, Error> {
    let phase = control.phase("comparing nuclear texture", DESCRIPTORS.len());
    let (real, synthetic): (Vec<&FeatureTable>, Vec<&FeatureTable>) =
        (real.iter().collect(), synthetic.iter().collect());
    let nuclei = |tables: &[&FeatureTable]| tables.iter().map(|t| t.len()).sum::<usize>();
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let halves: Vec<[Vec<&FeatureTable>; 2]> = (0..draws).map(|_| halves(&real, &mut rng)).collect();
    // The null distribution uses halves: 9 of 10 of them have so many nuclei.
    let mut sizes: Vec<f64> = halves.iter().map(|h| nuclei(&h[0]).min(nuclei(&h[1])) as f64).collect();
    let most = whole(quantile(&mut sizes, 0.1)).min(nuclei(&synthetic));
    let n = if n == 0 { most } else { n };
    let wider = widening(real.iter().filter(|t| !t.is_empty()).count());
    if n < LEAST || n > most {
        return Ok(None);
    }
    let halves: Vec<&[Vec<&FeatureTable>; 2]> =
        halves.iter().filter(|h| nuclei(&h[0]).min(nuclei(&h[1])) >= n).collect();
    let descriptor = |name: &&str| -> Result<Descriptor, Error> {
        let values = |tables: &[&FeatureTable]| tables.iter().flat_map(|t| t.column(name)).collect::<Vec<f64>>();
        let all = [values(&real), values(&synthetic)];
        let (mut slopes, mut shifts, mut null_slopes, mut null_shifts) =
            (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for half in &halves {
            phase.check()?;
            let mut draw = |mut values: Vec<f64>| {
                shuffle(&mut values, &mut rng);
                values.truncate(n);
                values
            };
            let (a, b) = (draw(values(&half[0])), draw(values(&half[1])));
            let other = draw(all[1].clone());
            slopes.push(qq_slope(&other, &a));
            null_slopes.push(qq_slope(&b, &a));
            shifts.push(shift(&a, &other));
            null_shifts.push(shift(&a, &b));
        }
        let at = |values: &mut [f64], quantiles: [f64; 3]| quantiles.map(|q| quantile(values, q));
        let band = |values: &mut [f64]| {
            let [low, middle, high] = at(values, BAND);
            [low, middle, high].map(|v| middle + wider * (v - middle))
        };
        let sorted = all.map(sorted);
        let points = (0..DRAWN).map(|i| (i as f64 + 0.5) / DRAWN as f64);
        let [slope, shift] = [&mut slopes, &mut shifts].map(|values| at(values, [0.05, 0.5, 0.95]));
        let [null_slope, null_shift] = [&mut null_slopes, &mut null_shifts].map(|values| band(values));
        let within = |value: [f64; 3], [low, _, high]: [f64; 3]| value[1] >= low && value[1] <= high;
        phase.step()?;
        Ok(Descriptor {
            name: (*name).to_owned(),
            description: describe(name),
            slope,
            null_slope,
            shift,
            null_shift,
            within: within(slope, null_slope) && within(shift, null_shift),
            quantiles: points.map(|q| [of_sorted(&sorted[0], q), of_sorted(&sorted[1], q)]).collect(),
        })
    };
    let descriptors = DESCRIPTORS.iter().map(descriptor).collect::<Result<_, Error>>()?;
    Ok(Some(Moments { n, descriptors }))
}

/// Returns the median of `other` minus that of `values`, in standard deviations of `values`.
fn shift(values: &[f64], other: &[f64]) -> f64 {
    (median(&mut other.to_vec()) - median(&mut values.to_vec())) / deviation(values).max(1e-9)
}

/// Splits fields into two random halves.
fn halves<'a>(tables: &[&'a FeatureTable], rng: &mut Xoshiro256PlusPlus) -> [Vec<&'a FeatureTable>; 2] {
    let mut tables: Vec<&FeatureTable> = tables.iter().copied().filter(|t| !t.is_empty()).collect();
    shuffle(&mut tables, rng);
    let other = tables.split_off(tables.len() / 2);
    [tables, other]
}

#[cfg(test)]
mod tests {
    use super::*;
    use portable_numerics::random::below;

    fn normal(rng: &mut Xoshiro256PlusPlus) -> f64 {
        // The sum of twelve uniform numbers.
        (0..12).map(|_| below(1 << 30, rng) as f64 / f64::from(1 << 30)).sum::<f64>() - 6.0
    }

    #[test]
    fn moments_and_entropy_of_two_levels_are_exact() {
        // (−7.5)ⁿ/4 + 2.5ⁿ·3/4.
        let moments = [18.75, -93.75_f64, 820.3125].map(|m| libm::log10(1.0 + m.abs()) * m.signum());
        let found = descriptors([10.0, 20.0, 20.0, 20.0].into_iter());
        assert!(found.iter().zip(moments).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
        assert!((found[5] - 0.25 * 2.0 - 0.75 * libm::log2(4.0 / 3.0)).abs() < 1e-12);
        assert!((descriptors([1.0, 2.0, 3.0, 4.0].into_iter())[5] - 2.0).abs() < 1e-12);
        assert_eq!(descriptors(std::iter::empty()), [0.0; 6]);
    }

    #[test]
    fn the_slope_of_a_scaled_normal_is_its_scale() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
        let draw = |rng: &mut Xoshiro256PlusPlus| (0..4000).map(|_| normal(rng)).collect::<Vec<f64>>();
        let (x, y) = (draw(&mut rng), draw(&mut rng));
        let scaled: Vec<f64> = y.iter().map(|v| 2.5 * v + 7.0).collect();
        // The error of either's deviation is 1/√(2 · 4000) = 1.1 %.
        assert!((qq_slope(&x, &scaled) - 2.5).abs() < 4.0 * 2.5 * 0.016);
        assert!((qq_slope(&x, &x.iter().map(|v| 0.3 * v).collect::<Vec<_>>()) - 0.3).abs() < 1e-12);
        assert!(qq_slope(&[1.0, 1.0], &[1.0, 2.0]).is_nan());
    }

    /// Fields of nuclei with normal descriptors, whose means differ between fields.
    fn tables(count: usize, sd: f64, mean: f64, seed: u64) -> Vec<FeatureTable> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut field = |_| {
            let own = 0.3 * normal(&mut rng);
            let nucleus = |_| {
                let mut row = crate::table::Row::default();
                for name in DESCRIPTORS {
                    row.put(crate::table::FeatureKind::Texture, name, mean + own + sd * normal(&mut rng));
                }
                (row, [0.0; 2])
            };
            (0..30).map(nucleus).collect()
        };
        (0..count).map(&mut field).collect()
    }

    fn compared(real: &[FeatureTable], other: &[FeatureTable], n: usize, draws: usize, seed: u64) -> Option<Moments> {
        compare(real, other, n, draws, seed, &Control::NONE).unwrap()
    }

    #[test]
    fn different_sides_are_outside_the_range_of_halves() {
        let real = tables(16, 1.0, 4.0, 11);
        let found = |synthetic: &[FeatureTable]| compared(&real, synthetic, 0, 200, 7).unwrap();
        let [narrow, moved] = [(0.5, 4.0, 3), (1.0, 5.5, 4)].map(|(sd, mean, seed)| found(&tables(16, sd, mean, seed)));
        assert_eq!(narrow.n, 240);
        assert!(narrow.descriptors.iter().all(|d| !d.within && (1.6..2.2).contains(&d.slope[1])), "{narrow:?}");
        assert!(moved.descriptors.iter().all(|d| !d.within), "{moved:?}");
    }

    #[test]
    fn too_few_nuclei_are_not_compared() {
        let (real, synthetic) = (tables(4, 1.0, 4.0, 1), tables(1, 1.0, 4.0, 2));
        assert_eq!(compared(&real, &synthetic, 0, 20, 1).unwrap().n, 30);
        assert!(compared(&real, &synthetic, 31, 20, 1).is_none());
        assert!(compared(&real, &[], 0, 20, 1).is_none());
    }

    #[test]
    fn fields_of_one_kind_are_distinguishable_in_about_1_of_20_comparisons() {
        const PAIRS: u64 = 40;
        for fields in [6, 12] {
            let differs = |pair: u64| {
                let [real, other] = [0, 1].map(|side| tables(fields, 1.0, 4.0, 1000 + 2 * pair + side));
                !compared(&real, &other, 0, 100, pair).unwrap().descriptors.iter().all(|d| d.within)
            };
            // Of 40, 2 are expected; the probability of 7 or more is 1/200.
            let count = (0..PAIRS).filter(|pair| differs(*pair)).count();
            assert!(count <= 6, "{count} of {PAIRS} with {fields} fields");
        }
    }
}
