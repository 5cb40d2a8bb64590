//! Options of the subcommands for data sets.

use std::path::PathBuf;

use clap::Args;
use papsynth::recipe::CameraPreset;
use papsynth_dataset::{Check, Format};

use super::shared::{EngineArgs, FileArgs, LayoutArgs};
use super::values::{camera_parser, format_parser, integer};

/// The check of present files, with or without `--verify`.
pub(crate) fn check_of(verify: bool) -> Check {
    if verify { Check::Hashes } else { Check::Sizes }
}

/// Check every file of a data set.
///
/// Finds changed, truncated, missing and untracked files, missing frames, and masks, boxes, areas, tables and label
/// images that contradict each other. Computes the files that cover all frames, such as coco.json, again and compares
/// them. To repair frames, run `papsynth generate --verify` with the same recipe.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth verify fields
  papsynth verify fields --frames 1000     also check that all 1000 frames are present
  papsynth verify fields --json

Exit codes: 0 no problems; 2 problems found; 74 input/output error.")]
pub(crate) struct Verify {
    /// Folder or object store of the data set
    #[arg(value_name = "DIR")]
    pub(crate) dir: PathBuf,
    /// Number of frames that must be present [default: up to the last one present]
    #[arg(long, value_name = "N", value_parser = integer(0, u64::MAX))]
    pub(crate) frames: Option<u64>,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// Remove temporary files of killed runs from a data set.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth clean fields
  papsynth clean fields --untracked --dry-run     list the files that --untracked would delete
  papsynth clean fields --untracked               also delete files that do not belong to the data set")]
pub(crate) struct Clean {
    /// Folder or object store of the data set
    #[arg(value_name = "DIR")]
    pub(crate) dir: PathBuf,
    /// Also delete all files that do not belong to the data set, such as your own; only after `papsynth merge`, because
    /// other tasks may still write files before
    #[arg(long)]
    pub(crate) untracked: bool,
    /// List the files, and remove none
    #[arg(long)]
    pub(crate) dry_run: bool,
}

/// Write a data set in other formats.
///
/// Copies images and masks without rendering. Run the same command again to continue after an interruption.
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
    /// Folder of the new data set: new, empty, or written by the same command
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Formats to write, separated by commas
    #[arg(long, value_name = "NAME", value_parser = format_parser(), value_delimiter = ',', required = true)]
    pub(crate) format: Vec<Format>,
    #[command(flatten)]
    pub(crate) files: FileArgs,
    /// Print errors only
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

/// Print how much of a data set is present, also while tasks write it.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth status fields --frames 100000
  papsynth status fields --frames 100000 --missing              print the missing shards
  sbatch --array=$(papsynth status fields --frames 100000 --missing --tasks 50) job.sh")]
pub(crate) struct Status {
    /// Folder or object store of the data set, or folder of a slide
    #[arg(value_name = "DIR")]
    pub(crate) dir: PathBuf,
    /// Number of frames of the complete data set; not needed for slides and merged data sets
    #[arg(long, value_name = "N", value_parser = integer(1, u64::MAX))]
    pub(crate) frames: Option<u64>,
    /// Print only the missing shards, as numbers and ranges for `sbatch --array`
    #[arg(long)]
    pub(crate) missing: bool,
    /// Print the numbers of the tasks that have missing shards, if the work is divided into N tasks (`--task I/N`)
    #[arg(long, value_name = "N", requires = "missing", value_parser = integer(1, u64::MAX))]
    pub(crate) tasks: Option<u64>,
}

/// Finish a data set of several tasks: check that all frames are present, and write the files that cover all frames,
/// such as coco.json.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  papsynth merge fields --frames 100000")]
pub(crate) struct Merge {
    /// Folder or object store of the data set
    #[arg(value_name = "DIR")]
    pub(crate) dir: PathBuf,
    /// Number of frames that must be present
    #[arg(long, value_name = "N", value_parser = integer(1, u64::MAX))]
    pub(crate) frames: u64,
    /// Check the content of all files before the merge, not only their sizes
    #[arg(long)]
    pub(crate) verify: bool,
}

/// Estimate time, disk space and memory of a data set from a few sample frames.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth plan --frames 100000
  papsynth plan my.toml --frames 1000000 --format webdataset --samples 16 --tasks 200
  papsynth plan my.toml --frames 1000000 --per-core-hour 0.04     estimate the price")]
pub(crate) struct Plan {
    #[command(flatten)]
    pub(crate) engine: EngineArgs,
    #[command(flatten)]
    pub(crate) layout: LayoutArgs,
    /// Number of frames of the data set
    #[arg(long, value_name = "N", value_parser = integer(1, u64::MAX))]
    pub(crate) frames: u64,
    /// Number of sample frames, generated on one thread and deleted
    #[arg(long, value_name = "K", default_value_t = 6, value_parser = integer(2, 1000_u64))]
    pub(crate) samples: u64,
    /// Number of tasks that share the work
    #[arg(long, value_name = "N", value_parser = integer(1, u64::MAX))]
    pub(crate) tasks: Option<u64>,
    /// Price of a core hour, in any currency
    #[arg(long, value_name = "PRICE")]
    pub(crate) per_core_hour: Option<f64>,
}

/// Print a script that generates a data set on a cluster.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth submit slurm --tasks 50 -- my.toml --out many --frames 100000 > job.sh
  papsynth submit kubernetes --tasks 50 --image registry.example/papsynth:0.1 \\
      -- --out /data/many --frames 100000 > job.yaml

Tasks that fail with an input/output error (exit code 74) are run again; tasks that fail with an \
error in usage, recipe or input (2) are not. When all tasks are done, run papsynth status, then \
papsynth merge.")]
pub(crate) struct Submit {
    /// Scheduler of the cluster
    #[arg(value_name = "SCHEDULER", value_parser = ["slurm", "kubernetes"])]
    pub(crate) scheduler: String,
    /// Number of tasks that share the work
    #[arg(long, value_name = "N", value_parser = integer(1, 100_000_u64))]
    pub(crate) tasks: u64,
    /// Number of threads of each task
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = integer(1, 1024_u16))]
    pub(crate) threads: u16,
    /// Container image with papsynth, for Kubernetes
    #[arg(long, value_name = "NAME", required_if_eq("scheduler", "kubernetes"))]
    pub(crate) image: Option<String>,
    /// Arguments of `papsynth generate`, without --task and --threads
    #[arg(last = true, required = true, value_name = "ARGUMENTS")]
    pub(crate) arguments: Vec<String>,
}

