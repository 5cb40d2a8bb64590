//! Rounding of numbers to integers.

/// Rounds a number to the nearest integer, halves away from 0, and clamps it to 0 to 2³² − 1. NaN gives 0.
#[must_use]
pub fn round_to_count(value: f64) -> usize {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the range of u32")]
    let count = libm::round(value).clamp(0.0, f64::from(u32::MAX)) as usize;
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_rounded_and_bounded() {
        let counts = [-3.0, f64::NAN, 0.49, 0.5, 2.5, 1e300].map(round_to_count);
        assert_eq!(counts, [0, 0, 0, 1, 3, u32::MAX as usize]);
    }
}
