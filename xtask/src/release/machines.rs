//! Runs the released files on machines without Rust: parts of Debian below the target folder, and an empty folder.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};

use super::{programs, wheels};
use crate::external::{HEAVY_FORMATS, LIGHT_FORMATS};
use crate::shell::{self, skipped};
use crate::workspace::{PROGRAM, Workspace};
use crate::{hashes, python};

/// The oldest Debian on its mirrors, with glibc 2.31.
const OLD: &str = "bullseye";

/// The oldest Debian with a Python for our wheels, and the version of this Python.
const WITH_PYTHON: (&str, &str) = ("bookworm", "3.11");

/// Options for two small fields; xtask/python/root_hash.py generates the same.
const FIELDS: &str = "--quiet --frames 2 --seed 7 --set field.width_px=320 --set field.height_px=240";

/// Runs the program and loads the wheel for x86-64 in an old Debian, and runs the wheel in a newer one.
pub(super) fn x86_64(workspace: &Workspace) -> Result<()> {
    let [processor, target] = [wheels::PROCESSORS[0], programs::TARGETS[0]];
    let old = Machine::new(workspace, OLD, "amd64", "libgcc-s1", None)?;
    check_program(workspace, &old, target)?;
    install_wheel(workspace, &old, processor)?;
    let library = old.path("opt/python/papsynth/_native.abi3.so");
    shell::run(old.command("lib64/ld-linux-x86-64.so.2").arg("--list").arg(library))?;
    let newer = Machine::new(workspace, WITH_PYTHON.0, "amd64", "python3,libstdc++6", None)?;
    check_wheel(workspace, &newer, processor)
}

/// Runs the program and the wheel for aarch64 in an emulator.
pub(super) fn aarch64(workspace: &Workspace) -> Result<()> {
    let emulator = Some(hashes::emulator()?);
    let machine = Machine::new(workspace, WITH_PYTHON.0, "arm64", "python3,libstdc++6", emulator)?;
    check_program(workspace, &machine, programs::TARGETS[1])?;
    check_wheel(workspace, &machine, wheels::PROCESSORS[1])
}

/// Runs the program in an empty folder, as in a container, and builds the container image.
pub(super) fn image(workspace: &Workspace) -> Result<()> {
    let machine = Machine { root: super::work(workspace, "empty"), emulator: None };
    shell::remove(&machine.root)?;
    check_program(workspace, &machine, programs::TARGETS[0])?;
    if !shell::answers("docker", "info") {
        return Err(skipped("Docker is not running, so no image was built; the program ran in an empty folder"));
    }
    let docker = || Command::new("docker");
    let recipe = workspace.root.join("Dockerfile");
    shell::run(docker().args(["build", "--tag", "papsynth", "--file"]).arg(recipe).arg(super::files(workspace)))?;
    shell::run(docker().args(["run", "--rm", "papsynth", "--version"]))
}

/// A folder in which programs find no files of this machine, except in an emulator.
struct Machine {
    root: PathBuf,
    /// Program for another processor. It replaces `chroot`, and finds system libraries in the folder.
    emulator: Option<&'static str>,
}

impl Machine {
    /// Unpacks these packages of Debian and their dependencies, unless an earlier run has.
    fn new(
        workspace: &Workspace,
        suite: &str,
        architecture: &str,
        packages: &str,
        emulator: Option<&'static str>,
    ) -> Result<Self> {
        let root = super::work(workspace, &format!("{suite}-{architecture}"));
        let stamp = root.join("packages.txt");
        if std::fs::read_to_string(&stamp).is_ok_and(|unpacked| unpacked == packages) {
            return Ok(Self { root, emulator });
        }
        let tool = "mmdebstrap";
        let is_here = || shell::answers(tool, "--version").then_some(());
        shell::find_or_install(is_here, &[tool, "debian-archive-keyring"])
            .ok_or_else(|| skipped("mmdebstrap is not installed and cannot be installed"))?;
        shell::remove(&root)?;
        let mut command = Command::new(tool);
        command.args(["--quiet", "--variant=extract", "--architectures", architecture, "--include", packages, suite]);
        shell::run(command.arg(&root))
            .map_err(|error| skipped(format!("packages of Debian cannot be unpacked: {error}")))?;
        shell::write(&stamp, packages)?;
        Ok(Self { root, emulator })
    }

    /// Returns the path by which its programs find a file.
    fn path(&self, file: &str) -> PathBuf {
        self.emulator.map_or(Path::new("/"), |_| &self.root).join(file)
    }

    /// Returns a command that starts a program of this machine.
    fn command(&self, program: &str) -> Command {
        let mut command = Command::new(self.emulator.unwrap_or("chroot"));
        if self.emulator.is_some() {
            command.arg("-L");
        }
        command.arg(&self.root).arg(self.path(program));
        command
    }
}

