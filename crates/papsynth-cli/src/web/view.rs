//! `papsynth view`: a data set or a slide in the browser.

use papsynth_web::Server;

use super::open;
use crate::args::View;
use crate::exit::{self, Failure};
use crate::interrupt::Interrupt;

pub(crate) fn run(args: &View) -> Result<(), Failure> {
    let view = papsynth_web::View::open(&args.dir)?;
    let server = Server::bind(args.port.unwrap_or(0))?;
    let interrupt = Interrupt::watch()?;
    let address = server.address();
    exit::print(&format!("{}: a {}\nOpen {address} in a browser. Ctrl-C ends.\n", args.dir.display(), view.kind()))?;
    if args.open {
        open(&address);
    }
    Ok(server.run(view, interrupt.flag(), |_| ())?)
}
