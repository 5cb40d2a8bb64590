//! Fits a shape model to a set of outlines.

use nalgebra::DMatrix;
use portable_numerics::statistics::{deviation, mean};

use crate::descriptors::Descriptors;
use crate::outline::{Point, resample, signed_area};
use crate::roughness::{DetailStatistics, dot};
use crate::sample::FleishmanPolynomial;
use crate::statistics::{PrincipalComponent, Residual, ShapeStatistics, add_scaled};
use crate::steps::to_steps;
use crate::{Error, ShapeModel};

/// Minimum number of outlines of a fit.
const MIN_OUTLINES: usize = 3;
/// Minimum number of outlines for estimates of third and fourth moments and of roughness.
const MIN_OUTLINES_FOR_MOMENTS: usize = 30;
/// Standard errors by which a skewness or kurtosis must differ from 0; others are set to 0.
const MIN_STANDARD_ERRORS: f64 = 1.0;
/// Fraction of the variance that the components explain; the remainder is in the residual. 1 % of the variance is a
/// tenth of the standard deviation, similar to the effect of the shrinkage, and halves the size of the model.
const EXPLAINED: f64 = 0.99;
/// Sample points per harmonic. Descriptors of a polygon decrease with l², so that aliasing is below 2 % with 8 points.
const POINTS_PER_HARMONIC: usize = 8;
/// Minimum number of sample points.
const MIN_SAMPLES: usize = 256;

/// Parameters of a fit.
#[derive(Clone, Debug, PartialEq)]
pub struct ShapeModelParams {
    /// Highest |l| of the descriptors, 1..=4096. The paper states none; the authors' programs use 4 for nuclei and all
    /// for cytoplasm. Default 40 (ours), for cytoplasm; 4 to 10 are sufficient for nuclei.
    pub harmonics: usize,
    /// Model of shape variation. Default `CovarianceModel::Shrinkage { lambda: 0.1 }` (ours).
    pub covariance: CovarianceModel,
}

impl Default for ShapeModelParams {
    fn default() -> Self {
        Self { harmonics: 40, covariance: CovarianceModel::Shrinkage { lambda: 0.1 } }
    }
}

impl ShapeModelParams {
    /// Returns the paper's parameters for nuclei: independent normals for indexed descriptor up to |l| = 4.
    pub fn paper_nucleus() -> Self {
        Self { harmonics: 4, covariance: CovarianceModel::Independent }
    }

    /// Returns the paper's parameters for cytoplasm: independent normals for indexed descriptor of 420 points, all of
    /// them (|l| ≤ 209).
    pub fn paper_cytoplasm() -> Self {
        Self { harmonics: 209, covariance: CovarianceModel::Independent }
    }
}

/// Covariance of the descriptors of a population of shapes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum CovarianceModel {
    /// The paper ("Shape generation"): a mean and a standard deviation for indexed descriptor, real and imaginary part,
    /// drawn independently. Neither start point nor rotation is normalised, so that the means are only meaningful for
    /// outlines in a common pose.
    Independent,
    /// Ours: outlines are aligned, and their coordinates vary jointly along principal components, whose scores have the
    /// skewness and kurtosis of the training set. The covariance is shrunk towards its diagonal. Roughness varies from
    /// shape to shape and along the outline.
    Shrinkage {
        /// Weight of the diagonal, 0..=1. With 0 all draws are combinations of the components, with 1 coordinates are
        /// independent. Default 0.1 (ours): the sample covariance of n outlines only has rank n - 1.
        lambda: f64,
    },
}

