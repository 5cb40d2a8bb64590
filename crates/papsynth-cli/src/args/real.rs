//! What can be typed after verbs that look at real pictures.

use std::path::PathBuf;

use clap::{ArgGroup, Args};
use optics_psf::MicroscopeParams;
use optics_psf::calibrate::Window;
use papsynth::recipe::Preset;
use papsynth_judge::NucleiFrom;
use papsynth_study::{Grey, StudyParams, Task};

use super::values::{
    grey_parser, nuclei_parser, parse_budget, parse_class, parse_line, parse_pixel, parse_step, parse_window,
    preset_parser, task_parser,
};

/// Learn what cells of a class are like, from real material.
///
/// Reads nuclei with their masks, and cytoplasm as outlines or label images, and writes one model file for
/// `papsynth generate --model`. What is not given is kept as the base model has it.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("material").required(true).multiple(true)
    .args(["nuclei", "nucleus_outlines", "outlines", "labels"]), after_help = "\
Examples:
  papsynth learn --class intermediate --nuclei nuclei --outlines cells.csv --pixel-um 0.25 --out mine.json
  papsynth learn --class high-grade --nuclei hsil/crops --masks hsil/masks --pixel-um 0.25 \\
      --base mine.json --numbers-only --out mine.json
  papsynth learn --class parabasal --like intermediate --labels fields --pixel-um 0.33 --out mine.json

Images are PNG or TIFF in grey; a mask or label image is 0 outside. An outline file is CSV with the columns
outline, k, x_px, y_px: name of the outline, number of its point from 0, and its place in pixels.")]
pub(crate) struct Learn {
    /// Class that is learned: new, or one of the base model's to learn anew
    #[arg(long, value_name = "NAME", value_parser = parse_class)]
    pub(crate) class: String,
    /// Folder of nuclei: `images` and `masks` in it hold files of the same names
    #[arg(long, value_name = "DIR")]
    pub(crate) nuclei: Option<PathBuf>,
    /// Folder of the masks, where they are elsewhere; then `--nuclei` holds the images themselves
    #[arg(long, value_name = "DIR", requires = "nuclei")]
    pub(crate) masks: Option<PathBuf>,
    /// Outlines of nuclei, instead of those of their masks
    #[arg(long, value_name = "FILE.csv")]
    pub(crate) nucleus_outlines: Option<PathBuf>,
    /// Outlines of whole cells
    #[arg(long, value_name = "FILE.csv", conflicts_with = "labels")]
    pub(crate) outlines: Option<PathBuf>,
    /// Folder of label images of whole cells; those at an image's border are left out
    #[arg(long, value_name = "DIR")]
    pub(crate) labels: Option<PathBuf>,
    /// Size of a pixel of all of them, in micrometres
    #[arg(long, value_name = "UM", value_parser = parse_pixel)]
    pub(crate) pixel_um: f64,
    /// Class of the base model to take after in what the material does not show [default: the class itself]
    #[arg(long, value_name = "NAME")]
    pub(crate) like: Option<String>,
    /// Category of the Bethesda system, such as NILM or HSIL [default: that of the class it takes after]
    #[arg(long, value_name = "NAME")]
    pub(crate) bethesda: Option<String>,
    /// Where the material came from, for the record [default: the names of the files]
    #[arg(long, value_name = "TEXT")]
    pub(crate) source: Option<String>,
    /// Model to learn into [default: the one that ships]
    #[arg(long, value_name = "MODEL")]
    pub(crate) base: Option<PathBuf>,
    /// Keep means, covariances and spectra of this class alone, and no pixels
    #[arg(long)]
    pub(crate) numbers_only: bool,
    /// Model file to write; an older model is replaced, no other file
    #[arg(long, value_name = "MODEL.json")]
    pub(crate) out: PathBuf,
}

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
    #[arg(long, value_name = "NA", default_value_t = MicroscopeParams::default().na)]
    pub(crate) na: f64,
    /// Wavelength of the light, in micrometres
    #[arg(long, value_name = "UM", default_value_t = MicroscopeParams::default().wavelength_um)]
    pub(crate) wavelength_um: f64,
    /// Refractive index of the mountant
    #[arg(long, value_name = "N", default_value_t = MicroscopeParams::default().mount_index)]
    pub(crate) mount_index: f64,
    /// Refractive index between cover glass and objective: 1 dry, 1.515 oil
    #[arg(long, value_name = "N", default_value_t = MicroscopeParams::default().immersion_index)]
    pub(crate) immersion_index: f64,
    /// Folder to write to; older calibrations in it are replaced, no other file
    #[arg(long, value_name = "DIR", default_value = "calibration")]
    pub(crate) out: PathBuf,
}

/// Tell synthetic fields from real ones, and say what gives them away.
///
/// A classifier learns to tell nuclei, free cells and patches of both sides apart, and is tried on fields that it has not
/// seen; the same between halves of the real fields shows what chance does. Beside it stand the paper's Q-Q slopes of nuclear texture
/// and statistics of whole fields. Writes report.html, a page that needs nothing else, and report.json with the same numbers.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth judge slides fields --pixel-um 0.33 --out report
  papsynth judge slides fields --pixel-um 0.33 --group N --out report      negative fields alone
  papsynth judge slides other-slides --pixel-um 0.33 --synthetic-pixel-um 0.25 --out report

