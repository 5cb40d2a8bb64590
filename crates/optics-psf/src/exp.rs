//! Powers over rows of samples with the same bits everywhere: only multiplications, additions and conversions, no fused
//! operation and no library function.

use multiversion::multiversion;

/// Absorbed share of the light, 1 − 10^(−A), from absorbance A (Eq. 11). Relative error of 10^(−A) below 3e-7.
#[multiversion(targets = "simd")]
pub(crate) fn absorbed(values: &mut [f32]) {
    for value in values {
        *value = 1.0 - exp(-*value * core::f32::consts::LN_10);
    }
}

/// exp x, x in −80 to 80. Relative error below 3e-7.
#[inline(always)]
pub(crate) fn exp(x: f32) -> f32 {
    /// ln 2 in two parts, the first short enough that its products with whole numbers are exact.
    const LN_2_HIGH: f32 = 355.0 / 512.0;
    const LN_2_LOW: f32 = -2.121_944_4e-4;
    /// 1.5·2²³: adding it rounds to a whole number, which the lowest bits then hold.
    const ROUND: f32 = 12_582_912.0;
    let x = x.clamp(-80.0, 80.0);
    let shifted = x * core::f32::consts::LOG2_E + ROUND;
    let whole = shifted - ROUND;
    // What is left of x, from −½ ln 2 to ½ ln 2: the first difference is exact.
    let t = (x - whole * LN_2_HIGH) - whole * LN_2_LOW;
    let p = 1.0
        + t * (1.0
            + t * (0.5 + t * (1.0 / 6.0 + t * (1.0 / 24.0 + t * (1.0 / 120.0 + t * (1.0 / 720.0 + t / 5040.0))))));
    p * f32::from_bits((shifted.to_bits() << 23).wrapping_add(1.0_f32.to_bits()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agree_with_the_library_functions() {
        let values: Vec<f32> = (-8000..8000).map(|i| i as f32 * 0.01).collect();
        for x in &values {
            let y = exp(*x);
            let exact = libm::exp(f64::from(*x));
            assert!((f64::from(y) / exact - 1.0).abs() < 3e-7, "exp {x} = {y}");
        }
        let absorbance: Vec<f32> = (0..6000).map(|i| i as f32 * 0.001).collect();
        let mut shares = absorbance.clone();
        absorbed(&mut shares);
        for (a, share) in absorbance.iter().zip(&shares) {
            assert!((f64::from(*share) - (1.0 - libm::exp10(-f64::from(*a)))).abs() < 3e-7, "{a}");
        }
        assert_eq!(shares[0], 0.0);
    }
}
