//! A first data set to look at.

use std::ffi::OsStr;
use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result};

use crate::arguments::Arguments;
use crate::chore::{Chore, Outcome};
use crate::shell;
use crate::workspace::Workspace;

pub(crate) const CHORE: Chore = Chore {
    name: "dataset",
    usage: "",
    about: "writes eight labelled fields and one focus stack of the default recipe, and says where to look",
    details: "Builds the program `papsynth` in release, without what data sets do not need (judge, study, viewer, calibration), and writes to target/dataset, anew each time: fields of 1376 x 1038 pixels, \
              and a stack of 11 planes, 0.8 µm apart.",
    run,
};

fn run(workspace: &Workspace, arguments: Arguments) -> Result<Outcome> {
    arguments.finish()?;
    let folder = workspace.target.join("dataset");
    let (fields, stack) = (folder.join("fields"), folder.join("stack"));
    generate(program(workspace, ""), &fields, ["--frames", "8"])?;
    let planes = ["--frames", "1", "--set", "focus.planes=11", "--set", "focus.step_um=0.8"];
    generate(program(workspace, ""), &stack, planes)?;
    println!("\nEight labelled fields and a focus stack:");
    for folder in [fields, stack] {
        look_at(workspace, &folder)?;
    }
    Ok(Outcome::Done)
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
    if out.exists() {
        fs::remove_dir_all(out).with_context(|| format!("cannot empty {}", out.display()))?;
    }
    shell::run(program.args(["generate", "--out"]).arg(out).args(arguments))
}

/// Prints what lies in a folder, a line for each folder in it and each file.
fn look_at(workspace: &Workspace, folder: &Path) -> Result<()> {
    println!("  {}", workspace.shown(folder));
    let entries = fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let mut paths = entries.map(|entry| Ok(entry?.path())).collect::<Result<Vec<_>>>()?;
    paths.sort();
    for path in paths {
        let name = path.file_name().unwrap_or_default().display().to_string();
        if path.is_dir() {
            println!("    {name}/ ({} files)", fs::read_dir(&path)?.count());
        } else {
            println!("    {name}");
        }
    }
    Ok(())
}
