//! The pure crates without threads and without a source of entropy, and what they give.

use std::process::Command;

use anyhow::Result;

use crate::arguments::Arguments;
use crate::chore::{Chore, Outcome};
use crate::workspace::Workspace;
use crate::{deps, hashes, shell, system};

/// Without a system, and with one that programs can print to.
const TARGETS: [&str; 2] = ["wasm32-unknown-unknown", "wasm32-wasip1"];

pub(crate) const CHORE: Chore = Chore {
    name: "wasm",
    usage: "",
    about: "checks the transforms, the technique crates and the engine for wasm32, and compares hashes of what they give there",
    details: "The hashes are those of `cargo xtask hashes`, made in wasm32 by Node. Left out, with a sentence, where a target is missing and rustup cannot \
              add it, or where there is no Node.",
    run,
};

fn run(workspace: &Workspace, arguments: Arguments) -> Result<Outcome> {
    arguments.finish()?;
    for target in TARGETS {
        if !system::has_target(target)? {
            return Ok(Outcome::Skipped(format!("the target {target} is not installed, and rustup cannot add it")));
        }
    }
    let mut command = workspace.cargo();
    command.args(["check", "--target", TARGETS[0], "--lib", "--no-default-features"]);
    for name in deps::pure_crates(workspace) {
        command.args(["--package", name]);
    }
    shell::run(&mut command)?;
    if !shell::answers(Command::new("node").arg("--version")) {
        return Ok(Outcome::Skipped("Node is not installed, which runs programs for wasm32".to_owned()));
    }
    shell::run(workspace.cargo().args(["build", "--target", TARGETS[1], "--package", hashes::PACKAGE]))?;
    let program = workspace.target.join(TARGETS[1]).join("debug").join(hashes::PACKAGE).with_extension("wasm");
    let found = shell::output(Command::new("node").arg(workspace.root.join("xtask/src/wasi.mjs")).arg(program))?;
    hashes::compare(workspace, &found, "wasm32")?;
    Ok(Outcome::Done)
}
