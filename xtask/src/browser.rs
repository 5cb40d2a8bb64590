//! Whether people could take part in a study, and look at data sets.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};

use crate::arguments::Arguments;
use crate::chore::{Chore, Outcome};
use crate::python::Python;
use crate::workspace::Workspace;
use crate::{dataset, shell, system};

pub(crate) const CHORE: Chore = Chore {
    name: "browser",
    usage: "",
    about: "goes through `papsynth study` and `papsynth view` in headless Chromium, with keyboard and mouse",
    details: "The study shortened, with the page and the program started anew in the middle; holds results against what was clicked, and \
              looks that nothing left loopback and no answer was in what was sent. The viewer on a focus stack: what is on the \
              canvas is held against its pixels and its tables. Screenshots go to target/browser/study and target/browser/view. \
              Where Chromium is missing it is installed, by root on Debian; else it is left out, with a sentence; a failure where \
              CI is set.",
    run,
};

/// What Chromium goes by on different systems.
const NAMES: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];

fn run(workspace: &Workspace, arguments: Arguments) -> Result<Outcome> {
    arguments.finish()?;
    let script = |name: &str| -> Result<PathBuf> {
        let script = workspace.root.join("crates/papsynth-web/tests").join(name);
        ensure!(script.exists(), "{} is missing", workspace.shown(&script));
        Ok(script)
    };
    let (study, view) = (script("browser_study.py")?, script("browser_view.py")?);
    let python = match Python::system() {
        Python::Ready(python) => python,
        Python::Missing(reason) => return Outcome::skipped_unless_ci(reason),
    };
    let Some(chromium) = chromium() else {
        return Outcome::skipped_unless_ci("there is no Chromium on this machine, nor a way to install it".to_owned());
    };
    let folder = workspace.target.join("browser");
    let (synthetic, other, real) = (folder.join("synthetic"), folder.join("other"), folder.join("real"));
    let small = ["--frames", "2", "--set", "field.width_px=640", "--set", "field.height_px=520"];
    // The program of the integration tests: built with them, because without their dependencies libraries have other features.
    shell::run(workspace.cargo_light(&["test", "--no-run"]).args(["--test", "it"]))?;
    let program = workspace.target.join("debug").join(format!("papsynth{}", std::env::consts::EXE_SUFFIX));
    let generate = |out: &Path, more: &[&str]| dataset::generate(Command::new(&program), out, small.iter().chain(more));
    generate(&synthetic, &[])?;
    // What stands for real: pictures without truth, of another preset. Whether it is makes no difference to the page.
    generate(&other, &["--preset", "high-grade", "--seed", "1"])?;
    copy_pictures(&other.join("images"), &real)?;
    let stack = folder.join("stack");
    generate(&stack, &["--set", "focus.planes=5", "--set", "focus.step_um=1.5"])?;
    let run = |script: &Path, folders: &[&PathBuf]| {
        shell::run(Command::new(&python).arg(script).arg(&program).arg(chromium).args(folders))
    };
    run(&study, &[&real, &synthetic, &folder.join("study")])?;
    run(&view, &[&stack, &folder.join("view")])?;
    Ok(Outcome::Done)
}

/// The name of a Chromium that answers, installed if need be and possible.
fn chromium() -> Option<&'static str> {
    let find = || NAMES.into_iter().find(|name| shell::answers(Command::new(name).arg("--version")));
    find().or_else(|| system::install(&["chromium"]).then(find).flatten())
}

/// Copies the pictures of a folder into one that is empty before.
fn copy_pictures(from: &Path, to: &Path) -> Result<()> {
    if to.exists() {
        fs::remove_dir_all(to).with_context(|| format!("cannot empty {}", to.display()))?;
    }
    fs::create_dir_all(to).with_context(|| format!("cannot make {}", to.display()))?;
    for entry in fs::read_dir(from).with_context(|| format!("cannot read {}", from.display()))? {
        let entry = entry?;
        fs::copy(entry.path(), to.join(entry.file_name()))
            .with_context(|| format!("cannot copy to {}", to.display()))?;
    }
    Ok(())
}
