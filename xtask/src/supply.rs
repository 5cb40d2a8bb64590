//! Checks of dependencies, the bill of materials, and packages.

use std::fs;
use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, Result};
use serde_json::Value;

use crate::shell::{self, skipped};
use crate::workspace::{PROGRAM, Workspace};

pub(crate) fn deny(workspace: &Workspace, checks: &[String]) -> Result<()> {
    let mut command = tool(workspace, "cargo-deny", "0.20.2", "")?;
    command.args(["--locked", "check"]).args(checks);
    if checks.is_empty() {
        command.args(["bans", "licenses", "sources"]);
    }
    shell::run(&mut command)
}

pub(crate) fn sbom(workspace: &Workspace) -> Result<()> {
    println!("{}", workspace.shown(&bill(workspace)?));
    Ok(())
}

/// Writes the bill of materials and returns its path.
pub(crate) fn bill(workspace: &Workspace) -> Result<PathBuf> {
    const NAME: &str = "papsynth.cdx";
    let mut command = tool(workspace, "cargo-cyclonedx", "0.5.9", "")?;
    command.args(["cyclonedx", "--format", "json", "--spec-version", "1.5", "--all-features", "--target", "all"]);
    // This variable suppresses the serial number.
    shell::run(command.args(["--override-filename", NAME]).env("SOURCE_DATE_EPOCH", "0"))?;
    let mut text = String::new();
    // It writes a file next to the manifest of each member.
    for package in &workspace.packages {
        let written = package.folder().join(format!("{NAME}.json"));
        if package.name == PROGRAM {
            text = shell::read(&written)?;
        }
        fs::remove_file(&written).with_context(|| format!("cannot remove {}", written.display()))?;
    }
    let text = without_folders(&text.replace(&*workspace.root.to_string_lossy(), ""));
    let mut bill: Value = serde_json::from_str(&text).context("the output of cargo-cyclonedx")?;
    bill["metadata"].as_object_mut().and_then(|metadata| metadata.remove("timestamp"));
    let path = workspace.target.join(format!("{NAME}.json"));
    shell::write(&path, &format!("{bill:#}\n"))?;
    Ok(path)
}

/// Removes the folders of our crates from a bill of materials: everyone else finds them in the registry.
fn without_folders(bill: &str) -> String {
    let mut parts = bill.split("?download_url=file://");
    let first = parts.next().unwrap_or_default();
    let rest = parts.map(|part| part.trim_start_matches(|c| !['"', '#'].contains(&c)));
    std::iter::once(first).chain(rest).collect()
}

/// Returns a program, which Cargo installs with these features below the target folder if this version is missing.
pub(crate) fn tool(workspace: &Workspace, name: &str, version: &str, features: &str) -> Result<Command> {
    let root = workspace.target.join("tools");
    let installed = fs::read_to_string(root.join(".crates.toml")).unwrap_or_default();
    if !installed.contains(&format!("\"{name} {version} ")) {
        let mut command = workspace.cargo();
        // With little optimisation: more would take longer than it saves.
        command.args(["install", name, "--version", &format!("={version}"), "--features", features, "--locked"]);
        shell::run(command.args(["--debug", "--root"]).arg(&root).env("CARGO_PROFILE_DEV_OPT_LEVEL", "1"))
            .map_err(|error| skipped(format!("{name} {version} cannot be installed: {error}")))?;
    }
    let mut command = Command::new(root.join("bin").join(name));
    command.current_dir(&workspace.root);
    Ok(command)
}

/// Returns the folder in which Cargo unpacks crates of registries.
pub(crate) fn sources() -> PathBuf {
    let home = std::env::var_os("CARGO_HOME").map(PathBuf::from);
    let home = home.or_else(|| std::env::home_dir().map(|home| home.join(".cargo"))).unwrap_or_default();
    home.join("registry/src")
}

/// Packages every crate that is published, in target/package, and builds it from its package.
///
/// Removes packages that an earlier run has unpacked and built, because Cargo would reuse them for the same version.
pub(crate) fn publish(workspace: &Workspace) -> Result<()> {
    for registry in fs::read_dir(sources()).into_iter().flatten().flatten() {
        // The temporary registry of such a run has no host, so that its name begins with a dash.
        if registry.file_name().to_string_lossy().starts_with('-') {
            shell::remove(&registry.path())?;
        }
    }
    let published = workspace.packages.iter().filter(|package| package.is_published());
    let names: Vec<&str> = published.flat_map(|package| ["--package", &package.name]).collect();
    shell::run(workspace.cargo().arg("clean").args(&names))?;
    shell::run(workspace.cargo().args(["package", "--locked", "--allow-dirty"]).args(&names))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bill_of_materials_names_no_folders() {
        let bill =
            r#"["pkg:cargo/a@1?download_url=file://../a", "pkg:cargo/b@1?download_url=file://.#src/main.rs", 1]"#;
        assert_eq!(without_folders(bill), r#"["pkg:cargo/a@1", "pkg:cargo/b@1#src/main.rs", 1]"#);
        assert_eq!(without_folders("[]"), "[]");
    }
}
