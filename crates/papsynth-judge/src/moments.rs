//! The paper's comparison of nuclear textures.

use crate::number::{nearest, whole};

/// Grey levels of a histogram.
const LEVELS: usize = 256;

/// How often each grey level of 8 bits occurs, as parts of 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Histogram {
    parts: Vec<f64>,
}

impl Histogram {
    /// Counts grey levels 0 to 255; what lies between two counts to the nearer.
    pub fn new(grey: impl Iterator<Item = f32>) -> Self {
        let mut parts = vec![0.0; LEVELS];
        let mut count = 0.0;
        for level in grey {
            parts[nearest(f64::from(level)).min(LEVELS - 1)] += 1.0;
            count += 1.0;
        }
        if count > 0.0 {
            parts.iter_mut().for_each(|p| *p /= count);
        }
        Self { parts }
    }

    /// Eq. 18: m = Σᵢ zᵢ p(zᵢ).
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.parts.iter().enumerate().map(|(z, p)| z as f64 * p).sum()
    }

    /// Eq. 17: μₙ = Σᵢ (zᵢ − m)ⁿ p(zᵢ).
    #[must_use]
    pub fn moment(&self, n: i32) -> f64 {
        let mean = self.mean();
        let power = |d: f64| (0..n).fold(1.0, |product, _| product * d);
        self.parts.iter().enumerate().map(|(z, p)| power(z as f64 - mean) * p).sum()
    }

    /// The logarithm to base 10 of 1 + |μₙ|, with the sign of μₙ: the odd ones have either.
    #[must_use]
    pub fn log_moment(&self, n: i32) -> f64 {
        let moment = self.moment(n);
        libm::log10(1.0 + moment.abs()) * moment.signum()
    }

    /// Eq. 19: H = −Σᵢ p(zᵢ) log₂ p(zᵢ), bits.
    #[must_use]
    pub fn entropy(&self) -> f64 {
        -self.parts.iter().filter(|p| **p > 0.0).map(|p| p * libm::log2(*p)).sum::<f64>()
    }
}
