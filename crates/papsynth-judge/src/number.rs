//! Conversions between numbers that are known to fit.

/// The nearest `f32`.
#[must_use]
#[expect(clippy::cast_possible_truncation, reason = "f32 is what pixels and features are kept in")]
pub fn single(value: f64) -> f32 {
    value as f32
}

/// The whole part of a number that is not negative; 0 for negative ones and NaN.
#[must_use]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates, which is what is wanted")]
pub fn whole(value: f64) -> usize {
    value as usize
}

/// The nearest whole number; 0 for negative ones and NaN.
pub(crate) fn nearest(value: f64) -> usize {
    whole(value + 0.5)
}

/// An index in 32 bits: images have fewer pixels than 2³².
pub(crate) fn id(index: usize) -> u32 {
    u32::try_from(index).unwrap_or(u32::MAX)
}
