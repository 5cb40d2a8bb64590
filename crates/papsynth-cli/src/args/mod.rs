//! The command line.

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

use std::borrow::Cow;
use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf};

use clap::error::{ContextKind, ContextValue};
use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand};
use papsynth_dataset::Location;

use crate::exit::{ExitError, escaped};

#[cfg(not(feature = "calibrate"))]
use MissingFeature as Calibrate;
#[cfg(not(feature = "learn"))]
use MissingFeature as Learn;
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
#[cfg(feature = "web")]
pub(crate) use web::{Study, View, Workbench};
#[cfg(not(feature = "completions"))]
use {MissingFeature as Completions, MissingFeature as Man};
#[cfg(not(feature = "judge"))]
use {MissingFeature as Judge, MissingFeature as Match};
#[cfg(not(feature = "web"))]
use {MissingFeature as Study, MissingFeature as View, MissingFeature as Workbench};

/// Synthetic bright-field images of cervical smears with exact ground truth.
#[derive(Debug, Parser)]
#[command(
    name = "papsynth",
    version,
    max_term_width = 100,
    after_help = "\
Examples:
  papsynth generate --out fields --frames 8       generate 8 fields of the default recipe
  papsynth init --preset dense --out dense.toml   write a commented recipe to edit
  papsynth preview dense.toml                     show one field next to its ground truth
  papsynth generate dense.toml --out dense --frames 100
  papsynth match images --pixel-um 0.33 --out mine.toml    find a recipe for fields like yours

Exit codes:
    0  success
    2  error in usage, recipe or input
   74  input/output error, such as a full disk
  130  interrupted: run the same command again to continue"
)]
pub(crate) struct Cli {
    /// The subcommand.
    #[command(subcommand)]
    pub(crate) verb: Verb,
}

/// The subcommands.
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
    Workbench(Box<Workbench>),
    Schema(SchemaArgs),
    Completions(Completions),
    Man(Man),
}

/// Print a commented recipe to edit.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth init > my.toml
  papsynth init --preset high-grade --out my.toml
  papsynth init --set field.pixel_um=0.33 --set optics.na=0.75 --out my.toml
  papsynth init --list")]
pub(crate) struct Init {
    #[command(flatten)]
    pub(crate) recipe: RecipeArgs,
    /// Write to this file instead of standard output
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// Replace an existing file
    #[arg(long, requires = "out")]
    pub(crate) force: bool,
    /// List the built-in recipes
    #[arg(long, exclusive = true)]
    pub(crate) list: bool,
}

/// Print the JSON schema of recipes, for editors.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  papsynth schema > papsynth-recipe.schema.json")]
pub(crate) struct SchemaArgs {}

/// Print a script for shell completion.
#[cfg(feature = "completions")]
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth completions bash > ~/.local/share/bash-completion/completions/papsynth
  papsynth completions zsh > ~/.zfunc/_papsynth")]
pub(crate) struct Completions {
    /// Shell
    #[arg(value_enum)]
    pub(crate) shell: clap_complete::Shell,
}

/// Write manual pages of papsynth and of every subcommand.
#[cfg(feature = "completions")]
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth man --out ~/.local/share/man/man1      then: man papsynth-generate
  papsynth man --out pages                        then: man pages/papsynth-generate.1")]
pub(crate) struct Man {
    /// Folder for the pages, which replace older ones
    #[arg(long, value_name = "FOLDER")]
    pub(crate) out: PathBuf,
}

// The arguments of a subcommand without its feature. The doc comment is its help.
/// Not in this build.
#[derive(Debug, Args)]
#[allow(dead_code, reason = "a build with all features has all subcommands")]
pub(crate) struct MissingFeature {
    /// All other arguments
    #[arg(hide = true, trailing_var_arg = true, allow_hyphen_values = true)]
    words: Vec<OsString>,
}

/// Options of earlier releases, and their new names.
const RENAMED: [(&str, &str); 3] = [("--shard", "--task"), ("--strays", "--untracked"), ("--budget", "--simulations")];

/// Parses a command line. Negative numbers are values, so that the message for them states the accepted range.
pub(crate) fn parse(words: impl IntoIterator<Item = OsString>) -> Result<Cli, clap::Error> {
    fn with_negative_numbers(command: clap::Command) -> clap::Command {
        let relaxed = command.mut_args(|arg| {
            let takes_number = !arg.is_positional() && arg.get_action().takes_values();
            if takes_number { arg.allow_negative_numbers(true) } else { arg }
        });
        relaxed.mut_subcommands(with_negative_numbers)
    }
    let matches = with_negative_numbers(Cli::command()).try_get_matches_from(words).map_err(|mut error| {
        let renamed = match error.get(ContextKind::InvalidArg) {
            Some(ContextValue::String(option)) => RENAMED.iter().find(|(old, _)| option == old),
            _ => None,
        };
        if let (clap::error::ErrorKind::UnknownArgument, Some((_, new))) = (error.kind(), renamed) {
            error.insert(ContextKind::SuggestedArg, ContextValue::String((*new).to_owned()));
        }
        error
    })?;
    Cli::from_arg_matches(&matches)
}

