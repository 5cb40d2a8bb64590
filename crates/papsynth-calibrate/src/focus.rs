//! σ against focus offset, and the condenser's aperture, from a focus stack of nuclei.

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

/// σ at which the search of [`calibrate::focus`] ends, px, less a step of it: what reaches it may be wider.
const WIDEST_PX: f64 = 15.8;

/// Distances from focus that both lines go by at least, where there are so many on both sides.
const LEAST_COMMON: usize = 3;

/// Nuclei that make a median: fewer are no fair sample of many.
const LEAST_NUCLEI: usize = 5;

/// Where the nuclei of a stack lie.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum NucleiAt {
    /// They are found: dark, compact, sharp things.
    #[default]
    Found,
    /// In these windows, each of which must hold one that can be measured.
    Windows(Vec<Window>),
}

/// What is known of a focus stack.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FocusParams {
    /// Where its nuclei lie.
    pub nuclei: NucleiAt,
    /// Travel of the stage from plane to plane, µm, where it is known.
    pub step_um: Option<f64>,
    /// The microscope, where the size of its pixels is known. With it and `step_um` the condenser's aperture is sought.
    pub instrument: Option<Instrument>,
}

/// σ against focus offset.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Focus {
    /// Travel of the stage from plane to plane, where it is known.
    pub step_um: Option<f64>,
    /// The nuclei that could be measured.
    pub nuclei: Vec<Nucleus>,
    /// Their medians, from the first plane to the last.
    pub offsets: Vec<Offset>,
    /// The line before focus.
    pub before: Side,
    /// The line after focus.
    pub after: Side,
    /// σ = k·|n|: pixels a plane, mean of both sides.
    pub proportional_px: f64,
    /// Standard error of that: from nucleus to nucleus, or of the fit if there is one alone.
    pub proportional_error_px: f64,
    /// How much the slopes of both sides differ, as a part of their mean.
    pub asymmetry: f64,
    /// The condenser's aperture, where it was sought.
    pub condenser: Option<Condenser>,
}

/// All nuclei, at one distance from focus.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Offset {
    /// Planes from focus.
    pub planes: i64,
    /// Nuclei that have a plane there.
    pub nuclei: usize,
    /// Median of their σ, pixels.
    pub sigma_px: f64,
    /// Quartiles of their σ, pixels.
    pub quartiles_px: [f64; 2],
    /// Whether the lines go by it.
    pub fitted: bool,
}

/// The line through the medians on one side of focus.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Side {
    /// Pixels a plane.
    pub slope_px: f64,
    /// σ of the line in focus, pixels.
    pub intercept_px: f64,
    /// Pixels a plane of the line through 0.
    pub proportional_px: f64,
    /// The part of the variance that the line explains.
    pub r_squared: f64,
}

impl Side {
    fn through(points: &[[f64; 2]]) -> Self {
        let Line { slope_px, intercept_px, proportional_px } = Line::through(points);
        let mean = points.iter().map(|p| p[1]).sum::<f64>() / points.len() as f64;
        let square = |f: &dyn Fn(&[f64; 2]) -> f64| points.iter().map(|p| f(p) * f(p)).sum::<f64>();
        let (rest, all) = (square(&|p| p[1] - intercept_px - slope_px * p[0]), square(&|p| p[1] - mean));
        let r_squared = if all > 0.0 { 1.0 - rest / all } else { 1.0 };
        Self { slope_px, intercept_px, proportional_px, r_squared }
    }

    /// σ that the line has at a number of planes from focus.
    #[must_use]
    pub fn at(&self, planes: f64) -> f64 {
        self.intercept_px + self.slope_px * planes
    }
}

