//! Runs other programs, and accesses files with errors that contain their names.

use std::fs;
use std::io::ErrorKind;
use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Error, Result, anyhow, ensure};

/// The reason why a step is skipped on this machine.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct Skipped(String);

/// Returns [`Skipped`], or a failure if `CI` is set, where a message would be overlooked.
pub(crate) fn skipped(reason: impl Into<String>) -> Error {
    let reason = reason.into();
    let in_ci = std::env::var("CI").is_ok_and(|value| !matches!(value.as_str(), "" | "0" | "false"));
    if in_ci { anyhow!("{reason}, and CI is set") } else { Skipped(reason).into() }
}

/// Runs a program, with our standard output and error.
pub(crate) fn run(command: &mut Command) -> Result<()> {
    eprintln!("$ {command:?}");
    let status = command.status().with_context(|| format!("cannot start {command:?}"))?;
    ensure!(status.success(), "{command:?} failed ({status})");
    Ok(())
}

/// Runs a program and returns its standard output.
pub(crate) fn output(command: &mut Command) -> Result<String> {
    let output = command.stderr(Stdio::inherit()).output().with_context(|| format!("cannot start {command:?}"))?;
    ensure!(output.status.success(), "{command:?} failed ({})", output.status);
    String::from_utf8(output.stdout).with_context(|| format!("the output of {command:?} is not valid UTF-8"))
}

/// Returns whether a program is installed and accepts this argument.
pub(crate) fn answers(program: &str, word: &str) -> bool {
    succeeds(Command::new(program).arg(word))
}

/// Runs a program without output, and returns whether it succeeds.
pub(crate) fn succeeds(command: &mut Command) -> bool {
    let command = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command.status().is_ok_and(|status| status.success())
}

/// Returns the result of `find`, if necessary after installing Debian packages as root.
pub(crate) fn find_or_install<T>(find: impl Fn() -> Option<T>, packages: &[&str]) -> Option<T> {
    let apt =
        |words: &[&str]| run(Command::new("apt-get").args(words).env("DEBIAN_FRONTEND", "noninteractive")).is_ok();
    let install = || {
        is_root()
            && answers("apt-get", "--version")
            && apt(&["update", "--quiet"])
            && apt(&[&["install", "--quiet", "--yes", "--no-install-recommends"], packages].concat())
    };
    find().or_else(|| install().then(find).flatten())
}

pub(crate) fn is_root() -> bool {
    output(Command::new("id").arg("-u")).is_ok_and(|id| id.trim() == "0")
}

/// Adds a target with rustup if it is missing; skips the step if that fails.
pub(crate) fn need_target(target: &str) -> Result<()> {
    let is_installed = || -> Result<bool> {
        let libraries = output(rustc().args(["--print", "target-libdir", "--target", target]))?;
        Ok(Path::new(libraries.trim()).is_dir())
    };
    if is_installed()? || succeeds(Command::new("rustup").args(["target", "add", target])) && is_installed()? {
        return Ok(());
    }
    Err(skipped(format!("the target {target} is not installed, and rustup cannot add it")))
}

pub(crate) fn rustc() -> Command {
    Command::new(std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into()))
}

/// Parses the last line of a text as JSON.
pub(crate) fn last_json(text: &str) -> Result<serde_json::Value> {
    let line = text.trim_end().lines().last().unwrap_or_default();
    serde_json::from_str(line).with_context(|| format!("expected a line of JSON, found `{line}`"))
}

pub(crate) fn read(file: &Path) -> Result<String> {
    fs::read_to_string(file).with_context(|| format!("cannot read {}", file.display()))
}

pub(crate) fn write(file: &Path, text: &str) -> Result<()> {
    fs::write(file, text).with_context(|| format!("cannot write {}", file.display()))
}

pub(crate) fn copy(from: &Path, to: &Path) -> Result<()> {
    fs::copy(from, to).with_context(|| format!("cannot copy {} to {}", from.display(), to.display()))?;
    Ok(())
}

/// Creates a folder and its parents if they are missing.
pub(crate) fn make(folder: &Path) -> Result<()> {
    fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))
}

/// Removes a folder and its contents, if it exists.
pub(crate) fn remove(folder: &Path) -> Result<()> {
    match fs::remove_dir_all(folder) {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            Err(error).with_context(|| format!("cannot remove {}", folder.display()))
        }
        _ => Ok(()),
    }
}
