//! Tests the web pages in a browser.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};

use crate::shell::{self, skipped};
use crate::workspace::Workspace;
use crate::{dataset, python, site};

/// Names of Chromium on different systems.
const NAMES: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];

pub(crate) fn run(workspace: &Workspace) -> Result<()> {
    let python = python::system()?;
    let find = || NAMES.into_iter().find(|name| shell::answers(name, "--version"));
    let Some(chromium) = shell::find_or_install(find, &["chromium"]) else {
        return Err(skipped("Chromium is not installed and cannot be installed"));
    };
    let folder = workspace.target.join("browser");
    let (synthetic, other, real) = (folder.join("synthetic"), folder.join("other"), folder.join("real"));
    let small = ["--frames", "2", "--set", "field.width_px=640", "--set", "field.height_px=520"];
    // Builds the program with the integration tests, because the features of libraries depend on the packages that are
    // built.
    shell::run(workspace.cargo_light(&["test", "--no-run"]).args(["--test", "it"]))?;
    let program = workspace.program("debug", "papsynth");
    let generate = |out: &Path, more: &[&str]| dataset::generate(Command::new(&program), out, small.iter().chain(more));
    generate(&synthetic, &[])?;
    // Images of another preset, without ground truth, replace real images.
    generate(&other, &["--preset", "high-grade", "--seed", "2"])?;
    copy_images(&other.join("images"), &real)?;
    let stack = folder.join("stack");
    generate(&stack, &["--set", "focus.planes=5", "--set", "focus.step_um=1.5"])?;
    let run = |script: &str, folders: &[&PathBuf]| {
        let script = workspace.root.join("crates/papsynth-web/tests").join(script);
        shell::run(Command::new(&python).arg(script).arg(&program).arg(chromium).args(folders))
    };
    run("browser_study.py", &[&real, &synthetic, &folder.join("study")])?;
    run("browser_view.py", &[&stack, &folder.join("view")])?;
    run("browser_workbench.py", &[&folder.join("workbench")])?;
    let pages = site::check(workspace)?;
    let script = workspace.root.join("crates/papsynth-wasm/tests/browser_engine.py");
    shell::run(Command::new(&python).arg(script).arg(&program).arg(chromium).args([&pages, &folder.join("engine")]))?;
    let script = workspace.root.join("site/tests/browser_site.py");
    shell::run(Command::new(&python).arg(script).arg(chromium).args([&pages, &folder.join("site")]))
}

/// Replaces a folder by the images of another.
fn copy_images(from: &Path, to: &Path) -> Result<()> {
    shell::remove(to)?;
    shell::make(to)?;
    for entry in fs::read_dir(from).with_context(|| format!("cannot read {}", from.display()))? {
        let entry = entry?;
        shell::copy(&entry.path(), &to.join(entry.file_name()))?;
    }
    Ok(())
}
