//! What can be typed about whole slides.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::shared::EngineArgs;
use super::values::parse_pair;
use crate::memory::parse_size;
use crate::share::ShareArgs;

/// Whole slides, larger than memory, and any part of one.
///
/// `[scan]` of a recipe says how large a slide is and where its deposit lies; counts of cells and debris are those of a field where the
/// deposit is full.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth slide make --out slide --size 8192,8192 --set scan.deposit.x_um=1000 --set scan.deposit.y_um=1000
  papsynth slide tile --at 30000,28000 --size 1024,768 --out tile.png    any part, without the rest
  papsynth slide make --out big --shard 0/16                             one of sixteen shares; then
  papsynth slide finalize big
  papsynth verify big

A slide is an OME-Zarr 0.5 image with labels, and a table and a GeoJSON file of objects for every square of it.")]
pub(crate) struct Slide {
    /// What to do.
    #[command(subcommand)]
    pub(crate) verb: SlideVerb,
}

/// What is done with slides.
#[derive(Debug, Subcommand)]
pub(crate) enum SlideVerb {
    /// Make a slide, or a share of it; what is whole is left alone.
    Make(SlideMake),
    /// Close a slide whose shards were made by several: the upper levels, a thumbnail, a card. Fails on any gap.
    Finalize(SlideFinalize),
    /// Make any part of a slide alone, as a PNG; of several planes the middle one.
    Tile(SlideTile),
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth slide make --out slide --size 8192,8192 --set scan.deposit.x_um=1000 --set scan.deposit.y_um=1000
  papsynth slide make mine.toml --out big --shard 0/16         one of sixteen shares
  papsynth slide make mine.toml --out big --verify             reads what is there, and makes again what is wrong")]
pub(crate) struct SlideMake {
    #[command(flatten)]
    pub(crate) engine: EngineArgs,
    /// Folder of the slide: new, empty, or one that this command began
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Number of the slide among those of the seed
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u64).range(0..1 << 30))]
    pub(crate) slide: u64,
    /// Columns and rows, px [default: scan.width_px and scan.height_px of the recipe]
    #[arg(long, value_name = "W,H", value_parser = parse_pair)]
    pub(crate) size: Option<[u32; 2]>,
    /// Side of the squares that are written and made again together, px
    #[arg(long, value_name = "PX", default_value = "4096", value_parser = ["512", "1024", "2048", "4096", "8192"])]
    pub(crate) shard_px: String,
    /// Write tables of objects as CSV alone, not as Parquet too
    #[cfg(feature = "parquet")]
    #[arg(long)]
    pub(crate) no_parquet: bool,
    #[command(flatten)]
    pub(crate) share: ShareArgs,
    /// Memory to use at most, such as 2GiB: fewer frames are made side by side if need be [default: 80 % of what is available, where the
    /// system tells]
    #[arg(long, value_name = "SIZE", value_parser = parse_size)]
    pub(crate) max_memory: Option<u64>,
    /// Read all files of shards that are there before they are kept
    #[arg(long)]
    pub(crate) verify: bool,
    /// Say nothing but errors
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  papsynth slide finalize big")]
pub(crate) struct SlideFinalize {
    /// Folder of the slide
    #[arg(value_name = "DIR")]
    pub(crate) dir: PathBuf,
    /// Read all files of shards before, not their sizes alone
    #[arg(long)]
    pub(crate) verify: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  papsynth slide tile --at 30000,28000 --size 1024,768 --out tile.png")]
pub(crate) struct SlideTile {
    #[command(flatten)]
    pub(crate) engine: EngineArgs,
    /// PNG to write: of a slide of several planes the middle one
    #[arg(long, value_name = "FILE")]
    pub(crate) out: PathBuf,
    /// Number of the slide among those of the seed
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u64).range(0..1 << 30))]
    pub(crate) slide: u64,
    /// Column and row of the first pixel
    #[arg(long, value_name = "X,Y", value_parser = parse_pair)]
    pub(crate) at: [u32; 2],
    /// Columns and rows, px
    #[arg(long, value_name = "W,H", value_parser = parse_pair, default_value = "1024,1024")]
    pub(crate) size: [u32; 2],
}
