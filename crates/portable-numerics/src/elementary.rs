//! Exponentials, logarithms and sines for loops over rows of numbers. They consist of multiplications, additions and
//! conversions, so that they vectorise and every instruction set gives the same bits.
//!
//! For single numbers in double precision, `libm` is more accurate.

use multiversion::multiversion;

/// Replaces each value v by 10ˣ with x = a − v, where a is the element of `from`. x is clamped to −37 to 37.
///
/// Relative error below 3·10⁻⁷.
#[multiversion(targets = "simd")]
pub fn exp10_from(from: &[f32], values: &mut [f32]) {
    for (value, from) in values.iter_mut().zip(from) {
        *value = exp10_one(from - *value);
    }
}

/// 1.5·2²³: adding it rounds to an integer, which the lowest bits then hold.
const ROUND: f32 = 12_582_912.0;

#[inline(always)]
fn exp10_one(x: f32) -> f32 {
    /// log₁₀ 2 in two parts, the first short enough that its products with integers are exact.
    const LOG10_2_HIGH: f32 = 77.0 / 256.0;
    const LOG10_2_LOW: f32 = 2.487_456_6e-4;
    let x = x.clamp(-37.0, 37.0);
    let shifted = x * core::f32::consts::LOG2_10 + ROUND;
    let whole = shifted - ROUND;
    // The remainder of x, within ±½ log₁₀ 2: the first difference is exact.
    let rest = (x - whole * LOG10_2_HIGH) - whole * LOG10_2_LOW;
    scaled(rest * core::f32::consts::LN_10, shifted)
}

/// Returns eˣ with a relative error below 3·10⁻⁷. x is clamped to −85 to 85.
#[inline(always)]
#[must_use]
pub fn exp_f32(x: f32) -> f32 {
    /// ln 2 in two parts, as above.
    const LN_2_HIGH: f32 = 355.0 / 512.0;
    const LN_2_LOW: f32 = -2.121_944_4e-4;
    let x = x.clamp(-85.0, 85.0);
    let shifted = x * core::f32::consts::LOG2_E + ROUND;
    let whole = shifted - ROUND;
    scaled((x - whole * LN_2_HIGH) - whole * LN_2_LOW, shifted)
}

/// Returns eᵗ·2ⁿ by its Taylor polynomial, for |t| ≤ ½ ln 2; n is the integer in the lowest bits of `shifted`.
#[inline(always)]
fn scaled(t: f32, shifted: f32) -> f32 {
    let p = 1.0
        + t * (1.0
            + t * (0.5
                + t * (1.0 / 6.0 + t * (1.0 / 24.0 + t * (1.0 / 120.0 + t * (1.0 / 720.0 + t * (1.0 / 5040.0)))))));
    p * f32::from_bits((shifted.to_bits() << 23).wrapping_add(1.0_f32.to_bits()))
}

/// Returns eˣ for |x| < 700, with a relative error below 1e-14.
#[inline(always)]
#[must_use]
pub fn exp_f64(x: f64) -> f64 {
    /// As [`ROUND`], in double precision: 1.5·2⁵².
    const ROUND: f64 = 6_755_399_441_055_744.0;
    let shifted = ROUND + x * core::f64::consts::LOG2_E;
    let power = shifted - ROUND;
    let rest = (x - power * 0.693_147_180_369_123_8) - power * 1.908_214_929_270_587_7e-10;
    // Taylor polynomial, for |rest| up to ½ ln 2. Even and odd powers are independent chains.
    let square = rest * rest;
    let (mut even, mut odd) = (1.0 / 479_001_600.0, 1.0 / 39_916_800.0);
    for (a, b) in [(3_628_800.0, 362_880.0), (40_320.0, 5_040.0), (720.0, 120.0), (24.0, 6.0), (2.0, 1.0)] {
        even = even * square + 1.0 / a;
        odd = odd * square + 1.0 / b;
    }
    let e = (even * square + 1.0) + odd * rest;
    e * f64::from_bits((shifted.to_bits() << 52).wrapping_add(1.0_f64.to_bits()))
}

/// Returns the cosine and sine of the angle word · 2π/2³², with an error below 1.2e-7: reduced by the nearest quarter
/// turn, then the polynomials of Cephes' `sinf` and `cosf`.
#[inline(always)]
#[must_use]
pub fn cos_sin_of_turn(word: u32) -> [f32; 2] {
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

/// Returns the natural logarithm of a normal positive number, with an error of 1e-7 (the polynomial of Cephes' `logf`).
#[inline(always)]
#[must_use]
pub fn ln_f32(x: f32) -> f32 {
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
    // ln 2 in two parts; the product of the first with the exponent is exact.
    let low = p * m * square - 2.121_944_4e-4 * exponent - 0.5 * square;
    0.693_359_4 * exponent + (m + low)
}

/// Evaluates a polynomial, highest power first. Even and odd powers are independent chains, which halves the latency.
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

    fn exp10(x: f32) -> f32 {
        let mut value = [0.0];
        exp10_from(&[x], &mut value);
        value[0]
    }

    #[test]
    fn exponentials_agree_with_libm() {
        for (found, exact, inputs, step) in [
            (exp10 as fn(f32) -> f32, libm::exp10 as fn(f64) -> f64, -60_000..10_000, 1.01e-4),
            (exp_f32, libm::exp, -84_000..84_000, 1.003e-3),
        ] {
            for x in inputs.map(|i| i as f32 * step) {
                let error = f64::from(found(x)) / exact(f64::from(x)) - 1.0;
                assert!(error.abs() < 3e-7, "{x}: error {error}");
            }
            assert!(found(0.0) == 1.0 && found(-1e9) > 0.0 && found(-1e9) < 1.3e-37 && found(1e9).is_finite());
        }
        for x in (-20_000..20_000).map(|i| f64::from(i) * 0.02) {
            assert!((exp_f64(x) / libm::exp(x) - 1.0).abs() < 1e-14, "{x}");
        }
    }

    #[test]
    fn cosines_and_sines_agree_with_libm() {
        for i in 0..2_000_000_u32 {
            let word = i.wrapping_mul(2_147_483_629).wrapping_add(i >> 3);
            let angle = f64::from(word) * core::f64::consts::TAU / 4_294_967_296.0;
            let [cosine, sine] = cos_sin_of_turn(word).map(f64::from);
            assert!((cosine - libm::cos(angle)).abs() < 1.2e-7, "{word}: {cosine}");
            assert!((sine - libm::sin(angle)).abs() < 1.2e-7, "{word}: {sine}");
        }
        assert_eq!([0, 1 << 30, 2 << 30, 3 << 30].map(cos_sin_of_turn), [[1., 0.], [-0., 1.], [-1., -0.], [0., -1.]]);
    }

    #[test]
    fn ln_agrees_with_libm() {
        for i in 1..1_000_000_u32 {
            let x = i as f32 * 1e-6;
            let exact = libm::log(f64::from(x));
            assert!((f64::from(ln_f32(x)) - exact).abs() < 1.2e-7 * exact.abs() + 1e-8, "{x}");
        }
    }
}
