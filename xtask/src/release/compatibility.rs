//! Compatibility with the last release, and with the oldest supported Rust.

use std::process::Command;

use anyhow::Result;

use crate::shell::{self, skipped};
use crate::supply;
use crate::workspace::Workspace;

/// Compares the interfaces of all libraries with those of the last release: the latest tag `v…` of another version.
///
/// An incompatible change is only allowed if the version says so.
pub(super) fn interfaces(workspace: &Workspace) -> Result<()> {
    let mut git = Command::new("git");
    let words = ["tag", "--list", "v*", "--merged", "HEAD", "--sort=-version:refname"];
    let tags = shell::output(git.args(words).current_dir(&workspace.root))?;
    let Some(baseline) = last_release(&tags, &workspace.released()?.version) else {
        println!("There is no earlier release to compare with: no tag `v…` of another version.");
        return Ok(());
    };
    let mut checks = supply::tool(workspace, "cargo-semver-checks", "0.51.0", "")?;
    checks.args(["semver-checks", "--workspace", "--baseline-rev", baseline]);
    shell::run(checks.env("CARGO_TARGET_DIR", workspace.target.join("semver-checks")))
}

/// Returns the first of these tags that is not the tag of `version`.
fn last_release<'a>(tags: &'a str, version: &str) -> Option<&'a str> {
    tags.lines().find(|tag| *tag != format!("v{version}"))
}

/// Compiles all crates with the `rust-version` of Cargo.toml.
pub(super) fn oldest_rust(workspace: &Workspace) -> Result<()> {
    let oldest = &workspace.released()?.rust_version;
    let installed = || shell::succeeds(Command::new("rustup").args(["run", oldest, "rustc", "--version"]));
    let install =
        || shell::succeeds(Command::new("rustup").args(["toolchain", "install", oldest, "--profile=minimal"]));
    let is_ready = installed() || install() && installed();
    if !is_ready {
        return Err(skipped(format!("Rust {oldest} is not installed, and rustup cannot install it")));
    }
    let mut cargo = Command::new("rustup");
    cargo.args(["run", oldest, "cargo", "check", "--locked", "--workspace", "--all-features", "--target-dir"]);
    shell::run(cargo.arg(workspace.target.join("oldest-rust")).env_remove("CARGO").current_dir(&workspace.root))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_release_has_another_version() {
        let tags = "v0.3.0\nv0.2.1\nv0.2.0\n";
        assert_eq!(last_release(tags, "0.3.0"), Some("v0.2.1"));
        assert_eq!(last_release(tags, "0.4.0"), Some("v0.3.0"));
        assert_eq!(last_release("v0.1.0\n", "0.1.0"), None);
        assert_eq!(last_release("", "0.1.0"), None);
    }
}
