//! Benchmarks of the techniques and of the engine.

pub(crate) mod counts;

use std::fs;
use std::path::Path;

use anyhow::{Result, ensure};
use clap::{Args, Subcommand};

use crate::workspace::Workspace;
use crate::{peers, shell};

/// Runs the benchmarks of all crates, counts instructions, or compares with other programs
#[derive(Args)]
#[command(args_conflicts_with_subcommands = true)]
pub(crate) struct Bench {
    #[command(subcommand)]
    command: Option<BenchCommand>,
    /// Saves the results under a name
    #[arg(long, value_name = "NAME")]
    save: Option<String>,
    /// Compares with the results saved under a name
    #[arg(long, value_name = "NAME")]
    against: Option<String>,
    /// Part of the names of the benchmarks to run, and other arguments of criterion
    #[arg(value_name = "FILTER", allow_hyphen_values = true)]
    filter: Vec<String>,
}

#[derive(Subcommand)]
enum BenchCommand {
    /// Counts the instructions of small kernels with valgrind, and fails if a count is more than 2 % above that of this
    /// compiler in benches/counts.json
    Counts {
        /// Replaces the counts in benches/counts.json
        #[arg(long)]
        bless: bool,
    },
    Peers(peers::Peers),
}

pub(crate) fn run(workspace: &Workspace, arguments: Bench) -> Result<()> {
    match arguments.command {
        Some(BenchCommand::Counts { bless }) => return counts::run(workspace, bless),
        Some(BenchCommand::Peers(peers)) => return peers::run(workspace, &peers),
        None => {}
    }
    // Selects each benchmark by name, because the test harness of a library rejects arguments of criterion.
    let targets = workspace.packages.iter().flat_map(|package| &package.targets);
    let benches = targets.filter(|target| target.kind.iter().any(|kind| kind == "bench"));
    let mut command = workspace.cargo();
    command.args(["bench", "--workspace"]).args(benches.flat_map(|bench| ["--bench", &bench.name])).arg("--");
    if let Some(name) = arguments.save {
        command.args(["--save-baseline", &name]);
    }
    if let Some(name) = arguments.against {
        let saved = has_baseline(&workspace.target.join("criterion"), &name);
        ensure!(saved, "no results are saved as `{name}`: run cargo xtask bench --save {name}");
        // Lenient: a benchmark without a baseline is measured but not compared.
        command.args(["--baseline-lenient", &name]);
    }
    shell::run(command.args(arguments.filter))
}

/// Returns whether any benchmark below a folder has results of that name.
fn has_baseline(folder: &Path, name: &str) -> bool {
    let mut folders =
        fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()).filter(|path| path.is_dir());
    folders.any(|path| path.file_name().is_some_and(|last| last == name) || has_baseline(&path, name))
}
