//! What can be typed about recipe, model, seed and threads.

use std::path::PathBuf;

use clap::Args;
use papsynth::recipe::{CameraPreset, Preset};

use super::values::{camera_parser, preset_parser};

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

impl EngineArgs {
    /// Threads to work with.
    pub(crate) fn threads(&self) -> usize {
        threads(self.threads)
    }
}

/// As many threads as asked for, or one a core.
pub(crate) fn threads(asked: Option<u16>) -> usize {
    match asked {
        Some(threads) => usize::from(threads),
        None => std::thread::available_parallelism().map_or(1, usize::from),
    }
}
