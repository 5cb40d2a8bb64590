//! The whole test suite.

use anyhow::Result;

use crate::arguments::Arguments;
use crate::outcome::Outcome;
use crate::workspace::Workspace;
use crate::{Chore, shell};

pub(crate) const CHORE: Chore = Chore {
    name: "test",
    usage: "[ARGUMENTS OF cargo test]",
    about: "runs the whole test suite: laws, oracles, golden images, doc tests, programs",
    details: "Without PAPSYNTH_REFERENCE, the folder of the real material, the tests that need it are left out and say so. Crates that take long to build are left to \
              `cargo xtask ci --full`.",
    run,
};

fn run(workspace: &Workspace, arguments: Arguments) -> Result<Outcome> {
    shell::run(workspace.cargo_light("test").args(arguments.rest()))?;
    Ok(Outcome::Done)
}
