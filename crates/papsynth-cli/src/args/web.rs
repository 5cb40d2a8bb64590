//! What can be typed after `study` and `view`.

use std::path::PathBuf;

use clap::Args;
use papsynth_study::{Grey, StudyParams, Task};

use super::values::{named, parse_pixel};

/// Ask people which images are real, as the paper did.
///
/// A page on this machine shows small patches of real and synthetic fields, a moment each, and asks which they are. It works
/// offline, lets nothing out of the two folders, and keeps every answer at once: the same command goes on where it was.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth study real fields --out results --subject ann         120 patches, about 10 minutes
  papsynth study real fields --out results --subject ben --open
  papsynth study real fields --out pairs --design 2afc           two at a time: which one is real?
  papsynth study real fields --out try --trials 10 --exposure-ms 500
  papsynth study real fields --pixel-um 0.33                     synthetic pixels are made as large
  papsynth study --results results                               all subjects, as the paper's Table 1

REAL and SYNTHETIC are folders of PNG, JPEG or TIFF images, data sets of papsynth, or folders of several
such data sets, of varied settings; answers are then broken down by what the recipes differ in, and
by defocus, stain and density. Of images in colour green is shown, of stacks the middle plane.

Fields are shown as they are; --grey glass brings the bright glass of each to one level. If the
size of a pixel is known of both, the finer are resampled. A patch is taken anywhere at random, 8
pixels off the border, where at least a fifth of it is 8 % darker than the glass, and shares at most
a quarter with another. In the folder of --out, each subject has a folder with trials.csv,
summary.json, and the state to go on from.

An accuracy near .5 known to 5 points takes 384 trials, of one subject or several.")]
pub(crate) struct Study {
    /// Folder of real fields
    #[arg(value_name = "REAL", required_unless_present = "results")]
    pub(crate) real: Option<PathBuf>,
    /// Folder of synthetic fields
    #[arg(value_name = "SYNTHETIC", required_unless_present = "results")]
    pub(crate) synthetic: Option<PathBuf>,
    /// Folder of the results, with a folder for each subject
    #[arg(long, value_name = "DIR", default_value = "results")]
    pub(crate) out: PathBuf,
    /// Who looks: a name of letters, digits, `-`, `_` and `.`
    #[arg(long, value_name = "NAME", default_value_t = StudyParams::default().subject)]
    pub(crate) subject: String,
    /// What is asked: of one patch whether it is real (the paper's), or of two which
    #[arg(long, value_name = "NAME", value_parser = named(Task::ALL, Task::name), default_value = StudyParams::default().task.name())]
    pub(crate) design: Task,
    /// Trials that count
    #[arg(long, value_name = "N", default_value_t = StudyParams::default().trials)]
    pub(crate) trials: usize,
    /// Trials for practice before them
    #[arg(long, value_name = "N", default_value_t = StudyParams::default().training)]
    pub(crate) training: usize,
    /// How long a patch is shown
    #[arg(long, value_name = "MS", default_value_t = StudyParams::default().exposure_ms)]
    pub(crate) exposure_ms: u32,
    /// Standard deviation of the noise that is added to every pixel, in grey levels
    #[arg(long, value_name = "DN", default_value_t = StudyParams::default().noise_dn)]
    pub(crate) noise: f64,
    /// Side of a patch
    #[arg(long, value_name = "PX", default_value_t = StudyParams::default().patch_px)]
    pub(crate) patch_px: usize,
    /// Fields of each side, drawn from those there are
    #[arg(long, value_name = "N", default_value_t = StudyParams::default().fields)]
    pub(crate) fields: usize,
    /// Seed: which fields, patches, order and noise
    #[arg(long, value_name = "N", default_value_t = StudyParams::default().seed)]
    pub(crate) seed: u64,
    /// How grey levels are brought to 8 bits, on both sides alike
    #[arg(long, value_name = "NAME", value_parser = named(Grey::ALL, Grey::name), default_value = StudyParams::default().grey.name())]
    pub(crate) grey: Grey,
    /// Size of a real pixel in the object, in micrometres
    #[arg(long, value_name = "UM", value_parser = parse_pixel)]
    pub(crate) pixel_um: Option<f64>,
    /// Size of a synthetic pixel, in micrometres [default: as the data set says]
    #[arg(long, value_name = "UM", value_parser = parse_pixel)]
    pub(crate) synthetic_pixel_um: Option<f64>,
    /// Port of 127.0.0.1 to serve the page at [default: that of last time, or any]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub(crate) port: Option<u16>,
    /// Open the page in the browser
    #[arg(long)]
    pub(crate) open: bool,
    /// Print the results in this folder instead: all subjects, pooled
    #[arg(long, value_name = "DIR", conflicts_with_all = ["real", "synthetic", "open", "port"])]
    pub(crate) results: Option<PathBuf>,
    /// Print results as JSON instead of a table
    #[arg(long, requires = "results", conflicts_with_all = ["real", "synthetic"])]
    pub(crate) json: bool,
}

/// Look at a data set or a slide in the browser: pan, zoom, focus, and the truth over the picture.
///
/// A page on this machine alone (127.0.0.1). Nothing is written; a data set or slide that is being made can be looked at, too.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth view fields
  papsynth view stacks --open            in the browser at once
  papsynth view slide --port 8080        a slide of `papsynth slide make` (a build with --features zarr)

Drag moves, the wheel zooms, with Shift it focuses; a click says what lies there. The address in the
browser keeps picture, place, focus and labels. Ctrl-C ends.")]
pub(crate) struct View {
    /// Folder of the data set or slide
    #[arg(value_name = "DIR")]
    pub(crate) dir: PathBuf,
    /// Port of 127.0.0.1 to serve the page at [default: any]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub(crate) port: Option<u16>,
    /// Open the page in the browser
    #[arg(long)]
    pub(crate) open: bool,
}
