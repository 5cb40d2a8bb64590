//! Builds, installs and tests the Python package.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};

use crate::python;
use crate::shell::{self, Skipped, skipped};
use crate::workspace::Workspace;

/// Programs that build wheels and compile for other systems, with zig as compiler and linker of C.
const BUILDERS: &str = "maturin>=1.9,<2\nziglang\ncargo-zigbuild\n";

const TESTERS: &str = "numpy\npillow\npytest\nscipy\nscikit-learn\nipython\n";

const NAPARI: &str = "napari[pyqt6]>=0.6\nmagicgui>=0.9\nnumpy\npytest\n";

/// Debian packages of the libraries that Qt loads.
const QT_LIBRARIES: [&str; 6] = ["libegl1", "libgl1", "libglib2.0-0", "libfontconfig1", "libxkbcommon0", "libdbus-1-3"];

const ENGINES: &str = "numpy\nray\ndask[distributed]\nboto3\nmoto[server]\n";

/// Environments of the training scripts: name, packages, and scripts as PAPSYNTH_TRAINERS. Cellpose 4 cannot start from
/// random weights.
const TRAINERS: [(&str, &str, &str); 2] = [
    (
        "training-torch",
        "torch\ntorchvision\nmonai\ntransformers\naccelerate\ndatasets\ncellpose>=3.1,<4\nnumpy\npytest\n",
        "unet,monai,segformer,mask_rcnn,torchvision,monai_crops,datasets,cellpose",
    ),
    (
        "training-stardist",
        "stardist>=0.9\nnumpy\npytest\n\
        tensorflow-cpu; sys_platform == 'linux' and platform_machine == 'x86_64'\n\
        tensorflow; sys_platform != 'linux' or platform_machine != 'x86_64'\n",
        "stardist",
    ),
];

pub(crate) const PACKAGE: &str = "crates/papsynth-python";

pub(crate) fn run(workspace: &Workspace) -> Result<()> {
    let wheel = wheel(workspace)?;
    test(workspace, &wheel, &program(workspace)?)?;
    napari(workspace, &wheel)
}

/// Runs the tests of the package with an installed wheel and the command line program.
pub(crate) fn test(workspace: &Workspace, wheel: &Path, program: &Path) -> Result<()> {
    let tests = ["test_package.py", "test_display.py", "test_examples.py"];
    let tests = tests.map(|name| workspace.root.join(PACKAGE).join("tests").join(name));
    let mut pytest = Command::new(installed(workspace, "package", TESTERS, wheel)?);
    pytest.args(["-m", "pytest", "--quiet", "-p", "no:cacheprovider"]).args(tests);
    // Outside the source folder, so that the installed package is imported.
    shell::run(pytest.env("PAPSYNTH", program).env("PYTHONDONTWRITEBYTECODE", "1").current_dir(&workspace.target))
}

/// Runs the tests of the napari plugin without a screen.
fn napari(workspace: &Workspace, wheel: &Path) -> Result<()> {
    let python = installed(workspace, "napari", NAPARI, wheel)?;
    let loads = || shell::succeeds(Command::new(&python).args(["-c", "import PyQt6.QtWidgets"])).then_some(());
    shell::find_or_install(loads, &QT_LIBRARIES)
        .ok_or_else(|| skipped("the libraries of Qt are not installed and cannot be installed"))?;
    let test = workspace.root.join(PACKAGE).join("tests/test_napari.py");
    let mut pytest = Command::new(python);
    pytest.args(["-m", "pytest", "--quiet", "-p", "no:cacheprovider", "--disable-warnings"]).arg(test);
    pytest.envs([("QT_QPA_PLATFORM", "offscreen"), ("PYTHONDONTWRITEBYTECODE", "1")]);
    shell::run(pytest.current_dir(&workspace.target))
}

