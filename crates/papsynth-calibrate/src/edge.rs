//! σ in focus from a straight edge, and blur in addition to that of the objective.

use std::f64::consts::{PI, SQRT_2};

use optics_psf::calibrate::{self, EdgeFit, Window};
use optics_psf::{Border, BrightField, BrightFieldParams, Gaussian, Microscope, MicroscopeParams, Padding, Scratch};
use serde::{Deserialize, Serialize};

use crate::error::Error;
use crate::find;

/// Smallest size of a window, px.
const MIN_SIDE_PX: f64 = 8.0;

/// The position of a straight edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum EdgeAt {
    /// Automatic detection of the sharpest straight edge.
    Detected,
    /// The square around the centre of a line (x0, y0, x1, y1), px. Its size is the length of the line.
    Line([f64; 4]),
}

/// A measured edge.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Edge {
    /// Left, top, width and height of the window, px.
    pub window: [usize; 4],
    /// σ of the blur, including the pixel width, px.
    pub sigma_px: f64,
    /// Standard error of σ, px.
    pub error_px: f64,
    /// Grey level of the dark side.
    pub dark: f64,
    /// Grey level of the light side.
    pub light: f64,
    /// Unit vector towards the light side; x right, y down.
    pub normal: [f64; 2],
    /// Root mean square of the residuals.
    pub difference: f64,
}

impl Edge {
    /// Measures an edge in an image with rows of `width` pixels, grey levels in any unit.
    ///
    /// # Errors
    /// If there is no straight edge, or it cannot be fitted.
    ///
    /// # Panics
    /// If the image is not complete rows.
    pub fn measure(image: &[f32], width: usize, at: EdgeAt) -> Result<Self, Error> {
        let (window, fit) = match at {
            EdgeAt::Detected => find::straight_edge(image, width).ok_or(Error::NoEdge)?,
            EdgeAt::Line(line) => {
                let height = image.len() / width;
                let window = square_around(line, width, height).ok_or(Error::Line { line, width, height })?;
                (window, calibrate::edge(image, width, window).map_err(Error::Edge)?)
            }
        };
        let EdgeFit { sigma_px, dark, light, normal, rms_residual: difference } = fit;
        // From least squares: ∫ t²φ² = 1 ∕ (4√π).
        let length = window.width.min(window.height) as f64;
        let error_px = difference / (light - dark) * (4.0 * PI.sqrt() * sigma_px / length).sqrt();
        Ok(Self { window: find::numbers(window), sigma_px, error_px, dark, light, normal, difference })
    }

    /// Returns the distance of each pixel of the window from the edge, positive on the light side, and its grey level.
    /// The position of the edge minimises the residuals.
    ///
    /// # Panics
    /// If the window extends beyond the image.
    #[must_use]
    pub fn profile(&self, image: &[f32], width: usize) -> Vec<[f64; 2]> {
        let [left, top, wide, high] = self.window;
        let [cx, cy] = [wide, high].map(|side| (side as f64 - 1.0) / 2.0);
        let samples: Vec<[f64; 2]> = (0..high)
            .flat_map(|y| (0..wide).map(move |x| (x, y)))
            .map(|(x, y)| {
                let d = self.normal[0] * (x as f64 - cx) + self.normal[1] * (y as f64 - cy);
                [d, f64::from(image[(top + y) * width + left + x])]
            })
            .collect();
        let rest =
            |shift: f64| -> f64 { samples.iter().map(|[d, value]| value - self.at(d - shift)).map(|r| r * r).sum() };
        let best = |from: f64, step: f64, count: u32| {
            let shifts = (0..=count).map(|i| from + step * f64::from(i));
            shifts.min_by(|a, b| rest(*a).total_cmp(&rest(*b))).unwrap_or(from)
        };
        // Search in steps of 0.25 px, then 0.01 px.
        let reach = cx + cy;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "four times the size of a window")]
        let coarse = best(-reach, 0.25, (8.0 * reach) as u32);
        let shift = best(coarse - 0.25, 0.01, 50);
        samples.into_iter().map(|[d, value]| [d - shift, value]).collect()
    }

    /// Returns the grey level of the fitted edge at a distance from its centre, px.
    #[must_use]
    pub fn at(&self, distance_px: f64) -> f64 {
        self.dark + (self.light - self.dark) * 0.5 * libm::erfc(-distance_px / (self.sigma_px * SQRT_2))
    }
}

