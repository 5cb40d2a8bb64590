//! `papsynth man`: manual pages.

use std::path::PathBuf;

use clap::{Command, CommandFactory};

use crate::args::{Cli, Man};
use crate::exit::ExitError;
use crate::output_file::{Kind, OutputFile, check_folder};

/// The first line of every page, by which older pages are recognised.
const FIRST_LINE: &str = ".\\\" A manual page of papsynth.\n";

const PAGE: Kind = Kind::Text(FIRST_LINE.as_bytes(), "a manual page that papsynth wrote");

pub(crate) fn run(args: &Man) -> Result<(), ExitError> {
    let mut command = Cli::command().disable_help_subcommand(true);
    command.build();
    let mut pages = Vec::new();
    add_pages(&command, &mut pages)?;
    let files: Vec<_> = pages.iter().map(|(name, _)| (name.as_str(), PAGE)).collect();
    check_folder(&args.out, &files)?;
    for (name, text) in &pages {
        let path: PathBuf = args.out.join(name);
        OutputFile::check(&path, PAGE, false)?.write(text.as_bytes())?;
    }
    Ok(())
}

/// Adds file names and texts of the pages of a command and its subcommands.
fn add_pages(command: &Command, pages: &mut Vec<(String, String)>) -> Result<(), ExitError> {
    let page = clap_mangen::Man::new(command.clone()).manual("papsynth");
    let mut text = FIRST_LINE.as_bytes().to_vec();
    page.render(&mut text).map_err(|error| ExitError::input(error.to_string()))?;
    // clap_mangen calls the text after the options EXTRA; ours contains examples.
    let text = String::from_utf8_lossy(&text).replace(".SH EXTRA\nExamples:\n", ".SH EXAMPLES\n");
    pages.push((page.get_filename(), text.replace(".SH EXTRA\nExample:\n", ".SH EXAMPLE\n")));
    let mut shown = command.get_subcommands().filter(|command| !command.is_hide_set());
    shown.try_for_each(|command| add_pages(command, pages))
}
