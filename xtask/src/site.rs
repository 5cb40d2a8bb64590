//! Generates the documentation site.

use std::path::{Path, PathBuf};

use anyhow::Result;

use crate::shell;
use crate::workspace::Workspace;

/// Generates the documentation site in target/site: plain files that need no server
///
/// The pages are those of site/pages, docs and the READMEs; a reference of recipes, from their schema; and a gallery
/// with a field of each preset. `papsynth` renders the pictures of galleries and physics. Fails if a link or an anchor within the site does not exist.
/// `cargo xtask browser` opens all pages.
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
    let program = match &options.program {
        Some(program) => program.clone(),
        None => {
            let build = ["build", "--release", "--package", "papsynth-cli", "--no-default-features"];
            shell::run(workspace.cargo().args(build))?;
            workspace.program("release", "papsynth")
        }
    };
    generate(workspace, &program, &workspace.target.join("site"), !options.no_pictures)
}

/// Generates the site with pictures, as a step of the checks.
pub(crate) fn whole(workspace: &Workspace) -> Result<()> {
    run(workspace, &Site { no_pictures: false, program: None })
}

/// Generates the site without pictures with the program of the integration tests, and returns its folder.
pub(crate) fn check(workspace: &Workspace) -> Result<PathBuf> {
    shell::run(workspace.cargo_light(&["test", "--no-run"]).args(["--test", "it"]))?;
    let folder = workspace.target.join("site-check");
    generate(workspace, &workspace.program("debug", "papsynth"), &folder, false)?;
    Ok(folder)
}

fn generate(workspace: &Workspace, program: &Path, folder: &Path, pictures: bool) -> Result<()> {
    let mut command = workspace.cargo();
    command.args(["run", "--package", "papsynth-site", "--"]).args([&workspace.root, program, folder]);
    shell::run(command.args((!pictures).then_some("--no-pictures")))
}
