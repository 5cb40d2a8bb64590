//! The metadata of the workspace from Cargo.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};
use serde::Deserialize;
use serde::de::IgnoredAny;

use crate::shell;

/// Crates that take long to build or test. They are built only if named or with `--full`, and are not in the
/// `default-members`.
pub(crate) const HEAVY_CRATES: [&str; 2] = ["papsynth-python", "papsynth-zarr"];

/// Features with dependencies that take long to build.
pub(crate) const HEAVY_FEATURES: [&str; 3] = ["cloud", "parquet", "zarr"];

/// The package of the program `papsynth`.
pub(crate) const PROGRAM: &str = "papsynth-cli";

/// The workspace.
#[derive(Deserialize)]
pub(crate) struct Workspace {
    /// The folder of the root manifest.
    #[serde(rename = "workspace_root")]
    pub(crate) root: PathBuf,
    /// The target folder.
    #[serde(rename = "target_directory")]
    pub(crate) target: PathBuf,
    /// The members.
    pub(crate) packages: Vec<Package>,
    /// Package IDs of the default members.
    #[serde(rename = "workspace_default_members")]
    pub(crate) usual: BTreeSet<String>,
}

/// One member of the workspace.
#[derive(Deserialize)]
pub(crate) struct Package {
    pub(crate) name: String,
    pub(crate) version: String,
    /// The oldest Rust that compiles it.
    pub(crate) rust_version: String,
    pub(crate) repository: Option<String>,
    /// Package ID.
    pub(crate) id: String,
    features: BTreeMap<String, IgnoredAny>,
    manifest_path: PathBuf,
    /// The registries that it may be published to; `None` for all.
    publish: Option<Vec<String>>,
    dependencies: Vec<Dependency>,
    /// Its targets.
    pub(crate) targets: Vec<Target>,
}

/// A dependency of a member, including those of tests and build scripts.
#[derive(Deserialize)]
struct Dependency {
    name: String,
    /// Only for members of the workspace.
    path: Option<PathBuf>,
}

/// A library, program, benchmark, …
#[derive(Deserialize)]
pub(crate) struct Target {
    pub(crate) kind: Vec<String>,
    pub(crate) name: String,
}

impl Workspace {
    /// Returns the package of the released program.
    pub(crate) fn released(&self) -> Result<&Package> {
        let found = self.packages.iter().find(|package| package.name == PROGRAM);
        found.with_context(|| format!("the workspace has no package {PROGRAM}"))
    }

    /// Runs `cargo metadata`.
    pub(crate) fn load() -> Result<Self> {
        let text = shell::output(cargo_command().args(["metadata", "--no-deps", "--format-version", "1"]))?;
        serde_json::from_str(&text).context("the output of `cargo metadata`")
    }

    /// Returns a command of the Cargo that runs this program, in the root folder.
    pub(crate) fn cargo(&self) -> Command {
        let mut command = cargo_command();
        command.current_dir(&self.root);
        command
    }

    /// Returns a subcommand of Cargo for all members and features except the heavy ones.
    pub(crate) fn cargo_light(&self, subcommand: &[&str]) -> Command {
        let mut command = self.cargo();
        command.args(subcommand).args(["--workspace", "--features", &self.features(false)]);
        command.args(HEAVY_CRATES.iter().flat_map(|name| ["--exclude", name]));
        command
    }

    /// Returns a subcommand of Cargo for [`heavy_packages`](Self::heavy_packages), with the heavy features.
    pub(crate) fn cargo_heavy(&self, subcommand: &[&str]) -> Command {
        let mut command = self.cargo();
        command.args(subcommand).args(["--features", &self.features(true)]);
        command.args(self.heavy_packages().flat_map(|name| ["--package", name]));
        command
    }

    /// Returns the heavy members, and those with heavy features.
    pub(crate) fn heavy_packages(&self) -> impl Iterator<Item = &str> {
        let names = self.packages.iter().filter(|package| {
            HEAVY_CRATES.contains(&&*package.name)
                || HEAVY_FEATURES.iter().any(|name| package.features.contains_key(*name))
        });
        names.map(|package| package.name.as_str())
    }

    /// Returns all heavy or all other features, for `--features`.
    fn features(&self, heavy: bool) -> String {
        let all = self.packages.iter().flat_map(|package| package.features.keys().map(move |name| (package, name)));
        let wanted = all.filter(|(_, name)| *name != "default" && HEAVY_FEATURES.contains(&name.as_str()) == heavy);
        wanted.map(|(package, name)| format!("{}/{name}", package.name)).collect::<Vec<_>>().join(",")
    }

    /// Returns the path of a program or example; `folder` is that of the profile.
    pub(crate) fn program(&self, folder: &str, name: &str) -> PathBuf {
        self.target.join(folder).join(format!("{name}{}", std::env::consts::EXE_SUFFIX))
    }

    /// Formats a path relative to the root folder.
    pub(crate) fn shown<'a>(&self, path: &'a Path) -> std::path::Display<'a> {
        path.strip_prefix(&self.root).unwrap_or(path).display()
    }
}

impl Package {
    pub(crate) fn folder(&self) -> &Path {
        self.manifest_path.parent().unwrap_or(&self.manifest_path)
    }

    pub(crate) fn is_published(&self) -> bool {
        self.publish.is_none()
    }

    /// Returns the members that it depends on.
    pub(crate) fn members(&self) -> BTreeSet<&str> {
        self.dependencies.iter().filter(|known| known.path.is_some()).map(|known| known.name.as_str()).collect()
    }
}

fn cargo_command() -> Command {
    Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}
