//! From a set of outlines to their statistics.

use nalgebra::DMatrix;
use portable_numerics::statistics::{deviation, mean};

use crate::descriptors::Descriptors;
use crate::outline::{Point, resample, signed_area};
use crate::roughness::{Fine, dot};
use crate::sample::Bend;
use crate::statistics::{PrincipalComponent, Residual, ShapeStatistics, add_scaled};
use crate::steps::to_steps;
use crate::{Error, ShapeModel};

/// Fewest outlines to fit a model to: fewer have no spread.
const FEWEST_OUTLINES: usize = 3;
/// Fewest outlines whose third and fourth moments and roughness are believed.
const ENOUGH_FOR_MOMENTS: usize = 30;
/// Standard errors by which a skewness or kurtosis must differ from 0 to be kept.
const NOTABLE: f64 = 1.0;
/// Share of the variance that the kept components explain; the rest goes into the residual. 1 % of the variance is a
/// tenth of the standard deviation, about what the shrinkage blurs anyway, and it halves the size of the model.
const EXPLAINED: f64 = 0.99;
/// Points per harmonic at which outlines are sampled: descriptors of a polygon fall with l², so at 8 points a harmonic, aliases are below 2 %.
const POINTS_PER_HARMONIC: usize = 8;
/// Fewest points at which outlines are sampled.
const FEWEST_SAMPLES: usize = 256;

/// What kind of model to fit.
#[derive(Clone, Debug, PartialEq)]
pub struct ShapeModelParams {
    /// Highest |l| of the descriptors kept, 1..=4096. The paper names none; the authors' programs keep 4 for nuclei and all for
    /// cytoplasm. Default 40 (ours), for cytoplasm; 4 to 10 for nuclei, whose masks show no more.
    pub harmonics: usize,
    /// How shapes vary. Default `Spread::Shrinkage { lambda: 0.1 }` (ours).
    pub spread: Spread,
}

impl Default for ShapeModelParams {
    fn default() -> Self {
        Self { harmonics: 40, spread: Spread::Shrinkage { lambda: 0.1 } }
    }
}

impl ShapeModelParams {
    /// The paper's nuclei: independent normals for each descriptor up to |l| = 4.
    pub fn paper_nucleus() -> Self {
        Self { harmonics: 4, spread: Spread::Independent }
    }

    /// The paper's cytoplasm: independent normals for each descriptor of 420 points, all of them (|l| ≤ 209).
    pub fn paper_cytoplasm() -> Self {
        Self { harmonics: 209, spread: Spread::Independent }
    }
}

/// How descriptors vary from shape to shape.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Spread {
    /// The paper ("Shape generation"): a mean and a standard deviation for each descriptor, real and imaginary part, drawn independently.
    /// Neither start point nor rotation is normalised, so outlines must be given in a common pose for the means to be worth much.
    Independent,
    /// Ours: outlines are aligned first; their coordinates vary together along principal components, whose scores keep skewness and tails; the
    /// covariance is shrunk towards its diagonal; roughness varies from shape to shape and along the outline.
    Shrinkage {
        /// Weight of the diagonal, 0..=1. 0 draws only combinations of the components, 1 independent coordinates. Default 0.1 (ours): the
        /// sample covariance of n outlines has rank n - 1, and without shrinkage a draw could do nothing they did not.
        lambda: f64,
    },
}

