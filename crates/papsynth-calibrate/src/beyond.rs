//! Blur beyond that of the lens.

use std::f64::consts::SQRT_2;

use optics_psf::calibrate::{self, Window};
use optics_psf::{
    Border, BrightField, BrightFieldParams, Error, Gaussian, Microscope, MicroscopeParams, Padding, Scratch,
};

use crate::edge::Edge;

/// What a microscope makes of a sharp edge, and what is missing from that to an edge that was measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Beyond {
    /// σ that the sharp edge has, pixels.
    pub expected_px: f64,
    /// σ of the further spread that makes it as wide as the edge that was measured; 0 if it is as wide already.
    pub extra_px: f64,
}

/// Compares an edge with a sharp one of the same contrast and direction, drawn by this microscope.
///
/// # Errors
/// If the microscope is out of range.
pub fn beyond(edge: &Edge, microscope: &MicroscopeParams) -> Result<Beyond, crate::Error> {
    search(edge, microscope).map_err(crate::Error::Microscope)
}

fn search(edge: &Edge, microscope: &MicroscopeParams) -> Result<Beyond, Error> {
    /// Pixels of the image, and the window in its middle.
    const SIDE: usize = 96;
    const WINDOW: usize = 24;
    /// Halvings after which the spread is known to a thousandth of a pixel.
    const HALVINGS: u32 = 14;
    let image = sharp_edge(edge, microscope, SIDE)?;
    let first = (SIDE - WINDOW) / 2;
    let window = Window { left: first, top: first, width: WINDOW, height: WINDOW };
    let expected_px = calibrate::edge(&image, SIDE, window)?.sigma_px;
    // The edge of a lens is no Gaussian's, so that squares of widths do not simply add.
    let (mut low, mut high) = (0.0, edge.sigma_px);
    let (mut blurred, mut scratch) = (image.clone(), Scratch::new());
    for _ in 0..HALVINGS {
        let extra = 0.5 * (low + high);
        Gaussian::new(extra)?.blur_into(&image, SIDE, Border::Replicate, &mut blurred, &mut scratch);
        if calibrate::edge(&blurred, SIDE, window)?.sigma_px < edge.sigma_px { low = extra } else { high = extra }
    }
    let extra_px = if expected_px < edge.sigma_px { 0.5 * (low + high) } else { 0.0 };
    Ok(Beyond { expected_px, extra_px })
}

/// The image of a sharp edge through the middle of a square of `side` pixels.
fn sharp_edge(edge: &Edge, microscope: &MicroscopeParams, side: usize) -> Result<Vec<f32>, Error> {
    /// σ of the edge itself, pixels: far below what pixels show, but no staircase.
    const OWN_PX: f64 = 0.12;
    /// Absorbance of the edge, which matters little: a trace, and where hardly any light is left.
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
        ..BrightFieldParams::default()
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
