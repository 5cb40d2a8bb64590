//! Measures blur in images: the procedures of the paper, and the aperture of the condenser.
//!
//! - [`focus`]: σ against focus offset, from a focus stack of one object (Fig. 10).
//! - [`edge`]: σ of the image plane, from an edge in focus ("Impulse response").
//! - [`condenser`]: the condenser aperture that fits a focus stack best.
//!
//! Images are intensities in any unit, in rows of `width` pixels.

mod edge;

pub use crate::window::Window;
pub use edge::{EdgeFit, edge};

use crate::error::require;
use crate::grid::fast_length;
use crate::spectrum::{Grid, GridScratch, LANES, LanePlans, Lanes, Pixels, Spectrum, Support};
use crate::{Border, Error, Gaussian, Microscope, MicroscopeParams, Scratch};

/// Smallest width and height of a window, in pixels.
const MIN_SIDE: usize = 8;

impl Window {
    /// Returns an error unless the window lies inside an image and is large enough.
    fn check(self, width: usize, height: usize) -> Result<(), Error> {
        let fits = |from: usize, len: usize, side: usize| len >= MIN_SIDE && from <= side && len <= side - from;
        if fits(self.left, self.width, width) && fits(self.top, self.height, height) {
            Ok(())
        } else {
            Err(Error::Window { window: self, width, height, min_side: MIN_SIDE })
        }
    }

    /// Returns the window grown by `margin` pixels on each side, clipped to the image.
    fn grown(self, margin: usize, width: usize, height: usize) -> Self {
        let (left, top) = (self.left.saturating_sub(margin), self.top.saturating_sub(margin));
        let right = (self.left + self.width + margin).min(width);
        let bottom = (self.top + self.height + margin).min(height);
        Self { left, top, width: right - left, height: bottom - top }
    }

    /// Iterates over the pixels of the window, row by row.
    fn crop(self, image: &[f32], width: usize) -> impl Iterator<Item = f32> {
        let rows = self.top..self.top + self.height;
        rows.flat_map(move |y| &image[y * width + self.left..][..self.width]).copied()
    }
}

/// A window of a focus stack.
struct StackWindow {
    /// Index of the plane with the most detail, neither the first nor the last.
    focused: usize,
    /// The window with a margin, the window relative to it, and the pixels of the focused plane in it.
    outer: Window,
    inner: Window,
    source: Vec<f32>,
    /// Pixels of each plane in the window.
    targets: Vec<Vec<f32>>,
}

impl StackWindow {
    /// # Panics
    ///
    /// See the public functions.
    fn new(stack: &[&[f32]], width: usize, window: Window, margin: usize) -> Result<Self, Error> {
        require("stack", stack.len() as f64, stack.len() >= 3, "at least three planes")?;
        assert!(width > 0 && stack[0].len().is_multiple_of(width), "image lengths must be a multiple of the width");
        assert!(stack.iter().all(|plane| plane.len() == stack[0].len()), "all planes must have the same size");
        let height = stack[0].len() / width;
        window.check(width, height)?;
        let targets: Vec<Vec<f32>> = stack.iter().map(|plane| window.crop(plane, width).collect()).collect();
        let detail: Vec<f64> = targets.iter().map(|target| detail(target, window.width)).collect();
        if detail.iter().any(|d| !d.is_finite()) || detail.iter().all(|d| *d == 0.0) {
            return Err(Error::NothingToMeasure { what: "detail" });
        }
        let focused = (0..detail.len()).max_by(|&a, &b| detail[a].total_cmp(&detail[b])).unwrap_or(0);
        if focused == 0 || focused + 1 == stack.len() {
            return Err(Error::FocusAtStackEnd { sharpest: focused, planes: stack.len() });
        }
        let outer = window.grown(margin, width, height);
        let inner = Window { left: window.left - outer.left, top: window.top - outer.top, ..window };
        Ok(Self { focused, outer, inner, source: outer.crop(stack[focused], width).collect(), targets })
    }

    /// Returns the mean of |a − b| over the window, between an image of the outer window and a plane.
    fn mean_difference(&self, image: &[f32], plane: usize) -> f64 {
        let (inner, target) = (self.inner.crop(image, self.outer.width), &self.targets[plane]);
        inner.zip(target).map(|(a, b)| f64::from((a - b).abs())).sum::<f64>() / target.len() as f64
    }
}

