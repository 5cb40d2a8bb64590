//! The checks for a change.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Result, bail};

use crate::bench::counts;
use crate::shell::{self, skipped};
use crate::steps::{self, Step};
use crate::workspace::Workspace;
use crate::{browser, dataset, deps, equations, external, hashes, package, prose, python, site, supply, test, vectors};

/// In order of increasing time. The golden images are part of the tests.
const STEPS: [Step; 16] = [
    ("format", |workspace| shell::run(workspace.cargo().args(["fmt", "--all", "--check"]))),
    ("dependencies", deps::run),
    ("equations", equations::run),
    ("prose", prose::run),
    ("python lints", |workspace| python::lint(workspace, false)),
    ("reference images", |_| reference_images()),
    ("lints", |workspace| lints(workspace.cargo_light(&["clippy"]))),
    ("documentation", |workspace| documentation(workspace.cargo_light(&["doc"]))),
    ("tests", |workspace| test::suite(workspace, Workspace::cargo_light, &[])),
    ("site", |workspace| site::check(workspace).map(drop)),
    ("data set", dataset::run),
    ("vector code", vectors::run),
    ("instructions", |workspace| counts::run(workspace, false)),
    ("external readers", |workspace| external::run(workspace, false)),
    ("browser", browser::run),
    ("wasm32", hashes::wasm),
];

/// Steps with heavy crates, heavy readers, other processors and packaging; at most 80 minutes including the steps
/// above.
const FULL: [Step; 12] = [
    ("licences", |workspace| supply::deny(workspace, &[])),
    ("heavy lints", |workspace| lints(workspace.cargo_heavy(&["clippy"]))),
    ("heavy docs", |workspace| documentation(workspace.cargo_heavy(&["doc"]))),
    ("heavy tests", |workspace| test::suite(workspace, Workspace::cargo_heavy, &[])),
    ("feature doc tests", feature_doc_tests),
    ("every reader", |workspace| external::run(workspace, true)),
    ("gallery", site::whole),
    ("packages", supply::publish),
    ("python package", package::run),
    ("training scripts", package::training),
    ("cluster", package::cluster),
    ("processors", |workspace| hashes::run(workspace, false, true)),
];

/// Files and folders that require --full after a change, in addition to the folders of heavy packages.
const COVERED: [&str; 13] = [
    "Cargo.lock",
    "crates/*/src/interop.rs",
    "deny.toml",
    "docs/SLIDES.md",
    "docs/formats",
    "fixtures/hashes.txt",
    "hashes",
    "site/pages/gallery",
    "site/pages/physics",
    "site/src/figures.rs",
    "site/src/gallery.rs",
    "xtask/src/external.rs",
    "xtask/src/package.rs",
];

fn covered(workspace: &Workspace) -> Vec<String> {
    let crates = workspace.heavy_packages().map(|package| format!("crates/{package}"));
    COVERED.map(str::to_owned).into_iter().chain(crates).collect()
}

pub(crate) fn run(workspace: &Workspace, full: bool) -> Result<()> {
    let further: &[Step] = if full { &FULL } else { &[] };
    steps::run(workspace, STEPS.iter().chain(further))?;
    if full {
        return record(workspace);
    }
    println!("\n{}", required(workspace));
    Ok(())
}

/// Runs doc tests of the technique crates with all features, which convert to types of other libraries.
fn feature_doc_tests(workspace: &Workspace) -> Result<()> {
    let packages = deps::pure_crates().filter(|name| *name != "papsynth").flat_map(|name| ["--package", name]);
    shell::run(workspace.cargo().args(["test", "--doc", "--all-features"]).args(packages))
}

/// Returns the file with the commit at which --full last passed.
fn recorded(workspace: &Workspace) -> PathBuf {
    workspace.target.join("ci-full-passed")
}

/// Returns the output of a Git command for the files that --full covers.
fn git(workspace: &Workspace, words: &[&str]) -> Result<String> {
    shell::output(Command::new("git").args(words).arg("--").args(covered(workspace)).current_dir(&workspace.root))
}

fn record(workspace: &Workspace) -> Result<()> {
    if !git(workspace, &["status", "--porcelain"])?.is_empty() {
        println!("\nNot recorded, because files that --full covers have uncommitted changes.");
        return Ok(());
    }
    shell::write(&recorded(workspace), &git(workspace, &["rev-list", "--max-count=1", "HEAD"])?)
}

/// Returns a message that states whether --full is required, and by which files.
fn required(workspace: &Workspace) -> String {
    let Ok(commit) = fs::read_to_string(recorded(workspace)) else {
        return format!("--full has not passed on this machine yet. It covers:\n{}", covered(workspace).join("\n"));
    };
    let commit = commit.trim();
    match git(workspace, &["diff", "--name-only", commit]) {
        Ok(files) if files.is_empty() => {
            format!("--full is not required: no file that it covers has changed since it passed at commit {commit}")
        }
        Ok(files) => {
            format!("--full is required: these files have changed since it passed at commit {commit}:\n{files}")
        }
        Err(error) => format!("--full may be required: {error}"),
    }
}

/// Reports whether tests with real images are skipped.
fn reference_images() -> Result<()> {
    match std::env::var_os("PAPSYNTH_REFERENCE") {
        Some(folder) if Path::new(&folder).is_dir() => Ok(()),
        Some(folder) => bail!("PAPSYNTH_REFERENCE = {}: expected a folder", folder.display()),
        None => Err(skipped("PAPSYNTH_REFERENCE is not set, so tests with real images are skipped")),
    }
}

fn lints(mut clippy: Command) -> Result<()> {
    shell::run(clippy.args(["--all-targets", "--", "-D", "warnings"]))
}

fn documentation(mut doc: Command) -> Result<()> {
    // Only libraries: the program and the engine are both called papsynth and would write to the same folder.
    shell::run(doc.args(["--lib", "--no-deps"]).env("RUSTDOCFLAGS", "-D warnings"))
}
