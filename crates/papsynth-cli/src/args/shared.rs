//! Options of several subcommands: recipe, model, seed, threads, and the files of a data set.

use std::path::PathBuf;
use std::sync::Once;

use clap::Args;
use papsynth::recipe::{CameraPreset, Preset};
use papsynth::truth::MIN_DETECTABILITY;
use papsynth_dataset::{Extra, Flatten, Format, Layout};

use super::values::{camera_parser, extra_parser, format_parser, integer, named, number, preset_parser};
use crate::exit;
use crate::words::counted;

/// Options of the recipe.
#[derive(Debug, Clone, Args)]
pub(crate) struct RecipeArgs {
    /// Recipe in TOML, as printed by `papsynth init`; `-` reads standard input [default: the preset `lbc`]
    #[arg(value_name = "RECIPE")]
    pub(crate) recipe: Option<PathBuf>,
    /// Built-in recipe instead of a file; `papsynth init --list` prints all
    #[arg(long, value_name = "NAME", value_parser = preset_parser(), hide_possible_values = true, conflicts_with = "recipe")]
    pub(crate) preset: Option<Preset>,
    /// File with sections that replace those of the recipe, such as the output of `papsynth calibrate`; repeatable
    #[arg(long, value_name = "FILE")]
    pub(crate) with: Vec<PathBuf>,
    /// Built-in camera that replaces the camera of the recipe
    #[arg(long, value_name = "NAME", value_parser = camera_parser())]
    pub(crate) camera: Option<CameraPreset>,
    /// Widen the distributions of stain, focus, light, noise, texture, debris and crowding by this factor, for
    /// training; 1.5 adds half of the spread between real slides
    #[arg(long, value_name = "FACTOR", value_parser = number(1.0, 5.0))]
    pub(crate) widen: Option<f64>,
    /// Set one parameter of the recipe, also where the recipe has [[conditions]]; repeatable, the last value counts
    #[arg(long, value_name = "KEY=VALUE", allow_hyphen_values = true)]
    pub(crate) set: Vec<String>,
    /// As `set`, from `--vary` of `papsynth sweep`.
    #[arg(skip)]
    pub(crate) vary: Vec<String>,
}

/// Options of the engine.
#[derive(Debug, Clone, Args)]
pub(crate) struct EngineArgs {
    #[command(flatten)]
    pub(crate) recipe: RecipeArgs,
    /// Model of `papsynth learn`, or class file (TOML), in addition to the built-in classes
    #[arg(long, value_name = "FILE")]
    pub(crate) model: Option<PathBuf>,
    /// Seed of the data set. Recipes with the same seed generate the same objects, except where their parameters differ
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = integer(0, u64::MAX))]
    pub(crate) seed: u64,
    /// Number of threads; does not change the output [default: the number of cores]
    #[arg(long, value_name = "N", value_parser = integer(1, 1024_u16))]
    pub(crate) threads: Option<u16>,
}

/// The number of threads of `--threads`, or of cores. More than 8 threads are limited to the number of cores, because
/// more only slow a run down.
pub(crate) fn threads(asked: Option<u16>) -> usize {
    const ALWAYS_ALLOWED: usize = 8;
    static NOTE: Once = Once::new();
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let Some(asked) = asked.map(usize::from) else { return cores };
    let limit = cores.max(ALWAYS_ALLOWED);
    if asked > limit {
        let cores = counted(cores as u64, "core", "cores");
        NOTE.call_once(|| exit::note(format!("--threads {asked}: {limit} are used, as this machine has {cores}")));
    }
    asked.min(limit)
}

/// Formats and files of a data set.
#[derive(Debug, Args)]
pub(crate) struct LayoutArgs {
    /// Formats to write, separated by commas [default: folder; webdataset above 10000 frames]
    #[arg(long, value_name = "NAME", value_parser = format_parser(), value_delimiter = ',')]
    pub(crate) format: Vec<Format>,
    #[command(flatten)]
    pub(crate) files: FileArgs,
    /// Also write the scene of each frame to scenes/NNNNNN.json, for `papsynth render`
    #[arg(long)]
    pub(crate) scenes: bool,
}

/// Files of a data set, for all formats.
#[derive(Debug, Args)]
pub(crate) struct FileArgs {
    /// Label of a pixel with several objects, in formats with one label per pixel: top (nearest to the objective), drop
    /// (background) or max (largest id)
    #[arg(long, value_name = "POLICY", value_parser = named(Flatten::ALL, Flatten::name), default_value = Flatten::Top.name())]
    pub(crate) flatten: Flatten,
    /// Frames per shard, the group of frames that is written or repaired together [default: 1; 256 with webdataset and
    /// huggingface]
    #[arg(long, value_name = "N", value_parser = integer(1, 1_000_000_u64))]
    pub(crate) frames_per_shard: Option<u64>,
    /// Files to leave out, separated by commas
    #[arg(long, value_name = "FILES", value_parser = extra_parser(), value_delimiter = ',')]
    pub(crate) without: Vec<Extra>,
    /// Mark nuclei, and objects that look like nuclei, as ignored if their contrast-to-noise ratio in the sharpest
    /// plane is lower: value 255 in labels/semantic, iscrowd 1 in COCO; 0 ignores none
    #[arg(long, value_name = "RATIO", default_value_t = MIN_DETECTABILITY, value_parser = number(0.0, 1e6))]
    pub(crate) min_detectability: f64,
    /// Write the table of objects as CSV only, without Parquet
    #[cfg(feature = "parquet")]
    #[arg(long)]
    pub(crate) no_parquet: bool,
}

impl LayoutArgs {
    /// Largest number of frames for which `folder` is the default format.
    pub(crate) const MAX_IN_FOLDERS: u64 = 10_000;

    /// The layout of a data set with this many frames, and whether the number of frames decides its format.
    pub(crate) fn layout(&self, frames: u64) -> (Layout, bool) {
        let many = self.format.is_empty() && frames > Self::MAX_IN_FOLDERS;
        let default = if many { Format::Webdataset } else { Format::Folder };
        let formats = if self.format.is_empty() { vec![default] } else { self.format.clone() };
        (Layout { scenes: self.scenes, ..self.files.layout(formats) }, many)
    }

    /// The same for frames that are added to a data set, whose formats and shards are the default.
    pub(crate) fn layout_in(&self, existing: Option<&Layout>, frames: u64) -> (Layout, bool) {
        match existing {
            Some(existing) if self.format.is_empty() => {
                let mut layout = self.files.layout(existing.formats.clone());
                layout.frames_per_shard = self.files.frames_per_shard.unwrap_or(existing.frames_per_shard);
                (Layout { scenes: self.scenes, ..layout }, false)
            }
            _ => self.layout(frames),
        }
    }
}

impl FileArgs {
    pub(crate) fn layout(&self, formats: Vec<Format>) -> Layout {
        let mut layout = Layout::new(formats).without(self.without.iter().copied());
        layout.flatten = self.flatten;
        layout.min_detectability = self.min_detectability;
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