/// Generates two fields in every format with the archived program, and compares their root hash.
fn check_program(workspace: &Workspace, machine: &Machine, target: &str) -> Result<()> {
    need_root()?;
    let folder = machine.root.join("opt/papsynth");
    shell::remove(&folder)?;
    shell::make(&folder)?;
    let archive = programs::archived(workspace, target)?;
    ensure!(archive.exists(), "{}: no such file; run the step `programs`", workspace.shown(&archive));
    shell::run(Command::new("tar").arg("-xzf").arg(archive).arg("--strip-components=1").arg("-C").arg(&folder))?;
    let formats = format!("--format {LIGHT_FORMATS},{HEAVY_FORMATS}");
    let own = super::work(workspace, "own/all");
    let expected = root_hash(|| own_program(workspace), &own, &own, &formats)?;
    let papsynth = || machine.command("opt/papsynth/papsynth");
    let out = "fields";
    let found = root_hash(papsynth, &machine.root.join(out), &machine.path(out), &formats)?;
    ensure!(found == expected, "{target}: root hash {found}; a build for this machine gives {expected}");
    println!("{target}: the same root hash {found} as a build for this machine");
    Ok(())
}

/// Generates two fields with the wheel, and compares their root hash.
fn check_wheel(workspace: &Workspace, machine: &Machine, processor: &str) -> Result<()> {
    need_root()?;
    install_wheel(workspace, machine, processor)?;
    let own = super::work(workspace, "own/folder");
    let expected = root_hash(|| own_program(workspace), &own, &own, "--no-parquet")?;
    let script = "opt/root_hash.py";
    shell::copy(&workspace.root.join("xtask/python/root_hash.py"), &machine.root.join(script))?;
    let out = "fields-python";
    shell::remove(&machine.root.join(out))?;
    let mut python = machine.command(&format!("usr/bin/python{}", WITH_PYTHON.1));
    python.arg(machine.path(script)).arg(machine.path(out)).env("PYTHONPATH", machine.path("opt/python"));
    let text = shell::output(&mut python)?;
    let found = root_line(&text)?;
    ensure!(found == expected, "wheel for {processor}: root hash {found}; the program gives {expected}");
    println!("wheel for {processor}: the same root hash {found} as the program");
    Ok(())
}

/// Installs a wheel and NumPy in the folder opt/python of a machine.
fn install_wheel(workspace: &Workspace, machine: &Machine, processor: &str) -> Result<()> {
    let python = python::environment(workspace, "wheels", wheels::CHECKERS)?;
    let folder = machine.root.join("opt/python");
    shell::remove(&folder)?;
    let mut pip = python::pip(&python, "install");
    pip.args(["--only-binary", ":all:", "--no-compile", "--python-version", WITH_PYTHON.1]);
    for platform in ["manylinux_2_28", "manylinux_2_17", "manylinux2014"] {
        pip.arg("--platform").arg(format!("{platform}_{processor}"));
    }
    shell::run(pip.arg("--target").arg(folder).arg(wheels::wheel(workspace, processor)?))
}

/// Generates a data set in a folder, which is replaced, and returns the root hash that `papsynth verify` prints.
/// `seen` is the path of the folder for the program.
fn root_hash(program: impl Fn() -> Command, folder: &Path, seen: &Path, options: &str) -> Result<String> {
    shell::remove(folder)?;
    let options = FIELDS.split(' ').chain(options.split(' '));
    shell::run(program().arg("generate").args(options).arg("--out").arg(seen))?;
    let text = shell::output(program().arg("verify").arg(seen))?;
    root_line(&text).map(str::to_owned)
}

/// Returns the hash in the line `root HASH`.
fn root_line(text: &str) -> Result<&str> {
    let found = text.lines().find_map(|line| line.strip_prefix("root "));
    found.with_context(|| format!("expected a line `root HASH`, found `{text}`"))
}

/// Returns a command that builds the program for this machine with the profile of the tests, and runs it.
fn own_program(workspace: &Workspace) -> Command {
    let mut command = workspace.cargo();
    command.args(["run", "--locked", "--package", PROGRAM, "--all-features", "--"]);
    command
}

fn need_root() -> Result<()> {
    if shell::is_root() { Ok(()) } else { Err(skipped("chroot needs root")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_root_hash_is_a_line_of_the_output() {
        assert_eq!(root_line("fields: no problems found\nroot 12ab\n").unwrap(), "12ab");
        assert!(root_line("no hash").is_err());
    }

    #[test]
    fn an_emulator_needs_paths_of_this_machine() {
        let mut machine = Machine { root: "/m".into(), emulator: None };
        assert_eq!(format!("{:?}", machine.command("opt/a")), r#""chroot" "/m" "/opt/a""#);
        machine.emulator = Some("qemu");
        assert_eq!(format!("{:?}", machine.command("opt/a")), r#""qemu" "-L" "/m" "/m/opt/a""#);
    }
}
