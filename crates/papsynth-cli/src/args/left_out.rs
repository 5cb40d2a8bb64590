//! Subcommands that this program was built without.

use std::ffi::OsString;

use clap::Args;

/// Not in this build.
#[derive(Debug, Args)]
pub(crate) struct LeftOut {
    /// Whatever is typed after it
    #[arg(hide = true, trailing_var_arg = true, allow_hyphen_values = true)]
    _words: Vec<OsString>,
}
