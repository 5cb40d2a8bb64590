//! What can be typed after `calibrate`.

use std::path::PathBuf;

use clap::{ArgGroup, Args};
use papsynth_calibrate::{Instrument, Window};

use super::values::parse_pixel;

/// Measure a microscope and its camera on your own images.
///
/// A focus stack of nuclei gives the blur against the distance from focus and the condenser's aperture; a straight edge
/// gives the blur in focus; flat frames give the camera's gain and noise. Prints tables, and writes plots, parts of recipes, and `calibration.json` with all numbers.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("images").required(true).multiple(true).args(["stack", "edge", "flat"]), after_help = "\
Examples:
  papsynth calibrate --stack nucleus.tif
  papsynth calibrate --stack planes --step-um 0.5 --pixel-um 0.25 --na 0.75
  papsynth calibrate --stack planes/z*.png --window 120,80,48,52 --step-um 0.5 --pixel-um 0.25
  papsynth calibrate --edge edge.png --line 40,10,40,60 --pixel-um 0.25
  papsynth calibrate --flat flats --dark darks --bits 12
  papsynth preview calibration/optics.toml

Images are PNG or TIFF in grey, in the order of the numbers in their names. The planes of a stack
lie at equal distances, on both sides of focus, and nothing else among them. Without --window nuclei
are found: dark, compact, sharp things; the law is that of their medians. Without --step-um it is in
planes, without --pixel-um in pixels, and what lacks a length goes into no recipe.

Flats are frames of an even field, two or more of each light, from near dark to the brightest, and
two or more in the dark. Unevenness wider than 15 pixels is taken for the lamp's. A folder of flats
holds a subfolder for each light, and one named `dark`,
  flats/dark/1.tif  flats/dark/2.tif  flats/5ms/1.tif  flats/5ms/2.tif  flats/9ms/1.tif ...
or files alone, of which each two after one another by name are of the same light:
  flats/01a.tif  flats/01b.tif  flats/02a.tif  flats/02b.tif ...  darks/1.tif  darks/2.tif

What an older run left in the folder of --out is kept where this run does not measure it again.")]
pub(crate) struct Calibrate {
    /// Focus stack of a nucleus or more: a TIFF of several pages, a folder, or images
    #[arg(long, value_name = "FILE|DIR", num_args = 1..)]
    pub(crate) stack: Vec<PathBuf>,
    /// Travel of the stage from plane to plane, in micrometres
    #[arg(long, value_name = "UM", value_parser = parse_step, requires = "stack")]
    pub(crate) step_um: Option<f64>,
    /// Where a nucleus lies in the stack, in pixels; repeatable [default: found]
    #[arg(long, value_name = "X,Y,W,H", value_parser = parse_window, requires = "stack")]
    pub(crate) window: Vec<Window>,
    /// Image of a sharp straight edge in focus
    #[arg(long, value_name = "FILE")]
    pub(crate) edge: Option<PathBuf>,
    /// Line across the edge or along it, in pixels: the square of its length around its middle is looked at [default: found]
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = parse_line, requires = "edge", allow_hyphen_values = true)]
    pub(crate) line: Option<[f64; 4]>,
    /// Folder of flat frames: a subfolder for each light, or pairs of files
    #[arg(long, value_name = "DIR")]
    pub(crate) flat: Option<PathBuf>,
    /// Folder of frames taken in the dark [default: the subfolder `dark` of that of --flat]
    #[arg(long, value_name = "DIR", requires = "flat")]
    pub(crate) dark: Option<PathBuf>,
    /// Bits of the camera, which files of 16 bits do not tell [default: 8 for files of 8 bits]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(8..=16), requires = "flat")]
    pub(crate) bits: Option<u32>,
    /// Size of a pixel in the object, in micrometres
    #[arg(long, value_name = "UM", value_parser = parse_pixel)]
    pub(crate) pixel_um: Option<f64>,
    /// Numerical aperture of the objective
    #[arg(long, value_name = "NA", default_value_t = Instrument::default().na)]
    pub(crate) na: f64,
    /// Wavelength of the light, in micrometres
    #[arg(long, value_name = "UM", default_value_t = Instrument::default().wavelength_um)]
    pub(crate) wavelength_um: f64,
    /// Refractive index of the mountant
    #[arg(long, value_name = "N", default_value_t = Instrument::default().mount_index)]
    pub(crate) mount_index: f64,
    /// Refractive index between cover glass and objective: 1 dry, 1.515 oil
    #[arg(long, value_name = "N", default_value_t = Instrument::default().immersion_index)]
    pub(crate) immersion_index: f64,
    /// Folder to write to; older calibrations in it are replaced, no other file
    #[arg(long, value_name = "DIR", default_value = "calibration")]
    pub(crate) out: PathBuf,
}

fn parse_step(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if value > 0.0 && value <= 100.0 => Ok(value),
        _ => Err("expected more than 0 and at most 100 micrometres".to_owned()),
    }
}

/// Four numbers between commas.
fn parse_four<T: std::str::FromStr>(text: &str) -> Option<[T; 4]> {
    let numbers: Vec<T> = text.split(',').map(|part| part.trim().parse().ok()).collect::<Option<_>>()?;
    numbers.try_into().ok()
}

fn parse_window(text: &str) -> Result<Window, String> {
    let [left, top, width, height] = parse_four(text)
        .ok_or("expected X,Y,W,H: left, top, width and height in whole pixels, such as 120,80,48,52")?;
    // No image is so large; sums of them never overflow.
    match [left, top, width, height].iter().all(|v| *v <= 1 << 20) {
        true => Ok(Window { left, top, width, height }),
        false => Err("expected numbers up to 1048576".to_owned()),
    }
}

fn parse_line(text: &str) -> Result<[f64; 4], String> {
    let line = parse_four(text).filter(|line| line.iter().all(|v: &f64| v.is_finite()));
    line.ok_or_else(|| "expected X0,Y0,X1,Y1: two points in pixels, such as 40,10,40,60".to_owned())
}
