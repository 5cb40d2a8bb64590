//! Options of `judge` and `match`.

use std::path::PathBuf;

use clap::Args;
use papsynth_judge::{FeatureSet, NucleiFrom};

use super::shared::RecipeArgs;
use super::values::{integer, named, parse_pixel};

/// Test whether synthetic fields can be distinguished from real ones, and list the distinguishing features.
///
/// Classifiers are trained on nuclei, free cells and patches, and tested on fields outside the training set. The same
/// test between halves of the real fields gives the result expected by chance. The report also has the Q-Q slopes of
/// nuclear texture of the paper and statistics of complete fields. Writes report.html, a page without external files,
/// and report.json with the same numbers.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth judge slides fields --pixel-um 0.33 --out report
  papsynth judge slides fields --pixel-um 0.33 --group N --out report      only negative fields
  papsynth judge slides other-slides --pixel-um 0.33 --synthetic-pixel-um 0.25 --out report

REAL and SYNTHETIC are each a data set of `papsynth generate`, or a folder of PNG, JPEG or TIFF images \
of 8 or 16 bits; of colour images the green channel is used. A folder may also hold:
  NAME.csv     points in the nuclei of NAME.png, one `y,x` per line
  masks/       masks or label images of nuclei, with the names of the images
  frames.csv   the group of each image, with the columns `frame,grade`
Nuclei come from masks if all fields of both folders have them, else from points if all fields have \
points or masks, else they are found automatically: always in the same way in both folders. If pixel \
sizes differ, the images with smaller pixels are averaged to the larger size. The page shows parts of \
the images.")]
pub(crate) struct Judge {
    /// Folder with 2 or more real fields
    #[arg(value_name = "REAL")]
    pub(crate) real: PathBuf,
    /// Folder with 2 or more synthetic fields
    #[arg(value_name = "SYNTHETIC")]
    pub(crate) synthetic: PathBuf,
    /// Output folder; replaces an older report in it, but no other file
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Pixel size of the real fields, in micrometres [default: as recorded in the data set, else that of the
    /// other folder]
    #[arg(long, value_name = "UM", value_parser = parse_pixel)]
    pub(crate) pixel_um: Option<f64>,
    /// Pixel size of the synthetic fields, in micrometres [default: as recorded in the data set, else that of the
    /// other folder]
    #[arg(long, value_name = "UM", value_parser = parse_pixel)]
    pub(crate) synthetic_pixel_um: Option<f64>,
    /// Use only fields of this group, in folders that have groups; repeatable
    #[arg(long, value_name = "NAME")]
    pub(crate) group: Vec<String>,
    /// Source of nuclei [default: masks if all fields have them, else points, else search]
    #[arg(long, value_name = "SOURCE", value_parser = named(NucleiFrom::ALL, NucleiFrom::name))]
    pub(crate) nuclei: Option<NucleiFrom>,
    /// Set of features: 1, of version 0.1, for comparison with older reports; 2, also the texture of cytoplasm
    #[arg(long, value_name = "SET", default_value = "2", value_parser = named(FeatureSet::ALL, FeatureSet::name))]
    pub(crate) features: FeatureSet,
    /// Seed of the random numbers
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = integer(0, u64::MAX))]
    pub(crate) seed: u64,
    /// Use fewer trees, splits and resamples, for a first impression
    #[arg(long)]
    pub(crate) quick: bool,
    /// Number of threads; does not change the report [default: the number of cores]
    #[arg(long, value_name = "N", value_parser = integer(1, 1024_u16))]
    pub(crate) threads: Option<u16>,
    /// Print no progress
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

/// Find the recipe whose fields resemble real ones.
///
/// Light and noise are measured. All other parameters come from simulation: fields with random parameters show how the
/// statistics of nuclei, cells, debris and background depend on them; then a few rounds of fields around the result
/// correct it. Each real field has values of its own: the recipe holds them as conditions, one of which is drawn for
/// each slide. Every value has a 95 % interval; parameters without visible influence are listed and keep their values.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth match slides --pixel-um 0.33 --out mine.toml
  papsynth match slides --pixel-um 0.33 --group N --preset extended-focus --out mine.toml --report mine.json
  papsynth match slides start.toml --pixel-um 0.33 --out mine.toml --page mine.html
  papsynth match slides --find-pixel --quick --out mine.toml
  papsynth generate mine.toml --out fields --frames 20

REAL is a folder as for `papsynth judge`: 2 or more images of one size and one magnification. Nuclei come \
from masks or points if all fields have them, else they are found automatically; always in the same way \
in real and simulated fields. Points must mark all nuclei, else use --nuclei search. If all fields are \
colour images, the dyes of nuclei and cytoplasm are matched as well, and the recipe is one of colour images.

Eight fields of 1280 x 960 pixels take about two minutes on two cores; the progress line shows the time \
left. Ctrl-C ends the match, and no file is written.")]
pub(crate) struct Match {
    /// Folder of real fields
    #[arg(value_name = "REAL")]
    pub(crate) real: PathBuf,
    /// The initial recipe
    #[command(flatten)]
    pub(crate) recipe: RecipeArgs,
    /// Recipe to write; replaces an older recipe of papsynth match, but no other file
    #[arg(long, value_name = "FILE")]
    pub(crate) out: PathBuf,
    /// Replace any existing file
    #[arg(long)]
    pub(crate) force: bool,
    /// Pixel size, in micrometres [default: as recorded]
    #[arg(long, value_name = "UM", value_parser = parse_pixel)]
    pub(crate) pixel_um: Option<f64>,
    /// Also estimate the pixel size, from the cell size of the initial recipe
    #[arg(long)]
    pub(crate) find_pixel: bool,
    /// Use only fields of this group; repeatable
    #[arg(long, value_name = "NAME")]
    pub(crate) group: Vec<String>,
    /// Source of nuclei [default: masks if all fields have them, else points, else search]
    #[arg(long, value_name = "SOURCE", value_parser = named(NucleiFrom::ALL, NucleiFrom::name))]
    pub(crate) nuclei: Option<NucleiFrom>,
    /// Number of simulated fields with random parameters [default: 150]
    #[arg(long, value_name = "N", value_parser = integer(60, 1_000_000_usize), conflicts_with = "quick")]
    pub(crate) simulations: Option<usize>,
    /// Simulate fewer fields, for a first impression: wider intervals
    #[arg(long)]
    pub(crate) quick: bool,
    /// Then improve the recipe in this many rounds, so that classifiers tell simulated from real fields less often;
    /// half of the fields are held out
    #[arg(long, value_name = "ROUNDS", default_value_t = 0, hide_default_value = true, value_parser = integer(0, 10_000_usize))]
    pub(crate) refine: usize,
    /// Model of `papsynth learn`, or class file (TOML), in addition to the built-in classes
    #[arg(long, value_name = "FILE")]
    pub(crate) model: Option<PathBuf>,
    /// Also write all results to this file, as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) report: Option<PathBuf>,
    /// Also compare simulated with real fields as `papsynth judge --quick`, and write its page, which shows parts of
    /// the images
    #[arg(long, value_name = "FILE")]
    pub(crate) page: Option<PathBuf>,
    /// Seed of the random numbers
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = integer(0, u64::MAX))]
    pub(crate) seed: u64,
    /// Number of threads; does not change the recipe [default: the number of cores]
    #[arg(long, value_name = "N", value_parser = integer(1, 1024_u16))]
    pub(crate) threads: Option<u16>,
    /// Print no progress
    #[arg(long, short)]
    pub(crate) quiet: bool,
}
