//! Everything that has to pass before a change is taken.

use std::time::{Duration, Instant};

use anyhow::{Result, bail, ensure};

use crate::arguments::Arguments;
use crate::outcome::{Outcome, in_ci};
use crate::workspace::Workspace;
use crate::{Chore, bench, browser, dataset, deps, equations, external, publish, shell, test, wasm};

pub(crate) const CHORE: Chore = Chore {
    name: "ci",
    usage: "[--full]",
    about: "everything that has to pass before a change is taken, at most 25 minutes on 2 cores from nothing",
    details: "Formatting, lints, the test suite with its golden images, documentation, the rules of this workspace, instruction counts, a data set, other people's \
              readers, the study in a browser, wasm32, packages. With --full every reader there is, and the packages and features that take long to compile. All steps run even if one fails; each tells its time. Where CI \
              is set, a step that cannot run for want of Python, Chromium, valgrind or the real material (PAPSYNTH_REFERENCE) is a failure.",
    run,
};

type Step = (&'static str, fn(&Workspace) -> Result<Outcome>);

/// Packages that take long to compile: the usual steps leave them out, with the features that bring them along; `--full` looks at them.
pub(crate) const HEAVY: [&str; 1] = ["papsynth-parquet"];

/// Features that bring them along, as `--features` wants them with the packages that have them.
pub(crate) const HEAVY_FEATURES: &str = "papsynth-cli/parquet";

/// All other features.
const LIGHT_FEATURES: &str = "fsd-shape/serde,papsynth/threads";

/// The packages that are built with heavy features.
const WITH_HEAVY: [&str; 2] = ["papsynth-dataset", "papsynth-cli"];

/// What takes the heavier packages and readers; at most 80 minutes with everything before.
const FULL: [Step; 4] = [
    ("heavy lints", |workspace| heavy(workspace, &["clippy", "--all-targets"], &["--", "-D", "warnings"])),
    ("heavy tests", |workspace| heavy(workspace, &["test"], &[])),
    ("heavy pages", |workspace| heavy(workspace, &["doc", "--lib", "--no-deps"], &[])),
    ("every reader", |workspace| (external::CHORE.run)(workspace, Arguments::new(vec!["--full".to_owned()]))),
];

/// Cheap ones first. The golden images are part of the tests.
const STEPS: [Step; 14] = [
    ("format", |workspace| cargo(workspace, &["fmt", "--all", "--check"])),
    ("dependencies", |workspace| chore(workspace, &deps::CHORE)),
    ("equations", |workspace| chore(workspace, &equations::CHORE)),
    ("real material", |_| real_material()),
    ("lints", lints),
    ("documentation", documentation),
    ("tests", |workspace| chore(workspace, &test::CHORE)),
    ("instructions", |workspace| (bench::CHORE.run)(workspace, Arguments::new(vec!["counts".to_owned()]))),
    ("data set", |workspace| chore(workspace, &dataset::CHORE)),
    ("external readers", |workspace| chore(workspace, &external::CHORE)),
    ("browser", |workspace| chore(workspace, &browser::CHORE)),
    ("wasm32", |workspace| chore(workspace, &wasm::CHORE)),
    ("packages", |workspace| chore(workspace, &publish::CHORE)),
    ("licences", licences),
];

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
    Ok(Outcome::Done)
}

#[expect(clippy::disallowed_methods, reason = "the time goes to whoever waits, and into no image")]
fn timed<T>(work: impl FnOnce() -> T) -> (T, Duration) {
    let start = Instant::now();
    (work(), start.elapsed())
}

fn chore(workspace: &Workspace, chore: &Chore) -> Result<Outcome> {
    (chore.run)(workspace, Arguments::new(Vec::new()))
}

fn cargo(workspace: &Workspace, arguments: &[&str]) -> Result<Outcome> {
    shell::run(workspace.cargo().args(arguments))?;
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

/// The whole workspace without what is heavy.
pub(crate) fn light() -> impl Iterator<Item = &'static str> {
    std::iter::once("--workspace").chain(HEAVY.into_iter().flat_map(|package| ["--exclude", package]))
}

fn lints(workspace: &Workspace) -> Result<Outcome> {
    let mut command = workspace.cargo();
    command.arg("clippy").args(light()).args(["--all-targets", "--features", LIGHT_FEATURES, "--", "-D", "warnings"]);
    shell::run(&mut command)?;
    Ok(Outcome::Done)
}

/// What is heavy, and what is built with it.
fn heavy(workspace: &Workspace, before: &[&str], after: &[&str]) -> Result<Outcome> {
    let mut command = workspace.cargo();
    let packages = HEAVY.into_iter().chain(WITH_HEAVY).flat_map(|package| ["--package", package]);
    command.args(before).args(packages).args(["--features", HEAVY_FEATURES]).args(after);
    shell::run(&mut command)?;
    Ok(Outcome::Done)
}

fn documentation(workspace: &Workspace) -> Result<Outcome> {
    let mut command = workspace.cargo();
    // Libraries alone: the program and the engine are both called papsynth and would write to the same place.
    command.arg("doc").args(light()).args(["--lib", "--no-deps", "--features", LIGHT_FEATURES]);
    command.env("RUSTDOCFLAGS", "-D warnings");
    shell::run(&mut command)?;
    Ok(Outcome::Done)
}

fn licences(workspace: &Workspace) -> Result<Outcome> {
    if !shell::answers(workspace.cargo().args(["deny", "--version"])) {
        return Ok(Outcome::Skipped("cargo-deny is not installed".to_owned()));
    }
    cargo(workspace, &["deny", "check"])
}
