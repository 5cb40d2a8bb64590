//! Benchmarks of the techniques and of the engine.

pub(crate) mod counts;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Result, ensure};
use clap::{Args, Subcommand};

use crate::shell::{self, skipped};
use crate::workspace::Workspace;
use crate::{peers, site};

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
    /// Compares the CPU time of fields in WebAssembly with that of the program, on one thread each, with Node
    ///
    /// An instance of the engine of the site and `papsynth workbench --threads 1` render fields of the default recipe
    /// alternately. Fails if a field has other pixels.
    Wasm {
        /// Program `papsynth` to compare with, instead of a build in release mode
        #[arg(long, value_name = "PATH")]
        program: Option<PathBuf>,
        /// Number of fields
        #[arg(long, value_name = "N", default_value_t = 24)]
        fields: u32,
    },
}

pub(crate) fn run(workspace: &Workspace, arguments: Bench) -> Result<()> {
    match arguments.command {
        Some(BenchCommand::Counts { bless }) => return counts::run(workspace, bless),
        Some(BenchCommand::Peers(peers)) => return peers::run(workspace, &peers),
        Some(BenchCommand::Wasm { program, fields }) => return wasm(workspace, program, fields),
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

/// Compares the engine in WebAssembly with the program.
fn wasm(workspace: &Workspace, program: Option<PathBuf>, fields: u32) -> Result<()> {
    if !shell::answers("node", "--version") {
        return Err(skipped("Node is not installed"));
    }
    let engine = site::engine(workspace, "wasm")?;
    let program = program.map_or_else(|| site::program(workspace), Ok)?;
    let script = workspace.root.join("xtask/src/wasm_speed.mjs");
    shell::run(Command::new("node").arg(script).arg(engine).arg(program).arg(fields.to_string()))
}

/// Returns whether any benchmark below a folder has results of that name.
fn has_baseline(folder: &Path, name: &str) -> bool {
    let mut folders =
        fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()).filter(|path| path.is_dir());
    folders.any(|path| path.file_name().is_some_and(|last| last == name) || has_baseline(&path, name))
}
