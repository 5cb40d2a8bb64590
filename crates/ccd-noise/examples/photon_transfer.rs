//! Plots the photon transfer curve of the preset `orca_05g`: noise against signal in grey levels, from 1 to beyond
//! saturation. Optional argument: the output path.

use std::error::Error;

use ccd_noise::calibrate::{CalibrationParams, LightLevel, PhotonTransfer, Shading};
use ccd_noise::{Camera, CameraParams};
use image::{GrayImage, Luma};

const WIDTH: usize = 256;
const PIXELS: usize = WIDTH * 256;
const FRAMES: u64 = 8;
const LEVELS: u32 = 44;
/// Signals near saturation, in grey levels, where the converter clips the noise.
const CLIPPED: [f64; 6] = [3850.0, 3940.0, 3985.0, 4010.0, 4060.0, 4100.0];

/// Position of the plot's corner, and length of a decade on both axes, in pixels.
const CORNER: [f32; 2] = [60.0, 420.0];
const DECADE: f32 = 130.0;
/// Decades of signal from 1, and of noise from 0.1.
const DECADES: [f32; 2] = [4.0, 3.0];
/// log₁₀ of the lowest noise.
const LOWEST: f32 = -1.0;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "target/photon_transfer.png".to_owned());
    let params = CameraParams::orca_05g();
    let camera = Camera::new(&params)?;
    let mut plot = GrayImage::from_pixel(620, 460, Luma([255]));

    // Model curves, in grey, up to saturation.
    for step in 0..4000 {
        let signal = libm::exp10(f64::from(step) * 0.001);
        let electrons = signal / params.gain_dn_per_e;
        if electrons < camera.saturation_capacity_e() {
            let (noise, pattern) = (camera.temporal_noise_dn(electrons), camera.nonuniformity_dn(electrons));
            for value in [noise, pattern, (noise * noise + pattern * pattern).sqrt()] {
                put(&mut plot, place(signal, value), [0, 0], 170);
            }
        }
    }
    axes(&mut plot);

    let measure = CalibrationParams { bit_depth: 12, shading: Shading::Kept, ..CalibrationParams::default() };
    let mut transfer = PhotonTransfer::new(&measure)?;
    let mut level = |electrons: f64, light: LightLevel, key: u64| -> Result<_, ccd_noise::Error> {
        let scene = vec![single(electrons); PIXELS];
        let frames: Vec<Vec<u16>> = (key..key + FRAMES)
            .map(|key| {
                let mut frame = vec![0; PIXELS];
                camera.expose_window(&scene, WIDTH, [0, 0], key, &mut frame);
                frame
            })
            .collect();
        let frames: Vec<&[u16]> = frames.iter().map(Vec::as_slice).collect();
        transfer.add(&frames, WIDTH, light).cloned()
    };
    let dark = level(0.0, LightLevel::Dark, 0)?;
    let signals = (0..LEVELS).map(|step| libm::exp10(f64::from(step) * 3.56 / f64::from(LEVELS - 1)));
    for (i, signal) in (1..).zip(signals.chain(CLIPPED)) {
        let flat = level(signal / params.gain_dn_per_e, LightLevel::Unknown, FRAMES * i)?;
        let signal = flat.mean_dn - dark.mean_dn;
        let (noise, pattern) = (flat.variance_dn2, flat.spatial_dn2.max(0.0));
        disc(&mut plot, place(signal, (noise + pattern).sqrt()), 0.0, 3.6);
        disc(&mut plot, place(signal, noise.sqrt()), 2.5, 3.6);
        if pattern > 0.0 {
            let at = place(signal, pattern.sqrt());
            for i in -3..=3 {
                put(&mut plot, at, [i, i], 0);
                put(&mut plot, at, [i, -i], 0);
            }
        }
    }
    plot.save(path)?;
    Ok(())
}

#[expect(clippy::cast_possible_truncation, reason = "frames take single precision")]
fn single(value: f64) -> f32 {
    value as f32
}

/// Returns the position of a point of the curve, if it is inside the plot.
fn place(signal: f64, noise: f64) -> Option<[f32; 2]> {
    let [x, y] = [libm::log10f(single(signal)), libm::log10f(single(noise)) - LOWEST];
    let inside = (0.0..=DECADES[0]).contains(&x) && (0.0..=DECADES[1]).contains(&y);
    inside.then(|| [CORNER[0] + x * DECADE, CORNER[1] - y * DECADE])
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the image")]
fn put(plot: &mut GrayImage, at: Option<[f32; 2]>, [dx, dy]: [i16; 2], grey: u8) {
    if let Some([x, y]) = at {
        let [x, y] = [x + f32::from(dx), y + f32::from(dy)].map(|v| v.round() as u32);
        plot.put_pixel(x, y, Luma([grey]));
    }
}

fn disc(plot: &mut GrayImage, at: Option<[f32; 2]>, hole: f32, radius: f32) {
    for dy in -4..=4_i16 {
        for dx in -4..=4_i16 {
            let distance = f32::from(dx * dx + dy * dy).sqrt();
            if (hole..radius).contains(&distance) {
                put(plot, at, [dx, dy], 0);
            }
        }
    }
}

fn axes(plot: &mut GrayImage) {
    let mut line = |from: [f32; 2], step: [f32; 2], length: f32, grey: u8| {
        let mut along = 0.0;
        while along <= length {
            put(plot, Some([from[0] + along * step[0], from[1] + along * step[1]]), [0, 0], grey);
            along += 1.0;
        }
    };
    line(CORNER, [1.0, 0.0], DECADES[0] * DECADE, 0);
    line(CORNER, [0.0, -1.0], DECADES[1] * DECADE, 0);
    for digit in 1..=9_u8 {
        let part = libm::log10f(digit.into());
        let length = if digit == 1 { 9.0 } else { 4.0 };
        let decades = |axis: usize| (0..5_u8).map(|i| f32::from(i) + part).filter(move |&at| at <= DECADES[axis]);
        for at in decades(0) {
            line([CORNER[0] + at * DECADE, CORNER[1]], [0.0, 1.0], length, 0);
        }
        for at in decades(1) {
            line([CORNER[0], CORNER[1] - at * DECADE], [-1.0, 0.0], length, 0);
        }
    }
    for (i, label) in (0..).zip(["1", "10", "100", "1000", "10000"]) {
        let width = 8.0 * label.len() as f32;
        write(plot, label, [CORNER[0] + DECADE * i as f32 - width / 2.0, CORNER[1] + 14.0]);
    }
    for (i, label) in (0..).zip(["0.1", "1", "10", "100"]) {
        let width = 8.0 * label.len() as f32;
        write(plot, label, [CORNER[0] - 14.0 - width, CORNER[1] - DECADE * i as f32 - 5.0]);
    }
}

/// Bitmap rows of the required glyphs, three pixels wide, drawn at double size.
fn glyph(glyph: char) -> [u8; 5] {
    match glyph {
        '0' => [7, 5, 5, 5, 7],
        '1' => [2, 6, 2, 2, 7],
        _ => [0, 0, 0, 0, 2],
    }
}

fn write(plot: &mut GrayImage, text: &str, [x, y]: [f32; 2]) {
    for (place, character) in (0..).zip(text.chars()) {
        for (row, bits) in (0..).zip(glyph(character)) {
            for column in (0..3_i16).filter(|column| bits >> (2 - column) & 1 != 0) {
                for (dx, dy) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                    put(plot, Some([x, y]), [8 * place + 2 * column + dx, 2 * row + dy], 0);
                }
            }
        }
    }
}
