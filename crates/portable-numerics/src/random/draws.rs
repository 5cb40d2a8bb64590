//! Scalar draws: uniform, integer and normal numbers, and shuffles. Also branch-free normal numbers from given random
//! words, for rows of pixels whose words are hashes of their positions.

use crate::elementary::{cos_sin_of_turn, ln_f32};
use rand_core::Rng;

/// 2⁻⁵³: the step of a 53-bit mantissa.
const STEP: f64 = 1.0 / (1_u64 << 53) as f64;

/// Maps the upper 53 bits of a random word to a uniform number in `[0, 1)`.
#[must_use]
pub fn unit(word: u64) -> f64 {
    (word >> 11) as f64 * STEP
}

/// Returns a uniform number in `[0, 1)` with 53 random bits.
pub fn uniform<R: Rng + ?Sized>(rng: &mut R) -> f64 {
    unit(rng.next_u64())
}

/// Returns a uniform number in `(0, 1]`, whose logarithm is finite.
pub fn open_uniform<R: Rng + ?Sized>(rng: &mut R) -> f64 {
    ((rng.next_u64() >> 11) as f64 + 0.5) * STEP
}

/// Returns a uniform number in `[low, high)`.
pub fn between<R: Rng + ?Sized>(low: f64, high: f64, rng: &mut R) -> f64 {
    low + (high - low) * uniform(rng)
}

/// Returns a uniform integer in `0..count`, by multiplication; the bias is below count / 2⁶⁴. Returns 0 if `count` is
/// 0.
pub fn below<R: Rng + ?Sized>(count: usize, rng: &mut R) -> usize {
    let product = u128::from(rng.next_u64()) * count as u128;
    usize::try_from(product >> u64::BITS).unwrap_or(0)
}

/// Returns true with the given probability.
pub fn chance<R: Rng + ?Sized>(probability: f64, rng: &mut R) -> bool {
    uniform(rng) < probability
}

/// Returns a uniform angle in `[0, 2π)`, in radians.
pub fn direction<R: Rng + ?Sized>(rng: &mut R) -> f64 {
    between(0.0, core::f64::consts::TAU, rng)
}

/// Shuffles items; every permutation is equally likely (Fisher and Yates).
pub fn shuffle<T, R: Rng + ?Sized>(items: &mut [T], rng: &mut R) {
    for last in (1..items.len()).rev() {
        items.swap(last, below(last + 1, rng));
    }
}

/// Returns a standard normal number. For several numbers, [`Normals`] draws half as many words.
pub fn normal<R: Rng + ?Sized>(rng: &mut R) -> f64 {
    normal_pair(rng)[0]
}

/// Returns two independent standard normal numbers by Marsaglia's polar method (doi:10.1137/1006063).
fn normal_pair<R: Rng + ?Sized>(rng: &mut R) -> [f64; 2] {
    loop {
        let x = 2.0 * uniform(rng) - 1.0;
        let y = 2.0 * uniform(rng) - 1.0;
        let s = x * x + y * y;
        if s > 0.0 && s < 1.0 {
            let scale = (-2.0 * libm::log(s) / s).sqrt();
            return [scale * x, scale * y];
        }
    }
}

/// A sequence of standard normal numbers, which uses both numbers of each pair.
#[derive(Debug)]
pub struct Normals<'a, R: Rng + ?Sized> {
    rng: &'a mut R,
    spare: Option<f64>,
}

impl<'a, R: Rng + ?Sized> Normals<'a, R> {
    /// Creates a sequence that draws from `rng`.
    pub fn new(rng: &'a mut R) -> Self {
        Self { rng, spare: None }
    }

    /// Returns the next number.
    pub fn draw(&mut self) -> f64 {
        self.spare.take().unwrap_or_else(|| {
            let [first, second] = normal_pair(self.rng);
            self.spare = Some(second);
            first
        })
    }
}

/// Maps a random word to a uniform number in `(0, 1]`, in single precision.
#[inline(always)]
#[must_use]
pub fn open_unit(word: u32) -> f32 {
    const STEP: f32 = 1.0 / 4_294_967_296.0;
    (word as f32 + 0.5) * STEP
}

