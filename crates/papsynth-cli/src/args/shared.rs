//! What several commands share: recipe, model, seed and threads, and the files of a data set.

use std::path::PathBuf;

use clap::Args;
use papsynth::recipe::{CameraPreset, Preset};
use papsynth_dataset::{Flatten, Format, Layout};

use super::values::{camera_parser, format_parser, named, preset_parser};

/// What a recipe is made of.
#[derive(Debug, Clone, Args)]
pub(crate) struct RecipeArgs {
    /// Recipe in TOML, as `papsynth init` prints it; `-` reads standard input [default: the preset `lbc`]
    #[arg(value_name = "RECIPE")]
    pub(crate) recipe: Option<PathBuf>,
    /// A built-in recipe instead of a file
    #[arg(long, value_name = "NAME", value_parser = preset_parser(), conflicts_with = "recipe")]
    pub(crate) preset: Option<Preset>,
    /// Sections to put in the place of the recipe's, such as `papsynth calibrate` measured; repeatable
    #[arg(long, value_name = "FILE")]
    pub(crate) with: Vec<PathBuf>,
    /// A built-in camera instead of the recipe's
    #[arg(long, value_name = "NAME", value_parser = camera_parser())]
    pub(crate) camera: Option<CameraPreset>,
    /// Set one field over the recipe; repeatable, the last one wins
    #[arg(long, value_name = "FIELD=VALUE", allow_hyphen_values = true)]
    pub(crate) set: Vec<String>,
}

/// What an engine is made of.
#[derive(Debug, Clone, Args)]
pub(crate) struct EngineArgs {
    #[command(flatten)]
    pub(crate) recipe: RecipeArgs,
    /// Model that `papsynth learn` wrote, or a class file (TOML), beside the classes that ship
    #[arg(long, value_name = "FILE")]
    pub(crate) model: Option<PathBuf>,
    /// Seed of the whole data set; recipes that differ share what they have in common under the same seed
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Threads to work with; the bytes are the same with any number [default: one a core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
}

/// As many threads as asked for, or one a core.
pub(crate) fn threads(asked: Option<u16>) -> usize {
    match asked {
        Some(threads) => usize::from(threads),
        None => std::thread::available_parallelism().map_or(1, usize::from),
    }
}

/// How a data set lies in files.
#[derive(Debug, Args)]
pub(crate) struct LayoutArgs {
    /// Formats to write, one or several [default: folder; webdataset above 10000 frames]
    #[arg(long, value_name = "NAME", value_parser = format_parser(), value_delimiter = ',')]
    pub(crate) format: Vec<Format>,
    #[command(flatten)]
    pub(crate) files: FileArgs,
    /// Write the scene of each frame too, as scenes/NNNNNN.json, which `papsynth render` reads
    #[arg(long)]
    pub(crate) scenes: bool,
}

/// The same, whatever the formats.
#[derive(Debug, Args)]
pub(crate) struct FileArgs {
    /// What a pixel shows that belongs to several objects, in formats with one label a pixel
    #[arg(long, value_name = "POLICY", value_parser = named(Flatten::ALL, Flatten::name), default_value = Flatten::Top.name())]
    pub(crate) flatten: Flatten,
    /// Frames that are written and made again together [default: 1; 256 with webdataset and huggingface]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    pub(crate) frames_per_shard: Option<u64>,
    /// Write the table of objects as CSV alone, not as Parquet too
    #[cfg(feature = "parquet")]
    #[arg(long)]
    pub(crate) no_parquet: bool,
}

impl LayoutArgs {
    /// From this many frames on a folder of single files is a burden.
    pub(crate) const MOST_IN_FOLDERS: u64 = 10_000;

    /// The layout of a data set of so many frames, and whether its format was chosen for their number.
    pub(crate) fn layout(&self, frames: u64) -> (Layout, bool) {
        let many = self.format.is_empty() && frames > Self::MOST_IN_FOLDERS;
        let usual = if many { Format::Webdataset } else { Format::Folder };
        let formats = if self.format.is_empty() { vec![usual] } else { self.format.clone() };
        (Layout { scenes: self.scenes, ..self.files.layout(formats) }, many)
    }
}

impl FileArgs {
    pub(crate) fn layout(&self, formats: Vec<Format>) -> Layout {
        let mut layout = Layout::new(formats);
        layout.flatten = self.flatten;
        #[cfg(feature = "parquet")]
        if self.no_parquet {
            layout.objects_parquet = false;
        }
        if let Some(frames) = self.frames_per_shard {
            layout.frames_per_shard = frames;
        }
        layout
    }
}