impl Focus {
    /// Measures the planes of a stack, at equal distances and on both sides of focus, each of rows of `width` pixels.
    ///
    /// # Errors
    /// If there are fewer than 3 planes, no nucleus is found, a window that was given or all that were found cannot be
    /// measured, or the condenser's aperture cannot be found.
    ///
    /// # Panics
    /// If planes differ in size or are not whole rows.
    pub fn measure(planes: &[&[f32]], width: usize, params: &FocusParams) -> Result<Self, Error> {
        if planes.len() < 3 {
            return Err(Error::Planes { planes: planes.len() });
        }
        let FocusParams { nuclei, step_um, instrument } = params;
        let found;
        let (windows, all_must_do) = match nuclei {
            NucleiAt::Windows(windows) => (windows, true),
            NucleiAt::Found => {
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
                Err(source) if all_must_do => return Err(Error::Window { window: *window, source }),
                Err(source) => refused = refused.or(Some(Error::Window { window: *window, source })),
            }
        }
        if measured.is_empty() {
            return Err(refused.unwrap_or(Error::NoNucleus));
        }
        let condenser = match (*step_um, instrument) {
            (Some(step_um), Some(instrument)) => Some(Condenser::seek(planes, width, &measured, step_um, instrument)?),
            _ => None,
        };
        let nuclei = measured.into_iter().map(|(_, nucleus)| nucleus).collect();
        Ok(Self { condenser, ..Self::law(nuclei, *step_um) })
    }

    /// The lines through the medians of all nuclei.
    fn law(nuclei: Vec<Nucleus>, step_um: Option<f64>) -> Self {
        let offsets = medians(&nuclei);
        let fitted = |planes: i64| offsets.iter().any(|o| o.planes == planes && o.fitted);
        let side = |sign: i64| {
            let points = offsets.iter().filter(|o| o.fitted && o.planes * sign > 0);
            Side::through(&points.map(|o| [(o.planes * sign) as f64, o.sigma_px]).collect::<Vec<_>>())
        };
        let (before, after) = (side(-1), side(1));
        let of_each: Vec<f64> = match nuclei.as_slice() {
            // One nucleus: each plane has its say.
            [_] => offsets.iter().filter(|o| o.fitted).map(|o| o.sigma_px / o.planes.abs() as f64).collect(),
            many => many
                .iter()
                .map(|nucleus| nucleus.points().filter(|(n, _)| fitted(*n)))
                .map(|points| points.map(|(n, sigma)| [n.abs() as f64, sigma]).collect::<Vec<_>>())
                .map(|points| Line::through(&points).proportional_px)
                .collect(),
        };
        let steepest = 0.5 * (before.slope_px + after.slope_px);
        Self {
            step_um,
            nuclei,
            offsets,
            before,
            after,
            proportional_px: 0.5 * (before.proportional_px + after.proportional_px),
            proportional_error_px: standard_error(&of_each),
            asymmetry: if steepest > 0.0 { (before.slope_px - after.slope_px).abs() / steepest } else { 0.0 },
            condenser: None,
        }
    }
}

/// Medians and quartiles of all nuclei by their distance from focus, and which of them the lines go by.
fn medians(nuclei: &[Nucleus]) -> Vec<Offset> {
    let mut by_offset: BTreeMap<i64, Vec<f64>> = BTreeMap::new();
    for (planes, sigma) in nuclei.iter().flat_map(Nucleus::points) {
        by_offset.entry(planes).or_default().push(sigma);
    }
    let enough = LEAST_NUCLEI.min(nuclei.len().div_ceil(2));
    let mut offsets: Vec<Offset> = by_offset
        .into_iter()
        .map(|(planes, mut sigmas)| {
            let [low, sigma_px, high] = [0.25, 0.5, 0.75].map(|part| quantile(&mut sigmas, part));
            let fitted = planes != 0 && sigmas.len() >= enough && high < WIDEST_PX;
            Offset { planes, nuclei: sigmas.len(), sigma_px, quartiles_px: [low, high], fitted }
        })
        .collect();
    // Blur is no exact line: the same distances on both sides, or their slopes could not be compared.
    let good: Vec<i64> = offsets.iter().filter(|o| o.fitted).map(|o| o.planes).collect();
    let common: Vec<i64> = good.iter().copied().filter(|n| good.contains(&-n)).collect();
    if common.len() >= 2 * LEAST_COMMON {
        offsets.iter_mut().for_each(|o| o.fitted = common.contains(&o.planes));
    }
    offsets
}
