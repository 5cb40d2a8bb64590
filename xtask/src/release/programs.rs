//! Static programs, and archives with what belongs to them.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Result, ensure};

use super::licences;
use crate::shell;
use crate::workspace::{PROGRAM, Workspace};
use crate::{package, supply};

/// Targets without system libraries: this machine, and aarch64.
pub(super) const TARGETS: [&str; 2] = ["x86_64-unknown-linux-musl", "aarch64-unknown-linux-musl"];

/// Files of the root folder in every archive.
const OWN: [&str; 4] = ["CHANGELOG.md", "LICENSE-APACHE", "LICENSE-MIT", "README.md"];

/// Scripts for completion, with the names that the shells expect.
const COMPLETIONS: [(&str, &str); 3] = [("bash", "papsynth.bash"), ("fish", "papsynth.fish"), ("zsh", "_papsynth")];

/// Builds the programs with all formats and stores, and an archive for each.
pub(super) fn build(workspace: &Workspace) -> Result<()> {
    let texts = licences::found(workspace, &format!("crates/{PROGRAM}"))?;
    for target in TARGETS {
        shell::need_target(target)?;
        let mut cargo = package::builder(workspace, "cargo-zigbuild")?;
        cargo.args(["zigbuild", "--locked", "--release", "--package", PROGRAM, "--all-features", "--target", target]);
        shell::run(cargo.env("RUSTFLAGS", without_paths()).current_dir(&workspace.root))?;
        ensure_static(&program(workspace, target))?;
        archive(workspace, target, &texts)?;
    }
    Ok(())
}

/// Returns the path of the program that [`build`] compiles.
pub(super) fn program(workspace: &Workspace, target: &str) -> PathBuf {
    workspace.target.join(target).join("release/papsynth")
}

/// Returns the path of the archive for a target.
pub(super) fn archived(workspace: &Workspace, target: &str) -> Result<PathBuf> {
    Ok(super::files(workspace).join(format!("{}.tar.gz", archive_name(&workspace.released()?.version, target))))
}

/// Returns the name of an archive and of the folder in it. Cargo.toml of papsynth-cli tells it to cargo-binstall.
fn archive_name(version: &str, target: &str) -> String {
    format!("papsynth-{version}-{target}")
}

/// Returns options of rustc that remove the folders of this machine from messages of panics.
pub(super) fn without_paths() -> String {
    format!("--remap-path-prefix={}=registry", supply::sources().display())
}

fn ensure_static(program: &Path) -> Result<()> {
    let bytes = fs::read(program)?;
    // A dynamically linked program contains the name of its loader.
    let is_static = !bytes.windows(9).any(|word| word == b"/ld-linux" || word == b"/ld-musl-");
    ensure!(is_static, "{}: not a static program", program.display());
    Ok(())
}

/// Packs a program with `texts` of licences, manual pages and completions. The same commit gives the same bytes.
fn archive(workspace: &Workspace, target: &str, texts: &Path) -> Result<()> {
    let name = archive_name(&workspace.released()?.version, target);
    let folder = super::work(workspace, &name);
    shell::remove(&folder)?;
    shell::make(&folder.join("completions"))?;
    shell::copy(&program(workspace, target), &folder.join("papsynth"))?;
    for file in OWN {
        shell::copy(&workspace.root.join(file), &folder.join(file))?;
    }
    shell::copy(texts, &folder.join(licences::NAME))?;
    // All programs have the same command line; this machine runs the first.
    let papsynth = || Command::new(program(workspace, TARGETS[0]));
    for (language, file) in COMPLETIONS {
        let script = shell::output(papsynth().args(["completions", language]))?;
        shell::write(&folder.join("completions").join(file), &script)?;
    }
    shell::run(papsynth().args(["man", "--out"]).arg(folder.join("man")))?;
    let mut git = Command::new("git");
    let time = shell::output(git.args(["log", "-1", "--format=%ct"]).current_dir(&workspace.root))?;
    let mut tar = Command::new("tar");
    tar.args(["--sort=name", "--owner=0", "--group=0", "--numeric-owner", "--mode=u=rwX,go=rX"]);
    tar.arg(format!("--mtime=@{}", time.trim())).arg("-czf").arg(archived(workspace, target)?);
    shell::run(tar.arg("-C").arg(super::work(workspace, "")).arg(name))
}
