//! Everything that has to pass before a change is taken.

use std::process::Command;
use std::time::{Duration, Instant};

use anyhow::{Result, bail, ensure};

use crate::arguments::Arguments;
use crate::outcome::{Outcome, in_ci};
use crate::workspace::Workspace;
use crate::{
    Chore, bench, browser, covered, dataset, deps, equations, external, hashes, package, publish, shell, supply, test,
    wasm,
};

pub(crate) const CHORE: Chore = Chore {
    name: "ci",
    usage: "[--full | --changed]",
    about: "everything that has to pass before a change is taken, at most 25 minutes on 2 cores from nothing",
    details: "Formatting, lints, the test suite with its golden images, documentation, the rules of this workspace, instruction counts, a data set, other people's \
              readers, the study and the viewer in a browser, wasm32. With --full the crates that take long to build, every reader there is, packages, Python, clusters, and what other processors give; if all passes, .ci/full records what of \
              the workspace that covers. With --changed that too, but only where it differs from what .ci/full records. All steps run even if one fails; each tells its time. Where CI \
              is set, a step that cannot run for want of Python, Chromium, Node, valgrind, a target of rustc or the real material (PAPSYNTH_REFERENCE) is a failure.",
    run,
};

type Step = (&'static str, fn(&Workspace) -> Result<Outcome>);

/// What takes heavy crates, the heavier readers, other processors, and what is done to publish; at most 80 minutes with everything before.
const FULL: [Step; 8] = [
    ("heavy lints", |workspace| {
        run_cargo(workspace.cargo_heavy("clippy").args(["--all-targets", "--", "-D", "warnings"]))
    }),
    ("heavy docs", |workspace| {
        run_cargo(workspace.cargo_heavy("doc").args(["--lib", "--no-deps"]).env("RUSTDOCFLAGS", "-D warnings"))
    }),
    ("heavy tests", |workspace| run_cargo(&mut workspace.cargo_heavy("test"))),
    ("every reader", |workspace| (external::CHORE.run)(workspace, Arguments::new(vec!["--full".to_owned()]))),
    ("packages", |workspace| chore(workspace, &publish::CHORE)),
    ("python package", |workspace| chore(workspace, &package::CHORE)),
    ("cluster", |workspace| chore(workspace, &package::CLUSTER)),
    ("processors", |workspace| (hashes::CHORE.run)(workspace, Arguments::new(vec!["--full".to_owned()]))),
];

/// Cheap ones first. The golden images are part of the tests.
const STEPS: [Step; 13] = [
    ("format", |workspace| cargo(workspace, &["fmt", "--all", "--check"])),
    ("dependencies", |workspace| chore(workspace, &deps::CHORE)),
    ("equations", |workspace| chore(workspace, &equations::CHORE)),
    ("real material", |_| real_material()),
    ("lints", |workspace| {
        let features = workspace.light_features();
        let mut command = workspace.cargo_light("clippy");
        run_cargo(command.args(["--all-targets", "--features", &features, "--", "-D", "warnings"]))
    }),
    ("documentation", documentation),
    ("tests", |workspace| chore(workspace, &test::CHORE)),
    ("instructions", |workspace| (bench::CHORE.run)(workspace, Arguments::new(vec!["counts".to_owned()]))),
    ("data set", |workspace| chore(workspace, &dataset::CHORE)),
    ("external readers", |workspace| chore(workspace, &external::CHORE)),
    ("browser", |workspace| chore(workspace, &browser::CHORE)),
    ("wasm32", |workspace| chore(workspace, &wasm::CHORE)),
    ("licences", licences),
];

fn run(workspace: &Workspace, mut arguments: Arguments) -> Result<Outcome> {
    let (mut full, changed) = (arguments.flag("--full"), arguments.flag("--changed"));
    arguments.finish()?;
    if changed && !full {
        full = covered::has_changed(workspace)?;
        println!("what --full covers {} since it last passed", if full { "has changed" } else { "has not changed" });
    }
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
        covered::record(workspace)?;
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
    run_cargo(workspace.cargo().args(arguments))
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

fn documentation(workspace: &Workspace) -> Result<Outcome> {
    let mut command = workspace.cargo_light("doc");
    // Libraries alone: the program and the engine are both called papsynth and would write to the same place.
    command.args(["--lib", "--no-deps", "--features", &workspace.light_features()]);
    run_cargo(command.env("RUSTDOCFLAGS", "-D warnings"))
}

fn licences(workspace: &Workspace) -> Result<Outcome> {
    if !shell::answers(workspace.cargo().args(["deny", "--version"])) {
        // Advisories alone are left out then.
        return supply::check(workspace);
    }
    cargo(workspace, &["deny", "check"])
}
