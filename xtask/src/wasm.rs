//! The pure crates without threads and without a source of entropy, and what they give.

use std::path::Path;
use std::process::Command;

use anyhow::Result;

use crate::arguments::Arguments;
use crate::outcome::Outcome;
use crate::workspace::Workspace;
use crate::{Chore, deps, hashes, shell};

/// Without a system, and with one that programs can print to.
const TARGETS: [&str; 2] = ["wasm32-unknown-unknown", "wasm32-wasip1"];

pub(crate) const CHORE: Chore = Chore {
    name: "wasm",
    usage: "",
    about: "builds the transforms, the technique crates and the engine for wasm32, and compares hashes of what they give there",
    details: "The hashes are those of `cargo xtask hashes`, made in wasm32 by Node. Left out, with a sentence, where Node or a target is \
              missing (rustup target add wasm32-unknown-unknown wasm32-wasip1); a failure where CI is set.",
    run,
};

fn run(workspace: &Workspace, arguments: Arguments) -> Result<Outcome> {
    arguments.finish()?;
    for target in TARGETS {
        let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
        let libraries = shell::output(Command::new(rustc).args(["--print", "target-libdir", "--target", target]))?;
        if !Path::new(libraries.trim()).is_dir() {
            return Outcome::skipped_unless_ci(format!("the target {target} is not installed"));
        }
    }
    let mut command = workspace.cargo();
    command.args(["build", "--target", TARGETS[0], "--lib", "--no-default-features"]);
    for name in deps::pure_crates(workspace) {
        command.args(["--package", name]);
    }
    shell::run(&mut command)?;
    if !shell::answers(Command::new("node").arg("--version")) {
        return Outcome::skipped_unless_ci("Node is not installed, which runs programs for wasm32".to_owned());
    }
    shell::run(workspace.cargo().args(["build", "--target", TARGETS[1], "--package", hashes::PACKAGE]))?;
    let program = workspace.target.join(TARGETS[1]).join("debug").join(hashes::PACKAGE).with_extension("wasm");
    let found = shell::output(Command::new("node").arg(workspace.root.join("xtask/src/wasi.mjs")).arg(program))?;
    hashes::compare(workspace, &found, "wasm32")?;
    Ok(Outcome::Done)
}
