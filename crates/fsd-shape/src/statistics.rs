//! The statistics of a shape model: numbers that describe a population of outlines.

use crate::Error;
use crate::outline::Point;
use crate::sample::FleishmanPolynomial;
use crate::steps;

/// Maximum number of harmonics, far above that of any outline; limits the memory for invalid files.
const MAX_HARMONICS: usize = 4096;

/// Statistics of the normalised descriptors (Eq. 3) of a population of outlines, from which new ones can be drawn.
///
/// A shape is a vector of *coordinates*, Re u₋ₕ, Im u₋ₕ, …, Re uₕ, Im uₕ without u₀: four times `harmonics` numbers in
/// units of |u₁|. It is drawn as
///
/// ```text
/// x = mean + R · (Σ scoreₖ · loadingₖ + residual_sd · normal)
/// ```
///
/// A residual in steps is transformed to descriptors first. Scores have mean 0, variance 1, and the skewness and
/// kurtosis of their component. R is the roughness: for |l| ≥ 2 a factor for each shape, of mean square 1, and for the
/// fine detail |l| > harmonics / 5 a random modulation along the outline.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct ShapeStatistics {
    /// Highest |l|, 1..=4096.
    pub harmonics: usize,
    /// Number of training outlines; for information.
    pub outlines: usize,
    /// Mean of ln |u₁|, |u₁| in px.
    pub ln_radius_mean: f64,
    /// Standard deviation of ln |u₁|, >= 0.
    pub ln_radius_sd: f64,
    /// Mean of the coordinates.
    pub mean: Vec<f64>,
    /// Principal components in order of descending variance; none in the paper's model.
    pub components: Vec<PrincipalComponent>,
    /// Coordinates in which the residual is independent.
    pub residual: Residual,
    /// Standard deviation of the residual of each coordinate, >= 0.
    pub residual_sd: Vec<f64>,
    /// Standard deviation of the logarithm of the roughness factor of a shape, 0..=1.
    pub roughness_sd: f64,
    /// Standard deviation of the modulation of roughness along an outline, relative to its mean, 0..=1.
    pub local_roughness: f64,
}

/// The coordinates in which the residual of a shape is independent.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Residual {
    /// The descriptors, as in the paper.
    Descriptors,
    /// Steps along the outline: u₁₊ₘ is replaced by the m-th harmonic of the direction of the steps, u₁₋ₘ by that of
    /// their length, for 3 ≤ m < harmonics. The points of a real outline are equidistant, so the second is small; with
    /// independent descriptors it would be as large as the first.
    Steps,
}

/// A principal component of the coordinates of a shape.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct PrincipalComponent {
    /// Direction of the component, with the length of one standard deviation.
    pub loading: Vec<f64>,
    /// Skewness of the score, -2..=2.
    pub skewness: f64,
    /// Excess kurtosis of the score, from 1.7 skewness² - 1 to 12.
    pub excess_kurtosis: f64,
}

impl PrincipalComponent {
    /// Largest |skewness| of a score.
    pub(crate) const MAX_SKEWNESS: f64 = 2.0;
    /// Largest excess kurtosis of a score.
    pub(crate) const MAX_KURTOSIS: f64 = 12.0;

    /// Returns the polynomial that maps a standard normal number to a score; none if the moments are out of range.
    pub(crate) fn polynomial(&self) -> Option<FleishmanPolynomial> {
        let kurtosis = FleishmanPolynomial::min_kurtosis(self.skewness)..=Self::MAX_KURTOSIS;
        let possible = self.skewness.abs() <= Self::MAX_SKEWNESS && kurtosis.contains(&self.excess_kurtosis);
        possible.then(|| FleishmanPolynomial::new(self.skewness, self.excess_kurtosis)).flatten()
    }
}

impl ShapeStatistics {
    /// Returns the statistics with every number rounded to `digits` significant decimal digits (1 to 17), for compact
    /// files.
    ///
    /// Five digits change drawn outlines by less than a hundredth of a pixel per 100 px of radius.
    ///
    /// # Errors
    ///
    /// If `digits` is 0 or above 17.
    pub fn rounded(&self, digits: usize) -> Result<Self, Error> {
        if !(1..=17).contains(&digits) {
            return Err(Error::Parameter { field: "digits", value: digits as f64, accepted: "1 to 17" });
        }
        // Rounds through the decimal representation, which is exact on every platform.
        let round = |v: &mut f64| *v = format!("{v:.*e}", digits - 1).parse().unwrap_or(*v);
        let mut rounded = self.clone();
        let Self { ln_radius_mean, ln_radius_sd, roughness_sd, local_roughness, .. } = &mut rounded;
        [ln_radius_mean, ln_radius_sd, roughness_sd, local_roughness].into_iter().for_each(round);
        rounded.mean.iter_mut().chain(&mut rounded.residual_sd).for_each(round);
        for PrincipalComponent { loading, skewness, excess_kurtosis } in &mut rounded.components {
            loading.iter_mut().chain([&mut *skewness, &mut *excess_kurtosis]).for_each(round);
            // Rounding may reduce the kurtosis below the minimum for its skewness.
            *excess_kurtosis = excess_kurtosis.max(FleishmanPolynomial::min_kurtosis(*skewness));
        }
        Ok(rounded)
    }

