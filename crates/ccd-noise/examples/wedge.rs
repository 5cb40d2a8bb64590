//! Writes the image of the crate documentation: a step wedge at four exposures, stretched to the same brightness, and
//! its photon transfer curve. Optional argument: the output path.

use std::error::Error;

use ccd_noise::{Camera, CameraParams};
use image::{GrayImage, Luma};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

const STEPS: u32 = 10;
/// Width of a step and height of a wedge, in pixels.
const STEP: [u32; 2] = [40, 60];
/// Brightest step, as a fraction of the full-well capacity.
const EXPOSURES: [f32; 4] = [0.9, 0.09, 0.009, 0.0018];
const PLOT: u32 = 240;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "target/wedge.png".to_owned());
    // No fixed pattern, because the variance is computed over the pixels of a step.
    let params = CameraParams { prnu: 0.0, dsnu_e: 0.0, dark_current_e_per_s: 0.0, ..CameraParams::orca_05g() };
    let camera = Camera::new(&params)?;
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
    let (width, height) = (STEPS * STEP[0], STEP[1]);
    let mut plot = GrayImage::from_pixel(width + 10 + PLOT, 4 * height, Luma([255]));
    let corner = [width + 10, 4 * height - 1];
    plot_axes(&mut plot, corner);

    let (gain, offset) = (single(params.gain_dn_per_e), single(params.offset_dn));
    for (exposure, top) in EXPOSURES.into_iter().zip((0..).step_by(STEP[1] as usize)) {
        let brightest = exposure * single(params.full_well_e);
        let step = |x: u32| (x / STEP[0] + 1) as f32 / STEPS as f32;
        let wedge: Vec<f32> = (0..width * height).map(|i| brightest * step(i % width)).collect();
        let mut frame = vec![0; wedge.len()];
        camera.expose_into(&wedge, width as usize, &mut frame, &mut rng);

        for (i, &dn) in (0..).zip(&frame) {
            let level = (f32::from(dn) - offset) / (1.1 * gain * brightest);
            plot.put_pixel(i % width, top + i / width, Luma([grey(level)]));
        }
        for s in 0..STEPS {
            let patch = (0..).zip(&frame).filter(|(i, _)| i % width / STEP[0] == s);
            let patch: Vec<f32> = patch.map(|(_, &dn)| f32::from(dn)).collect();
            let n = patch.len() as f32;
            let mean = patch.iter().sum::<f32>() / n;
            let variance = patch.iter().map(|v| (v - mean) * (v - mean)).sum::<f32>() / (n - 1.0);
            dot(&mut plot, corner, mean - offset, variance);
        }
    }
    // Prediction of EMVA 1288: σ² = K²σ_d² + 1/12 + K·(mean - offset)
    let read = gain * single(params.read_noise.rms_e());
    for x in 0..PLOT {
        let mean = libm::exp10f(x as f32 / PLOT as f32 * DECADES - 1.0);
        let [_, y] = place(corner, mean, read * read + 1.0 / 12.0 + gain * mean);
        plot.put_pixel(corner[0] + x, y, Luma([120]));
    }
    plot.save(path)?;
    Ok(())
}

#[expect(clippy::cast_possible_truncation, reason = "frames take single precision")]
fn single(value: f64) -> f32 {
    value as f32
}

/// Decades of both axes, from 0.1.
const DECADES: f32 = 5.0;

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the plot")]
fn place(corner: [u32; 2], mean: f32, variance: f32) -> [u32; 2] {
    let along = |v: f32| ((libm::log10f(v.max(0.1)) + 1.0) / DECADES * PLOT as f32) as u32;
    [corner[0] + along(mean), corner[1] - along(variance).min(PLOT - 2)]
}

fn plot_axes(plot: &mut GrayImage, [left, bottom]: [u32; 2]) {
    for i in 0..PLOT {
        plot.put_pixel(left, bottom - i, Luma([0]));
        plot.put_pixel(left + i, bottom, Luma([0]));
    }
    for decade in 0..5 {
        let at = decade * PLOT / 5;
        for i in 0..6 {
            plot.put_pixel(left + i, bottom - at, Luma([0]));
            plot.put_pixel(left + at, bottom - i, Luma([0]));
        }
    }
}

fn dot(plot: &mut GrayImage, corner: [u32; 2], mean: f32, variance: f32) {
    let [x, y] = place(corner, mean, variance);
    for (dx, dy) in [(0, 1), (1, 0), (1, 1), (1, 2), (2, 1)] {
        let (x, y) = ((x + dx).saturating_sub(1), (y + dy).saturating_sub(1));
        if x < plot.width() && y < plot.height() {
            plot.put_pixel(x, y, Luma([0]));
        }
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0..=1 to 8 bits")]
fn grey(level: f32) -> u8 {
    (level.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}