impl ShapeModel {
    /// Fits a model to outlines in a common scale: closed polygons of any number of points, in either direction.
    ///
    /// Each is resampled at equal arc length, turned to positive area, and described by Eqs. 2 and 3.
    ///
    /// # Errors
    ///
    /// If a parameter is out of range, there are fewer than 3 outlines, or one of them is unusable.
    pub fn fit(outlines: &[Vec<Point>], params: &ShapeModelParams) -> Result<Self, Error> {
        let lambda = match params.spread {
            Spread::Independent => None,
            Spread::Shrinkage { lambda } if (0.0..=1.0).contains(&lambda) => Some(lambda),
            Spread::Shrinkage { lambda } => {
                return Err(Error::Parameter { field: "lambda", value: lambda, accepted: "0..=1" });
            }
        };
        if !(1..=4096).contains(&params.harmonics) {
            let value = params.harmonics as f64;
            return Err(Error::Parameter { field: "harmonics", value, accepted: "1..=4096" });
        }
        if outlines.len() < FEWEST_OUTLINES {
            return Err(Error::TooFewOutlines { count: outlines.len(), needed: FEWEST_OUTLINES });
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
            shapes.push(shape.each().filter(|&(l, _)| l != 0.0).flat_map(|(_, u)| u).collect());
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
            correlate(&mut statistics, &shapes, lambda);
            let fine = Fine::new(&shapes, params.harmonics).filter(|_| shapes.len() >= ENOUGH_FOR_MOMENTS);
            if let Some(fine) = fine {
                statistics.roughness_sd = fine.roughness_sd(&statistics);
                statistics.local_roughness = fine.local_roughness();
            }
        }
        Self::from_statistics(statistics)
    }
}

/// Descriptors of one outline in the model's terms: positive area, equal arc length.
fn describe(outline: &[Point], harmonics: usize) -> Result<Descriptors, Error> {
    // Looks at the points before they are resampled, so that what is wrong is named by its own index.
    Descriptors::from_outline(outline)?;
    let samples = (POINTS_PER_HARMONIC * harmonics).next_power_of_two().max(FEWEST_SAMPLES);
    let mut points = resample(outline, samples);
    if signed_area(&points) < 0.0 {
        // The start point stays.
        points[1..].reverse();
    }
    Ok(Descriptors::from_outline(&points)?.truncated(harmonics))
}

/// Shrinkage: Σ = (1 − λ) S + λ diag S, the diagonal taken in directions and steps; as components of (1 − λ) S and residuals
/// that restore the diagonal.
fn correlate(statistics: &mut ShapeStatistics, deviations: &[Vec<f64>], lambda: f64) {
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
        let (skewness, excess_kurtosis) = notable_moments(&scores);
        let scale = sd * (1.0 - lambda).sqrt();
        let loading = axis.direction.iter().map(|v| v * scale).collect();
        statistics.components.push(PrincipalComponent { loading, skewness, excess_kurtosis });
    }
    // What the components leave of the variance of each direction and step.
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

/// Skewness and excess kurtosis (the unbiased estimators G₁ and G₂) of standardised scores, as far as they stand out from
/// their standard errors, and within what a draw can follow.
fn notable_moments(scores: &[f64]) -> (f64, f64) {
    if scores.len() < ENOUGH_FOR_MOMENTS {
        return (0.0, 0.0);
    }
    let n = scores.len() as f64;
    let power = |k: i32| scores.iter().map(|&s| (0..k).fold(1.0, |product, _| product * s)).sum::<f64>() / n;
    let variance = power(2);
    let g1 = power(3) / (variance * variance.sqrt());
    let g2 = power(4) / (variance * variance) - 3.0;
    let skewness = g1 * (n * (n - 1.0)).sqrt() / (n - 2.0);
    let kurtosis = (n - 1.0) / ((n - 2.0) * (n - 3.0)) * ((n + 1.0) * g2 + 6.0);
    let notable = |value: f64, error: f64| {
        if value.abs() > NOTABLE * error { value } else { 0.0 }
    };
    let skewness = notable(skewness, (6.0 / n).sqrt())
        .clamp(-PrincipalComponent::MOST_SKEWNESS, PrincipalComponent::MOST_SKEWNESS);
    let kurtosis =
        notable(kurtosis, (24.0 / n).sqrt()).clamp(Bend::least_kurtosis(skewness), PrincipalComponent::MOST_KURTOSIS);
    (skewness, kurtosis)
}

/// A direction of unit length and the variance along it.
struct Axis {
    variance: f64,
    direction: Vec<f64>,
}

/// Axes of the sample covariance of `deviations` (rows whose mean is 0), by falling variance; those without variance are left out.
/// The largest entry of a direction is positive.
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
    // What is left of a variance of 0 after rounding; the mean takes one degree of freedom, so there always is one.
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

/// Standard deviation of each column of rows with mean 0.
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
    fn axes_are_eigenvectors_of_the_covariance_whichever_side_is_longer() {
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