impl ShapeModel {
    /// Fits a model to outlines in a common scale: closed polygons of any number of points, in either orientation.
    ///
    /// Each outline is resampled at equal arc length, oriented to positive area, and described by Eqs. 2 and 3.
    ///
    /// # Errors
    ///
    /// If a parameter is out of range, there are fewer than 3 outlines, or an outline is invalid.
    pub fn fit(outlines: &[Vec<Point>], params: &ShapeModelParams) -> Result<Self, Error> {
        let lambda = match params.covariance {
            CovarianceModel::Independent => None,
            CovarianceModel::Shrinkage { lambda } if (0.0..=1.0).contains(&lambda) => Some(lambda),
            CovarianceModel::Shrinkage { lambda } => {
                return Err(Error::Parameter { field: "lambda", value: lambda, accepted: "0..=1" });
            }
        };
        if !(1..=4096).contains(&params.harmonics) {
            let value = params.harmonics as f64;
            return Err(Error::Parameter { field: "harmonics", value, accepted: "1..=4096" });
        }
        if outlines.len() < MIN_OUTLINES {
            return Err(Error::TooFewOutlines { count: outlines.len(), needed: MIN_OUTLINES });
        }
        let mut ln_radii = Vec::with_capacity(outlines.len());
        let mut shapes: Vec<Vec<f64>> = Vec::with_capacity(outlines.len());
        for (index, outline) in outlines.iter().enumerate() {
            let described = describe(outline, params.harmonics)
                .map_err(|source| Error::TrainingOutline { index, source: Box::new(source) })?;
            ln_radii.push(libm::log(described.radius()));
            let shape = described.normalised();
            let shape = if lambda.is_some() { shape.aligned() } else { shape };
            // Re u₋ₕ, Im u₋ₕ, … without u₀.
            shapes.push(shape.indexed().filter(|&(l, _)| l != 0.0).flat_map(|(_, u)| u).collect());
        }
        let mut statistics = ShapeStatistics {
            harmonics: params.harmonics,
            outlines: outlines.len(),
            ln_radius_mean: mean(&ln_radii),
            ln_radius_sd: deviation(&ln_radii),
            mean: mean_of(&shapes),
            components: Vec::new(),
            residual: Residual::Descriptors,
            residual_sd: Vec::new(),
            roughness_sd: 0.0,
            local_roughness: 0.0,
        };
        for shape in &mut shapes {
            add_scaled(shape, &statistics.mean, -1.0);
        }
        statistics.residual_sd = sd_of(&shapes);
        if let Some(lambda) = lambda {
            shrink_covariance(&mut statistics, &shapes, lambda);
            let detail =
                DetailStatistics::new(&shapes, params.harmonics).filter(|_| shapes.len() >= MIN_OUTLINES_FOR_MOMENTS);
            if let Some(detail) = detail {
                statistics.roughness_sd = detail.roughness_sd(&statistics);
                statistics.local_roughness = detail.local_roughness();
            }
        }
        Self::from_statistics(statistics)
    }
}

/// Returns the descriptors of an outline, with positive area and equal arc length.
fn describe(outline: &[Point], harmonics: usize) -> Result<Descriptors, Error> {
    // Validates the points before they are resampled, so that an error has the caller's index.
    Descriptors::from_outline(outline)?;
    let samples = (POINTS_PER_HARMONIC * harmonics).next_power_of_two().max(MIN_SAMPLES);
    let mut points = resample(outline, samples);
    if signed_area(&points) < 0.0 {
        // The start point does not change.
        points[1..].reverse();
    }
    Ok(Descriptors::from_outline(&points)?.truncated(harmonics))
}

/// Applies shrinkage: Σ = (1 − λ) S + λ diag S, with the diagonal in directions and steps. The result is stored as
/// components of (1 − λ) S and residuals that restore the diagonal.
fn shrink_covariance(statistics: &mut ShapeStatistics, deviations: &[Vec<f64>], lambda: f64) {
    let axes = principal_axes(deviations);
    let total: f64 = axes.iter().map(|axis| axis.variance).sum();
    let mut explained = 0.0;
    for axis in axes {
        if explained >= EXPLAINED * total || lambda >= 1.0 {
            break;
        }
        explained += axis.variance;
        let sd = axis.variance.sqrt();
        let scores: Vec<f64> = deviations.iter().map(|row| dot(row, &axis.direction) / sd).collect();
        let (skewness, excess_kurtosis) = significant_moments(&scores);
        let scale = sd * (1.0 - lambda).sqrt();
        let loading = axis.direction.iter().map(|v| v * scale).collect();
        statistics.components.push(PrincipalComponent { loading, skewness, excess_kurtosis });
    }
    // The remaining variance of indexed direction and step.
    let in_steps = |row: &Vec<f64>| {
        let mut row = row.clone();
        to_steps(&mut row);
        row
    };
    statistics.residual = Residual::Steps;
    statistics.residual_sd = sd_of(&deviations.iter().map(in_steps).collect::<Vec<_>>());
    let loadings: Vec<Vec<f64>> = statistics.components.iter().map(|c| in_steps(&c.loading)).collect();
    for (k, sd) in statistics.residual_sd.iter_mut().enumerate() {
        let shared: f64 = loadings.iter().map(|loading| loading[k] * loading[k]).sum();
        *sd = (*sd * *sd - shared).max(0.0).sqrt();
    }
}

/// Returns the skewness and excess kurtosis (the unbiased estimators G₁ and G₂) of standardised scores: 0 unless they
/// exceed their standard errors, and clamped to the accepted range.
fn significant_moments(scores: &[f64]) -> (f64, f64) {
    if scores.len() < MIN_OUTLINES_FOR_MOMENTS {
        return (0.0, 0.0);
    }
    let n = scores.len() as f64;
    let power = |k: i32| scores.iter().map(|&s| (0..k).fold(1.0, |product, _| product * s)).sum::<f64>() / n;
    let variance = power(2);
    let g1 = power(3) / (variance * variance.sqrt());
    let g2 = power(4) / (variance * variance) - 3.0;
    let skewness = g1 * (n * (n - 1.0)).sqrt() / (n - 2.0);
    let kurtosis = (n - 1.0) / ((n - 2.0) * (n - 3.0)) * ((n + 1.0) * g2 + 6.0);
    let significant = |value: f64, error: f64| {
        if value.abs() > MIN_STANDARD_ERRORS * error { value } else { 0.0 }
    };
    let skewness = significant(skewness, (6.0 / n).sqrt())
        .clamp(-PrincipalComponent::MAX_SKEWNESS, PrincipalComponent::MAX_SKEWNESS);
    let kurtosis = significant(kurtosis, (24.0 / n).sqrt())
        .clamp(FleishmanPolynomial::min_kurtosis(skewness), PrincipalComponent::MAX_KURTOSIS);
    (skewness, kurtosis)
}

