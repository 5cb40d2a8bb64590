//! Generates an example data set.

use std::ffi::OsStr;
use std::path::Path;
use std::process::Command;

use anyhow::Result;

use crate::shell;
use crate::workspace::Workspace;

pub(crate) fn run(workspace: &Workspace) -> Result<()> {
    let planes = ["--frames", "1", "--set", "focus.planes=11", "--set", "focus.step_um=0.8"];
    let folders = ["fields", "stack"].map(|name| workspace.target.join("dataset").join(name));
    for (folder, arguments) in folders.iter().zip([&["--frames", "8"][..], &planes]) {
        generate(program(workspace, ""), folder, arguments)?;
    }
    let [fields, stack] = folders.each_ref().map(|folder| workspace.shown(folder));
    println!(
        "\nEight labelled fields: {fields}\nA focus stack: {stack}\ncrates/papsynth-dataset/README.md describes the files."
    );
    Ok(())
}

/// Returns the program in release mode with only these features, which is the fastest build.
pub(crate) fn program(workspace: &Workspace, features: &str) -> Command {
    let mut command = workspace.cargo();
    command.args(["run", "--release", "--package", "papsynth-cli", "--no-default-features"]);
    command.args(["--features", features, "--"]);
    command
}

/// Runs `papsynth generate` with a new folder.
pub(crate) fn generate<I: AsRef<OsStr>>(
    mut program: Command,
    out: &Path,
    arguments: impl IntoIterator<Item = I>,
) -> Result<()> {
    shell::remove(out)?;
    shell::run(program.args(["generate", "--out"]).arg(out).args(arguments))
}
