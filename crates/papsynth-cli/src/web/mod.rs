//! Pages on this machine.

pub(crate) mod study;
pub(crate) mod view;

use std::process::{Command, Stdio};

use papsynth_web::Error;

use crate::exit::{self, Failure};

/// Opens a page with what the system opens pages with; if it cannot, the address stands above.
fn open(address: &str) {
    let (program, arguments): (&str, &[&str]) = match std::env::consts::OS {
        "macos" => ("open", &[]),
        // The empty word is the title of a window.
        "windows" => ("cmd", &["/C", "start", ""]),
        _ => ("xdg-open", &[]),
    };
    let mut command = Command::new(program);
    command.args(arguments).arg(address).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    if let Err(error) = command.spawn() {
        exit::note(&format!("no browser could be opened: {error}"));
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self::of(&error, error.is_io())
    }
}
