//! The same hashes on every machine.

use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::arguments::Arguments;
use crate::chore::{Chore, Outcome};
use crate::workspace::Workspace;
use crate::{shell, system};

pub(crate) const CHORE: Chore = Chore {
    name: "hashes",
    usage: "[--bless | --full]",
    about: "compares hashes of what small recipes give with fixtures/hashes.txt, or writes them anew",
    details: "Pixels, light, labels, truth and scenes of twenty recipes, made by the program papsynth-hashes on this machine, with and without the \
              instructions for which its C library has other functions; `cargo xtask wasm` has the same made in wasm32. --full also compiles \
              it for the plainest, a usual and the newest processor, and for aarch64, which qemu-user runs. --bless is for changes of what a recipe \
              gives, which have a line under Results in CHANGELOG.md.",
    run,
};

/// What makes and prints them.
pub(crate) const PACKAGE: &str = "papsynth-hashes";

/// Processors that compilers know, from the plainest on; `native` is the one at hand.
const PROCESSORS: [&str; 3] = ["x86-64", "x86-64-v3", "native"];

/// Another kind of processor, for which the compiler brings its own linker and C library.
const AARCH64: &str = "aarch64-unknown-linux-musl";

fn run(workspace: &Workspace, mut arguments: Arguments) -> Result<Outcome> {
    let (bless, full) = (arguments.flag("--bless"), arguments.flag("--full"));
    arguments.finish()?;
    let mut command = workspace.cargo();
    command.args(["test", "--package", PACKAGE]);
    if bless {
        command.env("PAPSYNTH_BLESS", "1");
    }
    shell::run(&mut command)?;
    if full {
        on_other_processors(workspace)?;
        return on_aarch64(workspace);
    }
    Ok(Outcome::Done)
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
        compare(workspace, &shell::output(&mut command)?, processor)?;
    }
    Ok(())
}

/// Compiled for aarch64.
fn on_aarch64(workspace: &Workspace) -> Result<Outcome> {
    let emulator = || {
        let mut names = ["qemu-aarch64", "qemu-aarch64-static"].into_iter();
        names.find(|name| shell::answers(Command::new(name).arg("--version")))
    };
    let Some(emulator) = emulator().or_else(|| system::install(&["qemu-user-static"]).then(emulator).flatten()) else {
        return Outcome::skipped_unless_ci("qemu-user, which runs programs for aarch64, is not installed".to_owned());
    };
    if !system::has_target(AARCH64)? {
        let reason = format!("the target {AARCH64} is not installed, and rustup cannot add it");
        return Outcome::skipped_unless_ci(reason);
    }
    let folder = workspace.target.join("hashes");
    let mut command = workspace.cargo();
    command.args(["build", "--package", PACKAGE, "--target", AARCH64, "--target-dir"]).arg(&folder);
    shell::run(command.env("CARGO_TARGET_AARCH64_UNKNOWN_LINUX_MUSL_LINKER", "rust-lld"))?;
    let program = folder.join(AARCH64).join("debug").join(PACKAGE);
    compare(workspace, &shell::output(Command::new(emulator).arg(program))?, "aarch64")?;
    Ok(Outcome::Done)
}

/// Fails if hashes made on `machine` are not those of the repository.
pub(crate) fn compare(workspace: &Workspace, found: &str, machine: &str) -> Result<()> {
    let file = workspace.root.join("fixtures/hashes.txt");
    let expected = read(&file)?;
    if found == expected {
        println!("{machine}: {} hashes agree", expected.lines().count());
        return Ok(());
    }
    // One line for each recipe: the first of its stages that differs.
    let mut recipes: Vec<&str> = Vec::new();
    let mut differences = String::new();
    for (expected, found) in expected.lines().zip(found.lines()).filter(|(expected, found)| expected != found) {
        let recipe = expected.split(' ').next().unwrap_or_default();
        if !recipes.contains(&recipe) {
            recipes.push(recipe);
            differences.push_str(&format!("\n  {expected}\n  is {found}"));
        }
    }
    bail!("on {machine} {} recipes give something else than in {}:{differences}", recipes.len(), workspace.shown(&file))
}

fn read(file: &Path) -> Result<String> {
    fs::read_to_string(file).with_context(|| format!("cannot read {}", file.display()))
}
