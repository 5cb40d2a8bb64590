//! Other programs, files whose names stand in errors, and what cannot be done on this machine.

use std::fs;
use std::io::ErrorKind;
use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Error, Result, anyhow, ensure};

/// Why something cannot be done here, which is nobody's fault.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct Skipped(String);

/// [`Skipped`] on a person's machine; a failure where `CI` is set, since nobody would read the sentence there.
pub(crate) fn skipped(reason: impl Into<String>) -> Error {
    let reason = reason.into();
    let in_ci = std::env::var("CI").is_ok_and(|value| !matches!(value.as_str(), "" | "0" | "false"));
    if in_ci { anyhow!("{reason}, and CI is set") } else { Skipped(reason).into() }
}

/// Runs a program to its end, its output going where ours goes.
pub(crate) fn run(command: &mut Command) -> Result<()> {
    eprintln!("$ {command:?}");
    let status = command.status().with_context(|| format!("cannot start {command:?}"))?;
    ensure!(status.success(), "{command:?} failed ({status})");
    Ok(())
}

/// Runs a program to its end and returns what it wrote to its standard output.
pub(crate) fn output(command: &mut Command) -> Result<String> {
    let output = command.stderr(Stdio::inherit()).output().with_context(|| format!("cannot start {command:?}"))?;
    ensure!(output.status.success(), "{command:?} failed ({})", output.status);
    String::from_utf8(output.stdout).with_context(|| format!("{command:?} wrote something else than text"))
}

/// Whether a program is there at all and answers to this word.
pub(crate) fn answers(program: &str, word: &str) -> bool {
    succeeds(Command::new(program).arg(word))
}

/// Whether a program ends well, which nobody hears of.
pub(crate) fn succeeds(command: &mut Command) -> bool {
    let command = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command.status().is_ok_and(|status| status.success())
}

/// What `find` finds, at once or after packages of Debian are installed, where this is one and nobody need be asked.
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

/// Fails if programs cannot be built for a target, which rustup adds if need be: a toolchain that came without it, or a machine without
/// a network, cannot have it.
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

/// The last line of a text that is not empty, as JSON.
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

/// Makes a folder and those around it, where they are not there.
pub(crate) fn make(folder: &Path) -> Result<()> {
    fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))
}

/// Removes a folder with all in it, if it is there.
pub(crate) fn remove(folder: &Path) -> Result<()> {
    match fs::remove_dir_all(folder) {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            Err(error).with_context(|| format!("cannot remove {}", folder.display()))
        }
        _ => Ok(()),
    }
}
