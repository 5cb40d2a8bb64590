//! Makes and checks the files of a release.

mod compatibility;
mod licences;
mod machines;
mod programs;
mod source;
mod wheels;

use std::path::PathBuf;
use std::process::Command;

use anyhow::Result;
use clap::builder::PossibleValuesParser;

use crate::shell::{self, skipped};
use crate::steps::{self, Step};
use crate::supply;
use crate::workspace::Workspace;

const STEPS: [Step; 11] = [
    ("licences", licences::write),
    ("bill", bill),
    ("interfaces", compatibility::interfaces),
    ("oldest-rust", compatibility::oldest_rust),
    ("crates", crates),
    ("programs", programs::build),
    ("wheels", wheels::build),
    ("tests", wheels::test),
    ("x86-64", machines::x86_64),
    ("aarch64", machines::aarch64),
    ("image", machines::image),
];

/// Makes the files of a release in target/release-files, and checks them
///
/// Static programs and wheels for Linux on x86-64 and aarch64, a source distribution for Python, all crates, licences
/// of the dependencies, the bill of materials, release notes and checksums. The programs run in a Debian without Rust
/// and in an empty folder, the wheels in a Debian without Rust; files for aarch64 run in an emulator. All must give
/// the same data set. docs/RELEASING.md describes the files and the steps. Only for Linux on x86-64, as root.
#[derive(clap::Args)]
pub(crate) struct Release {
    /// Accepts uncommitted changes, and takes the notes of a version without a date from Unreleased in CHANGELOG.md
    #[arg(long)]
    trial: bool,
    /// Steps to run, instead of all; files of other steps are kept
    #[arg(value_name = "STEP", value_parser = PossibleValuesParser::new(STEPS.map(|(name, _)| name)))]
    steps: Vec<String>,
}

pub(crate) fn run(workspace: &Workspace, options: &Release) -> Result<()> {
    if !cfg!(all(target_os = "linux", target_arch = "x86_64")) {
        return Err(skipped("a release can only be made on Linux for x86-64"));
    }
    let notes = source::check(workspace, options.trial)?;
    let files = files(workspace);
    if options.steps.is_empty() {
        shell::remove(&files)?;
    }
    shell::make(&files)?;
    shell::write(&files.join("RELEASE-NOTES.md"), &notes)?;
    let wanted = |name: &str| options.steps.is_empty() || options.steps.iter().any(|step| step == name);
    let result = steps::run(workspace, STEPS.iter().filter(|(name, _)| wanted(name)));
    write_checksums(workspace)?;
    result
}

/// Returns the folder of the files to publish.
fn files(workspace: &Workspace) -> PathBuf {
    workspace.target.join("release-files")
}

/// Returns a folder for files that are not published.
fn work(workspace: &Workspace, name: &str) -> PathBuf {
    workspace.target.join("release-work").join(name)
}

/// Writes the bill of materials.
fn bill(workspace: &Workspace) -> Result<()> {
    let name = format!("papsynth-{}.cdx.json", workspace.released()?.version);
    shell::copy(&supply::bill(workspace)?, &files(workspace).join(name))
}

/// Packages every crate, builds it from its package, and copies the packages.
fn crates(workspace: &Workspace) -> Result<()> {
    supply::publish(workspace)?;
    let folder = files(workspace).join("crates");
    shell::remove(&folder)?;
    shell::make(&folder)?;
    for package in workspace.packages.iter().filter(|package| package.is_published()) {
        let name = format!("{}-{}.crate", package.name, package.version);
        shell::copy(&workspace.target.join("package").join(&name), &folder.join(&name))?;
    }
    Ok(())
}

/// Writes SHA256SUMS for all files, and prints them with sizes.
fn write_checksums(workspace: &Workspace) -> Result<()> {
    const LIST: &str = "find . -type f ! -name SHA256SUMS -printf '%P\\0' | LC_ALL=C sort -z";
    let folder = files(workspace);
    let shell = |script: String| shell::output(Command::new("sh").args(["-c", &script]).current_dir(&folder));
    shell::write(&folder.join("SHA256SUMS"), &shell(format!("{LIST} | xargs -0 sha256sum"))?)?;
    println!("\n{}:\n{}", workspace.shown(&folder), shell(format!("{LIST} | xargs -0 du -h --apparent-size"))?);
    Ok(())
}
