//! One nucleus of a focus stack.

use portable_numerics::statistics::deviation;
use serde::{Deserialize, Serialize};

/// One nucleus of a focus stack.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Nucleus {
    /// Left, top, width, height, pixels.
    pub window: [usize; 4],
    /// Its plane in focus, counted from 0.
    pub focused: usize,
    /// σ in each plane, pixels.
    pub sigma_px: Vec<f64>,
}

impl Nucleus {
    /// σ in each plane, with the number of planes from focus.
    pub(crate) fn points(&self) -> impl Iterator<Item = (i64, f64)> {
        let focused = self.focused.cast_signed() as i64;
        self.sigma_px.iter().zip(0_i64..).map(move |(sigma, plane)| (plane - focused, *sigma))
    }
}

/// The standard error of a mean; of one number alone nothing is known, and it is 0.
pub(crate) fn standard_error(values: &[f64]) -> f64 {
    if values.len() < 2 { 0.0 } else { deviation(values) / (values.len() as f64).sqrt() }
}
