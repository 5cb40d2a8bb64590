//! σ versus defocus, and the aperture of the condenser, from a focus stack of nuclei.

use std::collections::BTreeMap;

use optics_psf::Error as Optics;
use optics_psf::calibrate::{self, FocusCurve, Line, Window};
use portable_numerics::statistics::quantile;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::condenser::Condenser;
use crate::error::Error;
use crate::find;
use crate::instrument::Instrument;
use crate::nucleus::{Nucleus, standard_error};

/// Largest σ of the search of [`calibrate::focus`] less one step, px. Values at this bound may be larger.
const MAX_SIGMA_PX: f64 = 15.8;

/// Number of common distances on both sides of focus from which only these are fitted.
const MIN_COMMON: usize = 3;

/// Smallest number of fitted distances on a side of focus that has as many.
const MIN_FITTED: usize = 2;

/// Smallest number of nuclei for a representative median.
const MIN_NUCLEI: usize = 5;

/// The positions of the nuclei in a stack.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum NucleiAt {
    /// Automatic detection of dark, compact, sharp objects.
    #[default]
    Detected,
    /// Given windows, each with one nucleus that can be measured.
    Windows(Vec<Window>),
}

/// Parameters of a focus stack.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FocusParams {
    /// Positions of the nuclei.
    pub nuclei: NucleiAt,
    /// Stage step between planes, µm, if known.
    pub step_um: Option<f64>,
    /// The microscope, if its pixel size is known. With it and `step_um`, the aperture of the condenser is estimated.
    pub instrument: Option<Instrument>,
}

/// σ versus defocus.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Focus {
    /// Stage step between planes, µm, if known.
    pub step_um: Option<f64>,
    /// The measured nuclei.
    pub nuclei: Vec<Nucleus>,
    /// Medians of all nuclei, from the first to the last plane.
    pub offsets: Vec<Offset>,
    /// Line fit before focus.
    pub before: LineFit,
    /// Line fit after focus.
    pub after: LineFit,
    /// k of σ = k·|n|, pixels per plane, mean of both sides.
    pub proportional_px: f64,
    /// Standard error of k over nuclei, or over planes if there is one nucleus.
    pub proportional_error_px: f64,
    /// Difference of the slopes of both sides, relative to their mean.
    pub asymmetry: f64,
    /// The aperture of the condenser, if it was estimated.
    pub condenser: Option<Condenser>,
}

/// Statistics of all nuclei at one distance from focus.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Offset {
    /// Number of planes from focus.
    pub planes: i64,
    /// Number of nuclei with a plane at this distance.
    pub nuclei: usize,
    /// Median of σ, px.
    pub sigma_px: f64,
    /// Quartiles of σ, px.
    pub quartiles_px: [f64; 2],
    /// Whether the line fit includes it.
    pub fitted: bool,
}

/// The line fit through the medians on one side of focus.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LineFit {
    /// Slope, pixels per plane.
    pub slope_px: f64,
    /// σ of the line in focus, px.
    pub intercept_px: f64,
    /// Slope of the line through 0, pixels per plane.
    pub proportional_px: f64,
    /// Coefficient of determination R².
    pub r_squared: f64,
}

impl LineFit {
    fn through(points: &[[f64; 2]]) -> Self {
        let Line { slope_px, intercept_px, proportional_px } = Line::through(points);
        let mean = points.iter().map(|p| p[1]).sum::<f64>() / points.len() as f64;
        let square = |f: &dyn Fn(&[f64; 2]) -> f64| points.iter().map(|p| f(p) * f(p)).sum::<f64>();
        let (rest, all) = (square(&|p| p[1] - intercept_px - slope_px * p[0]), square(&|p| p[1] - mean));
        let r_squared = if all > 0.0 { 1.0 - rest / all } else { 1.0 };
        Self { slope_px, intercept_px, proportional_px, r_squared }
    }

    /// Returns σ of the line at a number of planes from focus, px.
    #[must_use]
    pub fn at(&self, planes: f64) -> f64 {
        self.intercept_px + self.slope_px * planes
    }
}

impl Focus {
    /// Measures a stack of planes at equal distances on both sides of focus, each with rows of `width` pixels.
    ///
    /// # Errors
    /// If there are fewer than 3 planes, no nucleus is found, a given window or all detected ones cannot be measured,
    /// the blur of most planes is at the limit of the search, or the aperture of the condenser cannot be estimated.
    ///
    /// # Panics
    /// If planes differ in size or are not complete rows.
    pub fn measure(planes: &[&[f32]], width: usize, params: &FocusParams) -> Result<Self, Error> {
        if planes.len() < 3 {
            return Err(Error::Planes { planes: planes.len() });
        }
        let FocusParams { nuclei, step_um, instrument } = params;
        let found;
        let (windows, all_required) = match nuclei {
            NucleiAt::Windows(windows) => (windows, true),
            NucleiAt::Detected => {
                found = find::nuclei(planes, width, instrument.as_ref().map(|i| i.pixel_um));
                (&found, false)
            }
        };
        let curves: Vec<Result<FocusCurve, Optics>> =
            windows.par_iter().map(|window| calibrate::focus(planes, width, *window)).collect();
        let mut measured = Vec::new();
        let mut refused = None;
        for (window, curve) in windows.iter().zip(curves) {
            match curve {
                Ok(FocusCurve { focused, sigma_px, .. }) => {
                    measured.push((*window, Nucleus { window: find::numbers(*window), focused, sigma_px }));
                }
                Err(source) if all_required => return Err(Error::Window { window: *window, source }),
                Err(source) => refused = refused.or(Some(Error::Window { window: *window, source })),
            }
        }
        if measured.is_empty() {
            return Err(refused.unwrap_or(Error::NoNucleus));
        }
        let focus = Self::fit(measured.iter().map(|(_, nucleus)| nucleus.clone()).collect(), *step_um)?;
        let condenser = match (*step_um, instrument) {
            (Some(step_um), Some(instrument)) => {
                Some(Condenser::estimate(planes, width, &measured, step_um, instrument)?)
            }
            _ => None,
        };
        Ok(Self { condenser, ..focus })
    }

