//! The pure crates without threads and without a source of entropy.

use std::path::Path;
use std::process::Command;

use anyhow::Result;

use crate::arguments::Arguments;
use crate::outcome::Outcome;
use crate::workspace::Workspace;
use crate::{Chore, deps, shell};

const TARGET: &str = "wasm32-unknown-unknown";

pub(crate) const CHORE: Chore = Chore {
    name: "wasm",
    usage: "",
    about: "builds the technique crates and the engine for wasm32-unknown-unknown",
    details: "Left out, with a sentence, where that target is not installed: rustup target add wasm32-unknown-unknown.",
    run,
};

fn run(workspace: &Workspace, arguments: Arguments) -> Result<Outcome> {
    arguments.finish()?;
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let libraries = shell::output(Command::new(rustc).args(["--print", "target-libdir", "--target", TARGET]))?;
    if !Path::new(libraries.trim()).is_dir() {
        return Ok(Outcome::Skipped(format!("the target {TARGET} is not installed")));
    }
    let mut command = workspace.cargo();
    command.args(["build", "--target", TARGET, "--lib", "--no-default-features"]);
    for name in deps::pure_crates(workspace) {
        command.args(["--package", name]);
    }
    shell::run(&mut command)?;
    Ok(Outcome::Done)
}
