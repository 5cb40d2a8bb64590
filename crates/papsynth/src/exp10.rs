//! Powers of ten over rows of pixels: transmittance from absorbance, fast and with the same bits everywhere.

use multiversion::multiversion;

/// Replaces every x by 10ˣ, for −37 ≤ x ≤ 37 (beyond that by 10⁻³⁷ and 10³⁷).
///
/// Relative error below 3·10⁻⁷. Only multiplications, additions and conversions: no fused operation, no library
/// function, so every instruction set gives the same bits.
#[multiversion(targets = "simd")]
pub(crate) fn exp10(values: &mut [f32]) {
    for value in values {
        *value = exp10_one(*value);
    }
}

#[inline(always)]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the exponent is within −127..=127")]
fn exp10_one(x: f32) -> f32 {
    /// log₂ 10 in two parts, the first short enough that its products with whole numbers are exact.
    const LOG2_10_HIGH: f32 = 3.321_289;
    const LOG2_10_LOW: f32 = 6.390_324e-4;
    /// 1.5·2²³: adding and subtracting it rounds to a whole number.
    const ROUND: f32 = 12_582_912.0;
    let x = x.clamp(-37.0, 37.0);
    let whole = (x * (LOG2_10_HIGH + LOG2_10_LOW) + ROUND) - ROUND;
    // What is left of x·log₂10, from −½ to ½. The product x·HIGH is split so that nothing cancels.
    let high = x * LOG2_10_HIGH;
    let lost = product_error(x, LOG2_10_HIGH, high);
    let rest = (high - whole) + (lost + x * LOG2_10_LOW);
    // 2^rest by its Taylor polynomial: (rest·ln 2)ⁿ / n!.
    let t = rest * core::f32::consts::LN_2;
    let p = 1.0
        + t * (1.0
            + t * (0.5
                + t * (1.0 / 6.0 + t * (1.0 / 24.0 + t * (1.0 / 120.0 + t * (1.0 / 720.0 + t * (1.0 / 5040.0)))))));
    let power = f32::from_bits((((whole as i32) + 127) << 23) as u32);
    p * power
}

/// a·b − p for p = a·b rounded, exactly (Veltkamp and Dekker's splitting).
#[inline(always)]
fn product_error(a: f32, b: f32, p: f32) -> f32 {
    /// 2¹² + 1 splits a mantissa of 24 bits in halves.
    const SPLIT: f32 = 4097.0;
    let halves = |v: f32| {
        let c = SPLIT * v;
        let high = c - (c - v);
        (high, v - high)
    };
    let ((ah, al), (bh, bl)) = (halves(a), halves(b));
    ((ah * bh - p) + ah * bl + al * bh) + al * bl
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn ends_and_zero_are_right() {
        let mut values = [0.0, -100.0, 100.0, 1.0, -1.0];
        exp10(&mut values);
        assert_eq!(values[0], 1.0);
        assert!(values[1] > 0.0 && values[1] < 1.1e-37 && values[2] > 0.9e37 && values[2].is_finite());
        assert!((values[3] - 10.0).abs() < 3e-6 && (values[4] - 0.1).abs() < 3e-8);
    }
}