REAL and SYNTHETIC are each a data set of `papsynth generate`, or a folder of PNG or TIFF images
(16 bits are fine, of colours green is looked at), where what is known may lie beside them:
  NAME.csv     points in the nuclei of NAME.png, one `y,x` a line
  masks/       masks or label images of nuclei, of the same names
  frames.csv   the group of each image: `frame,grade`
Nuclei are taken from masks if all fields of both sides have them, else around points if all have
those or masks, else they are found: always in the same way on both sides. If pixels differ in size,
the finer side is averaged to the coarser. The page shows pieces of the images.")]
pub(crate) struct Judge {
    /// Folder of real fields; two or more
    #[arg(value_name = "REAL")]
    pub(crate) real: PathBuf,
    /// Folder of synthetic fields; two or more
    #[arg(value_name = "SYNTHETIC")]
    pub(crate) synthetic: PathBuf,
    /// Folder to write to; an older report in it is replaced, no other file
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Size of a pixel of the real fields, in micrometres [default: as recorded, else that of the other side]
    #[arg(long, value_name = "UM", value_parser = parse_pixel)]
    pub(crate) pixel_um: Option<f64>,
    /// Size of a pixel of the synthetic fields, in micrometres [default: as recorded, else that of the other side]
    #[arg(long, value_name = "UM", value_parser = parse_pixel)]
    pub(crate) synthetic_pixel_um: Option<f64>,
    /// Look at fields of this group alone, on each side that has it; repeatable
    #[arg(long, value_name = "NAME")]
    pub(crate) group: Vec<String>,
    /// Where nuclei are known from [default: masks if all fields have them, else points, else search]
    #[arg(long, value_name = "HOW", value_parser = nuclei_parser())]
    pub(crate) nuclei: Option<NucleiFrom>,
    /// Seed of all that is drawn
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Fewer trees, halvings and draws: for a first look
    #[arg(long)]
    pub(crate) quick: bool,
    /// Threads to work with; the numbers are the same with any [default: one a core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
}

/// Find the recipe of fields like real ones.
///
/// Light and noise are measured; the rest is searched by simulation: recipes from all over a range of possibilities are drawn and
/// imaged, regressions learn from them what statistics of fields say of parameters, and a search ends at the recipe
/// whose fields come nearest. Every number comes with a 95 % interval; what the fields do not tell is named and left as it was.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth match slides --pixel-um 0.33 --out mine.toml
  papsynth match slides --pixel-um 0.33 --group N --out mine.toml --report mine.json
  papsynth match slides --find-pixel --quick --out mine.toml
  papsynth generate mine.toml --out fields --frames 20

REAL is a folder as `papsynth judge` takes them: images of one size, and beside them, if they are known, masks of nuclei.
Without masks nuclei are searched for, in real and simulated fields alike; points are not used, as they are seldom of all nuclei.
Five to ten fields will do; of one alone no spread between fields can be told.")]
pub(crate) struct Match {
    /// Folder of real fields
    #[arg(value_name = "REAL")]
    pub(crate) real: PathBuf,
    /// Recipe to write; an older match of this name is replaced, no other file
    #[arg(long, value_name = "FILE")]
    pub(crate) out: PathBuf,
    /// The recipe to begin with
    #[arg(long, value_name = "NAME", value_parser = preset_parser(), default_value = Preset::Lbc.name(), hide_default_value = true)]
    pub(crate) preset: Preset,
    /// Size of a pixel, in micrometres [default: as recorded]
    #[arg(long, value_name = "UM", value_parser = parse_pixel)]
    pub(crate) pixel_um: Option<f64>,
    /// Find the size of a pixel too, taking cells to be as large as the recipe to begin with says
    #[arg(long)]
    pub(crate) find_pixel: bool,
    /// Look at fields of this group alone; repeatable
    #[arg(long, value_name = "NAME")]
    pub(crate) group: Vec<String>,
    /// Windows of 640 x 480 pixels to simulate, 60 or more, which takes most of the time [default: 2000]
    #[arg(long, value_name = "N", value_parser = parse_budget, conflicts_with = "quick")]
    pub(crate) budget: Option<usize>,
    /// Simulate a sixth as much: wider intervals, fewer parameters
    #[arg(long)]
    pub(crate) quick: bool,
    /// Model that `papsynth learn` wrote, or a class file (TOML), beside the classes that ship
    #[arg(long, value_name = "FILE")]
    pub(crate) model: Option<PathBuf>,
    /// Write all that was found here too, as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) report: Option<PathBuf>,
    /// Seed of all that is drawn
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Threads to work with; the recipe is the same with any number [default: one a core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
    /// Do not tell how far the work is
    #[arg(long)]
    pub(crate) quiet: bool,
}

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

REAL and SYNTHETIC are folders of PNG or TIFF images, data sets of papsynth, or folders of several
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
    #[arg(long, value_name = "NAME", value_parser = task_parser(), default_value = StudyParams::default().task.name())]
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
    #[arg(long, value_name = "NAME", value_parser = grey_parser(), default_value = StudyParams::default().grey.name())]
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
