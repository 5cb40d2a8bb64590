//! Statistics of small sets of numbers. Sums run in the order of the values.

/// Returns the mean; NaN for an empty slice.
#[must_use]
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Returns the sample standard deviation, with the denominator n − 1; NaN for fewer than two values.
#[must_use]
pub fn deviation(values: &[f64]) -> f64 {
    let mean = mean(values);
    let sum: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
    (sum / (values.len() as f64 - 1.0).max(0.0)).sqrt()
}

/// Returns the `q`-quantile, q from 0 to 1, with linear interpolation between neighbours; NaN for an empty slice. Sorts
/// the values.
pub fn quantile(values: &mut [f64], q: f64) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    quantile_of_sorted(values, q)
}

/// Returns the `q`-quantile of values in ascending order; see [`quantile`].
#[must_use]
pub fn quantile_of_sorted(values: &[f64], q: f64) -> f64 {
    let Some(last) = values.len().checked_sub(1) else { return f64::NAN };
    let place = q.clamp(0.0, 1.0) * last as f64;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to the last index")]
    let i = (place as usize).min(last);
    let next = values[(i + 1).min(last)];
    values[i] + (place - i as f64) * (next - values[i])
}

/// Returns the median; NaN for an empty slice. Sorts the values.
pub fn median(values: &mut [f64]) -> f64 {
    quantile(values, 0.5)
}

/// Returns Pearson's correlation coefficient; 0 if either sample is constant.
#[must_use]
pub fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let (mean_a, mean_b) = (mean(a), mean(b));
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (x, y) in a.iter().zip(b) {
        ab += (x - mean_a) * (y - mean_b);
        aa += (x - mean_a) * (x - mean_a);
        bb += (y - mean_b) * (y - mean_b);
    }
    if aa * bb > 0.0 { ab / (aa * bb).sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_interpolate_between_neighbours() {
        assert_eq!(quantile(&mut [4.0, 1.0, 2.0, 3.0], 0.5), 2.5);
        assert_eq!([0.0, 1.0, 9.0].map(|q| quantile(&mut [4.0, 1.0], q)), [1.0, 4.0, 4.0]);
        assert_eq!(quantile_of_sorted(&[3.0], 0.25), 3.0);
        assert_eq!(quantile_of_sorted(&[1.0, 2.0, 4.0], 0.75), 3.0);
        assert_eq!(median(&mut [4.0, 1.0, 2.0]), 2.0);
    }

    #[test]
    fn moments_and_correlations_of_small_samples_are_exact() {
        assert_eq!((mean(&[1.0, 2.0, 6.0]), deviation(&[1.0, 3.0])), (3.0, 2.0_f64.sqrt()));
        assert!((correlation(&[1.0, 2.0, 3.0], &[5.0, 3.0, 1.0]) + 1.0).abs() < 1e-12);
        assert_eq!(correlation(&[1.0, 1.0], &[1.0, 2.0]), 0.0);
    }

    #[test]
    fn undefined_statistics_are_nan() {
        let values = [mean(&[]), deviation(&[]), deviation(&[1.0]), median(&mut [])];
        assert!(values.iter().all(|v| v.is_nan()), "{values:?}");
    }
}
