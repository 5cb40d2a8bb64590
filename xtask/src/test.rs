//! The test suite, the golden images, and long-running tests.

use std::process::Command;

use anyhow::Result;
use clap::Args;

use crate::shell;
use crate::workspace::Workspace;

/// Runs tests, and without arguments also doc tests, of the packages selected by `cargo`.
pub(crate) fn suite(
    workspace: &Workspace,
    cargo: fn(&Workspace, &[&str]) -> Command,
    arguments: &[String],
) -> Result<()> {
    let has_nextest = shell::succeeds(workspace.cargo().args(["nextest", "--version"]));
    let mut tests = cargo(workspace, if has_nextest { &["nextest", "run"] } else { &["test"] });
    let is_target =
        |word: &String| ["--lib", "--bin", "--test", "--example", "--bench"].iter().any(|t| word.starts_with(t));
    if !arguments.iter().take_while(|word| *word != "--").any(is_target) {
        // Without examples, which would be linked.
        tests.arg("--tests");
    }
    shell::run(tests.arg("--no-fail-fast").args(arguments))?;
    if arguments.is_empty() {
        shell::run(cargo(workspace, &["test"]).arg("--doc"))?;
    }
    Ok(())
}

pub(crate) fn golden(workspace: &Workspace, bless: bool) -> Result<()> {
    let mut command = workspace.cargo();
    command.args(["test", "--package", "papsynth", "--test", "it", "golden::"]);
    shell::run(if bless { command.env("PAPSYNTH_BLESS", "1") } else { &mut command })
}

#[derive(Args)]
pub(crate) struct Torture {
    /// Runs that are killed at random moments and then resumed, once on a full disk
    #[arg(long, value_name = "N", default_value_t = 1000)]
    kills: u64,
    /// Mutated inputs for every fuzz target
    #[arg(long, value_name = "N", default_value_t = 100_000)]
    fuzz: u64,
    /// Tiny images, whose generation must not need more memory than that of a tenth of them
    #[arg(long, value_name = "N", default_value_t = 100_000)]
    tiny: u64,
    /// Windows of a slide that are compared with tiles of three sizes
    #[arg(long, value_name = "N", default_value_t = 1000)]
    windows: u64,
}

pub(crate) fn torture(workspace: &Workspace, numbers: &Torture) -> Result<()> {
    for (package, filter) in [
        ("papsynth-cli", "sets::the_next_run_completes"),
        ("papsynth-cli", "sets::a_full_disk"),
        ("papsynth-dataset", "verifying::damage::every_"),
        ("papsynth-cli", "hostile::"),
        ("papsynth-dataset", "corpus::"),
        ("papsynth-cli", "memory::"),
        ("papsynth", "slide::windows_of_tiles"),
        ("ccd-noise", "properties::"),
    ] {
        let mut cargo = workspace.cargo();
        cargo.args(["test", "--release", "--package", package, "--test", "it", filter]);
        cargo.args(["--", "--nocapture", "--include-ignored"]).env("PAPSYNTH_TORTURE", "1");
        let Torture { kills, fuzz, tiny, windows } = numbers;
        for (name, number) in [("KILLS", kills), ("FUZZ", fuzz), ("TINY", tiny), ("WINDOWS", windows)] {
            cargo.env(format!("PAPSYNTH_{name}"), number.to_string());
        }
        shell::run(&mut cargo)?;
    }
    Ok(())
}
