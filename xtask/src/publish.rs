//! Whether every crate could be published.

use std::path::{Path, PathBuf};
use std::{env, fs};

use anyhow::{Context, Result};

use crate::arguments::Arguments;
use crate::chore::{Chore, Outcome};
use crate::shell;
use crate::workspace::Workspace;

pub(crate) const CHORE: Chore = Chore {
    name: "publish",
    usage: "",
    about: "packs every crate and builds it from its package, as a publication would; publishes nothing",
    details: "",
    run,
};

fn run(workspace: &Workspace, arguments: Arguments) -> Result<Outcome> {
    arguments.finish()?;
    forget_unpacked(workspace)?;
    forget_built(workspace)?;
    shell::run(workspace.cargo().args(["publish", "--workspace", "--dry-run", "--allow-dirty"]))?;
    Ok(Outcome::Done)
}

/// Removes what an earlier run has unpacked of our own crates. Cargo unpacks each into its home, under the name of the
/// registry that the run makes up (which has no host, so that its name begins with a dash), and takes what is there for the same
/// as long as the version is.
fn forget_unpacked(workspace: &Workspace) -> Result<()> {
    let home = env::var_os("CARGO_HOME").map(PathBuf::from);
    let Some(home) = home.or_else(|| env::home_dir().map(|home| home.join(".cargo"))) else { return Ok(()) };
    let Ok(registries) = fs::read_dir(home.join("registry/src")) else { return Ok(()) };
    for registry in registries {
        let registry = registry?;
        if !registry.file_name().to_string_lossy().starts_with('-') {
            continue;
        }
        for unpacked in fs::read_dir(registry.path())? {
            let unpacked = unpacked?;
            let name = unpacked.file_name().to_string_lossy().into_owned();
            let ours = |package: &str| {
                let version = name.strip_prefix(package).and_then(|rest| rest.strip_prefix('-'));
                version.is_some_and(|version| version.starts_with(|c: char| c.is_ascii_digit()))
            };
            if workspace.packages.iter().any(|package| ours(&package.name)) {
                remove(&unpacked.path())?;
            }
        }
    }
    Ok(())
}

/// Has our own crates built anew: what was built of an earlier package counts as that of this one, as long as the version is.
fn forget_built(workspace: &Workspace) -> Result<()> {
    let Ok(fingerprints) = fs::read_dir(workspace.target.join("debug/.fingerprint")) else { return Ok(()) };
    for fingerprint in fingerprints {
        let fingerprint = fingerprint?;
        let name = fingerprint.file_name().to_string_lossy().into_owned();
        // A name, a dash, a hash.
        let package = name.rsplit_once('-').map_or(name.as_str(), |(package, _)| package);
        if workspace.packages.iter().any(|own| own.name == package) {
            remove(&fingerprint.path())?;
        }
    }
    Ok(())
}

fn remove(folder: &Path) -> Result<()> {
    fs::remove_dir_all(folder).with_context(|| format!("cannot remove {}", folder.display()))
}
