//! The whole test suite.

use std::process::Command;

use anyhow::Result;

use crate::arguments::Arguments;
use crate::chore::{Chore, Outcome};
use crate::shell;
use crate::workspace::Workspace;

pub(crate) const CHORE: Chore = Chore {
    name: "test",
    usage: "[ARGUMENTS OF cargo test]",
    about: "runs the whole test suite: laws, oracles, golden images, doc tests, programs",
    details: "Tests run with cargo-nextest if it is installed, otherwise with `cargo test`. Both take a part of a name (`cargo xtask test golden::`) and select targets \
              (`cargo xtask test --lib`). With arguments, doc tests do not run. Examples are not built: the lints check them.\n\
              Without PAPSYNTH_REFERENCE, the folder of the real material, the tests that need it are left out and say so. Crates that take long to build are left to \
              `cargo xtask ci --full`.",
    run,
};

fn run(workspace: &Workspace, arguments: Arguments) -> Result<Outcome> {
    suite(workspace, Workspace::cargo_light, &arguments.rest())
}

/// Runs tests and, without arguments, doc tests of the packages that `cargo` adds to a subcommand.
pub(crate) fn suite(
    workspace: &Workspace,
    cargo: fn(&Workspace, &[&str]) -> Command,
    arguments: &[String],
) -> Result<Outcome> {
    let has_nextest = shell::answers(workspace.cargo().args(["nextest", "--version"]));
    let mut tests = cargo(workspace, if has_nextest { &["nextest", "run"] } else { &["test"] });
    let is_target =
        |word: &String| ["--lib", "--bin", "--test", "--example", "--bench"].iter().any(|t| word.starts_with(t));
    if !arguments.iter().take_while(|word| *word != "--").any(is_target) {
        // All but examples, which would be linked.
        tests.arg("--tests");
    }
    shell::run(tests.arg("--no-fail-fast").args(arguments))?;
    if arguments.is_empty() {
        shell::run(cargo(workspace, &["test"]).arg("--doc"))?;
    }
    Ok(Outcome::Done)
}
