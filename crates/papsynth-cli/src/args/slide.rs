//! Options of the subcommands for slides.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::shared::EngineArgs;
use super::values::{integer, parse_extent, parse_pair};
use crate::memory::parse_size;
use crate::task::TaskArgs;

/// Generate slides, which may be larger than memory, and regions of slides.
///
/// `[scan]` of a recipe sets the size of a slide and the position of its deposit. A number of cells or debris per field
/// is that of a field completely inside the deposit.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth slide make --out slide --size 8192,8192 --set scan.deposit.x_um=1000 \\
      --set scan.deposit.y_um=1000
  papsynth slide tile --at 30000,28000 --size 1024,768 --out tile.png
  papsynth slide make --out big --task 0/16   task 0 of 16; after all tasks:
  papsynth slide finalize big
  papsynth verify big

A slide is an OME-Zarr 0.5 image with labels, and a table and a GeoJSON file of objects per \
shard.")]
pub(crate) struct Slide {
    /// The subcommand.
    #[command(subcommand)]
    pub(crate) verb: SlideVerb,
}

/// The subcommands for slides.
#[derive(Debug, Subcommand)]
pub(crate) enum SlideVerb {
    /// Generate a slide, or one task of it. Complete shards are not written again.
    Make(SlideMake),
    /// Finish a slide of several tasks: check that all shards are present, and write lower resolutions, thumbnail and
    /// card.
    Finalize(SlideFinalize),
    /// Write a region of a slide as a PNG. If the recipe has several planes, the PNG shows the central one.
    Tile(SlideTile),
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth slide make --out slide --size 8192,8192 --set scan.deposit.x_um=1000 \\
      --set scan.deposit.y_um=1000
  papsynth slide make mine.toml --out big --task 0/16   task 0 of 16
  papsynth slide make mine.toml --out big --verify      check and repair present files")]
pub(crate) struct SlideMake {
    #[command(flatten)]
    pub(crate) engine: EngineArgs,
    /// Folder of the slide: new, empty, or written by the same command
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Index of the slide
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = integer(0, (1_u64 << 30) - 1))]
    pub(crate) slide: u64,
    /// Width and height, px [default: scan.width_px and scan.height_px of the recipe]
    #[arg(long, value_name = "W,H", value_parser = parse_pair)]
    pub(crate) size: Option<[u32; 2]>,
    /// Width and height of a shard, the square region that is written or repaired together, px
    #[arg(long, value_name = "PX", default_value = "4096", value_parser = ["512", "1024", "2048", "4096", "8192"])]
    pub(crate) shard_px: String,
    /// Write tables of objects as CSV only, without Parquet
    #[cfg(feature = "parquet")]
    #[arg(long)]
    pub(crate) no_parquet: bool,
    #[command(flatten)]
    pub(crate) task: TaskArgs,
    /// Memory limit, for example 2GiB; fewer threads are used if needed [default: 80 % of the available memory, on
    /// Linux]
    #[arg(long, value_name = "SIZE", value_parser = parse_size)]
    pub(crate) max_memory: Option<u64>,
    /// Check the content of files that are already present, not only their sizes, and repair invalid files
    #[arg(long)]
    pub(crate) verify: bool,
    /// Print errors only
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  papsynth slide finalize big")]
pub(crate) struct SlideFinalize {
    /// Folder of the slide
    #[arg(value_name = "DIR")]
    pub(crate) dir: PathBuf,
    /// Check the content of all files first, not only their sizes
    #[arg(long)]
    pub(crate) verify: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  papsynth slide tile --at 30000,28000 --size 1024,768 --out tile.png")]
pub(crate) struct SlideTile {
    #[command(flatten)]
    pub(crate) engine: EngineArgs,
    /// PNG to write; replaces an older image of papsynth, but no other file
    #[arg(long, value_name = "FILE")]
    pub(crate) out: PathBuf,
    /// Replace any existing file
    #[arg(long)]
    pub(crate) force: bool,
    /// Index of the slide
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = integer(0, (1_u64 << 30) - 1))]
    pub(crate) slide: u64,
    /// Column and row of the top left pixel
    #[arg(long, value_name = "X,Y", value_parser = parse_pair)]
    pub(crate) at: [u32; 2],
    /// Width and height, px
    #[arg(long, value_name = "W,H", value_parser = parse_extent, default_value = "1024,1024")]
    pub(crate) size: [u32; 2],
}
