//! Writes the licences of all dependencies.

use std::path::PathBuf;

use anyhow::{Context, Result, ensure};

use crate::package;
use crate::shell;
use crate::supply;
use crate::workspace::{PROGRAM, Workspace};

/// The file of licences in archives and wheels. Its name is like those of our own licences.
pub(super) const NAME: &str = "LICENSE-THIRD-PARTY.txt";

/// Writes one file for the program and one for the Python package.
pub(super) fn write(workspace: &Workspace) -> Result<()> {
    let rules = shell::read(&workspace.root.join("deny.toml"))?;
    let allowed = allowed(&rules).context("deny.toml: no line `allow = […]` below [licenses]")?;
    let settings = super::work(workspace, "about.toml");
    shell::make(&super::work(workspace, ""))?;
    let targets =
        "targets = [\"x86_64-unknown-linux-musl\", \"aarch64-unknown-linux-musl\", \"x86_64-unknown-linux-gnu\"]";
    let more = "ignore-build-dependencies = true\nignore-dev-dependencies = true";
    shell::write(&settings, &format!("accepted = {allowed}\n{targets}\n{more}\n"))?;
    // With --frozen, cargo-about reads only the unpacked crates.
    shell::run(workspace.cargo().args(["fetch", "--locked"]))?;
    for folder in [&format!("crates/{PROGRAM}"), package::PACKAGE] {
        let mut about = supply::tool(workspace, "cargo-about", "0.9.3", "cli")?;
        about.args(["about", "generate", "--frozen", "--all-features", "--fail"]);
        about.arg("--config").arg(&settings).arg("--manifest-path").arg(workspace.root.join(folder).join("Cargo.toml"));
        about.arg("--output-file").arg(written(workspace, folder));
        shell::run(about.arg(workspace.root.join("xtask/src/release/licences.hbs")))?;
    }
    Ok(())
}

/// Returns the file of licences for the package in this folder, if [`write`] has made it.
pub(super) fn found(workspace: &Workspace, folder: &str) -> Result<PathBuf> {
    let texts = written(workspace, folder);
    ensure!(texts.exists(), "there are no licences: run the step `licences` first");
    Ok(texts)
}

/// Returns the file that [`write`] makes for the package in this folder.
fn written(workspace: &Workspace, folder: &str) -> PathBuf {
    super::work(workspace, &format!("licences-{}.txt", folder.trim_start_matches("crates/")))
}

/// Returns the list of allowed licences in the rules for dependencies.
fn allowed(rules: &str) -> Option<&str> {
    let section = rules.split_once("\n[licenses]\n")?.1;
    section.lines().find_map(|line| line.strip_prefix("allow = "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn allowed_licences_are_read_from_their_section() {
        let rules = "[bans]\nallow = [1]\n\n[licenses]\n# Every one.\nallow = [\"MIT\"]\n";
        assert_eq!(allowed(rules), Some("[\"MIT\"]"));
        assert_eq!(allowed("[bans]\nallow = [1]\n"), None);
    }
}
