//! Compares hashes of the output on several platforms.

use std::process::Command;

use anyhow::{Result, ensure};

use crate::deps;
use crate::shell::{self, need_target, skipped};
use crate::workspace::Workspace;

/// The package that computes and prints the hashes.
const PACKAGE: &str = "papsynth-hashes";

/// Target processors of the compiler.
const PROCESSORS: [&str; 3] = ["x86-64", "x86-64-v3", "native"];

/// Target for aarch64, for which the compiler includes linker and C library.
const AARCH64: &str = "aarch64-unknown-linux-musl";

/// Targets without an operating system, and with WASI.
const WASM: [&str; 2] = ["wasm32-unknown-unknown", "wasm32-wasip1"];

pub(crate) fn run(workspace: &Workspace, bless: bool, full: bool) -> Result<()> {
    let mut command = workspace.cargo();
    command.args(["test", "--package", PACKAGE]);
    shell::run(if bless { command.env("PAPSYNTH_BLESS", "1") } else { &mut command })?;
    if full {
        on_other_processors(workspace)?;
        on_aarch64(workspace)?;
    }
    Ok(())
}

/// Compares hashes of programs compiled for several processors.
fn on_other_processors(workspace: &Workspace) -> Result<()> {
    if !cfg!(all(target_arch = "x86_64", target_os = "linux")) {
        println!("skipped: target processors are only compared on Linux for x86-64");
        return Ok(());
    }
    for processor in PROCESSORS {
        let folder = workspace.target.join("hashes").join(processor);
        let mut command = workspace.cargo();
        command.args(["run", "--package", PACKAGE, "--target-dir"]).arg(&folder);
        command.env("RUSTFLAGS", format!("-C target-cpu={processor}"));
        compare(workspace, &mut command, processor)?;
    }
    Ok(())
}

/// Compares hashes of a program compiled for aarch64.
fn on_aarch64(workspace: &Workspace) -> Result<()> {
    let emulator = emulator()?;
    need_target(AARCH64)?;
    let folder = workspace.target.join("hashes");
    let mut command = workspace.cargo();
    command.args(["build", "--package", PACKAGE, "--target", AARCH64, "--target-dir"]).arg(&folder);
    shell::run(command.env("CARGO_TARGET_AARCH64_UNKNOWN_LINUX_MUSL_LINKER", "rust-lld"))?;
    let program = folder.join(AARCH64).join("debug").join(PACKAGE);
    compare(workspace, Command::new(emulator).arg(program), "aarch64")
}

/// Returns a program that runs programs for aarch64.
pub(crate) fn emulator() -> Result<&'static str> {
    let names = ["qemu-aarch64", "qemu-aarch64-static"];
    let find = || names.into_iter().find(|name| shell::answers(name, "--version"));
    shell::find_or_install(find, &["qemu-user-static"])
        .ok_or_else(|| skipped("qemu-user is not installed and cannot be installed"))
}

/// Checks the crates without files and threads for wasm32, and compares hashes.
pub(crate) fn wasm(workspace: &Workspace) -> Result<()> {
    let [bare, wasi] = WASM;
    WASM.into_iter().try_for_each(need_target)?;
    let mut command = workspace.cargo();
    command.args(["check", "--target", bare, "--lib", "--no-default-features"]);
    shell::run(command.args(deps::pure_crates().flat_map(|name| ["--package", name])))?;
    if !shell::answers("node", "--version") {
        return Err(skipped("Node is not installed"));
    }
    shell::run(workspace.cargo().args(["build", "--target", wasi, "--package", PACKAGE]))?;
    let program = workspace.target.join(wasi).join("debug").join(PACKAGE).with_extension("wasm");
    compare(workspace, Command::new("node").arg(workspace.root.join("xtask/src/wasi.mjs")).arg(program), "wasm32")
}

/// Fails if the hashes printed by a program differ from those in fixtures/hashes.txt.
fn compare(workspace: &Workspace, program: &mut Command, machine: &str) -> Result<()> {
    let file = workspace.root.join("fixtures/hashes.txt");
    let (found, expected) = (shell::output(program)?, shell::read(&file)?);
    let pairs = expected.lines().zip(found.lines()).filter(|(expected, found)| expected != found);
    let others: Vec<String> =
        pairs.map(|(expected, found)| format!("\n  expected {expected}\n  found    {found}")).collect();
    ensure!(
        found == expected,
        "{machine}: {} hashes differ from {}:{}",
        others.len(),
        workspace.shown(&file),
        others.concat()
    );
    println!("{machine}: all {} hashes agree", expected.lines().count());
    Ok(())
}
