//! What a machine may lack and may be able to have: programs of its distribution, targets of its compiler.

use std::path::Path;
use std::process::Command;

use anyhow::Result;

use crate::shell;

pub(crate) fn is_root() -> bool {
    shell::output(Command::new("id").arg("-u")).is_ok_and(|id| id.trim() == "0")
}

/// Installs packages of Debian, where this is one and nobody need be asked. Says whether it did.
pub(crate) fn install(packages: &[&str]) -> bool {
    let apt = |words: &[&str]| {
        shell::run(Command::new("apt-get").args(words).env("DEBIAN_FRONTEND", "noninteractive")).is_ok()
    };
    is_root()
        && shell::answers(Command::new("apt-get").arg("--version"))
        && apt(&["update", "--quiet"])
        && apt(&[&["install", "--quiet", "--yes", "--no-install-recommends"], packages].concat())
}

/// Whether programs can be built for a target, which rustup adds if need be: a toolchain that came without it, or a machine without a
/// network, cannot have it.
pub(crate) fn has_target(target: &str) -> Result<bool> {
    Ok(is_installed(target)?
        || shell::answers(Command::new("rustup").args(["target", "add", target])) && is_installed(target)?)
}

fn is_installed(target: &str) -> Result<bool> {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let libraries = shell::output(Command::new(rustc).args(["--print", "target-libdir", "--target", target]))?;
    Ok(Path::new(libraries.trim()).is_dir())
}
