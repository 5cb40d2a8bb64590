//! Golden images.

use anyhow::Result;

use crate::arguments::Arguments;
use crate::chore::{Chore, Outcome};
use crate::shell;
use crate::workspace::Workspace;

pub(crate) const CHORE: Chore = Chore {
    name: "golden",
    usage: "[--bless]",
    about: "compares the golden images of every stage, or writes them anew",
    details: "The images stand in fixtures/golden, each with the recipe it was made from. --bless writes them: what they show \
              is then what is right, so look at them, and give the change a line under Results in CHANGELOG.md.",
    run,
};

fn run(workspace: &Workspace, mut arguments: Arguments) -> Result<Outcome> {
    let bless = arguments.flag("--bless");
    arguments.finish()?;
    let mut command = workspace.cargo();
    command.args(["test", "--package", "papsynth", "--test", "it", "golden::"]);
    if bless {
        command.env("PAPSYNTH_BLESS", "1");
    }
    shell::run(&mut command)?;
    Ok(Outcome::Done)
}
