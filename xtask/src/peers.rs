//! Benchmarks of the simulator and its parts against other programs.

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

/// Measures the same work with our code and with other programs, and prints times, ratios and targets
///
/// Both run alternately on one thread of this machine. A missed target is not a failure.
#[derive(Args)]
pub(crate) struct Peers {
    /// Runs only the rows whose names begin with NAME
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    only: Vec<String>,
    /// Number of alternating measurements
    #[arg(long, value_name = "N", default_value_t = 5)]
    repetitions: usize,
    /// Appends the result to benches/history.jsonl and draws docs/performance.svg
    #[arg(long, conflicts_with = "only")]
    record: bool,
}

/// Runs the benchmarks and prints the table.
pub(crate) fn run(workspace: &Workspace, Peers { only, repetitions, record }: &Peers) -> Result<()> {
    let begins = |name: &str| only.is_empty() || only.iter().any(|word| name.starts_with(word));
    let names = ROWS.map(|row| row.name);
    for word in only {
        ensure!(
            names.iter().any(|name| name.starts_with(word)),
            "no row begins with `{word}`: expected the beginning of one of {}",
            names.join(", ")
        );
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
    println!("\nProcess CPU time on one thread, medians of alternating measurements:\n\n{}", table::text(&lines));
    println!("Rows of two cores are wall time. Both draw exact Poisson deviates for photon noise.");
    race.notes.iter().for_each(|note| println!("{note}"));
    match missing {
        Some(reason) => Err(reason),
        None if *record => history::record(workspace, &lines),
        None => Ok(()),
    }
}