/// Returns the sum of squared differences over two pixels, along x and y.
fn detail(image: &[f32], width: usize) -> f64 {
    let square = |a: f32, b: f32| f64::from(a - b) * f64::from(a - b);
    let along: f64 = image.chunks_exact(width).flat_map(|row| row.windows(3)).map(|w| square(w[0], w[2])).sum();
    let across: f64 = image.iter().zip(&image[2 * width..]).map(|(a, b)| square(*a, *b)).sum();
    along + across
}

/// Returns the position, in steps, and the value of the minimum of a sampled curve, from a parabola through the
/// smallest sample and its neighbours.
fn lowest(samples: &[f64]) -> (f64, f64) {
    let best = (0..samples.len()).min_by(|&a, &b| samples[a].total_cmp(&samples[b])).unwrap_or(0);
    if best == 0 || best + 1 == samples.len() {
        return (best as f64, samples[best]);
    }
    let (a, b, c) = (samples[best - 1], samples[best], samples[best + 1]);
    let bend = a - 2.0 * b + c;
    if bend <= 0.0 {
        return (best as f64, b);
    }
    let shift = 0.5 * (a - c) / bend;
    (best as f64 + shift, b - 0.25 * (a - c) * shift)
}

/// Largest σ of the search, and its step, in pixels.
const WIDEST_PX: f64 = 16.0;
const STEP_PX: f64 = 0.2;

/// Margin around the window in pixels: three times the largest σ.
const BLUR_MARGIN_PX: usize = 48;

/// Blur against focus offset: the paper's Fig. 10.
#[derive(Debug, Clone, PartialEq)]
pub struct FocusCurve {
    /// Index of the plane in focus: the one with the most detail in the window.
    pub focused: usize,
    /// For each plane, σ in pixels of the Gaussian that best maps the focused plane to it; 0 for the focused plane.
    pub sigma_px: Vec<f64>,
    /// For each plane, the mean absolute residual of this fit.
    pub mean_residual: Vec<f64>,
    /// Line through the planes before the focused one.
    pub before: Line,
    /// Line through the planes after the focused one.
    pub after: Line,
}

/// Lines fitted to σ against the number of planes from focus, |n|.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Slope of the least-squares line, in pixels per plane.
    pub slope_px: f64,
    /// Value of this line in focus, in pixels.
    pub intercept_px: f64,
    /// Slope of the least-squares line through 0, σ = k·n, in pixels per plane.
    pub proportional_px: f64,
}

