//! `--edge`: σ in the plane of the image.

use std::f64::consts::{PI, SQRT_2};
use std::fmt::Write;
use std::path::Path;

use optics_psf::calibrate::{self, EdgeFit, Window};
use optics_psf::{
    Border, BrightField, BrightFieldParams, Error, Gaussian, Microscope, MicroscopeParams, Padding, Scratch,
};
use papsynth_dataset::read::{Limits, Stack};

use super::find;
use super::record::{EdgeRecord, numbers};
use crate::args::Calibrate;
use crate::exit::{Complaint, Failure};

/// Least side of a window.
const LEAST_SIDE_PX: f64 = 8.0;

/// An edge and the pixels around it.
pub(super) struct Measured {
    pub(super) record: EdgeRecord,
    /// Distance of each pixel of the window from the middle of the edge, towards the light, and its value.
    pub(super) profile: Vec<[f64; 2]>,
}

pub(super) fn measure(args: &Calibrate, path: &Path) -> Result<Measured, Failure> {
    let image = Stack::read(&[path.to_owned()], &Limits::default())?;
    let (width, height) = (image.width, image.height());
    let name = path.display();
    let refuse = |message: String, help: &str| Err(Failure::input(Complaint::new(message).help(help)));
    if image.planes.len() != 1 {
        let help = "give the image in which the edge is in focus";
        return refuse(format!("--edge {name}: {} images; expected one", image.planes.len()), help);
    }
    let pixels = &image.planes[0];
    let (window, fit) = match args.line {
        Some(line) => {
            let help = "--line X0,Y0,X1,Y1: across a straight edge or along it, at least 8 pixels long, with a square \
                        of that side around its middle inside the image";
            let Some(window) = square_around(line, width, height) else {
                let [a, b, c, d] = line;
                return refuse(
                    format!(
                        "--edge {name}, --line {a},{b},{c},{d}: its square does not lie in the {width} x {height} image"
                    ),
                    help,
                );
            };
            match calibrate::edge(pixels, width, window) {
                Ok(fit) => (window, fit),
                Err(error) => return refuse(format!("--edge {name}: {error}"), help),
            }
        }
        None => match find::straight_edge(pixels, width) {
            Some(found) => found,
            None => {
                let help = "name a straight edge with --line X0,Y0,X1,Y1, across it or along it, in pixels";
                return refuse(format!("--edge {name}: no straight edge was found in it"), help);
            }
        },
    };
    let profile = profile(pixels, width, window, &fit);
    let EdgeFit { sigma_px, dark, light, normal, difference } = fit;
    // From the slopes of the least squares: ∫ t²φ² = 1 ∕ (4√π).
    let length = window.width.min(window.height) as f64;
    let error_px = difference / (light - dark) * (4.0 * PI.sqrt() * sigma_px / length).sqrt();
    let record = EdgeRecord { window: numbers(window), sigma_px, error_px, dark, light, normal, difference };
    Ok(Measured { record, profile })
}

/// The square around a line's middle whose side is as long as the line.
fn square_around([x0, y0, x1, y1]: [f64; 4], width: usize, height: usize) -> Option<Window> {
    let (dx, dy) = (x1 - x0, y1 - y0);
    let side = (dx * dx + dy * dy).sqrt().round();
    let first = |a: f64, b: f64| (0.5 * (a + b) - 0.5 * (side - 1.0)).round();
    let (left, top) = (first(x0, x1), first(y0, y1));
    let inside = side >= LEAST_SIDE_PX
        && left >= 0.0
        && top >= 0.0
        && left + side <= width as f64
        && top + side <= height as f64;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside the image")]
    inside.then_some(Window { left: left as usize, top: top as usize, width: side as usize, height: side as usize })
}

/// The pixels of a window by their distance from the edge, whose place is that which leaves least.
fn profile(image: &[f32], width: usize, window: Window, fit: &EdgeFit) -> Vec<[f64; 2]> {
    let [cx, cy] = [window.width, window.height].map(|side| (side as f64 - 1.0) / 2.0);
    let samples: Vec<[f64; 2]> = (0..window.height)
        .flat_map(|y| (0..window.width).map(move |x| (x, y)))
        .map(|(x, y)| {
            let d = fit.normal[0] * (x as f64 - cx) + fit.normal[1] * (y as f64 - cy);
            [d, f64::from(image[(window.top + y) * width + window.left + x])]
        })
        .collect();
    let left = |shift: f64| -> f64 {
        samples
            .iter()
            .map(|[d, value]| value - edge_at(fit.dark, fit.light, fit.sigma_px, d - shift))
            .map(|r| r * r)
            .sum()
    };
    let best = |from: f64, step: f64, count: u32| {
        let shifts = (0..=count).map(|i| from + step * f64::from(i));
        shifts.min_by(|a, b| left(*a).total_cmp(&left(*b))).unwrap_or(from)
    };
    // To a quarter of a pixel, then to a hundredth.
    let reach = cx + cy;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "four times a window's side")]
    let coarse = best(-reach, 0.25, (8.0 * reach) as u32);
    let shift = best(coarse - 0.25, 0.01, 50);
    samples.into_iter().map(|[d, value]| [d - shift, value]).collect()
}

