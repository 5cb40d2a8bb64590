use super::{Seen, Window, lowest};
use crate::{Border, Error, Gaussian, Scratch};

/// Widest Gaussian that is tried, and the step between two, pixels.
const WIDEST_PX: f64 = 16.0;
const STEP_PX: f64 = 0.2;

/// How far beyond the window the focused plane is looked at: three times the widest.
const MARGIN_PX: usize = 48;

/// Blur against focus offset: the paper's Fig. 10.
#[derive(Debug, Clone, PartialEq)]
pub struct FocusCurve {
    /// The plane in focus: the one with most detail in the window.
    pub focused: usize,
    /// For each plane, σ in pixels of the Gaussian that maps the focused plane to it best; 0 for itself.
    pub sigma_px: Vec<f64>,
    /// For each plane, the mean of what is left between the two.
    pub difference: Vec<f64>,
    /// The line through the planes before the focused one.
    pub before: Line,
    /// The line through those after it.
    pub after: Line,
}

/// σ against the number of planes from focus, |n|.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Pixels per plane, of the line that best fits.
    pub slope_px: f64,
    /// What that line has in focus, pixels.
    pub intercept_px: f64,
    /// Pixels per plane, of the line through 0 that best fits: σ = k·n.
    pub proportional_px: f64,
}

impl Line {
    /// Least squares through points (n, σ).
    ///
    /// With less than two points there is no slope, and it is that through 0.
    #[must_use]
    pub fn through(points: &[[f64; 2]]) -> Self {
        let count = points.len() as f64;
        let sum = |f: fn(&[f64; 2]) -> f64| points.iter().map(f).sum::<f64>();
        let (x, y) = (sum(|p| p[0]), sum(|p| p[1]));
        let (xx, xy) = (sum(|p| p[0] * p[0]), sum(|p| p[0] * p[1]));
        let proportional_px = if xx > 0.0 { xy / xx } else { 0.0 };
        let spread = count * xx - x * x;
        if spread <= 0.0 {
            return Self { slope_px: proportional_px, intercept_px: 0.0, proportional_px };
        }
        let slope_px = (count * xy - x * y) / spread;
        Self { slope_px, intercept_px: (y - slope_px * x) / count, proportional_px }
    }
}

/// σ against focus offset, from a stack of an object: for each plane the Gaussian is sought that, applied to the
/// focused plane, gives the least ∑ |difference| over the window (Fig. 10, Eq. 14), up to 16 pixels.
///
/// # Errors
///
/// If there are less than three planes, the window is not inside the images, there is no detail in it, or
/// the sharpest plane is the first or the last.
///
/// # Panics
///
/// If the images are not whole rows of `width` or differ in size.
///
/// # Differences from the paper
///
/// The paper selects the focused plane by eye.
pub fn focus(stack: &[&[f32]], width: usize, window: Window) -> Result<FocusCurve, Error> {
    let seen = Seen::new(stack, width, window, MARGIN_PX)?;
    let focused = seen.focused;
    let mut differences = vec![Vec::new(); stack.len()];
    let (mut blurred, mut scratch) = (seen.source.clone(), Scratch::new());
    let mut sigma = 0.0;
    while sigma <= WIDEST_PX {
        let gaussian = Gaussian::new(sigma)?;
        gaussian.blur_into(&seen.source, seen.outer.width, Border::Replicate, &mut blurred, &mut scratch);
        for (plane, list) in differences.iter_mut().enumerate() {
            list.push(seen.difference(&blurred, plane));
        }
        sigma += STEP_PX;
    }
    let (steps, difference): (Vec<f64>, Vec<f64>) = differences.iter().map(|list| lowest(list)).unzip();
    let sigma_px: Vec<f64> = steps.iter().map(|s| s * STEP_PX).collect();
    let points =
        |planes: core::ops::Range<usize>| planes.map(|i| [i.abs_diff(focused) as f64, sigma_px[i]]).collect::<Vec<_>>();
    let (before, after) = (Line::through(&points(0..focused)), Line::through(&points(focused + 1..stack.len())));
    Ok(FocusCurve { focused, sigma_px, difference, before, after })
}
