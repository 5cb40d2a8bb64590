//! Options of `generate`, `preview` and `render`.

use std::ops::Range;
use std::path::PathBuf;

use clap::{ArgGroup, Args};

use super::shared::{EngineArgs, LayoutArgs, RecipeArgs};
use super::values::{integer, parse_range};
use crate::memory::parse_size;
use crate::task::TaskArgs;

/// Generate images with ground truth.
///
/// The same recipe, model and seed give the same pixels, labels and tables on any machine, for any number of threads
/// and any split of the frames into ranges or tasks. Run the same command again to write missing frames; complete
/// frames are not written again. Without --format, frames are added to a data set in its formats.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("which").required(true).args(["frames", "range"]), after_help = "\
Examples:
  papsynth generate --out fields --frames 8
  papsynth generate my.toml --out fields --frames 1000 --seed 7
  papsynth generate --preset dense --out dense --range 500..1000     frames 500 to 999
  papsynth generate --out sets --frames 200 --format folder,cellpose,yolo-seg
  papsynth generate --out small --frames 200 --without noise-free,layers
  papsynth generate my.toml --out many --frames 100000 --task 3/20    task 3 of 0 to 19
  papsynth generate my.toml --out s3://bucket/many --frames 100000    keys as for AWS tools
  papsynth generate wide.toml --out wide --frames 20 --max-memory 2GiB
  papsynth generate --out timed --frames 20 --threads 1 --profile     time of each stage
  papsynth generate --out stacks --frames 4 --set focus.planes=21 --set focus.step_um=0.5
  papsynth generate --out few --frames 8 --set 'cells.intermediate.count={ uniform = [2, 6] }'")]
pub(crate) struct Generate {
    #[command(flatten)]
    pub(crate) engine: EngineArgs,
    /// Folder of the data set: new, empty, or written by the same command; in builds with --features cloud also an
    /// object store (s3://, gs:// or az:// with bucket and prefix)
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Number of frames to generate
    #[arg(long, value_name = "N", value_parser = integer(1, u64::MAX))]
    pub(crate) frames: Option<u64>,
    /// Indices of the frames to generate, from A to B − 1
    #[arg(long, value_name = "A..B", value_parser = parse_range)]
    pub(crate) range: Option<Range<u64>>,
    #[command(flatten)]
    pub(crate) layout: LayoutArgs,
    #[command(flatten)]
    pub(crate) task: TaskArgs,
    /// Check the content of files that are already present, not only their sizes, and repair invalid files
    #[arg(long)]
    pub(crate) verify: bool,
    /// Memory limit, for example 2GiB; fewer frames are generated at the same time if needed [default: 80 % of the
    /// available memory, on Linux]
    #[arg(long, value_name = "SIZE", value_parser = parse_size)]
    pub(crate) max_memory: Option<u64>,
    /// Print the time of each stage, and pixels and objects per second
    #[arg(long, conflicts_with = "quiet")]
    pub(crate) profile: bool,
    /// Print errors only
    #[arg(long, short, conflicts_with = "json")]
    pub(crate) quiet: bool,
    /// Print progress, result and errors as JSON on standard output, one object per line; errors of the command line
    /// itself, such as an unknown option, stay text
    #[arg(long)]
    pub(crate) json: bool,
}

impl Generate {
    /// Indices of the frames to generate.
    pub(crate) fn indices(&self) -> Range<u64> {
        self.range.clone().unwrap_or(0..self.frames.unwrap_or(1))
    }
}

/// Generate one field and show it next to its ground truth.
///
/// Also prints the SHA-256 of the grey levels, of a focus stack those of its middle plane: one byte per sample, or two
/// for cameras with more than 8 bits, least byte first. The page of `papsynth workbench` shows the same.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth preview
  papsynth preview my.toml --out my.png --set background.level=0.8
  papsynth preview --preset inflamed --index 3")]
pub(crate) struct Preview {
    #[command(flatten)]
    pub(crate) engine: EngineArgs,
    /// PNG to write; replaces an older image of papsynth, but no other file
    #[arg(long, value_name = "FILE", default_value = "preview.png")]
    pub(crate) out: PathBuf,
    /// Replace any existing file
    #[arg(long)]
    pub(crate) force: bool,
    /// Index of the frame
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = integer(0, u64::MAX))]
    pub(crate) index: u64,
}

/// Render one scene, which may have been edited or written by another program.
///
/// `papsynth generate --scenes` writes the scene of each frame as JSON. An unchanged scene with the same recipe and
/// model gives the same pixels. For a focus stack, the PNG shows the all-in-focus image.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth generate my.toml --out fields --frames 8 --scenes
  papsynth render fields/recipe.toml --scene fields/scenes/000003.json --out again.png
  papsynth render fields/recipe.toml --model fields/model.json --scene edited.json")]
pub(crate) struct Render {
    #[command(flatten)]
    pub(crate) recipe: RecipeArgs,
    /// Model of `papsynth learn`, or class file (TOML), in addition to the built-in classes
    #[arg(long, value_name = "FILE")]
    pub(crate) model: Option<PathBuf>,
    /// Scene to render; `-` reads standard input
    #[arg(long, value_name = "FILE")]
    pub(crate) scene: PathBuf,
    /// PNG to write; replaces an older image of papsynth, but no other file
    #[arg(long, value_name = "FILE", default_value = "scene.png")]
    pub(crate) out: PathBuf,
    /// Replace any existing file
    #[arg(long)]
    pub(crate) force: bool,
    /// Number of threads; does not change the output [default: the number of cores]
    #[arg(long, value_name = "N", value_parser = integer(1, 1024_u16))]
    pub(crate) threads: Option<u16>,
}
