//! The whole simulator and its parts against good programs of others, and against itself.

mod history;
mod race;
mod rows;
mod sides;
mod table;

use std::fs;

use anyhow::{Context, Result, bail, ensure};

use crate::arguments::Arguments;
use crate::chore::Outcome;
use crate::python::Python;
use crate::workspace::Workspace;
use race::Race;
use rows::{ROWS, Row};
use sides::{Ours, Peer};

/// How often both sides are measured in turn, unless it is said.
const TURNS: usize = 5;

/// Runs the race and prints the table. Nothing is asserted: a machine has good days and bad ones.
pub(crate) fn run(workspace: &Workspace, mut arguments: Arguments) -> Result<Outcome> {
    let turns = arguments.option("--repetitions")?;
    let turns: Option<usize> =
        turns.map(|n| n.parse().with_context(|| format!("`{n}` is no number of repetitions"))).transpose()?;
    let only = arguments.option("--only")?;
    let record = arguments.flag("--record");
    arguments.finish()?;
    ensure!(!(record && only.is_some()), "--record keeps every row, --only runs some");
    let rows = chosen(only.as_deref())?;
    let scripts = workspace.root.join("benches/peers");
    let requirements =
        fs::read_to_string(scripts.join("requirements.txt")).context("cannot read benches/peers/requirements.txt")?;
    let scratch = workspace.target.join("peers");
    let ours = Ours::build(workspace, scratch.clone())?;
    let (peer, missing) = match Python::environment(workspace, "peers", &requirements)? {
        Python::Ready(python) => (Some(Peer::new(python, scripts, scratch)), None),
        Python::Missing(reason) => (None, Some(reason)),
    };
    let mut race = Race::new(peer, ours, turns.unwrap_or(TURNS).max(1));
    let mut lines = Vec::new();
    for row in rows {
        eprintln!("{}: {}", row.name, row.work);
        lines.push((row, race.row(row)?));
    }
    println!("\nProcess CPU time on one thread, medians, both sides in turn in this run:\n\n{}", table::text(&lines));
    println!("Rows of two cores are wall time. Ours draws exact Poisson deviates for shot noise, as the peers do.");
    race.notes.iter().for_each(|note| println!("{note}"));
    if let Some(reason) = missing {
        return Outcome::skipped_unless_ci(format!("no race against the peers: {reason}"));
    }
    if record {
        history::record(workspace, &lines)?;
    }
    Ok(Outcome::Done)
}

/// The rows whose names begin with one of these words, which commas part.
fn chosen(only: Option<&str>) -> Result<Vec<&'static Row>> {
    let Some(only) = only else {
        return Ok(ROWS.iter().collect());
    };
    let words: Vec<&str> = only.split(',').collect();
    if let Some(word) = words.iter().find(|word| !ROWS.iter().any(|row| row.name.starts_with(**word))) {
        let names: Vec<&str> = ROWS.iter().map(|row| row.name).collect();
        bail!("no row begins with `{word}`; there are {}", names.join(", "));
    }
    Ok(ROWS.iter().filter(|row| words.iter().any(|word| row.name.starts_with(word))).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_chosen_by_how_their_names_begin() {
        let names = |only| chosen(only).unwrap().iter().map(|row| row.name).collect::<Vec<_>>();
        assert_eq!(names(None).len(), ROWS.len());
        assert_eq!(names(Some("cloth,noise")), ["cloth-538", "cloth-10000", "noise"]);
        assert!(chosen(Some("clouds")).is_err());
    }
}