/// The fitted edge at a distance from its middle.
pub(super) fn edge_at(dark: f64, light: f64, sigma: f64, d: f64) -> f64 {
    dark + (light - dark) * 0.5 * libm::erfc(-d / (sigma * SQRT_2))
}

/// What a microscope makes of a sharp edge, and what is missing from that to an edge that was measured.
pub(super) struct Beyond {
    /// σ that the sharp edge has, pixels.
    pub(super) expected_px: f64,
    /// σ of the further spread that makes it as wide as the edge that was measured; 0 if it is as wide already.
    pub(super) extra_px: f64,
}

/// Compares an edge with a sharp one of the same contrast and direction, drawn by this microscope.
pub(super) fn beyond(record: &EdgeRecord, microscope: &MicroscopeParams) -> Result<Beyond, Error> {
    /// Pixels of the image, and the window in its middle.
    const SIDE: usize = 96;
    const WINDOW: usize = 24;
    /// Halvings after which the spread is known to a thousandth of a pixel.
    const HALVINGS: u32 = 14;
    let image = sharp_edge(record, microscope, SIDE)?;
    let first = (SIDE - WINDOW) / 2;
    let window = Window { left: first, top: first, width: WINDOW, height: WINDOW };
    let expected_px = calibrate::edge(&image, SIDE, window)?.sigma_px;
    // The edge of a lens is no Gaussian's, so that squares of widths do not simply add.
    let (mut low, mut high) = (0.0, record.sigma_px);
    let (mut blurred, mut scratch) = (image.clone(), Scratch::new());
    for _ in 0..HALVINGS {
        let extra = 0.5 * (low + high);
        Gaussian::new(extra)?.blur_into(&image, SIDE, Border::Replicate, &mut blurred, &mut scratch);
        if calibrate::edge(&blurred, SIDE, window)?.sigma_px < record.sigma_px { low = extra } else { high = extra }
    }
    let extra_px = if expected_px < record.sigma_px { 0.5 * (low + high) } else { 0.0 };
    Ok(Beyond { expected_px, extra_px })
}

/// The image of a sharp edge through the middle of a square of `side` pixels.
fn sharp_edge(record: &EdgeRecord, microscope: &MicroscopeParams, side: usize) -> Result<Vec<f32>, Error> {
    /// σ of the edge itself, pixels: far below what pixels show, but no staircase.
    const OWN_PX: f64 = 0.12;
    /// Absorbance of the edge, which matters little: a trace, and where hardly any light is left.
    const ABSORBANCE: [f64; 2] = [0.02, 1.0];
    let step = if record.dark > 0.0 { libm::log10(record.light / record.dark) } else { ABSORBANCE[1] };
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
            let d = record.normal[0] * x + record.normal[1] * y;
            (absorbance * 0.5 * libm::erfc(d / (OWN_PX * SQRT_2))) as f32
        })
        .collect();
    let mut specimen = field.specimen();
    field.set_absorbance(&mut specimen, 0, &object);
    Ok(field.image(&mut specimen, 0))
}

/// The table on standard output.
pub(super) fn table(record: &EdgeRecord, pixel_um: Option<f64>) -> String {
    let mut out = String::new();
    let [x, y, w, h] = record.window;
    let (sigma, error) = (record.sigma_px, record.error_px);
    let turn = libm::atan2(record.normal[1], record.normal[0]).to_degrees();
    // Writing to a string cannot fail.
    let _ = writeln!(out, "edge");
    let _ = writeln!(out, "  window {x},{y},{w},{h}: lighter towards {turn:.0} degrees (0 right, 90 down)");
    let _ = writeln!(
        out,
        "levels        {:.4} dark, {:.4} light, {:.4} left by the fit",
        record.dark, record.light, record.difference
    );
    let _ = writeln!(out, "sigma_xy      {sigma:.3} +- {error:.3} px, the pixel's own width included");
    if let Some(pixel) = pixel_um {
        let _ = writeln!(out, "              {:.4} +- {:.4} um", sigma * pixel, error * pixel);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_asks_for_the_square_around_its_middle() {
        let square = |line| square_around(line, 64, 48).map(numbers);
        // Across or along.
        assert_eq!(square([10.0, 20.0, 26.0, 20.0]), Some([11, 13, 16, 16]));
        assert_eq!(square([18.0, 12.0, 18.0, 28.0]), Some([11, 13, 16, 16]));
        assert_eq!(square([0.0, 0.0, 47.0, 47.0]), None);
        assert_eq!(square([10.0, 20.0, 17.0, 20.0]), None);
        assert_eq!(square([0.0, 0.0, 16.0, 0.0]), None);
        assert_eq!(square([f64::NAN, 0.0, 16.0, 0.0]), None);
        assert_eq!(square([f64::INFINITY, 0.0, 16.0, 0.0]), None);
    }
}
