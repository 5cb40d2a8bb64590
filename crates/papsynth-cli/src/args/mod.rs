//! What can be typed.

mod real;
mod sets;
mod slide;
mod values;
mod view;

use std::ops::Range;
use std::path::PathBuf;

use clap::{ArgGroup, Args, Parser, Subcommand};
use papsynth::recipe::{CameraPreset, Preset};

use crate::memory::parse_size;
pub(crate) use real::{Calibrate, Judge, Learn, Match, Study};
pub(crate) use sets::{
    Clean, Convert, LayoutArgs, Merge, Plan, Rerender, Shards, ShareArgs, Status, Submit, Sweep, Verify, check_of,
};
pub(crate) use slide::{Slide, SlideTile, SlideVerb};
#[cfg(feature = "zarr")]
pub(crate) use slide::{SlideFinalize, SlideMake};
use values::{camera_parser, parse_range, preset_parser};
pub(crate) use view::View;

/// Synthetic bright-field images of cervical smears, with exact truth.
#[derive(Debug, Parser)]
#[command(
    name = "papsynth",
    version,
    max_term_width = 100,
    after_help = "\
Examples:
  papsynth generate --out fields --frames 8            eight labelled fields of the default recipe
  papsynth init --preset dense --out dense.toml        a commented recipe to change
  papsynth preview dense.toml                          one field beside its truth
  papsynth generate dense.toml --out dense --frames 100

Exit codes: 0 done; 2 usage, recipe or input (trying again will not help); 74 input/output (it may);
130 interrupted (run the same command again to go on)."
)]
pub(crate) struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub(crate) verb: Verb,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub(crate) enum Verb {
    Init(Init),
    Generate(Generate),
    Preview(Preview),
    Render(Box<Render>),
    Learn(Learn),
    Calibrate(Calibrate),
    Judge(Judge),
    Match(Match),
    Inspect(Inspect),
    Verify(Verify),
    Convert(Convert),
    Rerender(Box<Rerender>),
    Sweep(Box<Sweep>),
    Plan(Plan),
    Submit(Submit),
    Status(Status),
    Merge(Merge),
    Clean(Clean),
    Slide(Box<Slide>),
    Study(Box<Study>),
    View(View),
    Schema(SchemaArgs),
    Completions(Completions),
}

/// Print a commented recipe to start from.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth init > my.toml
  papsynth init --preset high-grade --out my.toml
  papsynth init --list")]
pub(crate) struct Init {
    /// The recipe to print
    #[arg(long, value_name = "NAME", value_parser = preset_parser(), default_value = Preset::Lbc.name(), hide_default_value = true)]
    pub(crate) preset: Preset,
    /// Write to this new file instead of standard output
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// List the presets
    #[arg(long, conflicts_with_all = ["preset", "out"])]
    pub(crate) list: bool,
}

/// What a recipe is made of.
#[derive(Debug, Args)]
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
#[derive(Debug, Args)]
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

/// Print the JSON schema of recipes.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  papsynth schema > papsynth-recipe.schema.json")]
pub(crate) struct SchemaArgs {}

/// Print what makes a shell complete papsynth's words.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth completions bash > ~/.local/share/bash-completion/completions/papsynth
  papsynth completions zsh > ~/.zfunc/_papsynth")]
pub(crate) struct Completions {
    /// The shell
    #[arg(value_enum)]
    pub(crate) shell: clap_complete::Shell,
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_command_is_sound_and_every_verb_shows_an_example() {
        let mut command = Cli::command();
        command.build();
        command.clone().debug_assert();
        for verb in command.get_subcommands().filter(|verb| verb.get_name() != "help") {
            let help = verb.get_after_help().map(ToString::to_string).unwrap_or_default();
            assert!(help.contains(&format!("papsynth {}", verb.get_name())), "{}", verb.get_name());
        }
    }

    #[test]
    fn frames_or_a_range_not_both_and_not_neither() {
        let parse = |words: &str| Cli::try_parse_from(words.split(' '));
        assert!(parse("papsynth generate --out x").is_err());
        assert!(parse("papsynth generate --out x --frames 2 --range 0..2").is_err());
        assert!(parse("papsynth generate --out x --frames 0").is_err());
        assert!(parse("papsynth generate r.toml --preset lbc --out x --frames 1").is_err());
        let Verb::Generate(generate) = parse("papsynth generate --out x --range 3..5").unwrap().verb else {
            unreachable!()
        };
        assert_eq!(generate.indices(), 3..5);
    }
}
