//! Writes the image of the crate documentation: cytoplasms with a nucleus each, from pale to dark, as a microscope
//! camera measures and displays them. Optional argument: the output path.

use std::error::Error;

use dye_spectra::{Amounts, Colour, ColourParams, DYES, Dye, amounts, encode_srgb};
use image::{Rgb, RgbImage};

/// Size of a patch, gap between patches and radius of a nucleus, in pixels.
const PATCH: usize = 56;
const GAP: usize = 4;
const NUCLEUS: f64 = 13.0;
/// Stain strengths from left to right.
const STRENGTHS: [f64; 6] = [0.5, 1.0, 1.5, 2.0, 2.5, 3.0];

/// Returns the cytoplasms, one per row.
fn cytoplasms() -> [Amounts; 5] {
    [
        amounts([(Dye::LightGreen, 0.15), (Dye::EosinY, 0.03)]),
        amounts([(Dye::EosinY, 0.18), (Dye::OrangeG, 0.05)]),
        amounts([(Dye::OrangeG, 0.45)]),
        // The first cytoplasm over the second.
        amounts([(Dye::LightGreen, 0.15), (Dye::EosinY, 0.21), (Dye::OrangeG, 0.05)]),
        [0.0; DYES],
    ]
}

/// Haematein of a nucleus.
const NUCLEAR: f64 = 0.5;

/// Returns the amounts at a pixel of one half of the image.
fn scene(x: usize, y: usize) -> Amounts {
    let cytoplasms = cytoplasms();
    let [(column, in_x), (row, in_y)] = [x, y].map(|v| (v / (PATCH + GAP), v % (PATCH + GAP)));
    if column >= STRENGTHS.len() || row >= cytoplasms.len() || in_x < GAP || in_y < GAP {
        return [0.0; DYES];
    }
    let mut stain = cytoplasms[row];
    let [dx, dy] = [in_x, in_y].map(|v| (v - GAP) as f64 - 0.5 * (PATCH - 1) as f64);
    if dx * dx + dy * dy < NUCLEUS * NUCLEUS {
        stain[Dye::Haematein as usize] += NUCLEAR;
    }
    stain.map(|amount| amount * STRENGTHS[column])
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "target/patches.png".to_owned());
    let [width, height] = [STRENGTHS.len(), cytoplasms().len()].map(|n| n * (PATCH + GAP) + GAP);
    let mut planes: [Vec<f32>; DYES] = std::array::from_fn(|_| vec![0.0; width * height]);
    for i in 0..width * height {
        for (plane, amount) in planes.iter_mut().zip(scene(i % width, i / width)) {
            plane[i] = single(amount);
        }
    }

    let colour = Colour::new(&ColourParams::default())?;
    let mut light = [(); 3].map(|()| vec![0.0; width * height]);
    colour.transmittance_into(planes.each_ref().map(|plane| &plane[..]), light.each_mut().map(|plane| &mut plane[..]));

    // Left: white-balanced camera light. Right: display colours.
    let mut image = RgbImage::new(u32::try_from(2 * width)?, u32::try_from(height)?);
    for (y, row) in image.rows_mut().enumerate() {
        for (x, pixel) in row.enumerate() {
            let camera: [f64; 3] = std::array::from_fn(|c| f64::from(light[c][y * width + x % width]));
            let screen = colour.to_srgb().map(|row| row.iter().zip(camera).map(|(m, v)| m * v).sum());
            *pixel = Rgb(if x < width { camera.map(linear) } else { screen.map(encode_srgb) });
        }
    }
    image.save(path)?;
    Ok(())
}

#[expect(clippy::cast_possible_truncation, reason = "pixels use single precision")]
fn single(value: f64) -> f32 {
    value as f32
}

/// Converts light to 8 bits without the sRGB curve.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255 after clamping")]
fn linear(light: f64) -> u8 {
    (255.0 * light.clamp(0.0, 1.0) + 0.5) as u8
}
