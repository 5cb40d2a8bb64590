//! Pages on this machine.

pub(crate) mod study;

use std::process::{Command, Stdio};

use papsynth_web::Server;

use crate::args::View;
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

/// `papsynth view`: a data set or a slide in the browser.
pub(crate) fn view(args: &View) -> Result<(), Failure> {
    let view = papsynth_web::View::open(&args.dir)?;
    let server = Server::bind(args.port.unwrap_or(0))?;
    let stop = exit::watch()?;
    let address = server.address();
    exit::print(&format!("{}: a {}\nOpen {address} in a browser. Ctrl-C ends.\n", args.dir.display(), view.kind()))?;
    if args.open {
        open(&address);
    }
    Ok(server.run(view, stop, |_| ())?)
}
