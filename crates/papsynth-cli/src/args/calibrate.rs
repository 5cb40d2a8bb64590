//! Options of `calibrate`.

use std::path::PathBuf;

use clap::{ArgGroup, Args};
use papsynth_calibrate::{Instrument, Window};

use super::values::{integer, parse_pixel};

/// Measure a microscope and its camera on your own images.
///
/// A focus stack of nuclei gives the blur as a function of focus and the condenser aperture; a straight edge gives the
/// blur in focus; flat frames give gain and noise of the camera. Prints tables, and writes plots, sections of recipes,
/// and `calibration.json` with all numbers.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("images").required(true).multiple(true).args(["stack", "edge", "flat"]), after_help = "\
Examples:
  papsynth calibrate --stack nucleus.tif
  papsynth calibrate --stack planes --step-um 0.5 --pixel-um 0.25 --na 0.75
  papsynth calibrate --stack planes/z*.png --window 120,80,48,52 --step-um 0.5 --pixel-um 0.25
  papsynth calibrate --edge edge.png --line 40,10,40,60 --pixel-um 0.25
  papsynth calibrate --flat flats --dark darks --bits 12
  papsynth preview calibration/optics.toml

Images are grey PNG or TIFF files, ordered by the numbers in their names. The planes of a stack have \
equal distances and are on both sides of focus; the folder holds no other images. Without --window, \
nuclei are found automatically as dark, compact, sharp objects, and the fit uses their medians. \
Without --step-um, distances are in planes; without --pixel-um, blur is in pixels. Such values are \
not written to recipes.

Flats are images of an even field: 2 or more per level, from near dark to bright, and 2 or more dark \
frames. Variations wider than 15 pixels count as illumination. A folder of flats holds either a \
subfolder per level and one named `dark`,
  flats/dark/1.tif  flats/dark/2.tif  flats/5ms/1.tif  flats/5ms/2.tif  flats/9ms/1.tif ...
or only files, where two consecutive files, by name, have the same light:
  flats/01a.tif  flats/01b.tif  flats/02a.tif  flats/02b.tif ...  darks/1.tif  darks/2.tif

Older measurements in the folder of --out are kept, unless this run measures them again.")]
pub(crate) struct Calibrate {
    /// Focus stack of one or more nuclei: a TIFF with several pages, a folder, or images
    #[arg(long, value_name = "FILE|DIR", num_args = 1..)]
    pub(crate) stack: Vec<PathBuf>,
    /// Distance between planes, in micrometres of stage travel
    #[arg(long, value_name = "UM", value_parser = parse_step, requires = "stack")]
    pub(crate) step_um: Option<f64>,
    /// Window of a nucleus, in pixels; repeatable [default: found automatically]
    #[arg(long, value_name = "X,Y,W,H", value_parser = parse_window, requires = "stack")]
    pub(crate) window: Vec<Window>,
    /// Image of a sharp straight edge in focus
    #[arg(long, value_name = "FILE")]
    pub(crate) edge: Option<PathBuf>,
    /// Two points of a line through the edge, in pixels. The measured region is a square centred on the line, as long
    /// as the line [default: found automatically]
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = parse_line, requires = "edge", allow_hyphen_values = true)]
    pub(crate) line: Option<[f64; 4]>,
    /// Folder of flat frames: a subfolder per level, or pairs of files
    #[arg(long, value_name = "DIR")]
    pub(crate) flat: Option<PathBuf>,
    /// Folder of dark frames [default: the subfolder `dark` of --flat]
    #[arg(long, value_name = "DIR", requires = "flat")]
    pub(crate) dark: Option<PathBuf>,
    /// Bit depth of the camera; required for 16-bit files [default: 8 for 8-bit files]
    #[arg(long, value_name = "N", value_parser = integer(8, 16_u32), requires = "flat")]
    pub(crate) bits: Option<u32>,
    /// Pixel size in the object plane, in micrometres
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
    /// Refractive index of the immersion medium: 1 for air, 1.515 for oil
    #[arg(long, value_name = "N", default_value_t = Instrument::default().immersion_index)]
    pub(crate) immersion_index: f64,
    /// Output folder; replaces older calibrations in it, but no other file
    #[arg(long, value_name = "DIR", default_value = "calibration")]
    pub(crate) out: PathBuf,
}

fn parse_step(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if value > 0.0 && value <= 100.0 => Ok(value),
        _ => Err("expected more than 0 and at most 100 micrometres".to_owned()),
    }
}

/// Parses four numbers, separated by commas.
fn parse_four<T: std::str::FromStr>(text: &str) -> Option<[T; 4]> {
    let numbers: Vec<T> = text.split(',').map(|part| part.trim().parse().ok()).collect::<Option<_>>()?;
    numbers.try_into().ok()
}

fn parse_window(text: &str) -> Result<Window, String> {
    let [left, top, width, height] =
        parse_four(text).ok_or("expected X,Y,W,H: left, top, width and height in pixels, for example 120,80,48,52")?;
    // Larger than any image, and sums do not overflow.
    match [left, top, width, height].iter().all(|v| *v <= 1 << 20) {
        true => Ok(Window { left, top, width, height }),
        false => Err("expected numbers up to 1048576".to_owned()),
    }
}

fn parse_line(text: &str) -> Result<[f64; 4], String> {
    let line = parse_four(text).filter(|line| line.iter().all(|v: &f64| v.is_finite()));
    line.ok_or_else(|| "expected X0,Y0,X1,Y1: two points in pixels, for example 40,10,40,60".to_owned())
}
