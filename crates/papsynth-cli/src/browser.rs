//! Pages on this machine.

use std::process::{Command, Stdio};

use papsynth_loopback::Error;

use crate::exit::{self, Complaint, Failure};

/// Opens a page with what the system opens pages with; if it cannot, the address stands above.
pub(crate) fn open(address: &str) {
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
        Self::input(Complaint::new(error.to_string()))
    }
}
