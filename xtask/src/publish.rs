//! Whether every crate could be published.

use anyhow::Result;

use crate::arguments::Arguments;
use crate::outcome::Outcome;
use crate::workspace::Workspace;
use crate::{Chore, shell};

pub(crate) const CHORE: Chore = Chore {
    name: "publish",
    usage: "",
    about: "packs every crate and builds it from its package, as a publication would; publishes nothing",
    details: "",
    run,
};

fn run(workspace: &Workspace, arguments: Arguments) -> Result<Outcome> {
    arguments.finish()?;
    shell::run(workspace.cargo().args(["publish", "--workspace", "--dry-run", "--allow-dirty"]))?;
    Ok(Outcome::Done)
}