/// Runs every training script for a few steps. Both environments are tried, also if the first cannot be installed.
pub(crate) fn training(workspace: &Workspace) -> Result<()> {
    let wheel = wheel(workspace)?;
    let test = workspace.root.join(PACKAGE).join("tests/test_training.py");
    let mut missing = Ok(());
    for (name, packages, scripts) in TRAINERS {
        let python = match installed(workspace, name, packages, &wheel) {
            Ok(python) => python,
            Err(reason) if reason.is::<Skipped>() => {
                missing = Err(reason);
                continue;
            }
            Err(error) => return Err(error),
        };
        let mut pytest = Command::new(python);
        pytest.args(["-m", "pytest", "--quiet", "-p", "no:cacheprovider"]).arg(&test);
        // With more threads, PyTorch competes with the processes that generate fields.
        pytest.envs([("PAPSYNTH_TRAINERS", scripts), ("OMP_NUM_THREADS", "1"), ("HF_HUB_OFFLINE", "1")]);
        // Data sets of the tests are kept out of the user's cache.
        pytest.env("HF_HOME", workspace.target.join("python/huggingface"));
        shell::run(pytest.env("PYTHONDONTWRITEBYTECODE", "1").current_dir(&workspace.target))?;
    }
    missing
}

pub(crate) fn cluster(workspace: &Workspace) -> Result<()> {
    let wheel = wheel(workspace)?;
    let python = installed(workspace, "cluster", ENGINES, &wheel)?;
    let folder = workspace.target.join("cluster");
    let run = |script: &str, arguments: &[&Path]| {
        let script = workspace.root.join(PACKAGE).join("tests").join(script);
        shell::run(Command::new(&python).arg(script).args(arguments).current_dir(&workspace.target))
    };
    for engine in ["ray", "dask"] {
        run("cluster.py", &[Path::new(engine), &folder.join(engine)])?;
    }
    let program = program(workspace)?;
    run("cluster_store.py", &[&program, &folder.join("store")])?;
    let is_here = || ["slurmctld", "slurmd", "munged"].iter().all(|name| shell::answers(name, "-V")).then_some(());
    if !shell::is_root() || shell::find_or_install(is_here, &["slurm-wlm", "munge"]).is_none() {
        return Err(skipped("Slurm is not installed and cannot be installed"));
    }
    run("cluster_slurm.py", &[&program, &folder.join("slurm"), &folder.join("dask/root.txt")])
}

/// Builds the wheel for this machine in target/wheels.
fn wheel(workspace: &Workspace) -> Result<PathBuf> {
    built(workspace, "wheels", builder(workspace, "maturin")?.args(["build", "--release"]))
}

/// Runs a command that builds a wheel, in a folder below the target folder, which is replaced.
pub(crate) fn built(workspace: &Workspace, folder: &str, maturin: &mut Command) -> Result<PathBuf> {
    let out = workspace.target.join(folder);
    shell::remove(&out)?;
    maturin.arg("--out").arg(&out).env("CARGO_TARGET_DIR", &workspace.target);
    shell::run(maturin.current_dir(workspace.root.join(PACKAGE)))?;
    let mut wheels = fs::read_dir(&out).with_context(|| format!("cannot read {}", out.display()))?;
    Ok(wheels.next().with_context(|| format!("no wheel in {}", workspace.shown(&out)))??.path())
}

/// Returns one of [`BUILDERS`], with zig in its PATH.
pub(crate) fn builder(workspace: &Workspace, name: &str) -> Result<Command> {
    let python = python::environment(workspace, "maturin", BUILDERS)?;
    let folder = python.parent().unwrap_or(&python);
    let path = std::env::var_os("PATH").unwrap_or_default();
    let path = std::env::join_paths(std::iter::once(folder.to_owned()).chain(std::env::split_paths(&path)))?;
    let mut command = Command::new(folder.join(name));
    command.env("PATH", path);
    Ok(command)
}

/// Returns the Python of an environment with these packages and the wheel, which is reinstalled.
pub(crate) fn installed(workspace: &Workspace, name: &str, packages: &str, wheel: &Path) -> Result<PathBuf> {
    let python = python::environment(workspace, name, packages)?;
    shell::run(python::pip(&python, "install").args(["--force-reinstall", "--no-deps"]).arg(wheel))?;
    Ok(python)
}

/// Builds the command line program.
fn program(workspace: &Workspace) -> Result<PathBuf> {
    let words = ["build", "--release", "--package", "papsynth-cli", "--features", "papsynth-cli/cloud"];
    shell::run(workspace.cargo().args(words))?;
    Ok(workspace.program("release", "papsynth"))
}
