//! The Python package: built, installed where nothing else is, and tried.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};

use crate::arguments::Arguments;
use crate::chore::{Chore, Outcome};
use crate::python::Python;
use crate::workspace::Workspace;
use crate::{shell, system};

pub(crate) const CHORE: Chore = Chore {
    name: "python",
    usage: "",
    about: "builds the Python package, installs it where nothing else is, and runs its tests",
    details: "The wheel goes to target/wheels. The tests hold what it gives against what the command line writes. Left out, with a sentence, where there is no \
              Python or its packages cannot be had; a failure where CI is set.",
    run,
};

pub(crate) const CLUSTER: Chore = Chore {
    name: "cluster",
    usage: "",
    about: "makes one data set with Ray, Dask, Slurm and in an object store, whose workers, drivers and daemons are killed",
    details: "The root hash must be that of one process. The object store is one on this machine that refuses requests and loses answers. Slurm is installed by root on Debian, started by the test itself below /tmp, and ended; elsewhere it is left \
              out, with a sentence, as is everything where Python's packages cannot be had; a failure where CI is set.",
    run: cluster,
};

pub(crate) const RELEASES: Chore = Chore {
    name: "releases",
    usage: "",
    about: "builds what is given away: a wheel for glibc 2.28 and a static program, and tries both",
    details: "The wheel goes to target/releases, and so does the program, which depends on no library of the system (x86_64-unknown-linux-musl). The package's tests run with both: \
              what the program writes must be what the wheel makes. By hand, before a release: both are built from nothing. Linux on x86-64 alone; left out, with a sentence, elsewhere.",
    run: releases,
};

const BUILDER: &str = "maturin>=1.9,<2\nziglang\n";

const TESTERS: &str = "numpy\npillow\npytest\nscipy\nscikit-learn\n";

const ENGINES: &str = "numpy\nray\ndask[distributed]\nboto3\nmoto[server]\n";

/// Where a program finds all it needs in itself.
const STATIC: &str = "x86_64-unknown-linux-musl";

/// Linux since 2019: Debian 10, Ubuntu 20.04, RHEL 8 and what is newer.
const OLD: [&str; 5] = ["--zig", "--compatibility", "manylinux_2_28", "--target", "x86_64-unknown-linux-gnu"];

const PACKAGE: &str = "crates/papsynth-python";

fn run(workspace: &Workspace, arguments: Arguments) -> Result<Outcome> {
    arguments.finish()?;
    let wheel = match wheel(workspace, "wheels", &[])? {
        Ok(wheel) => wheel,
        Err(reason) => return Outcome::skipped_unless_ci(reason),
    };
    tried(workspace, &wheel, &program(workspace)?)
}

fn releases(workspace: &Workspace, arguments: Arguments) -> Result<Outcome> {
    arguments.finish()?;
    if !cfg!(all(target_os = "linux", target_arch = "x86_64")) {
        return Outcome::skipped_unless_ci("these are built on Linux for x86-64".to_owned());
    }
    if !shell::answers(Command::new("rustup").args(["target", "add", STATIC])) {
        return Outcome::skipped_unless_ci(format!("rustup cannot add {STATIC}"));
    }
    let wheel = match wheel(workspace, "releases", &OLD)? {
        Ok(wheel) => wheel,
        Err(reason) => return Outcome::skipped_unless_ci(reason),
    };
    shell::run(workspace.cargo().args(["build", "--release", "--package", "papsynth-cli", "--target", STATIC]))?;
    let built = workspace.target.join(STATIC).join("release/papsynth");
    let program = workspace.target.join("releases/papsynth");
    fs::copy(&built, &program).with_context(|| format!("cannot copy {}", workspace.shown(&built)))?;
    // A program that wants a loader names it; one that is static has no such name.
    let bytes = fs::read(&program)?;
    ensure!(!bytes.windows(9).any(|word| word == b"/ld-linux" || word == b"/ld-musl-"), "papsynth is not static");
    println!("{} ({:.1} MB)", workspace.shown(&wheel), fs::metadata(&wheel)?.len() as f64 / 1e6);
    println!("{} ({:.1} MB)", workspace.shown(&program), bytes.len() as f64 / 1e6);
    tried(workspace, &wheel, &program)
}

