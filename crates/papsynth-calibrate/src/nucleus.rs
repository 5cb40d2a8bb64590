//! One nucleus of a focus stack.

use portable_numerics::statistics::deviation;
use serde::{Deserialize, Serialize};

/// One nucleus of a focus stack.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Nucleus {
    /// Left, top, width and height, px.
    pub window: [usize; 4],
    /// Index of the plane in focus.
    pub focused: usize,
    /// σ in each plane, px.
    pub sigma_px: Vec<f64>,
}

impl Nucleus {
    /// Returns the number of planes from focus and σ of each plane.
    pub(crate) fn points(&self) -> impl Iterator<Item = (i64, f64)> {
        let focused = self.focused.cast_signed() as i64;
        self.sigma_px.iter().zip(0_i64..).map(move |(sigma, plane)| (plane - focused, *sigma))
    }
}

/// Returns the standard error of the mean, or 0 for fewer than 2 values.
pub(crate) fn standard_error(values: &[f64]) -> f64 {
    if values.len() < 2 { 0.0 } else { deviation(values) / (values.len() as f64).sqrt() }
}
