//! The Python package: built, installed where nothing else is, and tried.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};

use crate::arguments::Arguments;
use crate::outcome::Outcome;
use crate::python::Python;
use crate::workspace::Workspace;
use crate::{Chore, shell};

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
    about: "makes one data set with Ray, Dask and Slurm, whose workers, drivers and daemons are killed",
    details: "The root hash must be that of one process. Slurm is installed by root on Debian, started by the test itself below /tmp, and ended; elsewhere it is left \
              out, with a sentence, as is everything where Python's packages cannot be had; a failure where CI is set.",
    run: cluster,
};

const BUILDER: &str = "maturin>=1.9,<2\n";

const TESTERS: &str = "numpy\npillow\npytest\nscipy\nscikit-learn\n";

const ENGINES: &str = "numpy\nray\ndask[distributed]\n";

const PACKAGE: &str = "crates/papsynth-python";

fn run(workspace: &Workspace, arguments: Arguments) -> Result<Outcome> {
    arguments.finish()?;
    let wheel = match wheel(workspace)? {
        Ok(wheel) => wheel,
        Err(reason) => return Outcome::skipped_unless_ci(reason),
    };
    let python = match installed(workspace, "package", TESTERS, &wheel)? {
        Python::Ready(python) => python,
        Python::Missing(reason) => return Outcome::skipped_unless_ci(reason),
    };
    let program = program(workspace)?;
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
    let wheel = match wheel(workspace)? {
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
    if !slurm() {
        let reason = "there is no Slurm on this machine, nor a way to install it".to_owned();
        return Outcome::skipped_unless_ci(reason);
    }
    let program = program(workspace)?;
    let mut command = Command::new(&python);
    command.arg(tests.join("cluster_slurm.py")).args([&program, &folder.join("slurm"), &folder.join("dask/root.txt")]);
    shell::run(&mut command)?;
    Ok(Outcome::Done)
}

/// Builds the wheel, or says why it cannot be built.
fn wheel(workspace: &Workspace) -> Result<Result<PathBuf, String>> {
    let python = match Python::environment(workspace, "maturin", BUILDER)? {
        Python::Ready(python) => python,
        Python::Missing(reason) => return Ok(Err(reason)),
    };
    let out = workspace.target.join("wheels");
    if out.exists() {
        fs::remove_dir_all(&out).with_context(|| format!("cannot empty {}", out.display()))?;
    }
    let mut command = Command::new(python);
    command.args(["-m", "maturin", "build", "--release", "--quiet", "--out"]).arg(&out);
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
    shell::run(workspace.cargo().args(["build", "--quiet", "--release", "--package", "papsynth-cli"]))?;
    let program = workspace.target.join("release").join(format!("papsynth{}", std::env::consts::EXE_SUFFIX));
    ensure!(program.exists(), "{} was not built", workspace.shown(&program));
    Ok(program)
}

/// Whether there is a Slurm, installed if need be and possible.
fn slurm() -> bool {
    let is_here = || ["slurmctld", "slurmd", "munged"].iter().all(|name| shell::answers(Command::new(name).arg("-V")));
    let is_root = shell::output(Command::new("id").arg("-u")).is_ok_and(|id| id.trim() == "0");
    if !is_root || is_here() {
        return is_root && is_here();
    }
    let apt = |words: &[&str]| {
        shell::run(Command::new("apt-get").args(words).env("DEBIAN_FRONTEND", "noninteractive")).is_ok()
    };
    shell::answers(Command::new("apt-get").arg("--version"))
        && apt(&["update", "--quiet"])
        && apt(&["install", "--quiet", "--yes", "--no-install-recommends", "slurm-wlm", "munge"])
        && is_here()
}
