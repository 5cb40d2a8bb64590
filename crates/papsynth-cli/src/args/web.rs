//! Options of `study`, `view` and `workbench`.

use std::path::PathBuf;

use clap::Args;
use papsynth_study::{Grey, StudyParams, TrialDesign};

use super::shared::EngineArgs;
use super::values::{integer, named, parse_pixel};
use crate::memory::parse_size;

/// Run a reader study: can observers distinguish real and synthetic images?
///
/// A page on this machine shows patches of real and synthetic fields for a short time and asks which are real, as in
/// the paper. It works offline, serves no other files, and saves every answer at once: run the same command again to
/// continue.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth study real fields --out results --subject 01          120 patches, about 10 minutes
  papsynth study real fields --out results --subject 02 --open
  papsynth study real fields --out pairs --design 2afc           two patches at a time
  papsynth study real fields --out try --trials 10 --exposure-ms 500
  papsynth study real fields --pixel-um 0.33                     resample to equal pixel sizes
  papsynth study --results results                               Table 1 of the paper

REAL and SYNTHETIC are folders of PNG, JPEG or TIFF images, data sets of papsynth, or folders of several \
data sets with different settings; results are then also listed by the settings that differ, and by \
defocus, stain and density. Of colour images the green channel is shown, of stacks the centre plane.

Grey levels are shown unchanged; --grey glass scales each field to equal background brightness. If \
both pixel sizes are known, the images with smaller pixels are resampled. Patches have random \
positions, 8 pixels or more from the border. At least a fifth of a patch is 8 % darker than the \
background, and two patches overlap by a quarter at most. In the folder of --out, each subject has a \
folder with trials.csv, summary.json, and the state of the session.

An accuracy near 0.5 with a margin of ±5 points needs 384 trials, of one or more subjects.")]
pub(crate) struct Study {
    /// Folder of real fields
    #[arg(value_name = "REAL", required_unless_present = "results")]
    pub(crate) real: Option<PathBuf>,
    /// Folder of synthetic fields
    #[arg(value_name = "SYNTHETIC", required_unless_present = "results")]
    pub(crate) synthetic: Option<PathBuf>,
    /// Folder of the results, with a folder per subject
    #[arg(long, value_name = "DIR", default_value = "results")]
    pub(crate) out: PathBuf,
    /// Name of the subject: letters, digits, `-`, `_` and `.`
    #[arg(long, value_name = "NAME", default_value_t = StudyParams::default().subject)]
    pub(crate) subject: String,
    /// Design of a trial: yes-no (is this patch real? as in the paper) or 2afc (which of two patches is real?)
    #[arg(long, value_name = "NAME", value_parser = named(TrialDesign::ALL, TrialDesign::name), default_value = StudyParams::default().task.name())]
    pub(crate) design: TrialDesign,
    /// Number of scored trials
    #[arg(long, value_name = "N", default_value_t = StudyParams::default().trials)]
    pub(crate) trials: usize,
    /// Number of practice trials
    #[arg(long, value_name = "N", default_value_t = StudyParams::default().training)]
    pub(crate) training: usize,
    /// Exposure time of a patch, in milliseconds
    #[arg(long, value_name = "MS", default_value_t = StudyParams::default().exposure_ms)]
    pub(crate) exposure_ms: u32,
    /// Standard deviation of the noise added to every pixel, in grey levels
    #[arg(long, value_name = "DN", default_value_t = StudyParams::default().noise_dn)]
    pub(crate) noise: f64,
    /// Width and height of a patch, in pixels
    #[arg(long, value_name = "PX", default_value_t = StudyParams::default().patch_px)]
    pub(crate) patch_px: usize,
    /// Number of fields used from each folder, chosen at random
    #[arg(long, value_name = "N", default_value_t = StudyParams::default().fields)]
    pub(crate) fields: usize,
    /// Seed of fields, patches, order and noise
    #[arg(long, value_name = "N", default_value_t = StudyParams::default().seed, value_parser = integer(0, u64::MAX))]
    pub(crate) seed: u64,
    /// Conversion of grey levels to 8 bits in both folders: as-is (scaled by bit depth) or glass (each field scaled to
    /// equal background brightness)
    #[arg(long, value_name = "NAME", value_parser = named(Grey::ALL, Grey::name), default_value = StudyParams::default().grey.name())]
    pub(crate) grey: Grey,
    /// Pixel size of the real images, in micrometres
    #[arg(long, value_name = "UM", value_parser = parse_pixel)]
    pub(crate) pixel_um: Option<f64>,
    /// Pixel size of the synthetic images, in micrometres [default: as recorded in the data set]
    #[arg(long, value_name = "UM", value_parser = parse_pixel)]
    pub(crate) synthetic_pixel_um: Option<f64>,
    /// Port of the page on 127.0.0.1 [default: the last port, or any free port]
    #[arg(long, value_name = "N", value_parser = integer(1, u16::MAX))]
    pub(crate) port: Option<u16>,
    /// Open the page in the browser
    #[arg(long)]
    pub(crate) open: bool,
    /// Print the pooled results of all subjects in this folder
    #[arg(long, value_name = "DIR", conflicts_with_all = ["real", "synthetic", "open", "port"])]
    pub(crate) results: Option<PathBuf>,
    /// Print results as JSON instead of a table
    #[arg(long, requires = "results", conflicts_with_all = ["real", "synthetic"])]
    pub(crate) json: bool,
}