/// Render the scenes of a data set with another microscope, camera, light, focus, stain or background.
///
/// The objects do not change: the masks of both data sets are compared, and a difference is an error.
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
    /// Folder of the new data set: new, empty, or written by the same command
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// File with sections that replace those of the recipe; repeatable
    #[arg(long, value_name = "FILE")]
    pub(crate) with: Vec<PathBuf>,
    /// Built-in camera that replaces the camera of the recipe
    #[arg(long, value_name = "NAME", value_parser = camera_parser())]
    pub(crate) camera: Option<CameraPreset>,
    /// Set one parameter of the recipe; repeatable, the last value counts
    #[arg(long, value_name = "KEY=VALUE", allow_hyphen_values = true)]
    pub(crate) set: Vec<String>,
    #[command(flatten)]
    pub(crate) layout: LayoutArgs,
    /// Number of threads [default: the number of cores]
    #[arg(long, value_name = "N", value_parser = integer(1, 1024_u16))]
    pub(crate) threads: Option<u16>,
    /// Print errors only
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

/// Generate the same fields with every combination of settings, and a table of all images.
///
/// Each combination is a data set in its own folder. Objects and images change only where they depend on the settings.
/// `sweep.csv` has a row per image with its settings, to join with the results of your method.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth sweep --out sweep --frames 8 --vary focus.centre_um=-4,-2,0,2,4
  papsynth sweep mine.toml --out sweep --frames 20 --vary debris.bacilli.clusters=0,8,32 \\
      --vary camera.full_well_e=2000,18000
  papsynth sweep --out sweep --frames 4 --vary stain.slide_nucleus=0.5,1,2 \\
      --vary background.illumination.falloff_x=0,0.1,0.3")]
pub(crate) struct Sweep {
    #[command(flatten)]
    pub(crate) engine: EngineArgs,
    /// Folder of the sweep: new, empty, or written by the same command
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Number of frames of each combination
    #[arg(long, value_name = "N", value_parser = integer(1, u64::MAX))]
    pub(crate) frames: u64,
    /// Parameter of the recipe and its values; repeatable, all combinations are generated
    #[arg(long, value_name = "KEY=A,B,…", required = true, allow_hyphen_values = true)]
    pub(crate) vary: Vec<String>,
    #[command(flatten)]
    pub(crate) layout: LayoutArgs,
    /// Print errors only
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

/// Print the contents of a data set.
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
    /// Check the SHA-256 of every file, not only its size
    #[arg(long)]
    pub(crate) verify: bool,
    /// Print JSON instead of a table
    #[arg(long)]
    pub(crate) json: bool,
}