impl Line {
    /// Fits points (n, σ) by least squares.
    ///
    /// With fewer than two distinct n, the slope is that of the line through 0.
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

/// Measures σ against focus offset in a focus stack of one object.
///
/// For each plane the search finds the Gaussian, up to 16 pixels wide, that minimises ∑ |difference| over the window
/// when applied to the focused plane (Fig. 10, Eq. 14). The paper selects the focused plane by eye.
///
/// # Errors
///
/// If there are fewer than three planes, the window is not inside the images or has no detail, or the sharpest plane is
/// the first or the last.
///
/// # Panics
///
/// If the image lengths are not a multiple of `width` or differ.
pub fn focus(stack: &[&[f32]], width: usize, window: Window) -> Result<FocusCurve, Error> {
    let stack_window = StackWindow::new(stack, width, window, BLUR_MARGIN_PX)?;
    let focused = stack_window.focused;
    let mut differences = vec![Vec::new(); stack.len()];
    let (mut blurred, mut scratch) = (stack_window.source.clone(), Scratch::new());
    let mut sigma = 0.0;
    while sigma <= WIDEST_PX {
        let gaussian = Gaussian::new(sigma)?;
        gaussian.blur_into(
            &stack_window.source,
            stack_window.outer.width,
            Border::Replicate,
            &mut blurred,
            &mut scratch,
        );
        for (plane, list) in differences.iter_mut().enumerate() {
            list.push(stack_window.mean_difference(&blurred, plane));
        }
        sigma += STEP_PX;
    }
    let (steps, mean_residual): (Vec<f64>, Vec<f64>) = differences.iter().map(|list| lowest(list)).unzip();
    let sigma_px: Vec<f64> = steps.iter().map(|s| s * STEP_PX).collect();
    let points =
        |planes: core::ops::Range<usize>| planes.map(|i| [i.abs_diff(focused) as f64, sigma_px[i]]).collect::<Vec<_>>();
    let (before, after) = (Line::through(&points(0..focused)), Line::through(&points(focused + 1..stack.len())));
    Ok(FocusCurve { focused, sigma_px, mean_residual, before, after })
}

/// Margin around the window for the transfer functions, in pixels.
const MARGIN_PX: usize = 32;

/// Searched apertures, as fractions of the objective's: from 0.1 in steps of 0.05.
const FIRST_NA: f64 = 0.1;
const STEP_NA: f64 = 0.05;
const TRIED: u32 = 19;

/// Noise level of the focused plane for Wiener deconvolution, relative to full transfer.
const NOISE: f64 = 0.1;

/// The condenser aperture that fits a focus stack best.
#[derive(Debug, Clone, PartialEq)]
pub struct CondenserFit {
    /// Index of the plane in focus.
    pub focused: usize,
    /// Numerical aperture of the condenser.
    pub condenser_na: f64,
    /// Searched apertures, each with its mean absolute difference.
    pub tried: Vec<[f64; 2]>,
}

/// Measures the condenser's aperture from a focus stack of one object, for which the stage moved by `step_um` per plane
/// in the immersion medium.
///
/// The other planes are predicted from the focused one by the ratio of transfer functions H_A. The result is the
/// aperture, from a tenth of the objective's to all of it, that minimises ∑ |difference| over the window and all
/// planes. All other parameters, including the pixel, are those of `microscope`. The model includes absorption only:
/// objects with strong refraction are unsuitable.
///
/// # Errors
///
/// See [`focus`](focus()). Also if `step_um` is not above 0 and at most 100, or `microscope` is invalid.
///
/// # Panics
///
/// If the image lengths are not a multiple of `width` or differ.
pub fn condenser(
    stack: &[&[f32]],
    width: usize,
    window: Window,
    step_um: f64,
    microscope: &MicroscopeParams,
) -> Result<CondenserFit, Error> {
    require("step_um", step_um, step_um > 0.0 && step_um <= 100.0, "above 0 and at most 100")?;
    Microscope::new(microscope)?;
    let stack_window = StackWindow::new(stack, width, window, MARGIN_PX)?;
    let StackWindow { focused, outer, source, .. } = &stack_window;

    // Mirrored, so that the periodic grid has no step at its seam.
    let [wide, high] = [outer.width, outer.height].map(|side| fast_length(2 * side));
    let plane = Grid::new([wide, high], &LanePlans::default());
    let support = Support::new([wide, high], 1.0);
    let (mut scratch, mut spectrum) = (GridScratch::default(), Spectrum::default());
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
    plane.forward(&support, Pixels::Real, fill, &mut spectrum, &mut scratch);
    let frequencies: Vec<[[f64; 2]; LANES]> =
        support.frequencies([wide, high]).map(|f| f.map(|f| f.map(|f| f / microscope.pixel_um))).collect();

    let mut tried = Vec::new();
    for i in 0..TRIED {
        let condenser_na = microscope.na * (FIRST_NA + STEP_NA * f64::from(i));
        let candidate = Microscope::new(&MicroscopeParams { condenser_na, ..microscope.clone() })?;
        let rest = candidate.transfer(0.0, 0.0)?;
        let mut sum = 0.0;
        for k in (0..stack.len()).filter(|k| k != focused) {
            let transfer = candidate.transfer(0.0, step_um * (k as f64 - *focused as f64))?;
            let mut filtered = spectrum.plus.clone();
            for (value, frequencies) in filtered.iter_mut().zip(&frequencies) {
                for (l, &f) in frequencies.iter().enumerate() {
                    let ([now, _], [then, _]) = (transfer.absorption(f), rest.absorption(f));
                    #[expect(clippy::cast_possible_truncation, reason = "spectra use single precision")]
                    let ratio = (now * then * (1.0 + NOISE * NOISE) / (then * then + NOISE * NOISE)) as f32;
                    value[0][l] *= ratio * plane.norm();
                    value[1][l] *= ratio * plane.norm();
                }
            }
            let mut image = vec![0.0; outer.width * outer.height];
            plane.image_into(&support, &filtered, outer.width, &mut image, &mut scratch);
            sum += stack_window.mean_difference(&image, k);
        }
        tried.push([condenser_na, sum / (stack.len() - 1) as f64]);
    }
    let (steps, _) = lowest(&tried.iter().map(|t| t[1]).collect::<Vec<_>>());
    Ok(CondenserFit { focused: *focused, condenser_na: microscope.na * (FIRST_NA + STEP_NA * steps), tried })
}
