//! `papsynth view`: a data set or a slide in the browser.

use papsynth_loopback::Server;
use papsynth_view::Error;

use crate::args::View;
use crate::browser;
use crate::exit::{self, Complaint, Failure};
use crate::interrupt::Interrupt;

pub(crate) fn run(args: &View) -> Result<(), Failure> {
    let view = papsynth_view::View::open(&args.dir)?;
    let server = Server::bind(args.port.unwrap_or(0))?;
    let interrupt = Interrupt::watch()?;
    let address = server.address();
    exit::print(&format!("{}: a {}\nOpen {address} in a browser. Ctrl-C ends.\n", args.dir.display(), view.kind()))?;
    if args.open {
        browser::open(&address);
    }
    Ok(server.run(view, interrupt.flag(), |_| ())?)
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        let complaint = Complaint::new(error.to_string());
        if error.is_io() { Self::io(complaint) } else { Self::input(complaint) }
    }
}