/// A unit vector and the variance along it.
struct Axis {
    variance: f64,
    direction: Vec<f64>,
}

/// Returns the axes of the sample covariance of `deviations` (rows of mean 0), by descending variance, without those of
/// variance 0. The largest entry of a direction is positive.
fn principal_axes(deviations: &[Vec<f64>]) -> Vec<Axis> {
    let (count, dims) = (deviations.len(), deviations.first().map_or(0, Vec::len));
    let freedom = count as f64 - 1.0;
    let rows = DMatrix::from_fn(count, dims, |i, k| deviations[i][k]);
    // The smaller of YᵀY and YYᵀ: both have the eigenvalues of the covariance, and an eigenvector v of YYᵀ gives Yᵀv.
    // `tr_mul` sums in one order on every processor; `*` does not.
    let (eigen, directions) = if count < dims {
        let columns = rows.transpose();
        let eigen = columns.tr_mul(&columns).symmetric_eigen();
        let directions = rows.tr_mul(&eigen.eigenvectors);
        (eigen.eigenvalues, directions)
    } else {
        let eigen = rows.tr_mul(&rows).symmetric_eigen();
        (eigen.eigenvalues, eigen.eigenvectors)
    };
    // Rounding error of a variance of 0; one variance is always 0, because the mean was subtracted.
    let floor = eigen.max() * f64::EPSILON * count.min(dims) as f64;
    let mut axes: Vec<Axis> = eigen
        .iter()
        .zip(directions.column_iter())
        .filter(|&(&value, _)| value > floor)
        .map(|(value, direction)| {
            let scale = direction[direction.icamax()].signum() / direction.norm();
            Axis { variance: value / freedom, direction: direction.iter().map(|v| v * scale).collect() }
        })
        .collect();
    axes.sort_by(|a, b| b.variance.total_cmp(&a.variance));
    axes
}

fn mean_of(rows: &[Vec<f64>]) -> Vec<f64> {
    let mut mean = vec![0.0; rows[0].len()];
    for row in rows {
        add_scaled(&mut mean, row, 1.0 / rows.len() as f64);
    }
    mean
}

/// Returns the standard deviation of indexed column of rows of mean 0.
fn sd_of(deviations: &[Vec<f64>]) -> Vec<f64> {
    let freedom = deviations.len() as f64 - 1.0;
    (0..deviations[0].len())
        .map(|k| (deviations.iter().map(|row| row[k] * row[k]).sum::<f64>() / freedom).sqrt())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::{Rng, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    #[test]
    fn axes_are_eigenvectors_of_the_covariance() {
        for (count, dims) in [(9, 30), (40, 12), (12, 12), (2, 5)] {
            let mut rng = Xoshiro256PlusPlus::seed_from_u64(0x9CA);
            let mut value = |k: usize| f64::from(rng.next_u32() >> 16) / (k + 1) as f64;
            let mut rows: Vec<Vec<f64>> = (0..count).map(|_| (0..dims).map(&mut value).collect()).collect();
            let mean = mean_of(&rows);
            rows.iter_mut().for_each(|row| add_scaled(row, &mean, -1.0));
            let axes = principal_axes(&rows);
            assert_eq!(axes.len(), dims.min(count - 1));
            assert!(axes.is_sorted_by(|a, b| a.variance >= b.variance));
            let total: f64 = sd_of(&rows).iter().map(|sd| sd * sd).sum();
            assert!((axes.iter().map(|axis| axis.variance).sum::<f64>() / total - 1.0).abs() < 1e-12);
            for Axis { variance, direction } in &axes {
                let mut left: Vec<f64> = direction.iter().map(|v| -variance * v).collect();
                for row in &rows {
                    add_scaled(&mut left, row, dot(row, direction) / (count as f64 - 1.0));
                }
                assert!(dot(&left, &left).sqrt() < 1e-12 * total);
                assert!((dot(direction, direction) - 1.0).abs() < 1e-12);
                assert!(direction.iter().all(|v| v.abs() <= direction.iter().copied().fold(0.0, f64::max)));
            }
        }
    }

    #[test]
    fn equal_rows_have_no_axes() {
        assert!(principal_axes(&[vec![0.0; 4], vec![0.0; 4]]).is_empty());
    }
}