/// Returns the square around the centre of a line, with the size of its length.
fn square_around([x0, y0, x1, y1]: [f64; 4], width: usize, height: usize) -> Option<Window> {
    let (dx, dy) = (x1 - x0, y1 - y0);
    let side = (dx * dx + dy * dy).sqrt().round();
    let first = |a: f64, b: f64| (0.5 * (a + b) - 0.5 * (side - 1.0)).round();
    let (left, top) = (first(x0, x1), first(y0, y1));
    let inside =
        side >= MIN_SIDE_PX && left >= 0.0 && top >= 0.0 && left + side <= width as f64 && top + side <= height as f64;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside the image")]
    inside.then_some(Window { left: left as usize, top: top as usize, width: side as usize, height: side as usize })
}

/// Simulates a sharp edge of the same contrast and direction with this microscope. Returns σ of its image, and σ of the
/// additional Gaussian blur that makes it as wide as the measured edge, or 0 if it is not narrower; px.
pub(crate) fn extra_blur(edge: &Edge, microscope: &MicroscopeParams) -> Result<[f64; 2], optics_psf::Error> {
    /// Sizes of the image and of the central window, px.
    const SIDE: usize = 96;
    const WINDOW: usize = 24;
    /// Bisections for a precision of 0.001 px.
    const BISECTIONS: u32 = 14;
    let image = sharp_edge(edge, microscope, SIDE)?;
    let first = (SIDE - WINDOW) / 2;
    let window = Window { left: first, top: first, width: WINDOW, height: WINDOW };
    let expected_px = calibrate::edge(&image, SIDE, window)?.sigma_px;
    // The blur of the objective is not Gaussian: variances do not add exactly.
    let (mut low, mut high) = (0.0, edge.sigma_px);
    let (mut blurred, mut scratch) = (image.clone(), Scratch::new());
    for _ in 0..BISECTIONS {
        let extra = 0.5 * (low + high);
        Gaussian::new(extra)?.blur_into(&image, SIDE, Border::Replicate, &mut blurred, &mut scratch);
        if calibrate::edge(&blurred, SIDE, window)?.sigma_px < edge.sigma_px { low = extra } else { high = extra }
    }
    let extra_px = if expected_px < edge.sigma_px { 0.5 * (low + high) } else { 0.0 };
    Ok([expected_px, extra_px])
}

/// Returns the image of a sharp edge through the centre of a square of `side` pixels.
fn sharp_edge(edge: &Edge, microscope: &MicroscopeParams, side: usize) -> Result<Vec<f32>, optics_psf::Error> {
    /// σ of the edge itself, px: much smaller than a pixel, but without aliasing.
    const OWN_PX: f64 = 0.12;
    /// Range of the absorbance of the edge; it has little effect.
    const ABSORBANCE: [f64; 2] = [0.02, 1.0];
    let step = if edge.dark > 0.0 { libm::log10(edge.light / edge.dark) } else { ABSORBANCE[1] };
    let absorbance = step.clamp(ABSORBANCE[0], ABSORBANCE[1]);
    let samples = side * microscope.oversampling;
    let scale = microscope.oversampling as f64;
    let params = BrightFieldParams {
        width: samples,
        height: samples,
        padding: Padding::Periodic,
        depths_um: vec![0.0],
        stages_um: vec![0.0],
    };
    let field = BrightField::new(&Microscope::new(microscope)?, &params)?;
    #[expect(clippy::cast_possible_truncation, reason = "single precision images")]
    let object: Vec<f32> = (0..samples * samples)
        .map(|i| {
            let [x, y] = [i % samples, i / samples].map(|v| (v as f64 - 0.5 * samples as f64) / scale);
            let d = edge.normal[0] * x + edge.normal[1] * y;
            (absorbance * 0.5 * libm::erfc(d / (OWN_PX * SQRT_2))) as f32
        })
        .collect();
    let mut specimen = field.specimen();
    field.set_absorbance(&mut specimen, 0, &object);
    Ok(field.image(&mut specimen, 0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_selects_the_square_around_its_centre() {
        let square = |line| square_around(line, 64, 48).map(find::numbers);
        // Horizontal and vertical.
        assert_eq!(square([10.0, 20.0, 26.0, 20.0]), Some([11, 13, 16, 16]));
        assert_eq!(square([18.0, 12.0, 18.0, 28.0]), Some([11, 13, 16, 16]));
        assert_eq!(square([0.0, 0.0, 47.0, 47.0]), None);
        assert_eq!(square([10.0, 20.0, 17.0, 20.0]), None);
        assert_eq!(square([0.0, 0.0, 16.0, 0.0]), None);
        assert_eq!(square([f64::NAN, 0.0, 16.0, 0.0]), None);
        assert_eq!(square([f64::INFINITY, 0.0, 16.0, 0.0]), None);
    }
}
