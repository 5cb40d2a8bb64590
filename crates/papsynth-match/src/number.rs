//! Conversions that are known to fit, and rounding.

/// The nearest `f32`.
#[expect(clippy::cast_possible_truncation, reason = "f32 is what pixels are kept in")]
pub(crate) fn single(value: f64) -> f32 {
    value as f32
}

/// The whole part of a number; 0 for negative ones and NaN.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates, which is what is wanted")]
pub(crate) fn whole(value: f64) -> usize {
    value as usize
}

/// To so many digits, as recipes are read by people.
pub(crate) fn rounded(value: f64, digits: i32) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let scale = libm::pow(10.0, f64::from(digits) - libm::ceil(libm::log10(value.abs())));
    libm::round(value * scale) / scale
}
