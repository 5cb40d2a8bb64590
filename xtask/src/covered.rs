//! What the longer tier of checks covers, and the state of it that last passed.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use sha2::{Digest, Sha256};

use crate::workspace::Workspace;

/// Files and folders on which its outcome depends more than that of the shorter tier.
const COVERED: [&str; 16] = [
    "Cargo.lock",
    "crates/papsynth-cli/tests",
    "crates/papsynth-dataset",
    "crates/papsynth-python",
    "crates/papsynth-view",
    "crates/papsynth-zarr",
    "docs/SLIDES.md",
    "docs/formats",
    "fixtures/hashes.txt",
    "hashes",
    "xtask/src/external.rs",
    "xtask/src/hashes.rs",
    "xtask/src/package.rs",
    "xtask/src/system.rs",
];

/// Where the state that last passed is recorded.
const RECORD: &str = ".ci/full";

/// Whether something of it differs from what last passed.
pub(crate) fn has_changed(workspace: &Workspace) -> Result<bool> {
    let recorded = fs::read_to_string(workspace.root.join(RECORD)).unwrap_or_default();
    Ok(recorded.trim() != state(&workspace.root)?)
}

/// Records what has just passed.
pub(crate) fn record(workspace: &Workspace) -> Result<()> {
    let path = workspace.root.join(RECORD);
    fs::write(&path, state(&workspace.root)? + "\n").with_context(|| format!("cannot write {}", path.display()))
}

/// SHA-256 of every path and its content.
fn state(root: &Path) -> Result<String> {
    let mut hash = Sha256::new();
    for covered in COVERED {
        let mut files = Vec::new();
        collect(&root.join(covered), &mut files)?;
        files.sort();
        for file in files {
            let bytes = fs::read(&file).with_context(|| format!("cannot read {}", file.display()))?;
            let name = file.strip_prefix(root).unwrap_or(&file).to_string_lossy().into_owned();
            hash.update(format!("{name}\0{}\0", bytes.len()));
            hash.update(bytes);
        }
    }
    Ok(hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
}

fn collect(path: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    if !path.is_dir() {
        files.push(path.to_owned());
        return Ok(());
    }
    for entry in fs::read_dir(path).with_context(|| format!("cannot read {}", path.display()))? {
        let entry = entry?.path();
        // What Python leaves beside its scripts.
        if entry.file_name().is_some_and(|name| name != "__pycache__") {
            collect(&entry, files)?;
        }
    }
    Ok(())
}
