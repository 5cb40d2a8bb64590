//! Generates the documentation site.

use std::path::{Path, PathBuf};

use anyhow::Result;

use crate::shell::{self, need_target};
use crate::workspace::Workspace;

/// Generates the documentation site in target/site: plain files that need no server
///
/// The pages are those of site/pages, docs and the READMEs; a reference of recipes, from their schema; and a gallery
/// with a field of each preset. `papsynth` renders the pictures of galleries and physics. The folder workbench is the
/// page of `papsynth workbench` with the engine in WebAssembly (target wasm32-unknown-unknown); any server of files can
/// host it. Fails if a link or an anchor within the site does not exist. `cargo xtask browser` opens all pages.
#[derive(clap::Args)]
pub(crate) struct Site {
    /// Leaves out the pictures that commands of the pages make
    #[arg(long)]
    no_pictures: bool,
    /// Program `papsynth` to use, instead of a build in release mode
    #[arg(long, value_name = "PATH")]
    program: Option<PathBuf>,
}

pub(crate) fn run(workspace: &Workspace, options: &Site) -> Result<()> {
    let program = options.program.clone().map_or_else(|| program(workspace), Ok)?;
    let engine = engine(workspace, "wasm")?;
    generate(workspace, &program, &engine, &workspace.target.join("site"), !options.no_pictures)
}

/// Generates the site with pictures, as a step of the checks.
pub(crate) fn whole(workspace: &Workspace) -> Result<()> {
    run(workspace, &Site { no_pictures: false, program: None })
}

/// Builds the program in release mode, and returns its file.
pub(crate) fn program(workspace: &Workspace) -> Result<PathBuf> {
    let build = ["build", "--release", "--package", "papsynth-cli", "--no-default-features", "--features", "web"];
    shell::run(workspace.cargo().args(build))?;
    Ok(workspace.program("release", "papsynth"))
}

/// Builds the engine in WebAssembly with a profile, and returns its file.
pub(crate) fn engine(workspace: &Workspace, profile: &str) -> Result<PathBuf> {
    const TARGET: &str = "wasm32-unknown-unknown";
    need_target(TARGET)?;
    let build = ["build", "--package", "papsynth-wasm", "--lib", "--target", TARGET, "--profile", profile];
    shell::run(workspace.cargo().args(build))?;
    let folder = if profile == "dev" { "debug" } else { profile };
    Ok(workspace.target.join(TARGET).join(folder).join("papsynth_wasm.wasm"))
}

/// Generates the site without pictures with the program of the integration tests, and returns its folder.
///
/// The engine is built with the profile of tests, which takes a third of the time.
pub(crate) fn check(workspace: &Workspace) -> Result<PathBuf> {
    shell::run(workspace.cargo_light(&["test", "--no-run"]).args(["--test", "it"]))?;
    let folder = workspace.target.join("site-check");
    let engine = engine(workspace, "dev")?;
    generate(workspace, &workspace.program("debug", "papsynth"), &engine, &folder, false)?;
    Ok(folder)
}

fn generate(workspace: &Workspace, program: &Path, engine: &Path, folder: &Path, pictures: bool) -> Result<()> {
    let mut command = workspace.cargo();
    command.args(["run", "--package", "papsynth-site", "--"]).args([&workspace.root, program, engine, folder]);
    shell::run(command.args((!pictures).then_some("--no-pictures")))
}
