//! Python environments below the target folder, and checks of Python files.

use std::fs;
use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, Result};

use crate::shell::{self, skipped};
use crate::workspace::Workspace;

/// One version, because others may format differently.
const RUFF: &str = "ruff==0.17.6\n";

/// Returns the Python of this machine, for programs that only need its standard library.
pub(crate) fn system() -> Result<PathBuf> {
    let found = ["python3", "python"].into_iter().find(|name| shell::answers(name, "--version"));
    found.map(PathBuf::from).ok_or_else(|| skipped("Python is not installed"))
}

/// Creates the environment `target/python/NAME`, or reuses it if it has the same packages, and returns its Python.
///
/// `requirements` is the text of a requirements file. The step is skipped if the environment cannot be created.
pub(crate) fn environment(workspace: &Workspace, name: &str, requirements: &str) -> Result<PathBuf> {
    let folder = workspace.target.join("python").join(name);
    let python = folder.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" });
    let stamp = folder.join("installed.txt");
    if fs::read_to_string(&stamp).is_ok_and(|installed| installed == requirements) && python.exists() {
        return Ok(python);
    }
    shell::make(&folder)?;
    shell::run(Command::new(system()?).args(["-m", "venv", "--clear"]).arg(&folder))
        .map_err(|error| skipped(format!("Python cannot create an environment: {error}")))?;
    let list = folder.join("requirements.txt");
    shell::write(&list, requirements)?;
    shell::run(pip(&python, "install").args(["--only-binary", ":all:", "-r"]).arg(&list))
        .map_err(|error| skipped(format!("Python packages cannot be installed: {error}")))?;
    fs::rename(&list, &stamp).with_context(|| format!("cannot write {}", stamp.display()))?;
    Ok(python)
}

/// Checks format and lints of all Python files with ruff, or formats and fixes the files. ruff.toml has the rules.
pub(crate) fn lint(workspace: &Workspace, fix: bool) -> Result<()> {
    let python = environment(workspace, "ruff", RUFF)?;
    let ruff = |words: &[&str]| {
        shell::run(Command::new(&python).args(["-m", "ruff"]).args(words).current_dir(&workspace.root))
    };
    if fix {
        // Fixes may need another format.
        let lints = ruff(&["check", "--fix"]);
        return ruff(&["format"]).and(lints);
    }
    let format = ruff(&["format", "--check"]);
    ruff(&["check", "--output-format", "concise"])
        .and(format)
        .context("`cargo xtask lint-python --fix` formats and fixes Python files")
}

/// Returns a subcommand of pip, which prints errors only.
pub(crate) fn pip(python: &PathBuf, subcommand: &str) -> Command {
    let mut command = Command::new(python);
    command.args(["-m", "pip", subcommand, "--quiet", "--disable-pip-version-check"]);
    command
}
