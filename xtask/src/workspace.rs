//! What Cargo knows about this workspace.

use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, Result};
use serde_json::Value;

use crate::shell;

/// What takes long to build, itself or its tests: only who names it, or works with `--full`, waits for it.
pub(crate) struct Heavy {
    /// A crate of this workspace, if it is one; else an optional dependency.
    pub(crate) package: Option<&'static str>,
    /// The features that bring it along.
    pub(crate) features: &'static [&'static str],
}

/// All of them; the crates are missing in the `default-members` of the workspace, too.
pub(crate) const HEAVY: &[Heavy] = &[
    Heavy { package: None, features: &["papsynth-dataset/cloud", "papsynth-cli/cloud", "papsynth-python/cloud"] },
    Heavy { package: Some("papsynth-python"), features: &[] },
    Heavy { package: None, features: &["papsynth-dataset/parquet", "papsynth-web/parquet", "papsynth-cli/parquet"] },
    Heavy {
        package: Some("papsynth-zarr"),
        features: &["papsynth-dataset/zarr", "papsynth-web/zarr", "papsynth-cli/zarr"],
    },
];

/// The features of other crates that bring heavy ones along, as Cargo reads them.
fn heavy_features() -> String {
    HEAVY.iter().flat_map(|heavy| heavy.features).copied().collect::<Vec<_>>().join(",")
}

/// Those of one crate.
pub(crate) fn heavy_features_of(package: &str) -> String {
    let all = HEAVY.iter().flat_map(|heavy| heavy.features).copied();
    let own = all.filter(|feature| feature.split_once('/').is_some_and(|(name, _)| name == package));
    own.collect::<Vec<_>>().join(",")
}

/// The heavy members and those that one of their features brings them to.
pub(crate) fn heavy_packages() -> Vec<&'static str> {
    let of_features = HEAVY.iter().flat_map(|heavy| heavy.features).filter_map(|feature| feature.split_once('/'));
    let mut packages: Vec<&str> = of_features.map(|(package, _)| package).collect();
    packages.extend(HEAVY.iter().filter_map(|heavy| heavy.package));
    packages.sort_unstable();
    packages.dedup();
    packages
}

/// The workspace.
pub(crate) struct Workspace {
    /// The folder of the root manifest.
    pub(crate) root: PathBuf,
    /// The folder that everything built goes to.
    pub(crate) target: PathBuf,
    /// The members.
    pub(crate) packages: Vec<Package>,
    /// The names of those that Cargo builds where none is named.
    pub(crate) usual: Vec<String>,
}

/// One member of the workspace.
pub(crate) struct Package {
    pub(crate) name: String,
    /// As Cargo tells it from others.
    pub(crate) id: String,
    /// Its features, but the default.
    pub(crate) features: Vec<String>,
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
        let packages = array(&metadata, "packages").iter().map(Package::new).collect::<Result<Vec<_>>>()?;
        let usual = array(&metadata, "workspace_default_members").iter().filter_map(Value::as_str);
        // An identity names the folder and, where that has another name, the package.
        let usual = packages.iter().filter(|package: &&Package| usual.clone().any(|id| id == package.id));
        let usual = usual.map(|package| package.name.clone()).collect();
        Ok(Self {
            usual,
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

    /// A subcommand of Cargo, of all members but the heavy ones, with every feature but those that bring heavy ones along.
    pub(crate) fn cargo_light(&self, subcommand: &[&str]) -> Command {
        let mut command = self.cargo();
        command.args(subcommand).args(["--workspace", "--features", &self.light_features()]);
        for package in HEAVY.iter().filter_map(|heavy| heavy.package) {
            command.args(["--exclude", package]);
        }
        command
    }

    /// A subcommand of Cargo, of [`heavy_packages`], with these features.
    pub(crate) fn cargo_heavy(&self, subcommand: &[&str]) -> Command {
        let mut command = self.cargo();
        command.args(subcommand).args(["--features", &heavy_features()]);
        for package in heavy_packages() {
            command.args(["--package", package]);
        }
        command
    }

    /// Every feature of every member but those that bring heavy ones along, as Cargo reads them.
    fn light_features(&self) -> String {
        let all = self
            .packages
            .iter()
            .flat_map(|package| package.features.iter().map(|feature| format!("{}/{feature}", package.name)));
        let is_heavy = |feature: &String| HEAVY.iter().any(|heavy| heavy.features.contains(&feature.as_str()));
        all.filter(|feature| !is_heavy(feature)).collect::<Vec<_>>().join(",")
    }

    /// A path below the target folder as a person would type it from the root folder.
    pub(crate) fn shown<'a>(&self, path: &'a std::path::Path) -> std::path::Display<'a> {
        path.strip_prefix(&self.root).unwrap_or(path).display()
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
        let features = value.get("features").and_then(Value::as_object);
        let features = features.into_iter().flat_map(|features| features.keys());
        Ok(Self {
            name: text_of(value, "name")?,
            id: text_of(value, "id")?,
            features: features.filter(|name| *name != "default").cloned().collect(),
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
