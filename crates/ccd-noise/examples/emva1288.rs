//! Writes a frame set as EMVA 1288 specifies, for `tests/external_emva.py`: two frames of the dark level and of 50
//! levels of light, 64 frames of the dark level and of half of saturation, a list of the frames, and the expected
//! results.
//!
//! Usage: `cargo run --example emva1288 [PRESET] [FOLDER]`

use std::error::Error;
use std::fmt::Write;
use std::fs;
use std::path::Path;

use ccd_noise::{Camera, CameraParams};
use image::{ImageBuffer, Luma};

const WIDTH: u32 = 320;
const HEIGHT: u32 = 256;
const LEVELS: u64 = 50;
const PATTERN_FRAMES: u64 = 64;
/// Fraction of saturation; the last levels are saturated.
const BRIGHTEST: f64 = 1.05;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next().unwrap_or_else(|| "orca-05g".to_owned());
    let folder = arguments.next().unwrap_or_else(|| format!("target/emva1288/{name}"));
    let params = match name.as_str() {
        "paper" => CameraParams::paper(),
        "orca-05g" => CameraParams::orca_05g(),
        "scmos" => CameraParams::scmos(),
        other => return Err(format!("unknown preset `{other}`: expected paper, orca-05g or scmos").into()),
    };
    let folder = Path::new(&folder);
    fs::create_dir_all(folder)?;
    let camera = Camera::new(&params)?;
    let nanoseconds = 1e9 * params.exposure_s;
    let mut list = format!("v 4.0\nn {} {WIDTH} {HEIGHT}\n", params.bit_depth);
    let mut key = 0;
    let mut level = |fraction: f64, frames: u64| -> Result<(), Box<dyn Error>> {
        let electrons = fraction * camera.saturation_capacity_e();
        match fraction > 0.0 {
            true => writeln!(list, "b {nanoseconds} {}", electrons / params.quantum_efficiency)?,
            false => writeln!(list, "d {nanoseconds}")?,
        }
        let light = vec![single(electrons); (WIDTH * HEIGHT) as usize];
        for _ in 0..frames {
            let mut frame = ImageBuffer::<Luma<u16>, Vec<u16>>::new(WIDTH, HEIGHT);
            camera.expose_window(&light, WIDTH as usize, [0, 0], key, &mut frame);
            frame.save(folder.join(format!("{key}.png")))?;
            writeln!(list, "i {key}.png")?;
            key += 1;
        }
        Ok(())
    };
    level(0.0, 2)?;
    for step in 1..=LEVELS {
        level(BRIGHTEST * step as f64 / LEVELS as f64, 2)?;
    }
    level(0.0, PATTERN_FRAMES)?;
    level(0.5, PATTERN_FRAMES)?;
    fs::write(folder.join("frames.txt"), list)?;

    let read = params.read_noise.rms_e();
    let expected = format!(
        "{{\"gain\": {}, \"quantum_efficiency\": {}, \"dark_noise\": {}, \"dsnu\": {}, \"prnu\": {}}}\n",
        params.gain_dn_per_e,
        params.quantum_efficiency,
        (read * read + params.dark_e()).sqrt(),
        params.dsnu_e,
        params.prnu,
    );
    fs::write(folder.join("expected.json"), expected)?;
    Ok(())
}

#[expect(clippy::cast_possible_truncation, reason = "frames take single precision")]
fn single(value: f64) -> f32 {
    value as f32
}
