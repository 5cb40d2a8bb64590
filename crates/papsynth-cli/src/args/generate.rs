//! What can be typed after `generate`, `preview` and `render`.

use std::ops::Range;
use std::path::PathBuf;

use clap::{ArgGroup, Args};

use super::shared::{EngineArgs, LayoutArgs, RecipeArgs};
use super::values::parse_range;
use crate::memory::parse_size;
use crate::share::ShareArgs;

/// Make images and their truth.
///
/// The same recipe, model and seed give the same pixels, labels and tables on any machine, whatever the number of threads and
/// however the frames are split into ranges. Running the same command again completes what is missing and touches nothing that is whole.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("which").required(true).args(["frames", "range"]), after_help = "\
Examples:
  papsynth generate --out fields --frames 8
  papsynth generate my.toml --out fields --frames 1000 --seed 7
  papsynth generate --preset dense --out dense --range 500..1000     the second half, on another machine
  papsynth generate --out sets --frames 200 --format folder,cellpose,yolo-seg
  papsynth generate my.toml --out many --frames 100000 --shard 3/20   the fourth of twenty machines
  papsynth generate my.toml --out s3://bucket/many --frames 100000    keys from AWS_ACCESS_KEY_ID and the like
  papsynth generate wide.toml --out wide --frames 20 --max-memory 2GiB
  papsynth generate --out timed --frames 20 --threads 1 --profile   where the time goes
  papsynth generate --out stacks --frames 4 --set focus.planes=21 --set focus.step_um=0.5
  papsynth generate --out few --frames 8 --set 'cells.intermediate.count={ uniform = [2, 6] }'")]
pub(crate) struct Generate {
    #[command(flatten)]
    pub(crate) engine: EngineArgs,
    /// Folder of the data set: new, empty, or one that this command began; or s3://, gs://, az://, bucket and prefix, in builds with --features cloud
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Number of frames: those with index 0 to N − 1
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) frames: Option<u64>,
    /// Indices of the frames, from A up to but without B
    #[arg(long, value_name = "A..B", value_parser = parse_range)]
    pub(crate) range: Option<Range<u64>>,
    #[command(flatten)]
    pub(crate) layout: LayoutArgs,
    #[command(flatten)]
    pub(crate) share: ShareArgs,
    /// Read every file that is there, as `papsynth verify` does, and make anew what is wrong, instead of comparing sizes
    #[arg(long)]
    pub(crate) verify: bool,
    /// Memory to use at most, such as 2GiB: fewer frames are made side by side if need be [default: 80 % of what is available, where the
    /// system tells]
    #[arg(long, value_name = "SIZE", value_parser = parse_size)]
    pub(crate) max_memory: Option<u64>,
    /// Say where the time went, stage by stage, and how many pixels and objects a second were made
    #[arg(long, conflicts_with = "quiet")]
    pub(crate) profile: bool,
    /// Say nothing but errors
    #[arg(long, short, conflicts_with = "json")]
    pub(crate) quiet: bool,
    /// Say everything as JSON, one object a line, on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

impl Generate {
    /// Indices of the frames that are asked for.
    pub(crate) fn indices(&self) -> Range<u64> {
        self.range.clone().unwrap_or(0..self.frames.unwrap_or(1))
    }
}

/// Make one field and show it beside its truth.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth preview
  papsynth preview my.toml --out my.png --set background.level=0.8
  papsynth preview --preset inflamed --index 3")]
pub(crate) struct Preview {
    #[command(flatten)]
    pub(crate) engine: EngineArgs,
    /// Picture to write; an older picture is replaced, no other file
    #[arg(long, value_name = "FILE", default_value = "preview.png")]
    pub(crate) out: PathBuf,
    /// Which frame of the data set
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) index: u64,
}

/// Render one scene, which may have been edited or made by another program.
///
/// `papsynth generate --scenes` writes the scene of each frame as JSON. With the same recipe and model an unchanged scene gives the same
/// image, bit by bit. The image of a focus stack is the one with every object in focus.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth generate my.toml --out fields --frames 8 --scenes
  papsynth render fields/recipe.toml --scene fields/scenes/000003.json --out again.png
  papsynth render fields/recipe.toml --model fields/model.json --scene edited.json")]
pub(crate) struct Render {
    #[command(flatten)]
    pub(crate) recipe: RecipeArgs,
    /// Model that `papsynth learn` wrote, or a class file (TOML), beside the classes that ship
    #[arg(long, value_name = "FILE")]
    pub(crate) model: Option<PathBuf>,
    /// Scene to render; `-` reads standard input
    #[arg(long, value_name = "FILE")]
    pub(crate) scene: PathBuf,
    /// PNG to write; an older picture is replaced, no other file
    #[arg(long, value_name = "FILE", default_value = "scene.png")]
    pub(crate) out: PathBuf,
    /// Threads to work with; the bytes are the same with any number [default: one a core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
}
