//! A first data set to look at.

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
        "\nEight labelled fields are in {fields}, a focus stack in {stack}; crates/papsynth-dataset/README.md names their files."
    );
    Ok(())
}

/// The program that makes, checks and converts data sets and does nothing else, in release, with these features: the quickest build.
pub(crate) fn program(workspace: &Workspace, features: &str) -> Command {
    let mut command = workspace.cargo();
    command.args(["run", "--release", "--package", "papsynth-cli", "--no-default-features"]);
    command.args(["--features", features, "--"]);
    command
}

/// Runs `papsynth generate` of a program into a folder that is empty before.
pub(crate) fn generate<I: AsRef<OsStr>>(
    mut program: Command,
    out: &Path,
    arguments: impl IntoIterator<Item = I>,
) -> Result<()> {
    shell::remove(out)?;
    shell::run(program.args(["generate", "--out"]).arg(out).args(arguments))
}