/// View a data set or a slide in the browser, with pan, zoom, focus and ground truth.
///
/// The page is served on this machine only (127.0.0.1) and writes no files. Data sets and slides can be viewed while
/// they are written.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth view fields
  papsynth view stacks --open            open the browser
  papsynth view slide --port 8080        a slide; needs a build with --features zarr

Drag to pan, turn the wheel to zoom, turn it with Shift to focus, click to identify an object. The \
address in the browser stores image, position, focus and labels. Press Ctrl-C to quit.")]
pub(crate) struct View {
    /// Folder of the data set or slide
    #[arg(value_name = "DIR")]
    pub(crate) dir: PathBuf,
    /// Port of the page on 127.0.0.1 [default: any free port]
    #[arg(long, value_name = "N", value_parser = integer(1, u16::MAX))]
    pub(crate) port: Option<u16>,
    /// Open the page in the browser
    #[arg(long)]
    pub(crate) open: bool,
}

/// Change a recipe in the browser and see its image at once.
///
/// A page on this machine (127.0.0.1) shows every number of the recipe with its range and meaning, and one field of the
/// recipe. A change computes only what depends on it. The page works offline, and the program writes no files: the
/// browser saves recipe, image and label masks.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth workbench                               the default recipe
  papsynth workbench --preset dense --open         open the browser
  papsynth workbench my.toml --seed 7              a recipe of your own
  papsynth workbench --with calibrated.toml        sections of `papsynth calibrate` or `papsynth match`
  papsynth workbench --port 8080 --max-memory 2GiB

The page marks what differs from the preset, the default preset for a recipe in a file. It shows the command line and \
the Python code that generate the same field, and its link holds preset, differences, seed and view: it opens the same \
field in the workbench of another person. Drag to pan, turn the wheel to zoom, turn it with Shift to focus, click to \
identify an object. Press Ctrl-C to quit.")]
pub(crate) struct Workbench {
    #[command(flatten)]
    pub(crate) engine: EngineArgs,
    /// Memory for images: a size such as 2GiB [default: 80 % of the available memory]
    #[arg(long, value_name = "SIZE", value_parser = parse_size)]
    pub(crate) max_memory: Option<u64>,
    /// Port of the page on 127.0.0.1 [default: any free port]
    #[arg(long, value_name = "N", value_parser = integer(1, u16::MAX))]
    pub(crate) port: Option<u16>,
    /// Open the page in the browser
    #[arg(long)]
    pub(crate) open: bool,
}
