use super::{Seen, Window, lowest};
use crate::error::require;
use crate::grid::fast_length;
use crate::lane_plane::{LANES, LanePlane, LanePlans, LaneScratch, LaneSupport, Lanes};
use crate::{Border, Error, Microscope, MicroscopeParams};

/// Pixels around the window that the transfer functions see.
const MARGIN_PX: usize = 32;

/// Apertures that are tried, as parts of the objective's: from a tenth on, in steps of a twentieth.
const FIRST: f64 = 0.1;
const STEP: f64 = 0.05;
const TRIED: u32 = 19;

/// What of the focused plane's own transfer counts as noise where it is to be undone.
const NOISE: f64 = 0.1;

/// The condenser's aperture that explains a stack best.
#[derive(Debug, Clone, PartialEq)]
pub struct CondenserFit {
    /// The plane in focus.
    pub focused: usize,
    /// The numerical aperture.
    pub condenser_na: f64,
    /// Apertures that were tried, and the mean difference each leaves.
    pub tried: Vec<[f64; 2]>,
}

/// The condenser's aperture, from a stack of an object taken by moving the stage by `step_um` for each plane through the
/// immersion medium.
///
/// The other planes are computed from the focused one by the ratio of the transfer functions H_A,
/// and the aperture is sought, from a tenth of the objective's to all of it, for which ∑ |difference| over
/// the window and all planes is least. All else, the pixel too, is as `microscope` says; absorption alone
/// counts, so an object that refracts much is no good one.
///
/// # Errors
///
/// As [`focus`](super::focus()); if `step_um` is not above 0 and at most 100, or `microscope` not in order.
///
/// # Panics
///
/// If the images are not whole rows of `width` or differ in size.
pub fn condenser(
    stack: &[&[f32]],
    width: usize,
    window: Window,
    step_um: f64,
    microscope: &MicroscopeParams,
) -> Result<CondenserFit, Error> {
    require("step_um", step_um, step_um > 0.0 && step_um <= 100.0, "above 0 and at most 100")?;
    Microscope::new(microscope)?;
    let seen = Seen::new(stack, width, window, MARGIN_PX)?;
    let Seen { focused, outer, source, .. } = &seen;

    // Reflected, so that the seam of the periodic grid has no step.
    let [wide, high] = [outer.width, outer.height].map(|side| fast_length(2 * side));
    let plane = LanePlane::new(wide, high, &LanePlans::default());
    let support = LaneSupport::new(wide, high, 1.0);
    let (mut scratch, mut spectrum) = (LaneScratch::default(), Vec::new());
    let reflected = |i: usize, len: usize| Border::Reflect.source(i.cast_signed(), len).unwrap_or(0);
    let fill = |left: usize, stripe: &mut [Lanes]| {
        for (y, row) in stripe.iter_mut().enumerate() {
            let from = &source[reflected(y, outer.height) * outer.width..][..outer.width];
            for (x, value) in row.as_flattened_mut().iter_mut().enumerate() {
                *value = if left + x < wide { from[reflected(left + x, outer.width)] } else { 0.0 };
            }
        }
        true
    };
    plane.forward(&support, fill, &mut spectrum, &mut scratch);
    let frequencies: Vec<[[f64; 2]; LANES]> =
        support.frequencies(wide, high).map(|f| f.map(|f| f.map(|f| f / microscope.pixel_um))).collect();

    let mut tried = Vec::new();
    for i in 0..TRIED {
        let condenser_na = microscope.na * (FIRST + STEP * f64::from(i));
        let candidate = Microscope::new(&MicroscopeParams { condenser_na, ..microscope.clone() })?;
        let rest = candidate.transfer(0.0, 0.0)?;
        let mut sum = 0.0;
        for k in (0..stack.len()).filter(|k| k != focused) {
            let transfer = candidate.transfer(0.0, step_um * (k as f64 - *focused as f64))?;
            let mut filtered = spectrum.clone();
            for (value, frequencies) in filtered.iter_mut().zip(&frequencies) {
                for (l, &f) in frequencies.iter().enumerate() {
                    let ([now, _], [then, _]) = (transfer.absorption(f), rest.absorption(f));
                    #[expect(clippy::cast_possible_truncation, reason = "f32 beside f32 spectra")]
                    let ratio = (now * then * (1.0 + NOISE * NOISE) / (then * then + NOISE * NOISE)) as f32;
                    value[0][l] *= ratio * plane.norm();
                    value[1][l] *= ratio * plane.norm();
                }
            }
            let mut image = vec![0.0; outer.width * outer.height];
            plane.image_into(&support, &filtered, outer.width, &mut image, &mut scratch);
            sum += seen.difference(&image, k);
        }
        tried.push([condenser_na, sum / (stack.len() - 1) as f64]);
    }
    let (steps, _) = lowest(&tried.iter().map(|t| t[1]).collect::<Vec<_>>());
    Ok(CondenserFit { focused: *focused, condenser_na: microscope.na * (FIRST + STEP * steps), tried })
}
