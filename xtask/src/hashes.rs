//! The same hashes on every machine.

use std::process::Command;

use anyhow::{Result, ensure};

use crate::deps;
use crate::shell::{self, need_target, skipped};
use crate::workspace::Workspace;

/// What makes and prints them.
const PACKAGE: &str = "papsynth-hashes";

/// Processors that compilers know, from the plainest on; `native` is the one at hand.
const PROCESSORS: [&str; 3] = ["x86-64", "x86-64-v3", "native"];

/// Another kind of processor, for which the compiler brings its own linker and C library.
const AARCH64: &str = "aarch64-unknown-linux-musl";

/// Without a system, and with one that programs can print to.
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

/// Compiled for several processors.
fn on_other_processors(workspace: &Workspace) -> Result<()> {
    if !cfg!(all(target_arch = "x86_64", target_os = "linux")) {
        println!("skipped: processors are known here for x86-64 and Linux alone");
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

/// Compiled for aarch64.
fn on_aarch64(workspace: &Workspace) -> Result<()> {
    let emulator =
        || ["qemu-aarch64", "qemu-aarch64-static"].into_iter().find(|name| shell::answers(name, "--version"));
    let Some(emulator) = shell::find_or_install(emulator, &["qemu-user-static"]) else {
        return Err(skipped("qemu-user, which runs programs for aarch64, is not installed"));
    };
    need_target(AARCH64)?;
    let folder = workspace.target.join("hashes");
    let mut command = workspace.cargo();
    command.args(["build", "--package", PACKAGE, "--target", AARCH64, "--target-dir"]).arg(&folder);
    shell::run(command.env("CARGO_TARGET_AARCH64_UNKNOWN_LINUX_MUSL_LINKER", "rust-lld"))?;
    let program = folder.join(AARCH64).join("debug").join(PACKAGE);
    compare(workspace, Command::new(emulator).arg(program), "aarch64")
}

/// The pure crates without threads and without a source of entropy, and what they give in wasm32.
pub(crate) fn wasm(workspace: &Workspace) -> Result<()> {
    let [bare, wasi] = WASM;
    WASM.into_iter().try_for_each(need_target)?;
    let mut command = workspace.cargo();
    command.args(["check", "--target", bare, "--lib", "--no-default-features"]);
    shell::run(command.args(deps::pure_crates().flat_map(|name| ["--package", name])))?;
    if !shell::answers("node", "--version") {
        return Err(skipped("Node is not installed, which runs programs for wasm32"));
    }
    shell::run(workspace.cargo().args(["build", "--target", wasi, "--package", PACKAGE]))?;
    let program = workspace.target.join(wasi).join("debug").join(PACKAGE).with_extension("wasm");
    compare(workspace, Command::new("node").arg(workspace.root.join("xtask/src/wasi.mjs")).arg(program), "wasm32")
}

/// Fails if hashes that a program prints on `machine` are not those of the repository.
fn compare(workspace: &Workspace, program: &mut Command, machine: &str) -> Result<()> {
    let file = workspace.root.join("fixtures/hashes.txt");
    let (found, expected) = (shell::output(program)?, shell::read(&file)?);
    let pairs = expected.lines().zip(found.lines()).filter(|(expected, found)| expected != found);
    let others: Vec<String> = pairs.map(|(expected, found)| format!("\n  {expected}\n  is {found}")).collect();
    ensure!(
        found == expected,
        "on {machine} {} hashes are others than in {}:{}",
        others.len(),
        workspace.shown(&file),
        others.concat()
    );
    println!("{machine}: {} hashes agree", expected.lines().count());
    Ok(())
}