    pub(crate) fn coordinates(&self) -> usize {
        4 * self.harmonics
    }

    /// Returns the variance of each coordinate due to the residual.
    pub(crate) fn residual_squares(&self) -> Vec<f64> {
        let mut squares: Vec<f64> = self.residual_sd.iter().map(|sd| sd * sd).collect();
        if self.residual == Residual::Steps {
            steps::squares_from_steps(&mut squares);
        }
        squares
    }

    /// Returns the mean square of each term u₋ₕ … uₕ of a shape.
    pub(crate) fn powers(&self) -> Vec<f64> {
        let mut squares = self.residual_squares();
        for (square, m) in squares.iter_mut().zip(&self.mean) {
            *square += m * m;
        }
        for component in &self.components {
            for (square, v) in squares.iter_mut().zip(&component.loading) {
                *square += v * v;
            }
        }
        let mut powers: Vec<f64> = squares.chunks_exact(2).map(|c| c[0] + c[1]).collect();
        powers.insert(self.harmonics, 0.0);
        powers
    }

    /// Checks the statistics and returns the polynomial of each component.
    pub(crate) fn checked(&self) -> Result<Vec<FleishmanPolynomial>, Error> {
        if !(1..=MAX_HARMONICS).contains(&self.harmonics) {
            return wrong("harmonics", format!("= {}: expected 1 to {MAX_HARMONICS}", self.harmonics));
        }
        check_number("ln_radius_mean", self.ln_radius_mean, -100.0, 100.0)?;
        check_number("ln_radius_sd", self.ln_radius_sd, 0.0, 10.0)?;
        check_number("roughness_sd", self.roughness_sd, 0.0, 1.0)?;
        check_number("local_roughness", self.local_roughness, 0.0, 1.0)?;
        self.check_vector("mean", &self.mean, f64::MIN)?;
        self.check_vector("residual_sd", &self.residual_sd, 0.0)?;
        let polynomial = |(k, component): (usize, &PrincipalComponent)| {
            self.check_vector("components.loading", &component.loading, f64::MIN)?;
            let PrincipalComponent { skewness, excess_kurtosis, .. } = component;
            let accepted = "expected -2 to 2 and 1.7 skewness² - 1 to 12";
            let problem = || {
                format!("[{k}]: skewness {skewness} and excess kurtosis {excess_kurtosis} are out of range: {accepted}")
            };
            component.polynomial().map_or_else(|| wrong("components", problem()), Ok)
        };
        self.components.iter().enumerate().map(polynomial).collect()
    }

    fn check_vector(&self, field: &'static str, values: &[f64], least: f64) -> Result<(), Error> {
        if values.len() != self.coordinates() {
            let problem = format!(
                "has {} numbers: expected {} for {} harmonics",
                values.len(),
                self.coordinates(),
                self.harmonics
            );
            return wrong(field, problem);
        }
        values.iter().try_for_each(|&v| check_number(field, v, least, f64::MAX))
    }
}

fn check_number(field: &'static str, value: f64, least: f64, most: f64) -> Result<(), Error> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    let accepted = match (least == f64::MIN, most == f64::MAX) {
        (true, _) => "a finite number".to_owned(),
        (false, true) => format!("a finite number of at least {least}"),
        (false, false) => format!("{least} to {most}"),
    };
    wrong(field, format!("contains {value}: expected {accepted}"))
}

fn wrong<T>(field: &'static str, problem: String) -> Result<T, Error> {
    Err(Error::Statistics { field, problem })
}

/// Returns |l| of coordinate k.
pub(crate) fn order(k: usize, harmonics: usize) -> usize {
    let place = k / 2;
    if place < harmonics { harmonics - place } else { place + 1 - harmonics }
}

/// Returns the descriptors with these coordinates, with u₀ = 0.
pub(crate) fn terms(coordinates: &[f64]) -> Vec<Point> {
    let mut terms: Vec<Point> = coordinates.chunks_exact(2).map(|c| [c[0], c[1]]).collect();
    terms.insert(terms.len() / 2, [0.0, 0.0]);
    terms
}

/// Returns the highest |l| of the coarse form, a fifth of the harmonics; terms above are detail. For 40 harmonics it is
/// 8, up to which the components explain outlines of cells.
pub(crate) fn finest_coarse(harmonics: usize) -> usize {
    (harmonics / 5).max(1)
}

/// Computes a += weight · b.
pub(crate) fn add_scaled(a: &mut [f64], b: &[f64], weight: f64) {
    for (x, y) in a.iter_mut().zip(b) {
        *x += weight * y;
    }
}
