//! `papsynth convert`: a data set in other formats.

use papsynth_dataset::Progress;

use crate::args::Convert;
use crate::exit::{self, Failure};
use crate::words::counted;

pub(crate) fn run(args: &Convert) -> Result<(), Failure> {
    let layout = args.files.layout(args.format.clone());
    let stop = exit::watch()?;
    let report = |_: Progress| ();
    let outcome = papsynth_dataset::convert(&args.dir, &args.out, &layout, stop, &report)?;
    let out = args.out.display();
    if outcome.stopped {
        let message = format!("stopped; every file in {out} is whole");
        return Err(Failure::stopped(message, "write"));
    }
    if args.quiet {
        return Ok(());
    }
    let there = if outcome.kept > 0 { format!(", {} were there", outcome.kept) } else { String::new() };
    exit::print(&format!("{out}: {} written{there}\n", counted(outcome.made, "frame", "frames")))
}
