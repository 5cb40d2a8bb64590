//! What can be typed.

#[cfg(feature = "calibrate")]
mod calibrate;
mod generate;
#[cfg(feature = "judge")]
mod judge;
#[cfg(feature = "learn")]
mod learn;
mod sets;
mod shared;
mod slide;
mod values;
#[cfg(feature = "web")]
mod web;

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::{Args, Parser, Subcommand};
use papsynth::recipe::Preset;
use papsynth_dataset::Location;

use crate::exit::Failure;

#[cfg(not(feature = "calibrate"))]
use LeftOut as Calibrate;
#[cfg(not(feature = "completions"))]
use LeftOut as Completions;
#[cfg(not(feature = "learn"))]
use LeftOut as Learn;
#[cfg(feature = "calibrate")]
pub(crate) use calibrate::Calibrate;
pub(crate) use generate::{Generate, Preview, Render};
#[cfg(feature = "judge")]
pub(crate) use judge::{Judge, Match};
#[cfg(feature = "learn")]
pub(crate) use learn::Learn;
pub(crate) use sets::{Clean, Convert, Inspect, Merge, Plan, Rerender, Status, Submit, Sweep, Verify, check_of};
pub(crate) use shared::{EngineArgs, LayoutArgs, RecipeArgs, threads};
pub(crate) use slide::{Slide, SlideTile, SlideVerb};
#[cfg(feature = "zarr")]
pub(crate) use slide::{SlideFinalize, SlideMake};
use values::preset_parser;
#[cfg(feature = "web")]
pub(crate) use web::{Study, View};
#[cfg(not(feature = "judge"))]
use {LeftOut as Judge, LeftOut as Match};
#[cfg(not(feature = "web"))]
use {LeftOut as Study, LeftOut as View};

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

/// Print the JSON schema of recipes.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  papsynth schema > papsynth-recipe.schema.json")]
pub(crate) struct SchemaArgs {}

/// Print what makes a shell complete papsynth's words.
#[cfg(feature = "completions")]
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

// A subcommand that this program was built without. What follows is its help.
/// Not in this build.
#[derive(Debug, Args)]
#[allow(dead_code, reason = "a program with all features lacks none")]
pub(crate) struct LeftOut {
    /// Whatever is typed after it
    #[arg(hide = true, trailing_var_arg = true, allow_hyphen_values = true)]
    words: Vec<OsString>,
}

/// An address where only folders are known would become a folder of that name, and so would one that is mistyped.
pub(crate) fn check_addresses(verb: &Verb, words: impl IntoIterator<Item = OsString>) -> Result<(), Failure> {
    let words: Vec<_> = words.into_iter().collect();
    if let Some((word, address)) = words.iter().find_map(|word| Some((word, mistyped(word.to_str()?)?))) {
        let message = format!("{}: begins as an address of an object store and is none", word.display());
        let help = format!("write {address} for an object store, ./{} for a folder", word.display());
        return Err(Failure::wrong(message, help));
    }
    if matches!(
        verb,
        Verb::Generate(_) | Verb::Status(_) | Verb::Merge(_) | Verb::Verify(_) | Verb::Clean(_) | Verb::Submit(_)
    ) {
        return Ok(());
    }
    match words.into_iter().find(|word| Location::is_address(Path::new(word))) {
        Some(word) => {
            let message = format!("{}: a folder or file is wanted here", Path::new(&word).display());
            let help = "generate, status, merge, verify and clean work on object stores";
            Err(Failure::wrong(message, help))
        }
        None => Ok(()),
    }
}

/// The address of an object store that was meant by one with too few strokes.
fn mistyped(word: &str) -> Option<String> {
    let (scheme, rest) = word.split_once(":/")?;
    let is_store = matches!(scheme, "s3" | "gs" | "az") && !rest.starts_with('/');
    is_store.then(|| format!("{scheme}://{rest}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(all(feature = "calibrate", feature = "completions", feature = "judge", feature = "learn", feature = "web"))]
    #[test]
    fn the_command_is_sound_and_every_verb_shows_an_example() {
        let mut command = <Cli as clap::CommandFactory>::command();
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
