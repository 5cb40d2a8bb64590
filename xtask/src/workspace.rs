//! What Cargo knows about this workspace.

use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::shell;

/// The workspace.
pub(crate) struct Workspace {
    /// The folder of the root manifest.
    pub(crate) root: PathBuf,
    /// The folder that everything built goes to.
    pub(crate) target: PathBuf,
    /// The members.
    pub(crate) packages: Vec<Package>,
}

/// One member of the workspace.
pub(crate) struct Package {
    pub(crate) name: String,
    /// The folder of its manifest.
    pub(crate) folder: PathBuf,
    /// The members it depends on in any way, tests and build scripts included.
    pub(crate) members: Vec<String>,
    /// What it builds, as (kind, name).
    pub(crate) targets: Vec<(String, String)>,
}

impl Workspace {
    /// Asks Cargo.
    pub(crate) fn load() -> Result<Self> {
        let text = shell::output(cargo_command().args(["metadata", "--no-deps", "--format-version", "1"]))?;
        let metadata: Value = serde_json::from_str(&text).context("the output of `cargo metadata`")?;
        let packages = array(&metadata, "packages").iter().map(Package::new).collect::<Result<_>>()?;
        Ok(Self {
            root: text_of(&metadata, "workspace_root")?.into(),
            target: text_of(&metadata, "target_directory")?.into(),
            packages,
        })
    }

    /// The Cargo that runs this program, in the root folder.
    pub(crate) fn cargo(&self) -> Command {
        let mut command = cargo_command();
        command.current_dir(&self.root);
        command
    }

    /// A path below the target folder as a person would type it from the root folder.
    pub(crate) fn shown<'a>(&self, path: &'a std::path::Path) -> std::path::Display<'a> {
        path.strip_prefix(&self.root).unwrap_or(path).display()
    }

    /// Checks that a package has a target of that kind and name, so that a chore can say what is missing.
    pub(crate) fn expect_target(&self, package: &str, kind: &str, name: &str) -> Result<()> {
        let found = self
            .packages
            .iter()
            .filter(|p| p.name == package)
            .flat_map(|p| &p.targets)
            .any(|(k, n)| k == kind && n == name);
        ensure!(found, "crate `{package}` has no {kind} `{name}`");
        Ok(())
    }
}

impl Package {
    fn new(value: &Value) -> Result<Self> {
        let manifest = PathBuf::from(text_of(value, "manifest_path")?);
        // Members are the dependencies that are found by path.
        let members = array(value, "dependencies").iter().filter(|d| d.get("path").is_some_and(Value::is_string));
        let mut members = members.map(|d| text_of(d, "name")).collect::<Result<Vec<_>>>()?;
        members.sort();
        members.dedup();
        let kind =
            |target: &Value| array(target, "kind").first().and_then(Value::as_str).unwrap_or_default().to_owned();
        let targets =
            array(value, "targets").iter().map(|t| Ok((kind(t), text_of(t, "name")?))).collect::<Result<_>>()?;
        Ok(Self {
            name: text_of(value, "name")?,
            folder: manifest.parent().context("a manifest lies in a folder")?.to_owned(),
            members,
            targets,
        })
    }
}

fn cargo_command() -> Command {
    Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}

fn array<'a>(value: &'a Value, name: &str) -> &'a [Value] {
    value.get(name).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

fn text_of(value: &Value, name: &str) -> Result<String> {
    let text = value.get(name).and_then(Value::as_str);
    text.map(str::to_owned).with_context(|| format!("`cargo metadata` says nothing about `{name}`"))
}
