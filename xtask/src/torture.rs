//! What takes too long for every change: many kills, many bits turned over.

use anyhow::{Context, Result};

use crate::arguments::Arguments;
use crate::outcome::Outcome;
use crate::workspace::Workspace;
use crate::{Chore, shell};

pub(crate) const CHORE: Chore = Chore {
    name: "torture",
    usage: "[--kills N]",
    about: "kills runs a thousand times, turns a thousand bits over",
    details: "Runs are killed at N random moments (1000 unless it is said) and completed again; a thousand bits of a data set in every format are turned \
              over, one at a time, and must be found. By hand, before a release.",
    run,
};

fn run(workspace: &Workspace, mut arguments: Arguments) -> Result<Outcome> {
    let kills: u64 = match arguments.option("--kills")? {
        Some(kills) => kills.parse().with_context(|| format!("`{kills}` is no number of kills"))?,
        None => 1000,
    };
    arguments.finish()?;
    let test = |package: &str, suite: &str, filter: &str| {
        let mut cargo = workspace.cargo();
        cargo.args(["test", "--package", package, "--test", suite, filter, "--", "--nocapture"]);
        cargo.env("PAPSYNTH_KILLS", kills.to_string()).env("PAPSYNTH_TORTURE", "1");
        shell::run(&mut cargo)
    };
    test("papsynth-cli", "sets", "whatever_is_killed")?;
    test("papsynth-dataset", "verifying", "every_bit")?;
    Ok(Outcome::Done)
}
