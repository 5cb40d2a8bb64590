//! What comes from others: whether `deny.toml` allows it, and a bill of materials.

use std::fs;
use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, Result};
use serde_json::Value;

use crate::arguments::Arguments;
use crate::chore::{Chore, Outcome};
use crate::shell;
use crate::workspace::Workspace;

pub(crate) const DENY: Chore = Chore {
    name: "deny",
    usage: "[ARGUMENTS OF cargo deny check]",
    about: "checks licences, sources and duplicate versions of dependencies against deny.toml",
    details: "Runs cargo-deny, which is installed to target/tools. Without arguments it runs `cargo deny check bans licenses sources`, \
              which needs no other files than those of Cargo; `cargo xtask deny advisories` downloads the database of advisories. Left out, with a sentence, where cargo-deny \
              cannot be installed; a failure where CI is set.",
    run: deny,
};

pub(crate) const SBOM: Chore = Chore {
    name: "sbom",
    usage: "",
    about: "writes the bill of materials of the program, as CycloneDX, to the target folder",
    details: "CycloneDX 1.5 in JSON, by cargo-cyclonedx, which is installed to target/tools: every crate that `papsynth` is built of, on any platform, with version, licence, \
              SHA-256 and what it depends on. It holds no dates, serial numbers or paths: the same Cargo.lock gives the same bytes.",
    run: sbom,
};

/// The crate whose program is shipped.
const PROGRAM: &str = "papsynth-cli";

fn deny(workspace: &Workspace, arguments: Arguments) -> Result<Outcome> {
    let mut command = match tool(workspace, "cargo-deny", "0.20.2") {
        Ok(command) => command,
        Err(reason) => return Outcome::skipped_unless_ci(reason),
    };
    let mut checks = arguments.rest();
    if checks.is_empty() {
        checks = ["bans", "licenses", "sources"].map(str::to_owned).into();
    }
    shell::run(command.args(["--locked", "check"]).args(checks))?;
    Ok(Outcome::Done)
}

fn sbom(workspace: &Workspace, arguments: Arguments) -> Result<Outcome> {
    arguments.finish()?;
    match bill(workspace)? {
        Ok(path) => println!("{}", workspace.shown(&path)),
        Err(reason) => return Outcome::skipped_unless_ci(reason),
    }
    Ok(Outcome::Done)
}

/// Writes the bill of materials and returns its path, or why it cannot be written.
pub(crate) fn bill(workspace: &Workspace) -> Result<Result<PathBuf, String>> {
    const NAME: &str = "papsynth.cdx";
    let mut command = match tool(workspace, "cargo-cyclonedx", "0.5.9") {
        Ok(command) => command,
        Err(reason) => return Ok(Err(reason)),
    };
    command.args(["cyclonedx", "--format", "json", "--spec-version", "1.5", "--all-features", "--target", "all"]);
    // With this variable it writes no serial number.
    shell::run(command.args(["--override-filename", NAME]).env("SOURCE_DATE_EPOCH", "0"))?;
    let mut text = String::new();
    // It writes one file beside the manifest of each member.
    for package in &workspace.packages {
        let written = package.folder.join(format!("{NAME}.json"));
        if package.name == PROGRAM {
            text = fs::read_to_string(&written).with_context(|| format!("cannot read {}", written.display()))?;
        }
        fs::remove_file(&written).with_context(|| format!("cannot remove {}", written.display()))?;
    }
    let text = text.replace(&*workspace.root.to_string_lossy(), "");
    let mut bill: Value = serde_json::from_str(&text).context("the output of cargo-cyclonedx")?;
    bill["metadata"].as_object_mut().and_then(|metadata| metadata.remove("timestamp"));
    let path = workspace.target.join(format!("{NAME}.json"));
    fs::write(&path, format!("{bill:#}\n")).with_context(|| format!("cannot write {}", path.display()))?;
    Ok(Ok(path))
}

/// A program that Cargo builds and installs below the target folder, if this version is not there yet; or why it cannot be installed.
fn tool(workspace: &Workspace, name: &str, version: &str) -> Result<Command, String> {
    let root = workspace.target.join("tools");
    let installed = fs::read_to_string(root.join(".crates.toml")).unwrap_or_default();
    if !installed.contains(&format!("\"{name} {version} ")) {
        let mut command = workspace.cargo();
        // Without optimisation, which takes longer than it saves.
        command.args(["install", name, "--version", &format!("={version}"), "--locked", "--debug", "--root"]);
        let failure = |error| format!("{name} {version} cannot be installed: {error}");
        shell::run(command.arg(&root)).map_err(failure)?;
    }
    let mut command = Command::new(root.join("bin").join(name));
    command.current_dir(&workspace.root);
    Ok(command)
}
