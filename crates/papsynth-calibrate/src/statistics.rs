//! How well a mean is known.

use portable_numerics::statistics::deviation;

/// The standard error of a mean; of one number alone nothing is known, and it is 0.
pub(crate) fn standard_error(values: &[f64]) -> f64 {
    if values.len() < 2 { 0.0 } else { deviation(values) / (values.len() as f64).sqrt() }
}
