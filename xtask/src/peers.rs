//! The whole simulator and its parts against good programs of others, and against itself.

mod history;
mod race;
mod rows;
mod table;

use anyhow::{Result, ensure};
use clap::Args;

use crate::python;
use crate::shell::{self, Skipped};
use crate::workspace::Workspace;
use race::Race;
use rows::ROWS;

/// Does the works of a table in our way and in a good program of others, and prints times, ratios and what is wanted
///
/// Both sides run in turn on one thread of this machine. Nothing is asserted: a machine has good days and bad ones.
#[derive(Args)]
pub(crate) struct Peers {
    /// Runs the rows whose names begin so
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    only: Vec<String>,
    /// How often both sides are measured in turn
    #[arg(long, value_name = "N", default_value_t = 5)]
    repetitions: usize,
    /// Adds a line to benches/history.jsonl and draws docs/performance.svg
    #[arg(long, conflicts_with = "only")]
    record: bool,
}

/// Runs the race and prints the table.
pub(crate) fn run(workspace: &Workspace, Peers { only, repetitions, record }: &Peers) -> Result<()> {
    let begins = |name: &str| only.is_empty() || only.iter().any(|word| name.starts_with(word));
    let names = ROWS.map(|row| row.name);
    for word in only {
        ensure!(names.iter().any(|name| name.starts_with(word)), "no row begins with `{word}`; there are {names:?}");
    }
    let requirements = shell::read(&workspace.root.join("benches/peers/requirements.txt"))?;
    let (python, missing) = match python::environment(workspace, "peers", &requirements) {
        Ok(python) => (Some(python), None),
        Err(reason) if reason.is::<Skipped>() => (None, Some(reason)),
        Err(error) => return Err(error),
    };
    let mut race = Race::new(workspace, python, (*repetitions).max(1))?;
    let mut lines = Vec::new();
    for row in ROWS.iter().filter(|row| begins(row.name)) {
        eprintln!("{}: {}", row.name, row.work);
        lines.push((row, race.row(row)?));
    }
    println!("\nProcess CPU time on one thread, medians, both sides in turn in this run:\n\n{}", table::text(&lines));
    println!("Rows of two cores are wall time. Ours draws exact Poisson deviates for shot noise, as the peers do.");
    race.notes.iter().for_each(|note| println!("{note}"));
    match missing {
        Some(reason) => Err(reason),
        None if *record => history::record(workspace, &lines),
        None => Ok(()),
    }
}