/// Returns two independent standard normal numbers for each pair of words: Box and Muller's r·cos φ and r·sin φ
/// (doi:10.1214/aoms/1177706645) with r² = -2 ln u, u = (word + ½)·2⁻³² and φ any of 2³² angles. The largest number is
/// 6.76; the error is below 3e-7 of r. Inlined, so that it is compiled for the caller's instruction set.
#[inline(always)]
#[must_use]
pub fn normals_of_words<const N: usize>(radii: &[u32; N], angles: &[u32; N]) -> [[f32; N]; 2] {
    let mut pairs = [[0.0; N]; 2];
    for i in 0..N {
        let radius = radius(radii[i]);
        let [cosine, sine] = cos_sin_of_turn(angles[i]);
        pairs[0][i] = radius * cosine;
        pairs[1][i] = radius * sine;
    }
    pairs
}

/// √(-2 ln u)
#[inline(always)]
fn radius(word: u32) -> f32 {
    // `open_unit` may round to 1; the logarithm is then 0 or slightly above.
    (-2.0 * ln_f32(open_unit(word))).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::super::assert_normal;
    use super::*;
    use crate::statistics::{deviation, mean};
    use rand_xoshiro::Xoshiro256PlusPlus;
    use rand_xoshiro::rand_core::SeedableRng;

    #[test]
    fn normals_have_normal_moments() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(0x40A1);
        assert_normal(&(0..200_000).map(|_| normal(&mut rng)).collect::<Vec<_>>());
        let mut normals = Normals::new(&mut rng);
        assert_normal(&(0..200_000).map(|_| normals.draw()).collect::<Vec<_>>());
    }

    #[test]
    fn one_normal_is_the_first_of_a_pair() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(3);
        assert_eq!(normal(&mut rng.clone()), Normals::new(&mut rng).draw());
    }

    #[test]
    fn uniforms_fill_the_unit_interval() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(0x0F0);
        let values: Vec<f64> = (0..100_000).map(|_| uniform(&mut rng)).collect();
        assert!(values.iter().all(|v| (0.0..1.0).contains(v)));
        assert!((mean(&values) - 0.5).abs() < 4.0 * (1.0 / 12.0 / 1e5_f64).sqrt());
        assert!((deviation(&values) - (1.0_f64 / 12.0).sqrt()).abs() < 4.0 * (1.0 / 60.0 / 1e5_f64).sqrt());
        assert_eq!([unit(0), unit(u64::MAX)], [0.0, 1.0 - STEP]);
        assert!((0..1000).map(|_| open_uniform(&mut rng)).all(|u| 0.0 < u && u <= 1.0));
    }

    #[test]
    fn integers_below_are_uniform() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(0xbe10);
        let mut counts = [0.0; 7];
        (0..70_000).for_each(|_| counts[below(7, &mut rng)] += 1.0);
        let chi_square: f64 = counts.map(|n| (n - 1e4) * (n - 1e4) / 1e4).iter().sum();
        // The 0.1 % level with 6 degrees of freedom.
        assert!(chi_square < 22.5, "{chi_square}");
        assert_eq!(below(0, &mut rng), 0);
    }

    #[test]
    fn every_permutation_is_equally_likely() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(6);
        let mut counts = std::collections::BTreeMap::new();
        for _ in 0..6000 {
            let mut items = [0, 1, 2];
            shuffle(&mut items, &mut rng);
            *counts.entry(items).or_insert(0) += 1;
        }
        // Six permutations, 1000 times each, with a standard error of √(6000 · 1/6 · 5/6) = 29.
        assert!(counts.len() == 6 && counts.values().all(|c: &i32| (c - 1000).abs() < 4 * 29), "{counts:?}");
    }

    #[test]
    fn normals_match_box_and_muller() {
        for i in 0..2_000_000_u32 {
            // The complete range, with both ends sampled densely.
            let (word, angle) = ([i * 2147, i, u32::MAX - i][i as usize % 3], i.wrapping_mul(2_147_483_629));
            let u = (f64::from(word) + 0.5) / 4_294_967_296.0;
            let exact = (-2.0 * libm::log(u)).sqrt();
            let (sine, cosine) = libm::sincos(f64::from(angle) * core::f64::consts::TAU / 4_294_967_296.0);
            for ([found], exact_part) in normals_of_words(&[word], &[angle]).iter().zip([exact * cosine, exact * sine])
            {
                // Near u = 1, u has steps of 2⁻²⁴ in single precision, and r has steps of about 2⁻²⁴ / r.
                let error = (f64::from(*found) - exact_part).abs();
                assert!(error < 3e-7 * exact + 2e-7 / exact, "{word} {angle}: {error}");
            }
        }
        assert!((6.7..6.8).contains(&radius(0)));
        assert_eq!(radius(u32::MAX), 0.0);
    }
}