/// Runs the package's tests with an installed wheel, against a program.
fn tried(workspace: &Workspace, wheel: &Path, program: &Path) -> Result<Outcome> {
    let python = match installed(workspace, "package", TESTERS, wheel)? {
        Python::Ready(python) => python,
        Python::Missing(reason) => return Outcome::skipped_unless_ci(reason),
    };
    let tests =
        ["test_package.py", "test_examples.py"].map(|name| workspace.root.join(PACKAGE).join("tests").join(name));
    let mut pytest = Command::new(python);
    pytest.args(["-m", "pytest", "--quiet", "-p", "no:cacheprovider"]).args(tests);
    // Out of the repository, so that the package is the installed one.
    shell::run(pytest.env("PAPSYNTH", program).env("PYTHONDONTWRITEBYTECODE", "1").current_dir(&workspace.target))?;
    Ok(Outcome::Done)
}

fn cluster(workspace: &Workspace, arguments: Arguments) -> Result<Outcome> {
    arguments.finish()?;
    let wheel = match wheel(workspace, "wheels", &[])? {
        Ok(wheel) => wheel,
        Err(reason) => return Outcome::skipped_unless_ci(reason),
    };
    let python = match installed(workspace, "cluster", ENGINES, &wheel)? {
        Python::Ready(python) => python,
        Python::Missing(reason) => return Outcome::skipped_unless_ci(reason),
    };
    let tests = workspace.root.join(PACKAGE).join("tests");
    let folder = workspace.target.join("cluster");
    for engine in ["ray", "dask"] {
        let mut command = Command::new(&python);
        command.arg(tests.join("cluster.py")).arg(engine).arg(folder.join(engine));
        shell::run(command.current_dir(&workspace.target))?;
    }
    let program = program(workspace)?;
    let mut command = Command::new(&python);
    shell::run(command.arg(tests.join("cluster_store.py")).arg(&program).arg(folder.join("store")))?;
    if !slurm() {
        let reason = "there is no Slurm on this machine, nor a way to install it".to_owned();
        return Outcome::skipped_unless_ci(reason);
    }
    let mut command = Command::new(&python);
    command.arg(tests.join("cluster_slurm.py")).args([&program, &folder.join("slurm"), &folder.join("dask/root.txt")]);
    shell::run(&mut command)?;
    Ok(Outcome::Done)
}

/// Builds the wheel into a folder below the target's, which is emptied, or says why it cannot be built.
fn wheel(workspace: &Workspace, folder: &str, more: &[&str]) -> Result<Result<PathBuf, String>> {
    let python = match Python::environment(workspace, "maturin", BUILDER)? {
        Python::Ready(python) => python,
        Python::Missing(reason) => return Ok(Err(reason)),
    };
    let out = workspace.target.join(folder);
    if out.exists() {
        fs::remove_dir_all(&out).with_context(|| format!("cannot empty {}", out.display()))?;
    }
    let mut command = Command::new(&python);
    // It looks for zig where programs are looked for.
    let own = python.parent().map(Path::to_owned).into_iter();
    let others = std::env::var_os("PATH").unwrap_or_default();
    let path = std::env::join_paths(own.chain(std::env::split_paths(&others)))?;
    command.env("PATH", path);
    command.args(["-m", "maturin", "build", "--release"]).args(more).arg("--out").arg(&out);
    shell::run(command.env("CARGO_TARGET_DIR", &workspace.target).current_dir(workspace.root.join(PACKAGE)))?;
    let mut wheels = fs::read_dir(&out).with_context(|| format!("cannot read {}", out.display()))?;
    let Some(wheel) = wheels.next() else { bail!("no wheel in {}", workspace.shown(&out)) };
    Ok(Ok(wheel?.path()))
}

/// An environment with these packages and the wheel, which is installed anew.
fn installed(workspace: &Workspace, name: &str, packages: &str, wheel: &Path) -> Result<Python> {
    let python = match Python::environment(workspace, name, packages)? {
        Python::Ready(python) => python,
        missing => return Ok(missing),
    };
    let pip = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--force-reinstall", "--no-deps"];
    shell::run(Command::new(&python).args(pip).arg(wheel))?;
    Ok(Python::Ready(python))
}

/// The command line, to compare with.
fn program(workspace: &Workspace) -> Result<PathBuf> {
    let words = ["build", "--release", "--package", "papsynth-cli", "--features", "papsynth-cli/cloud"];
    shell::run(workspace.cargo().args(words))?;
    let program = workspace.target.join("release").join(format!("papsynth{}", std::env::consts::EXE_SUFFIX));
    ensure!(program.exists(), "{} was not built", workspace.shown(&program));
    Ok(program)
}

/// Whether there is a Slurm, installed if need be and possible.
fn slurm() -> bool {
    let is_here = || ["slurmctld", "slurmd", "munged"].iter().all(|name| shell::answers(Command::new(name).arg("-V")));
    if !system::is_root() || is_here() {
        return system::is_root() && is_here();
    }
    system::install(&["slurm-wlm", "munge"]) && is_here()
}
