//! The aperture of the condenser, from the sharpest nuclei of a stack.

use optics_psf::MicroscopeParams;
use optics_psf::calibrate::{self, Window};
use portable_numerics::statistics::median;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::error::Error;
use crate::instrument::Instrument;
use crate::nucleus::{Nucleus, standard_error};

/// Largest number of nuclei, of planes on each side, and largest blur of a plane. The fit of each nucleus is slow, and
/// more data does not improve the estimate.
const MAX_NUCLEI: usize = 5;
const MAX_PLANES: usize = 4;
const MAX_BLUR_PX: f64 = 4.0;

/// Largest number of pairs of planes for the standard error with one nucleus.
const MAX_PAIRS: usize = 5;

/// Range of apertures of [`calibrate::condenser`], as fractions of that of the objective.
const MIN_TRIED: f64 = 0.1;
const MAX_TRIED: f64 = 1.0;

/// Precision of the search, as a fraction of the aperture of the objective: a tenth of its step.
const SEARCH_ERROR: f64 = 0.005;

/// The estimated aperture of the condenser.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Condenser {
    /// Numerical aperture.
    pub na: f64,
    /// Standard error over nuclei or distances, including the precision of the search.
    pub error: f64,
    /// Whether the estimate is at a limit of the search.
    pub bound: Bound,
}

/// The position of an estimate in the range of the search.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Bound {
    /// Between the limits.
    Inside,
    /// At the lower limit: the value is an upper bound.
    AtMost,
    /// At the upper limit: the value is a lower bound.
    AtLeast,
}

impl Bound {
    /// Returns the words before the value: "at most", "at least", or an empty string.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Inside => "",
            Self::AtMost => "at most",
            Self::AtLeast => "at least",
        }
    }
}

impl Condenser {
    pub(crate) fn estimate(
        planes: &[&[f32]],
        width: usize,
        nuclei: &[(Window, Nucleus)],
        step_um: f64,
        instrument: &Instrument,
    ) -> Result<Self, Error> {
        let params = instrument.params(MicroscopeParams::default().condenser_na);
        let estimate = |planes: &[&[f32]], window: Window, step_um: f64| {
            let fit = calibrate::condenser(planes, width, window, step_um, &params);
            fit.map(|fit| fit.condenser_na).map_err(Error::Condenser)
        };
        let chosen = &nuclei[..nuclei.len().min(MAX_NUCLEI)];
        let mut all: Vec<f64> = chosen
            .par_iter()
            .map(|(window, nucleus)| {
                let (some, stride) = select_planes(planes, nucleus);
                estimate(&some, *window, step_um * stride as f64)
            })
            .collect::<Result<_, _>>()?;
        let error = match chosen {
            [(window, Nucleus { focused, .. })] => {
                // Each pair of planes at the same distance is a separate stack.
                let farthest = (*focused).min(planes.len() - 1 - focused).min(MAX_PAIRS);
                let pair = |n: usize| [planes[focused - n], planes[*focused], planes[focused + n]];
                let pairs = (1..=farthest).into_par_iter().map(|n| estimate(&pair(n), *window, step_um * n as f64));
                standard_error(&pairs.collect::<Result<Vec<f64>, _>>()?)
            }
            _ => standard_error(&all),
        };
        let search_error = SEARCH_ERROR * instrument.na;
        let na = median(&mut all);
        let bound = match na / instrument.na {
            fraction if fraction <= MIN_TRIED + f64::EPSILON => Bound::AtMost,
            fraction if fraction >= MAX_TRIED - f64::EPSILON => Bound::AtLeast,
            _ => Bound::Inside,
        };
        Ok(Self { na, error: (error * error + search_error * search_error).sqrt(), bound })
    }
}

/// Selects a few planes at equal distances around focus that still show detail. Returns them and their distance in
/// planes.
fn select_planes<'a>(planes: &[&'a [f32]], nucleus: &Nucleus) -> (Vec<&'a [f32]>, usize) {
    let focused = nucleus.focused;
    let sides = [focused, planes.len() - 1 - focused];
    let blurred = |n: usize| {
        let at = [focused.checked_sub(n), Some(focused + n)].into_iter().flatten();
        at.filter_map(|i| nucleus.sigma_px.get(i)).copied().fold(0.0, f64::max)
    };
    let reach = (1..=sides[0].max(sides[1])).take_while(|n| blurred(*n) <= MAX_BLUR_PX).last().unwrap_or(1);
    let stride = (reach / MAX_PLANES).clamp(1, sides[0].min(sides[1]));
    let [before, after] = sides.map(|side| (side / stride).min(MAX_PLANES));
    let first = focused - before * stride;
    ((0..=before + after).map(|i| planes[first + i * stride]).collect(), stride)
}
