//! What can be typed about data sets: their formats, their shares, what is done with them afterwards.

use std::path::PathBuf;

use clap::Args;
use papsynth::recipe::CameraPreset;
use papsynth_dataset::{Check, Format};

use super::shared::{EngineArgs, FileArgs, LayoutArgs};
use super::values::{camera_parser, format_parser};

/// How carefully files that are there are looked at, with `--verify` or without.
pub(crate) fn check_of(verify: bool) -> Check {
    if verify { Check::Hashes } else { Check::Sizes }
}

/// Read every file of a data set and say what is wrong.
///
/// Finds every bit that has changed, every file that is cut, missing or too many, every frame that is missing, and masks, boxes, areas, tables
/// and label images that do not fit together; what `papsynth merge` writes is made again and compared. `papsynth generate --verify` with the same recipe mends what is found.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth verify fields
  papsynth verify fields --frames 1000     every one of them must be there
  papsynth verify fields --json

Exit codes: 0 whole; 2 something is wrong; 74 input/output.")]
pub(crate) struct Verify {
    /// Folder or object store of the data set
    #[arg(value_name = "DIR")]
    pub(crate) dir: PathBuf,
    /// Frames that must be there: those with index 0 to N − 1 [default: up to the last that is]
    #[arg(long, value_name = "N")]
    pub(crate) frames: Option<u64>,
    /// As JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// Remove what killed runs left behind in a data set.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth clean fields
  papsynth clean fields --strays     also everything else that is no file of the data set")]
pub(crate) struct Clean {
    /// Folder or object store of the data set
    #[arg(value_name = "DIR")]
    pub(crate) dir: PathBuf,
    /// Remove every file that the data set does not name, whoever put it there; once it is merged, since before others may be writing
    #[arg(long)]
    pub(crate) strays: bool,
}

/// Write a data set in other formats.
///
/// Nothing is rendered: images are copied level by level, truth mask by mask. Running the same command again goes on where it was stopped.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth convert fields --format cellpose --out for-cellpose
  papsynth convert fields --format stardist --flatten drop --out for-stardist
  papsynth convert fields --format webdataset,qupath --out both")]
pub(crate) struct Convert {
    /// Folder of the data set
    #[arg(value_name = "DIR")]
    pub(crate) dir: PathBuf,
    /// Folder of the new data set: new, empty, or one that this command began
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Formats to write, one or several
    #[arg(long, value_name = "NAME", value_parser = format_parser(), value_delimiter = ',', required = true)]
    pub(crate) format: Vec<Format>,
    #[command(flatten)]
    pub(crate) files: FileArgs,
    /// Say nothing but errors
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

/// Say how much of a data set is there, also while others write it.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth status fields --frames 100000
  papsynth status fields --frames 100000 --missing              numbers of the shards that are missing
  sbatch --array=$(papsynth status fields --frames 100000 --missing --tasks 50) job.sh")]
pub(crate) struct Status {
    /// Folder or object store of the data set, or folder of a slide
    #[arg(value_name = "DIR")]
    pub(crate) dir: PathBuf,
    /// Frames that there will be: those with index 0 to N − 1; a slide, or a data set that was merged, knows it by itself
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) frames: Option<u64>,
    /// Print only what is missing, as numbers and ranges that `sbatch --array` takes; nothing if nothing is
    #[arg(long)]
    pub(crate) missing: bool,
    /// Count in tasks of an array of N (`--shard auto`, `--shard I/N`) instead of shards
    #[arg(long, value_name = "N", requires = "missing", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) tasks: Option<u64>,
}

/// Close a data set that several runs have made: fail on any gap, write the files about all frames.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  papsynth merge fields --frames 100000")]
pub(crate) struct Merge {
    /// Folder or object store of the data set
    #[arg(value_name = "DIR")]
    pub(crate) dir: PathBuf,
    /// Frames that must be there: those with index 0 to N − 1
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) frames: u64,
    /// Read all files of shards before they are merged, not their sizes alone
    #[arg(long)]
    pub(crate) verify: bool,
}

/// Say what a data set will cost, from a few frames made for it: time, bytes, memory, shards.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth plan --frames 100000
  papsynth plan my.toml --frames 1000000 --format webdataset --samples 16 --tasks 200
  papsynth plan my.toml --frames 1000000 --per-core-hour 0.04     what it costs where a core costs that much an hour")]
