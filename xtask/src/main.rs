//! Chores of the workspace: `cargo xtask` lists them, `cargo xtask CHORE --help` explains one.
//!
//! Cargo and rustc do all the work; each chore is one file. Nothing here knows what a cell is.

#![forbid(unsafe_code)]
#![expect(clippy::print_stdout, reason = "a program that talks to whoever called it")]

mod arguments;
mod bench;
mod browser;
mod chore;
mod ci;
mod dataset;
mod deps;
mod equations;
mod external;
mod figures;
mod golden;
mod hashes;
mod package;
mod peers;
mod publish;
mod python;
mod realism;
mod shell;
mod supply;
mod system;
mod test;
mod torture;
mod wasm;
mod workspace;

use std::process::ExitCode;

use anyhow::{Result, bail};

use crate::arguments::Arguments;
use crate::chore::{Chore, Outcome};
use crate::workspace::Workspace;

const CHORES: &[Chore] = &[
    dataset::CHORE,
    test::CHORE,
    golden::CHORE,
    hashes::CHORE,
    bench::CHORE,
    figures::CHORE,
    realism::CHORE,
    equations::CHORE,
    deps::CHORE,
    external::CHORE,
    browser::CHORE,
    wasm::CHORE,
    publish::CHORE,
    supply::DENY,
    supply::SBOM,
    package::CHORE,
    package::CLUSTER,
    package::RELEASES,
    ci::CHORE,
    torture::CHORE,
];

fn main() -> ExitCode {
    match chore() {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::Skipped(reason)) => {
            println!("skipped: {reason}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn chore() -> Result<Outcome> {
    let mut words = std::env::args().skip(1);
    let Some(name) = words.next().filter(|word| !is_help(word) && word != "help") else {
        println!("Chores of the papsynth workspace: cargo xtask CHORE\n");
        for chore in CHORES {
            println!("  {:<10} {}", chore.name, chore.about);
        }
        println!("\ncargo xtask CHORE --help says more about one.");
        return Ok(Outcome::Done);
    };
    let Some(chore) = CHORES.iter().find(|chore| chore.name == name) else {
        let names: Vec<&str> = CHORES.iter().map(|chore| chore.name).collect();
        bail!("there is no chore `{name}`; expected one of {}", names.join(", "));
    };
    let words: Vec<String> = words.collect();
    if words.iter().take_while(|word| *word != "--").any(|word| is_help(word)) {
        let Chore { name, usage, about, details, .. } = chore;
        println!("{about}\n\nUsage: cargo xtask {}", [*name, *usage].join(" ").trim_end());
        if !details.is_empty() {
            println!("\n{}", wrapped(details));
        }
        return Ok(Outcome::Done);
    }
    (chore.run)(&Workspace::load()?, Arguments::new(words))
}

/// A text in lines that fit a terminal; its own line ends stay.
fn wrapped(text: &str) -> String {
    const COLUMNS: usize = 90;
    let mut lines: Vec<String> = Vec::new();
    for paragraph in text.lines() {
        lines.push(String::new());
        for word in paragraph.split_whitespace() {
            if lines.last().is_some_and(|line| line.len() + word.len() > COLUMNS) {
                lines.push(String::new());
            }
            if let Some(line) = lines.last_mut() {
                line.push_str(word);
                line.push(' ');
            }
        }
    }
    lines.iter().map(|line| line.trim_end()).collect::<Vec<_>>().join("\n")
}

fn is_help(word: &str) -> bool {
    word == "--help" || word == "-h"
}
