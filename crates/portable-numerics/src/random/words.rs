//! Numbers from random words that are at hand, without a branch: for rows of pixels, whose words are hashes of their places.

use crate::elementary::{cos_sin_of_turn, ln_f32};

/// Maps a random word to a number uniform in `(0, 1]`, in single precision.
#[inline(always)]
#[must_use]
pub fn open_unit(word: u32) -> f32 {
    const STEP: f32 = 1.0 / 4_294_967_296.0;
    (word as f32 + 0.5) * STEP
}

/// Returns two independent standard normal numbers for each pair of words: Box and Muller's r·cos φ and r·sin φ
/// (doi:10.1214/aoms/1177706645) with r² = -2 ln u, u = (word + ½)·2⁻³² and φ any of 2³² angles. They reach 6.76 standard
/// deviations and err by less than 3e-7 of r. Inlined, so that it is compiled for the instruction set of its caller.
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
    // What rounds to 1 has the logarithm 0.
    (-2.0 * ln_f32(open_unit(word))).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn radii_are_the_inverse_of_their_distribution() {
        for i in 0..2_000_000_u32 {
            // Every part of the range, and the ends closely.
            let word = [i * 2147, i, u32::MAX - i][i as usize % 3];
            let u = (f64::from(word) + 0.5) / 4_294_967_296.0;
            let exact = (-2.0 * libm::log(u)).sqrt();
            // Near u = 1 single precision has steps of 2⁻²⁴ in u, which are small in r times its density, r.
            let error = (f64::from(radius(word)) - exact).abs();
            assert!(error < 2e-7 * exact + 2e-7 / exact, "{word}: {error}");
        }
        assert!((6.7..6.8).contains(&radius(0)));
        assert_eq!(radius(u32::MAX), 0.0);
    }

    #[test]
    fn moments_are_normal_to_a_hundred_thousandth() {
        const BLOCK: usize = 64;
        // Evenly over all pairs of words, by two coordinates that fill a square.
        const SIDE: usize = 1 << 12;
        let step = |k: usize| u32::try_from(k).unwrap() * (1 << 20) + (1 << 19);
        let mut sums = [[0.0; 4]; 2];
        let mut product = 0.0;
        for radius in 0..SIDE {
            let radii = [step(radius); BLOCK];
            for angle in (0..SIDE).step_by(BLOCK) {
                let [first, second] = normals_of_words(&radii, &core::array::from_fn(|i| step(angle + i)));
                for i in 0..BLOCK {
                    let pair = [first[i], second[i]].map(f64::from);
                    product += (pair[0] * pair[0] - 1.0) * (pair[1] * pair[1] - 1.0);
                    for (sums, x) in sums.iter_mut().zip(pair) {
                        let mut power = 1.0;
                        for sum in sums {
                            power *= x;
                            *sum += power;
                        }
                    }
                }
            }
        }
        let count = (SIDE * SIDE) as f64;
        for sums in sums {
            let [first, second, third, fourth] = sums.map(|sum| sum / count);
            assert!(first.abs() < 1e-7 && third.abs() < 1e-6, "{first} {third}");
            // The midpoints of 4096 steps of the radius are off by this much.
            assert!((second - 1.0).abs() < 2e-4, "{second}");
            assert!((fourth - 3.0).abs() < 5e-3, "{fourth}");
        }
        assert!((product / count).abs() < 2e-3, "squares are uncorrelated: {}", product / count);
    }
}
