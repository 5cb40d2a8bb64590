//! From a set of outlines to their statistics.

use portable_numerics::statistics::{deviation, mean};

use crate::coordinates::add_scaled;
use crate::descriptors::Descriptors;
use crate::outline::{Point, count_as_f64, resample, signed_area};
use crate::pca::{dot, mean_of, principal_axes, sd_of};
use crate::roughness::Fine;
use crate::sample::Bend;
use crate::statistics::{PrincipalComponent, Residual, ShapeStatistics};
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
            let value = count_as_f64(params.harmonics);
            return Err(Error::Parameter { field: "harmonics", value, accepted: "1..=4096" });
        }
        if outlines.len() < FEWEST_OUTLINES {
            return Err(Error::TooFewOutlines { count: outlines.len(), needed: FEWEST_OUTLINES });
        }
        let mut ln_radii = Vec::with_capacity(outlines.len());
        let mut shapes = Vec::with_capacity(outlines.len());
        for (index, outline) in outlines.iter().enumerate() {
            let described = describe(outline, params.harmonics)
                .map_err(|source| Error::TrainingOutline { index, source: Box::new(source) })?;
            ln_radii.push(libm::log(described.radius()));
            let shape = described.normalised();
            shapes.push(coordinates(&if lambda.is_some() { shape.aligned() } else { shape }));
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

/// Re u₋ₕ, Im u₋ₕ, … without u₀.
fn coordinates(shape: &Descriptors) -> Vec<f64> {
    shape.each().filter(|&(l, _)| l != 0.0).flat_map(|(_, u)| u).collect()
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
    let n = count_as_f64(scores.len());
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
