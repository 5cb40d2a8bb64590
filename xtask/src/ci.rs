//! Everything that has to pass before a change is taken.

use std::fs;
use std::path::PathBuf;
use std::process::Command;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};

use crate::arguments::Arguments;
use crate::chore::{Chore, Outcome, in_ci};
use crate::workspace::{Workspace, heavy_packages};
use crate::{bench, browser, dataset, deps, equations, external, hashes, package, publish, shell, supply, test, wasm};

pub(crate) const CHORE: Chore = Chore {
    name: "ci",
    usage: "[--full]",
    about: "everything that has to pass before a change is taken, at most 20 minutes on 2 cores from nothing",
    details: "Formatting, lints, the test suite with its golden images, documentation, the rules of this workspace, instruction counts, a data set, other people's \
              readers, the study and the viewer in a browser, wasm32. With --full the crates that take long to build, every reader there is, licences, packages, Python, clusters, and what other processors give: \
              required before a release and after a change to a file that the longer tier covers. These are listed at the end of every run without --full: \
              the files that differ from the commit at which --full last passed, which is recorded in the target folder. All steps run even if one fails; each tells its time. Where CI \
              is set, a step that cannot run for want of Python, Chromium, Node, valgrind, a target of rustc or the real material (PAPSYNTH_REFERENCE) is a failure.",
    run,
};

