//! The whole test suite.

use anyhow::Result;

use crate::arguments::Arguments;
use crate::outcome::Outcome;
use crate::workspace::Workspace;
use crate::{Chore, ci, shell};

pub(crate) const CHORE: Chore = Chore {
    name: "test",
    usage: "[ARGUMENTS OF cargo test]",
    about: "runs the whole test suite: laws, oracles, golden images, doc tests, programs",
    details: "What takes long to compile is left out; cargo xtask ci --full tests it. Without PAPSYNTH_REFERENCE, the folder of the real material, the tests that need it are left out and say so.",
    run,
};

fn run(workspace: &Workspace, arguments: Arguments) -> Result<Outcome> {
    shell::run(workspace.cargo().arg("test").args(ci::light()).args(arguments.rest()))?;
    Ok(Outcome::Done)
}
