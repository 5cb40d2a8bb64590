//! Wheels and the source distribution of the Python package.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};

use super::{licences, programs};
use crate::shell::{self, need_target};
use crate::workspace::Workspace;
use crate::{package, python};

/// Processors of the wheels, as in their names: this machine, and aarch64.
pub(super) const PROCESSORS: [&str; 2] = ["x86_64", "aarch64"];

/// Linux with glibc 2.28 or newer: Debian 10, Ubuntu 20.04, RHEL 8.
const PLATFORM: &str = "manylinux_2_28";

/// Programs that check wheels.
pub(super) const CHECKERS: &str = "auditwheel\nabi3audit\ntwine\n";

/// A local object store.
const STORES: &str = "numpy\nboto3\nmoto[server]\n";

/// Builds a wheel for each processor and a source distribution, with the licences of all dependencies.
pub(super) fn build(workspace: &Workspace) -> Result<()> {
    let folder = workspace.root.join(package::PACKAGE);
    let texts = folder.join(licences::NAME);
    shell::copy(&licences::found(workspace, package::PACKAGE)?, &texts)?;
    shell::remove(&files(workspace))?;
    shell::make(&files(workspace))?;
    let built = PROCESSORS.into_iter().try_for_each(|processor| build_wheel(workspace, processor));
    let built = built.and_then(|()| build_source(workspace));
    fs::remove_file(&texts).with_context(|| format!("cannot remove {}", texts.display()))?;
    built?;
    audit(workspace)
}

fn build_wheel(workspace: &Workspace, processor: &str) -> Result<()> {
    let target = format!("{processor}-unknown-linux-gnu");
    need_target(&target)?;
    let mut maturin = package::builder(workspace, "maturin")?;
    maturin.args(["build", "--release", "--locked", "--zig", "--compatibility", PLATFORM, "--target", &target]);
    maturin.env("RUSTFLAGS", programs::without_paths());
    let wheel = package::built(workspace, "release-work/wheel", &mut maturin)?;
    let name = wheel.file_name().unwrap_or_default();
    shell::copy(&wheel, &files(workspace).join(name))
}

/// Builds the source distribution, and checks that its sources are complete.
fn build_source(workspace: &Workspace) -> Result<()> {
    let mut maturin = package::builder(workspace, "maturin")?;
    maturin.args(["sdist", "--out"]).arg(files(workspace));
    shell::run(maturin.current_dir(workspace.root.join(package::PACKAGE)))?;
    let unpacked = super::work(workspace, "sdist");
    shell::remove(&unpacked)?;
    shell::make(&unpacked)?;
    let source = file(workspace, ".tar.gz")?;
    shell::run(Command::new("tar").arg("-xzf").arg(source).arg("--strip-components=1").arg("-C").arg(&unpacked))?;
    let mut cargo = workspace.cargo();
    cargo
        .args(["check", "--offline", "--locked", "--features", "cloud", "--manifest-path"])
        .arg(unpacked.join(package::PACKAGE).join("Cargo.toml"));
    shell::run(cargo.env("CARGO_TARGET_DIR", &workspace.target))
}

/// Checks metadata, system libraries and the interface to Python of the files.
fn audit(workspace: &Workspace) -> Result<()> {
    let python = python::environment(workspace, "wheels", CHECKERS)?;
    let module = |name: &str| {
        let mut command = Command::new(&python);
        command.args(["-m", name]);
        command
    };
    shell::run(module("twine").args(["check", "--strict"]).args(entries(&files(workspace))?))?;
    for processor in PROCESSORS {
        let wheel = wheel(workspace, processor)?;
        shell::run(module("abi3audit").args(["--strict", "--summary"]).arg(&wheel))?;
        let report = shell::output(module("auditwheel").arg("show").arg(&wheel))?;
        println!("{report}");
        ensure!(report.contains(PLATFORM), "auditwheel: expected {PLATFORM} for {}", wheel.display());
        let files = shell::output(module("zipfile").arg("-l").arg(&wheel))?;
        for name in ["LICENSE-APACHE", "LICENSE-MIT", licences::NAME] {
            ensure!(files.contains(&format!("licenses/{name}")), "{}: {name} is missing", wheel.display());
        }
    }
    Ok(())
}

/// Runs the tests of the package and of object stores with the released wheel and program.
pub(super) fn test(workspace: &Workspace) -> Result<()> {
    let wheel = wheel(workspace, PROCESSORS[0])?;
    let program = programs::program(workspace, programs::TARGETS[0]);
    package::test(workspace, &wheel, &program)?;
    let python = package::installed(workspace, "stores", STORES, &wheel)?;
    let script = workspace.root.join(package::PACKAGE).join("tests/cluster_store.py");
    shell::run(Command::new(python).arg(script).arg(&program).arg(super::work(workspace, "store")))
}

/// Returns the folder of wheels and source distribution.
fn files(workspace: &Workspace) -> PathBuf {
    super::files(workspace).join("python")
}

/// Returns the released wheel for a processor.
pub(super) fn wheel(workspace: &Workspace, processor: &str) -> Result<PathBuf> {
    file(workspace, &format!("_{processor}.whl"))
}

/// Returns the file whose name ends so.
fn file(workspace: &Workspace, ending: &str) -> Result<PathBuf> {
    let folder = files(workspace);
    let found = entries(&folder)?.into_iter().find(|path| path.to_string_lossy().ends_with(ending));
    found.with_context(|| format!("{}: no file *{ending}; run the step `wheels`", workspace.shown(&folder)))
}

fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    let read = || fs::read_dir(folder)?.map(|entry| Ok(entry?.path())).collect::<std::io::Result<_>>();
    read().with_context(|| format!("cannot read {}", folder.display()))
}
