//! Statistics of numbers, and conversions that are known to fit.

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

/// Mean; NaN of none.
pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Standard deviation of a sample; NaN of fewer than two.
pub(crate) fn deviation(values: &[f64]) -> f64 {
    let m = mean(values);
    let sum: f64 = values.iter().map(|v| (v - m) * (v - m)).sum();
    if values.len() < 2 { f64::NAN } else { (sum / (values.len() - 1) as f64).sqrt() }
}

/// The value below which a part `q` lies, between neighbours in proportion; NaN of none. Sorts the values.
pub(crate) fn quantile(values: &mut [f64], q: f64) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let Some(last) = values.len().checked_sub(1) else { return f64::NAN };
    let place = q.clamp(0.0, 1.0) * last as f64;
    let i = whole(place).min(last);
    values[i] + (place - i as f64) * (values[(i + 1).min(last)] - values[i])
}

/// To so many digits, as recipes are read by people.
pub(crate) fn rounded(value: f64, digits: i32) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let scale = libm::pow(10.0, f64::from(digits) - libm::ceil(libm::log10(value.abs())));
    libm::round(value * scale) / scale
}
