//! What takes too long for every change: many kills, many bits turned over.

use anyhow::{Context, Result};

use crate::arguments::Arguments;
use crate::chore::{Chore, Outcome};
use crate::shell;
use crate::workspace::Workspace;

pub(crate) const CHORE: Chore = Chore {
    name: "torture",
    usage: "[--kills N] [--fuzz N] [--tiny N] [--windows N]",
    about: "kills runs a thousand times, turns a thousand bits over, fills a disk, makes a hundred thousand images, cuts a slide in a thousand ways",
    details: "Runs are killed at N random moments (1000 unless it is said) and completed again, once on a disk that is full; a thousand bits of a data set in every format are turned \
              over, one at a time, it is cut a hundred times and loses each of its files, and all must be found. Every field of a recipe gets whatever it cannot be. Inputs of every fuzz target are \
              changed N times (100000). N tiny images (100000) must not need more memory than a tenth of them, and estimates of memory are held against what is needed. N windows (1000) of a slide are put together from tiles of three sizes. Laws of noise are held against a million draws. By \
              hand, before a release: with these numbers it takes three quarters of an hour on 2 cores.",
    run,
};

fn run(workspace: &Workspace, mut arguments: Arguments) -> Result<Outcome> {
    let mut number = |name: &str, usual: u64| match arguments.option(name)? {
        Some(text) => text.parse().with_context(|| format!("{name}: `{text}` is no number")),
        None => Ok(usual),
    };
    let (kills, fuzz, tiny) = (number("--kills", 1000)?, number("--fuzz", 100_000)?, number("--tiny", 100_000)?);
    let windows = number("--windows", 1000)?;
    arguments.finish()?;
    let test = |package: &str, filter: &str| {
        let mut cargo = workspace.cargo();
        cargo.args(["test", "--release", "--package", package, "--test", "it", filter]);
        cargo.args(["--", "--nocapture", "--include-ignored"]);
        cargo.env("PAPSYNTH_KILLS", kills.to_string()).env("PAPSYNTH_TORTURE", "1");
        cargo.env("PAPSYNTH_FUZZ", fuzz.to_string()).env("PAPSYNTH_TINY", tiny.to_string());
        cargo.env("PAPSYNTH_WINDOWS", windows.to_string());
        shell::run(&mut cargo)
    };
    test("papsynth-cli", "sets::whatever_is_killed")?;
    test("papsynth-cli", "sets::a_full_disk")?;
    test("papsynth-dataset", "verifying::damage::every_")?;
    test("papsynth-cli", "hostile::")?;
    test("papsynth-dataset", "corpus::")?;
    test("papsynth-cli", "memory::")?;
    test("papsynth", "slide::windows_of_tiles")?;
    test("ccd-noise", "laws::")?;
    Ok(Outcome::Done)
}
