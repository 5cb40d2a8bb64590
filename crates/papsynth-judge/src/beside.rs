//! Field statistics of both sides beside each other.

use serde::{Deserialize, Serialize};

use crate::measure::{Field, HISTOGRAM, HISTOGRAM_FROM, HISTOGRAM_STEP, Statistics, frequencies};
use crate::statistics::of_sorted;

/// 10th, 50th and 90th percentile over the fields of a side.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// 10th percentile.
    pub p10: Option<f64>,
    /// Median.
    pub p50: Option<f64>,
    /// 90th percentile.
    pub p90: Option<f64>,
}

impl Spread {
    /// Of what is known.
    pub(crate) fn of(values: impl Iterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.filter(|v| v.is_finite()).collect();
        values.sort_unstable_by(f64::total_cmp);
        let at = |q: f64| (!values.is_empty()).then(|| of_sorted(&values, q));
        Self { p10: at(0.1), p50: at(0.5), p90: at(0.9) }
    }
}

/// A number for every field.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Scalar {
    /// Its name, with its unit where it has one.
    pub name: String,
    /// Over real fields.
    pub real: Spread,
    /// Over synthetic fields.
    pub synthetic: Spread,
    /// Whether the synthetic median lies between the real 10th and 90th percentile; false if either is unknown.
    pub within: bool,
}

/// A curve for every field.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    /// What it shows.
    pub name: String,
    /// What runs along it.
    pub along: String,
    /// Where its points are.
    pub at: Vec<f64>,
    /// Over real fields, point by point.
    pub real: Vec<Spread>,
    /// Over synthetic fields.
    pub synthetic: Vec<Spread>,
}

/// Field statistics of both sides beside each other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Beside {
    /// Single numbers.
    pub scalars: Vec<Scalar>,
    /// Absorbance's histogram and spectrum, cytoplasm from rim to centre.
    pub curves: Vec<Curve>,
}

/// Smaller parts of a field are drawn as this.
const RAREST: f64 = 1e-5;

pub(crate) fn beside(real: &[Field], synthetic: &[Field]) -> Beside {
    let names = real[0].statistics.scalars();
    let scalar = |(i, (name, _)): (usize, &(&str, f64))| {
        let of = |fields: &[Field]| Spread::of(fields.iter().map(|f| f.statistics.scalars()[i].1));
        let (real, synthetic) = (of(real), of(synthetic));
        let within = match (real.p10, real.p90, synthetic.p50) {
            (Some(low), Some(high), Some(middle)) => middle >= low && middle <= high,
            _ => false,
        };
        Scalar { name: (*name).to_owned(), real, synthetic, within }
    };
    let curve = |name: &str, along: &str, at: Vec<f64>, of: &dyn Fn(&Statistics) -> Vec<f64>| {
        let spreads =
            |fields: &[Field]| (0..at.len()).map(|i| Spread::of(fields.iter().map(|f| of(&f.statistics)[i]))).collect();
        Curve { name: name.to_owned(), along: along.to_owned(), real: spreads(real), synthetic: spreads(synthetic), at }
    };
    let bins = (0..HISTOGRAM).map(|i| HISTOGRAM_FROM + (i as f64 + 0.5) * HISTOGRAM_STEP).collect();
    let profile = (0..crate::measure::PROFILE).map(|i| i as f64 + 1.0).collect();
    let rings = frequencies().iter().map(|f| libm::log10(*f)).collect();
    Beside {
        scalars: names.iter().enumerate().map(scalar).collect(),
        curves: vec![
            curve("log10 of the part of the field", "absorbance", bins, &|s| {
                s.histogram.iter().map(|p| libm::log10(p.max(RAREST))).collect()
            }),
            curve("log10 of the power of absorbance", "log10 of cycles a pixel", rings, &|s| s.spectrum.to_vec()),
            curve("absorbance of free cells over their median", "bin from rim to centre", profile, &|s| {
                s.profile.to_vec()
            }),
        ],
    }
}
