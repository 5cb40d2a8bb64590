//! What a chore is, and how it ends if it does not fail.

use anyhow::{Result, bail};

use crate::arguments::Arguments;
use crate::workspace::Workspace;

/// One chore.
pub(crate) struct Chore {
    pub(crate) name: &'static str,
    /// Its arguments, as a usage line shows them.
    pub(crate) usage: &'static str,
    /// What it does, in a line.
    pub(crate) about: &'static str,
    /// What else there is to know.
    pub(crate) details: &'static str,
    pub(crate) run: fn(&Workspace, Arguments) -> Result<Outcome>,
}

/// How a chore ended.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// It did what it says.
    Done,
    /// It could not be done here, for this reason, which is nobody's fault.
    Skipped(String),
}

impl Outcome {
    /// Skipped on a person's machine; a failure where `CI` is set, since nobody would read the sentence there.
    pub(crate) fn skipped_unless_ci(reason: String) -> Result<Self> {
        if in_ci() {
            bail!("{reason}, and CI is set");
        }
        Ok(Self::Skipped(reason))
    }
}

/// Whether this runs unattended.
pub(crate) fn in_ci() -> bool {
    std::env::var("CI").is_ok_and(|value| !matches!(value.as_str(), "" | "0" | "false"))
}