    /// Fits lines through the medians of all nuclei.
    fn fit(nuclei: Vec<Nucleus>, step_um: Option<f64>) -> Result<Self, Error> {
        let offsets = medians(&nuclei)?;
        let fitted = |planes: i64| offsets.iter().any(|o| o.planes == planes && o.fitted);
        let side = |sign: i64| {
            let points = offsets.iter().filter(|o| o.fitted && o.planes * sign > 0);
            LineFit::through(&points.map(|o| [(o.planes * sign) as f64, o.sigma_px]).collect::<Vec<_>>())
        };
        let (before, after) = (side(-1), side(1));
        let of_each: Vec<f64> = match nuclei.as_slice() {
            // With one nucleus, the planes give the standard error.
            [_] => offsets.iter().filter(|o| o.fitted).map(|o| o.sigma_px / o.planes.abs() as f64).collect(),
            many => many
                .iter()
                .map(|nucleus| nucleus.points().filter(|(n, _)| fitted(*n)))
                .map(|points| points.map(|(n, sigma)| [n.abs() as f64, sigma]).collect::<Vec<_>>())
                .map(|points| Line::through(&points).proportional_px)
                .collect(),
        };
        let mean_slope = 0.5 * (before.slope_px + after.slope_px);
        Ok(Self {
            step_um,
            nuclei,
            offsets,
            before,
            after,
            proportional_px: 0.5 * (before.proportional_px + after.proportional_px),
            proportional_error_px: standard_error(&of_each),
            asymmetry: if mean_slope > 0.0 { (before.slope_px - after.slope_px).abs() / mean_slope } else { 0.0 },
            condenser: None,
        })
    }
}

/// Returns medians and quartiles of all nuclei by distance from focus, and selects those for the line fits.
///
/// # Errors
/// If fewer than [`MIN_FITTED`] distances on one side of focus can be fitted, because the blur of the others is at the
/// limit.
fn medians(nuclei: &[Nucleus]) -> Result<Vec<Offset>, Error> {
    let mut by_offset: BTreeMap<i64, Vec<f64>> = BTreeMap::new();
    for (planes, sigma) in nuclei.iter().flat_map(Nucleus::points) {
        by_offset.entry(planes).or_default().push(sigma);
    }
    let enough = MIN_NUCLEI.min(nuclei.len().div_ceil(2));
    let mut offsets: Vec<Offset> = by_offset
        .into_iter()
        .map(|(planes, mut sigmas)| {
            let [low, sigma_px, high] = [0.25, 0.5, 0.75].map(|part| quantile(&mut sigmas, part));
            let fitted = planes != 0 && sigmas.len() >= enough && high < MAX_SIGMA_PX;
            Offset { planes, nuclei: sigmas.len(), sigma_px, quartiles_px: [low, high], fitted }
        })
        .collect();
    let seen = || offsets.iter().filter(|o| o.planes != 0 && o.nuclei >= enough);
    for sign in [-1, 1] {
        let side = || seen().filter(|o| o.planes * sign > 0);
        if side().filter(|o| o.fitted).count() < MIN_FITTED.min(side().count()) {
            let blurred = seen().filter(|o| !o.fitted).count();
            return Err(Error::Blurred { blurred, planes: seen().count() });
        }
    }
    // Blur is not exactly linear: equal distances on both sides make the slopes comparable.
    let good: Vec<i64> = offsets.iter().filter(|o| o.fitted).map(|o| o.planes).collect();
    let common: Vec<i64> = good.iter().copied().filter(|n| good.contains(&-n)).collect();
    if common.len() >= 2 * MIN_COMMON {
        offsets.iter_mut().for_each(|o| o.fitted = common.contains(&o.planes));
    }
    Ok(offsets)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the nuclei of a stack with focus in its middle, with σ given by the distance from focus.
    fn stack(planes: usize, sigma: impl Fn(usize) -> f64) -> Vec<Nucleus> {
        let focused = planes / 2;
        let sigma_px = (0..planes).map(|plane| sigma(plane.abs_diff(focused))).collect();
        vec![Nucleus { window: [0, 0, 9, 9], focused, sigma_px }; 6]
    }

    #[test]
    fn planes_at_the_limit_of_the_search_are_not_a_focus_stack() {
        for planes in 3..12 {
            let unrelated = Focus::fit(stack(planes, |n| if n == 0 { 0.0 } else { 16.0 }), None).unwrap_err();
            let message = format!("the blur of {0} of {0} planes is at the limit of 16 px", planes - 1);
            assert!(unrelated.to_string().starts_with(&message), "{unrelated}");
            let focus = Focus::fit(stack(planes, |n| n as f64), None).unwrap();
            assert!((focus.proportional_px - 1.0).abs() < 1e-9, "{planes}");
        }
        // One distance on each side is enough only if there are no others.
        assert!(Focus::fit(stack(5, |n| if n < 2 { 1.0 } else { 16.0 }), None).is_err());
        Focus::fit(stack(7, |n| if n < 3 { n as f64 } else { 16.0 }), None).unwrap();
    }
}
