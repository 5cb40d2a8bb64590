//! What can be typed after `judge` and `match`.

use std::path::PathBuf;

use clap::Args;
use papsynth::recipe::Preset;
use papsynth_judge::NucleiFrom;

use super::values::{named, parse_pixel, preset_parser};

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

REAL and SYNTHETIC are each a data set of `papsynth generate`, or a folder of PNG, JPEG or TIFF images
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
    #[arg(long, value_name = "HOW", value_parser = named(NucleiFrom::ALL, NucleiFrom::name))]
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

fn parse_budget(text: &str) -> Result<usize, String> {
    /// Fewer windows teach nothing.
    const ALLOWED: std::ops::RangeInclusive<usize> = 60..=1_000_000;
    match text.parse() {
        Ok(value) if ALLOWED.contains(&value) => Ok(value),
        _ => Err(format!("expected {} to {} windows", ALLOWED.start(), ALLOWED.end())),
    }
}