/// Prints help or an error of [`parse`], with control characters of the command line escaped.
pub(crate) fn print_error(error: &clap::Error) -> std::io::Result<()> {
    let text = error.render().to_string();
    match escaped(&text) {
        Cow::Borrowed(_) => error.print(),
        Cow::Owned(text) => write!(std::io::stderr().lock(), "{text}"),
    }
}

/// Rejects addresses of object stores where a folder is expected, and misspelled addresses: both would become folders.
pub(crate) fn check_addresses(verb: &Verb, words: impl IntoIterator<Item = OsString>) -> Result<(), ExitError> {
    let words: Vec<_> = words.into_iter().collect();
    if let Some((word, address)) = words.iter().find_map(|word| Some((word, mistyped(word.to_str()?)?))) {
        let message = format!("{}: not a valid address of an object store", word.display());
        let help = format!("write {address} for an object store, or ./{} for a folder", word.display());
        return Err(ExitError::with_help(message, help));
    }
    if matches!(
        verb,
        Verb::Generate(_) | Verb::Status(_) | Verb::Merge(_) | Verb::Verify(_) | Verb::Clean(_) | Verb::Submit(_)
    ) {
        return Ok(());
    }
    match words.into_iter().find(|word| Location::is_address(Path::new(word))) {
        Some(word) => {
            let message = format!("{}: expected a folder or a file", Path::new(&word).display());
            let help = "generate, status, merge, verify, clean and submit accept object stores";
            Err(ExitError::with_help(message, help))
        }
        None => Ok(()),
    }
}

/// The corrected address of an object store, if slashes are missing.
fn mistyped(word: &str) -> Option<String> {
    let (scheme, rest) = word.split_once(":/")?;
    let is_store = matches!(scheme, "s3" | "gs" | "az") && !rest.starts_with('/');
    is_store.then(|| format!("{scheme}://{rest}"))
}

impl Verb {
    /// Whether `--quiet` is given.
    pub(crate) fn is_quiet(&self) -> bool {
        match self {
            Self::Generate(args) => args.quiet,
            Self::Convert(args) => args.quiet,
            Self::Rerender(args) => args.quiet,
            Self::Sweep(args) => args.quiet,
            #[cfg(feature = "judge")]
            Self::Judge(args) => args.quiet,
            #[cfg(feature = "judge")]
            Self::Match(args) => args.quiet,
            Self::Slide(args) => matches!(&args.verb, SlideVerb::Make(args) if args.quiet),
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(all(feature = "calibrate", feature = "completions", feature = "judge", feature = "learn", feature = "web"))]
    #[test]
    fn the_command_is_valid_and_every_subcommand_shows_an_example() {
        let mut command = <Cli as clap::CommandFactory>::command();
        command.build();
        command.clone().debug_assert();
        for verb in command.get_subcommands().filter(|verb| verb.get_name() != "help") {
            let help = verb.get_after_help().map(ToString::to_string).unwrap_or_default();
            assert!(help.contains(&format!("papsynth {}", verb.get_name())), "{}", verb.get_name());
        }
    }

    #[test]
    fn either_frames_or_a_range_is_required() {
        let parse = |words: &str| super::parse(words.split(' ').map(OsString::from));
        assert!(parse("papsynth generate --out x").is_err());
        assert!(parse("papsynth generate --out x --frames 2 --range 0..2").is_err());
        assert!(parse("papsynth generate --out x --frames 0").is_err());
        assert!(parse("papsynth generate r.toml --preset lbc --out x --frames 1").is_err());
        let Verb::Generate(generate) = parse("papsynth generate --out x --range 3..5").unwrap().verb else {
            unreachable!()
        };
        assert_eq!(generate.indices(), 3..5);
    }

    #[test]
    fn negative_numbers_and_renamed_options_have_helpful_messages() {
        let message = |words: &str| {
            let error = super::parse(words.split(' ').map(OsString::from)).unwrap_err();
            error.to_string()
        };
        let error = message("papsynth generate --out x --frames 1 --seed -1");
        assert!(error.contains("expected an integer from 0 to 18446744073709551615"), "{error}");
        for (words, new) in [
            ("papsynth generate --out x --frames 1 --shard 0/2", "'--task'"),
            ("papsynth slide make --out x --shard 0/2", "'--task'"),
            ("papsynth clean x --strays", "'--untracked'"),
        ] {
            assert!(message(words).contains(new), "{}", message(words));
        }
    }
}
