//! Normal deviates in pairs, without a branch.

use crate::hash::BLOCK;

/// Two independent standard normal deviates for each pair of words: Box and Muller's r·cos φ and r·sin φ
/// (doi:10.1214/aoms/1177706645) with r² = -2 ln u, u = (word + ½)·2⁻³² and φ any of 2³² angles. They reach 6.76 standard
/// deviations and err by less than 3e-7 of r.
#[inline(always)]
pub(crate) fn normal_pairs(radii: &[u32; BLOCK], angles: &[u32; BLOCK]) -> [[f32; BLOCK]; 2] {
    let mut pairs = [[0.0; BLOCK]; 2];
    for i in 0..BLOCK {
        let radius = radius(radii[i]);
        let [cosine, sine] = cosine_and_sine(angles[i]);
        pairs[0][i] = radius * cosine;
        pairs[1][i] = radius * sine;
    }
    pairs
}

/// √(-2 ln u)
#[inline(always)]
fn radius(word: u32) -> f32 {
    const STEP: f32 = 1.0 / 4_294_967_296.0;
    // What rounds to 1 has the logarithm 0.
    let u = (word as f32 + 0.5) * STEP;
    (-2.0 * ln(u)).max(0.0).sqrt()
}

/// Of the angle word · 2π/2³², to 1.2e-7: by the nearest quarter turn, and what is left by the polynomials of Cephes' `sinf`
/// and `cosf`.
#[inline(always)]
fn cosine_and_sine(word: u32) -> [f32; 2] {
    const STEP: f32 = core::f32::consts::FRAC_PI_2 / 1_073_741_824.0;
    let quarters = word.wrapping_add(1 << 29) >> 30;
    let rest = word.wrapping_sub(quarters << 30).cast_signed() as f32 * STEP;
    let square = rest * rest;
    let sine = ((-1.951_529_6e-4 * square + 8.332_161e-3) * square - 1.666_665_5e-1) * square * rest + rest;
    let cosine =
        ((2.443_315_7e-5 * square - 1.388_731_6e-3) * square + 4.166_664_6e-2) * square * square - 0.5 * square + 1.0;
    // A quarter turn takes (c, s) to (-s, c), half a turn to (-c, -s).
    let odd = quarters & 1 != 0;
    let (first, second) = if odd { (sine, cosine) } else { (cosine, sine) };
    let first_sign = (quarters ^ (quarters >> 1)) << 31;
    let second_sign = (quarters >> 1) << 31;
    [f32::from_bits(first.to_bits() ^ first_sign), f32::from_bits(second.to_bits() ^ second_sign)]
}

/// Natural logarithm of a normal positive number, to 1e-7 (the polynomial of Cephes' `logf`).
#[inline(always)]
fn ln(x: f32) -> f32 {
    const SQRT_HALF: u32 = 0x3f35_04f3;
    let above = x.to_bits().wrapping_sub(SQRT_HALF);
    let exponent = (above.cast_signed() >> 23) as f32;
    let m = f32::from_bits((above & 0x007f_ffff) + SQRT_HALF) - 1.0;
    let p = polynomial(
        [
            7.037_683_6e-2,
            -1.151_461e-1,
            1.167_699_9e-1,
            -1.242_014_1e-1,
            1.424_932_3e-1,
            -1.666_805_7e-1,
            2.000_071_5e-1,
            -2.499_999_4e-1,
            3.333_333e-1,
        ],
        m,
    );
    let square = m * m;
    // ln 2 in two parts, the first of which is exact when multiplied by the exponent.
    let low = p * m * square - 2.121_944_4e-4 * exponent - 0.5 * square;
    0.693_359_4 * exponent + (m + low)
}

/// A polynomial, highest power first: even and odd powers side by side, which halves the wait.
#[inline(always)]
fn polynomial(terms: [f32; 9], x: f32) -> f32 {
    let square = x * x;
    let (mut even, mut odd) = (terms[0], terms[1]);
    for i in [2, 4, 6] {
        even = even * square + terms[i];
        odd = odd * square + terms[i + 1];
    }
    (even * square + terms[8]) + odd * x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_all_around() {
        for i in 0..2_000_000_u32 {
            let word = i.wrapping_mul(2_147_483_629).wrapping_add(i >> 3);
            let angle = f64::from(word) * core::f64::consts::TAU / 4_294_967_296.0;
            let [cosine, sine] = cosine_and_sine(word).map(f64::from);
            assert!((cosine - libm::cos(angle)).abs() < 1.2e-7, "{word}: {cosine}");
            assert!((sine - libm::sin(angle)).abs() < 1.2e-7, "{word}: {sine}");
        }
        assert_eq!([0, 1 << 30, 2 << 30, 3 << 30].map(cosine_and_sine), [[1., 0.], [-0., 1.], [-1., -0.], [0., -1.]]);
    }

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
        // Evenly over all pairs of words, by two coordinates that fill a square.
        const SIDE: usize = 1 << 12;
        let step = |k: usize| u32::try_from(k).unwrap() * (1 << 20) + (1 << 19);
        let mut sums = [[0.0; 4]; 2];
        let mut product = 0.0;
        for radius in 0..SIDE {
            let radii = [step(radius); BLOCK];
            for angle in (0..SIDE).step_by(BLOCK) {
                let [first, second] = normal_pairs(&radii, &core::array::from_fn(|i| step(angle + i)));
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

    #[test]
    fn ln_is_the_logarithm() {
        for i in 1..1_000_000_u32 {
            let x = i as f32 * 1e-6;
            let exact = libm::log(f64::from(x));
            assert!((f64::from(ln(x)) - exact).abs() < 1.2e-7 * exact.abs() + 1e-8, "{x}");
        }
    }
}
