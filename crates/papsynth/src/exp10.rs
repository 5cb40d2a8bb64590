//! Powers of ten over rows of pixels, transmittance from absorbance, and exponentials: fast and with the same bits everywhere.

use multiversion::multiversion;

/// Replaces every value v, `from` a, by 10ˣ of x = a − v, for −37 ≤ x ≤ 37 (beyond that by 10⁻³⁷ and 10³⁷).
///
/// Relative error below 3·10⁻⁷. Only multiplications, additions and conversions: no fused operation, no library
/// function, so every instruction set gives the same bits.
#[multiversion(targets = "simd")]
pub(crate) fn exp10_from(from: &[f32], values: &mut [f32]) {
    for (value, from) in values.iter_mut().zip(from) {
        *value = exp10_one(from - *value);
    }
}

/// 1.5·2²³: adding it rounds to a whole number, which the lowest bits then hold.
const ROUND: f32 = 12_582_912.0;

#[inline(always)]
fn exp10_one(x: f32) -> f32 {
    /// log₁₀ 2 in two parts, the first short enough that its products with whole numbers are exact.
    const LOG10_2_HIGH: f32 = 77.0 / 256.0;
    const LOG10_2_LOW: f32 = 2.487_456_6e-4;
    let x = x.clamp(-37.0, 37.0);
    let shifted = x * core::f32::consts::LOG2_10 + ROUND;
    let whole = shifted - ROUND;
    // What is left of x, from −½ log₁₀ 2 to ½ log₁₀ 2: the first difference is exact.
    let rest = (x - whole * LOG10_2_HIGH) - whole * LOG10_2_LOW;
    scaled(rest * core::f32::consts::LN_10, shifted)
}

/// eˣ for −85 ≤ x ≤ 85 (beyond that e⁻⁸⁵ and e⁸⁵), relative error below 3·10⁻⁷. To be called in loops over pixels.
#[inline(always)]
pub(crate) fn exp(x: f32) -> f32 {
    /// ln 2 in two parts, as above.
    const LN_2_HIGH: f32 = 355.0 / 512.0;
    const LN_2_LOW: f32 = -2.121_944_4e-4;
    let x = x.clamp(-85.0, 85.0);
    let shifted = x * core::f32::consts::LOG2_E + ROUND;
    let whole = shifted - ROUND;
    scaled((x - whole * LN_2_HIGH) - whole * LN_2_LOW, shifted)
}

/// eᵗ·2ⁿ by its Taylor polynomial, for |t| ≤ ½ ln 2; n is the whole number that the lowest bits of `shifted` hold.
#[inline(always)]
fn scaled(t: f32, shifted: f32) -> f32 {
    let p = 1.0
        + t * (1.0
            + t * (0.5
                + t * (1.0 / 6.0 + t * (1.0 / 24.0 + t * (1.0 / 120.0 + t * (1.0 / 720.0 + t * (1.0 / 5040.0)))))));
    p * f32::from_bits((shifted.to_bits() << 23).wrapping_add(1.0_f32.to_bits()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn exp10(values: &mut [f32]) {
        let from = values.to_vec();
        values.fill(0.0);
        exp10_from(&from, values);
    }

    #[test]
    fn agrees_with_the_library_function() {
        let mut values: Vec<f32> = (-60_000..10_000).map(|i| i as f32 * 1e-4 * 1.01).collect();
        let inputs = values.clone();
        exp10(&mut values);
        for (x, y) in inputs.iter().zip(&values) {
            let exact = libm::exp10(f64::from(*x));
            let error = (f64::from(*y) - exact).abs() / exact;
            assert!(error < 3e-7, "10^{x} = {y}, error {error}");
        }
    }

    #[test]
    fn exponentials_agree_with_the_library_function() {
        for x in (-84_000..84_000).map(|i| i as f32 * 1.003e-3) {
            let exact = libm::exp(f64::from(x));
            let error = (f64::from(exp(x)) - exact).abs() / exact;
            assert!(error < 3e-7, "e^{x}: error {error}");
        }
        assert!(exp(0.0) == 1.0 && exp(-1e9) > 0.0 && exp(-1e9) < 1.3e-37 && exp(1e9).is_finite());
    }

    #[test]
    fn ends_and_zero_are_right() {
        let mut values = [0.0, -100.0, 100.0, 1.0, -1.0];
        exp10(&mut values);
        assert_eq!(values[0], 1.0);
        assert!(values[1] > 0.0 && values[1] < 1.1e-37 && values[2] > 0.9e37 && values[2].is_finite());
        assert!((values[3] - 10.0).abs() < 3e-6 && (values[4] - 0.1).abs() < 3e-8);
    }
}