pub(crate) struct Plan {
    #[command(flatten)]
    pub(crate) engine: EngineArgs,
    #[command(flatten)]
    pub(crate) layout: LayoutArgs,
    /// Frames that there will be
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) frames: u64,
    /// Frames to make and throw away, on one thread
    #[arg(long, value_name = "K", default_value_t = 6, value_parser = clap::value_parser!(u64).range(2..=1000))]
    pub(crate) samples: u64,
    /// Tasks of an array that share the work
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) tasks: Option<u64>,
    /// Price of a core for an hour, in any currency
    #[arg(long, value_name = "PRICE")]
    pub(crate) per_core_hour: Option<f64>,
}

/// Print a script that makes a data set on a cluster; nothing is run.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth submit slurm --tasks 50 -- my.toml --out many --frames 100000 > job.sh
  papsynth submit kubernetes --tasks 50 --image registry.example/papsynth:0.1 -- --out /data/many --frames 100000 > job.yaml

Tasks that fail by input/output (exit code 74) are run again, tasks that fail by usage, recipe or input (2) are not. When all have ended: papsynth status, then papsynth merge.")]
pub(crate) struct Submit {
    /// What schedules the tasks
    #[arg(value_name = "SCHEDULER", value_parser = ["slurm", "kubernetes"])]
    pub(crate) scheduler: String,
    /// Tasks that share the work
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=100_000))]
    pub(crate) tasks: u64,
    /// Threads of each task
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: u16,
    /// Container image that holds the program, for Kubernetes
    #[arg(long, value_name = "NAME", required_if_eq("scheduler", "kubernetes"))]
    pub(crate) image: Option<String>,
    /// What follows `papsynth generate`, without --shard and --threads
    #[arg(last = true, required = true, value_name = "ARGUMENTS")]
    pub(crate) arguments: Vec<String>,
}

/// Image the scenes of a data set again under another microscope, camera, light, focus, stain or background.
///
/// Everything lies where it lay: the masks of both data sets are compared, and a difference is an error.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth rerender fields --out soft --set optics.extra_blur_um=0.6
  papsynth rerender fields --out scanner --with calibration/optics.toml --camera scmos
  papsynth rerender fields --out faint --set stain.slide_nucleus=0.5 --set focus.centre_um=3")]
pub(crate) struct Rerender {
    /// Folder of the data set
    #[arg(value_name = "DIR")]
    pub(crate) dir: PathBuf,
    /// Folder of the new data set: new, empty, or one that this command began
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Sections to put in the place of the recipe's; repeatable
    #[arg(long, value_name = "FILE")]
    pub(crate) with: Vec<PathBuf>,
    /// A built-in camera instead of the recipe's
    #[arg(long, value_name = "NAME", value_parser = camera_parser())]
    pub(crate) camera: Option<CameraPreset>,
    /// Set one field over the recipe; repeatable, the last one wins
    #[arg(long, value_name = "FIELD=VALUE", allow_hyphen_values = true)]
    pub(crate) set: Vec<String>,
    #[command(flatten)]
    pub(crate) layout: LayoutArgs,
    /// Threads to work with [default: one a core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
    /// Say nothing but errors
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

/// Make the same fields under every combination of some settings, and one table of them all.
///
/// Each combination becomes a data set in a folder of its own; what does not depend on what is varied stays the same. `sweep.csv` has a row for each
/// image with the settings that made it: join it with what your method finds there.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth sweep --out sweep --frames 8 --vary focus.centre_um=-4,-2,0,2,4
  papsynth sweep mine.toml --out sweep --frames 20 --vary debris.bacilli.clusters=0,8,32 --vary camera.full_well_e=2000,18000
  papsynth sweep --out sweep --frames 4 --vary stain.slide_nucleus=0.5,1,2 --vary background.illumination.falloff_x=0,0.1,0.3")]
pub(crate) struct Sweep {
    #[command(flatten)]
    pub(crate) engine: EngineArgs,
    /// Folder of the sweep: new, empty, or one that this command began
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Number of frames of each combination
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) frames: u64,
    /// A field of the recipe and the values that it takes, separated by commas; repeatable, all are combined
    #[arg(long, value_name = "FIELD=A,B,…", required = true, allow_hyphen_values = true)]
    pub(crate) vary: Vec<String>,
    #[command(flatten)]
    pub(crate) layout: LayoutArgs,
    /// Say nothing but errors
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

/// Show what is in a data set.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth inspect fields
  papsynth inspect fields --verify
  papsynth inspect fields --json")]
pub(crate) struct Inspect {
    /// Folder of the data set
    #[arg(value_name = "DIR")]
    pub(crate) dir: PathBuf,
    /// Read every file and compare its SHA-256, instead of its size alone
    #[arg(long)]
    pub(crate) verify: bool,
    /// As JSON instead of a table
    #[arg(long)]
    pub(crate) json: bool,
}