type Step = (&'static str, fn(&Workspace) -> Result<Outcome>);

/// Cheap ones first. The golden images are part of the tests.
const STEPS: [Step; 12] = [
    ("format", |workspace| run_cargo(workspace.cargo().args(["fmt", "--all", "--check"]))),
    ("dependencies", |workspace| chore(workspace, &deps::CHORE)),
    ("equations", |workspace| chore(workspace, &equations::CHORE)),
    ("real material", |_| real_material()),
    ("lints", |workspace| lints(workspace.cargo_light(&["clippy"]))),
    ("documentation", |workspace| documentation(workspace.cargo_light(&["doc"]))),
    ("tests", |workspace| chore(workspace, &test::CHORE)),
    ("data set", |workspace| chore(workspace, &dataset::CHORE)),
    ("instructions", |workspace| (bench::CHORE.run)(workspace, Arguments::new(vec!["counts".to_owned()]))),
    ("external readers", |workspace| chore(workspace, &external::CHORE)),
    ("browser", |workspace| chore(workspace, &browser::CHORE)),
    ("wasm32", |workspace| chore(workspace, &wasm::CHORE)),
];

/// What takes heavy crates, the heavier readers, other processors, and what is done to publish; at most 80 minutes with everything before.
const FULL: [Step; 10] = [
    ("licences", |workspace| chore(workspace, &supply::DENY)),
    ("heavy lints", |workspace| lints(workspace.cargo_heavy(&["clippy"]))),
    ("heavy docs", |workspace| documentation(workspace.cargo_heavy(&["doc"]))),
    ("heavy tests", |workspace| test::suite(workspace, Workspace::cargo_heavy, &[])),
    ("feature doc tests", feature_doc_tests),
    ("every reader", |workspace| (external::CHORE.run)(workspace, Arguments::new(vec!["--full".to_owned()]))),
    ("packages", |workspace| chore(workspace, &publish::CHORE)),
    ("python package", |workspace| chore(workspace, &package::CHORE)),
    ("cluster", |workspace| chore(workspace, &package::CLUSTER)),
    ("processors", |workspace| (hashes::CHORE.run)(workspace, Arguments::new(vec!["--full".to_owned()]))),
];

/// Files and folders that require the longer tier, besides the folders of heavy crates and of crates with features that bring them along.
const COVERED: [&str; 9] = [
    "Cargo.lock",
    "crates/*/src/interop.rs",
    "deny.toml",
    "docs/SLIDES.md",
    "docs/formats",
    "fixtures/hashes.txt",
    "hashes",
    "xtask/src/external.rs",
    "xtask/src/package.rs",
];

fn covered() -> Vec<String> {
    let crates = heavy_packages().into_iter().map(|package| format!("crates/{package}"));
    COVERED.map(str::to_owned).into_iter().chain(crates).collect()
}

fn run(workspace: &Workspace, mut arguments: Arguments) -> Result<Outcome> {
    let full = arguments.flag("--full");
    arguments.finish()?;
    let mut table = String::new();
    let mut failed = Vec::new();
    let mut total = Duration::ZERO;
    let further: &[Step] = if full { &FULL } else { &[] };
    for &(name, step) in STEPS.iter().chain(further) {
        println!("\n== {name} ==");
        let (outcome, time) = timed(|| step(workspace));
        total += time;
        let words = match outcome {
            Ok(Outcome::Done) => "passed".to_owned(),
            Ok(Outcome::Skipped(reason)) => format!("skipped: {reason}"),
            Err(error) => {
                failed.push(name);
                format!("FAILED: {error:#}")
            }
        };
        println!("{words}");
        table.push_str(&format!("{name:<18} {:>6.0} s  {words}\n", time.as_secs_f64()));
    }
    println!("\n{table}{:<18} {:>6.0} s", "together", total.as_secs_f64());
    if !failed.is_empty() {
        bail!("failed: {}", failed.join(", "));
    }
    if full {
        record(workspace)?
    } else {
        println!("\n{}", required(workspace))
    }
    Ok(Outcome::Done)
}

/// Runs doc tests of the technique crates with all features: these convert to types of other libraries.
fn feature_doc_tests(workspace: &Workspace) -> Result<Outcome> {
    let mut cargo = workspace.cargo();
    cargo.args(["test", "--doc", "--all-features"]);
    for package in deps::pure_crates(workspace).filter(|name| *name != "papsynth") {
        cargo.args(["--package", package]);
    }
    run_cargo(&mut cargo)
}

/// Where the commit is recorded at which the longer tier last passed.
fn recorded(workspace: &Workspace) -> PathBuf {
    workspace.target.join("ci-full-passed")
}

/// What Git prints of the files that the longer tier covers.
fn git(workspace: &Workspace, words: &[&str]) -> Result<String> {
    shell::output(Command::new("git").args(words).arg("--").args(covered()).current_dir(&workspace.root))
}

fn record(workspace: &Workspace) -> Result<()> {
    if !git(workspace, &["status", "--porcelain"])?.is_empty() {
        println!("\nNot recorded: files that --full covers have uncommitted changes.");
        return Ok(());
    }
    let path = recorded(workspace);
    let commit = git(workspace, &["rev-list", "--max-count=1", "HEAD"])?;
    fs::write(&path, commit).with_context(|| format!("cannot write {}", path.display()))
}

/// Whether the longer tier is required, and by which files.
fn required(workspace: &Workspace) -> String {
    let Ok(commit) = fs::read_to_string(recorded(workspace)) else {
        return format!("--full has not passed here. It covers:\n{}", covered().join("\n"));
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

#[expect(clippy::disallowed_methods, reason = "the time goes to whoever waits, and into no image")]
fn timed<T>(work: impl FnOnce() -> T) -> (T, Duration) {
    let start = Instant::now();
    (work(), start.elapsed())
}

fn chore(workspace: &Workspace, chore: &Chore) -> Result<Outcome> {
    (chore.run)(workspace, Arguments::new(Vec::new()))
}

fn run_cargo(command: &mut Command) -> Result<Outcome> {
    shell::run(command)?;
    Ok(Outcome::Done)
}

/// The tests themselves leave out what needs the real material; here it is only said, once.
fn real_material() -> Result<Outcome> {
    match std::env::var_os("PAPSYNTH_REFERENCE") {
        Some(folder) => {
            ensure!(
                std::path::Path::new(&folder).is_dir(),
                "PAPSYNTH_REFERENCE is {}, which is no folder",
                folder.display()
            );
            Ok(Outcome::Done)
        }
        None if in_ci() => {
            bail!("PAPSYNTH_REFERENCE does not name the folder of the real material, and CI is set")
        }
        None => {
            Ok(Outcome::Skipped("PAPSYNTH_REFERENCE is not set, so the tests on real cells are left out".to_owned()))
        }
    }
}

fn lints(mut clippy: Command) -> Result<Outcome> {
    run_cargo(clippy.args(["--all-targets", "--", "-D", "warnings"]))
}

fn documentation(mut doc: Command) -> Result<Outcome> {
    // Libraries alone: the program and the engine are both called papsynth and would write to the same place.
    run_cargo(doc.args(["--lib", "--no-deps"]).env("RUSTDOCFLAGS", "-D warnings"))
}
