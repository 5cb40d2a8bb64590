//! The condenser's aperture, from the sharpest nuclei of a stack.

use optics_psf::MicroscopeParams;
use optics_psf::calibrate::{self, Window};
use portable_numerics::statistics::median;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::error::Error;
use crate::instrument::Instrument;
use crate::nucleus::{Nucleus, standard_error};

/// Nuclei from which the condenser is sought, planes on each side that are compared, and the blur of the last of them:
/// each nucleus takes as long as all the rest, and more no longer help.
const MOST_NUCLEI: usize = 5;
const MOST_PLANES: usize = 4;
const MOST_BLUR_PX: f64 = 4.0;

/// Pairs of planes, one on each side, from which it is sought where there is one nucleus alone.
const MOST_PAIRS: usize = 5;

/// Apertures at the ends of what [`calibrate::condenser`] tries, as parts of the objective's.
const FIRST_TRIED: f64 = 0.1;
const LAST_TRIED: f64 = 1.0;

/// How well it is known between two apertures that are tried, as a part of the objective's: a tenth of their distance.
const BETWEEN_TRIED: f64 = 0.005;

/// The condenser's aperture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Condenser {
    /// Its numerical aperture.
    pub na: f64,
    /// Standard error, from nucleus to nucleus or from distance to distance, and of the search.
    pub error: f64,
    /// Where the search ended at an end of what was tried.
    pub bound: Bound,
}

/// What an estimate says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Bound {
    /// The value lies between the ends of what was tried.
    Inside,
    /// The value is the smallest that was tried.
    AtMost,
    /// The value is the largest that was tried.
    AtLeast,
}

impl Bound {
    /// The words before the value: "at most", "at least", or nothing.
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
    pub(crate) fn seek(
        planes: &[&[f32]],
        width: usize,
        nuclei: &[(Window, Nucleus)],
        step_um: f64,
        instrument: &Instrument,
    ) -> Result<Self, Error> {
        let params = instrument.params(MicroscopeParams::default().condenser_na);
        let seek = |planes: &[&[f32]], window: Window, step_um: f64| {
            let fit = calibrate::condenser(planes, width, window, step_um, &params);
            fit.map(|fit| fit.condenser_na).map_err(Error::Condenser)
        };
        let chosen = &nuclei[..nuclei.len().min(MOST_NUCLEI)];
        let mut all: Vec<f64> = chosen
            .par_iter()
            .map(|(window, nucleus)| {
                let (some, stride) = some_planes(planes, nucleus);
                seek(&some, *window, step_um * stride as f64)
            })
            .collect::<Result<_, _>>()?;
        let error = match chosen {
            [(window, Nucleus { focused, .. })] => {
                // Pairs of planes at the same distance are stacks of their own.
                let farthest = (*focused).min(planes.len() - 1 - focused).min(MOST_PAIRS);
                let pair = |n: usize| [planes[focused - n], planes[*focused], planes[focused + n]];
                let pairs = (1..=farthest).into_par_iter().map(|n| seek(&pair(n), *window, step_um * n as f64));
                standard_error(&pairs.collect::<Result<Vec<f64>, _>>()?)
            }
            _ => standard_error(&all),
        };
        let between = BETWEEN_TRIED * instrument.na;
        let na = median(&mut all);
        let bound = match na / instrument.na {
            part if part <= FIRST_TRIED + f64::EPSILON => Bound::AtMost,
            part if part >= LAST_TRIED - f64::EPSILON => Bound::AtLeast,
            _ => Bound::Inside,
        };
        Ok(Self { na, error: (error * error + between * between).sqrt(), bound })
    }
}

/// A few planes at equal distances around focus, up to where detail is gone, and that distance in planes.
fn some_planes<'a>(planes: &[&'a [f32]], nucleus: &Nucleus) -> (Vec<&'a [f32]>, usize) {
    let focused = nucleus.focused;
    let sides = [focused, planes.len() - 1 - focused];
    let blurred = |n: usize| {
        let at = [focused.checked_sub(n), Some(focused + n)].into_iter().flatten();
        at.filter_map(|i| nucleus.sigma_px.get(i)).copied().fold(0.0, f64::max)
    };
    let reach = (1..=sides[0].max(sides[1])).take_while(|n| blurred(*n) <= MOST_BLUR_PX).last().unwrap_or(1);
    let stride = (reach / MOST_PLANES).clamp(1, sides[0].min(sides[1]));
    let [before, after] = sides.map(|side| (side / stride).min(MOST_PLANES));
    let first = focused - before * stride;
    ((0..=before + after).map(|i| planes[first + i * stride]).collect(), stride)
}
