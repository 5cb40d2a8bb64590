//! Python programs that check or race ours, each in an environment of its own below the target folder.

use std::fs;
use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, Result};

use crate::shell;
use crate::workspace::Workspace;

/// A Python with the packages that were asked for, or why there is none.
pub(crate) enum Python {
    Ready(PathBuf),
    Missing(String),
}

impl Python {
    /// The Python of this machine, for programs that need none but its own library.
    pub(crate) fn system() -> Self {
        let answers = |name: &&str| shell::answers(Command::new(name).arg("--version"));
        match ["python3", "python"].into_iter().find(answers) {
            Some(name) => Self::Ready(name.into()),
            None => Self::Missing("there is no Python on this machine".to_owned()),
        }
    }

    /// Makes the environment `target/python/NAME`, or takes the one from the last time if it holds the same packages.
    ///
    /// `requirements` is the text of a requirements file. An environment that cannot be made is not an error: a
    /// machine with only Rust is welcome.
    pub(crate) fn environment(workspace: &Workspace, name: &str, requirements: &str) -> Result<Self> {
        let folder = workspace.target.join("python").join(name);
        let python = folder.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" });
        let stamp = folder.join("installed.txt");
        if fs::read_to_string(&stamp).is_ok_and(|installed| installed == requirements) && python.exists() {
            return Ok(Self::Ready(python));
        }
        let system = match Self::system() {
            Self::Ready(python) => python,
            missing => return Ok(missing),
        };
        fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
        if let Err(error) = shell::run(Command::new(system).args(["-m", "venv", "--clear"]).arg(&folder)) {
            return Ok(Self::Missing(format!("Python cannot make an environment: {error}")));
        }
        let list = folder.join("requirements.txt");
        fs::write(&list, requirements).with_context(|| format!("cannot write {}", list.display()))?;
        let install =
            ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--only-binary", ":all:", "-r"];
        if let Err(error) = shell::run(Command::new(&python).args(install).arg(&list)) {
            return Ok(Self::Missing(format!("the packages of Python cannot be had: {error}")));
        }
        fs::rename(&list, &stamp).with_context(|| format!("cannot write {}", stamp.display()))?;
        Ok(Self::Ready(python))
    }
}
