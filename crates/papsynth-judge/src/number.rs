//! Conversions between number types.

/// Returns the nearest `f32`.
#[must_use]
#[expect(clippy::cast_possible_truncation, reason = "pixels and features are f32")]
pub fn single(value: f64) -> f32 {
    value as f32
}

/// Returns the integer part; 0 for negative numbers and NaN.
#[must_use]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the conversion saturates")]
pub fn whole(value: f64) -> usize {
    value as usize
}

/// Returns the nearest integer; 0 for negative numbers and NaN.
pub(crate) fn nearest(value: f64) -> usize {
    whole(value + 0.5)
}

/// Returns an index in 32 bits: images have fewer than 2³² pixels.
pub(crate) fn id(index: usize) -> u32 {
    u32::try_from(index).unwrap_or(u32::MAX)
}
