//! `papsynth verify` and `papsynth clean`: whether a data set is whole, and what does not belong there.

use papsynth_dataset::Mend;

use crate::args::{Clean, Verify};
use crate::exit::{self, Complaint, Failure};
use crate::place;

/// Findings that are printed in full; the rest is counted.
pub(crate) const MOST: usize = 50;

pub(crate) fn run(args: &Verify) -> Result<(), Failure> {
    #[cfg(feature = "zarr")]
    if papsynth_dataset::slide::SlideSet::is_in(&args.dir) {
        return crate::slide::verify(&args.dir, args.json);
    }
    let verdict = papsynth_dataset::verify(&place::home(&args.dir)?, args.frames.map(|frames| 0..frames))?;
    let dir = args.dir.display();
    if args.json {
        let text = serde_json::to_string_pretty(&verdict).unwrap_or_default();
        exit::print(&format!("{text}\n"))?;
    } else if let Some(root) = &verdict.root {
        exit::print(&format!("{dir}: whole, {} frames in {} files\nroot {root}\n", verdict.frames, verdict.files))?;
    } else {
        let mut text = String::new();
        for finding in verdict.findings.iter().take(MOST) {
            text.push_str(&format!("{}: {}\n", finding.path, finding.message));
        }
        if verdict.findings.len() > MOST {
            text.push_str(&format!("and {} more\n", verdict.findings.len() - MOST));
        }
        exit::print(&text)?;
    }
    let count = verdict.findings.len();
    if count == 0 {
        return Ok(());
    }
    let things = if count == 1 { "1 thing is".to_owned() } else { format!("{count} things are") };
    let wants = |mend: Mend| verdict.findings.iter().any(|finding| finding.mend == mend);
    let mends: Vec<&str> = [
        (Mend::Generate, "the command that made the data set, with --verify, makes again what is wrong"),
        (Mend::Clean, "`papsynth clean --strays` takes away what does not belong there"),
    ]
    .into_iter()
    .filter(|(mend, _)| wants(*mend))
    .map(|(_, words)| words)
    .collect();
    Err(Failure::input(Complaint::new(format!("{dir}: {things} wrong")).help(mends.join("; "))))
}

pub(crate) fn clean(args: &Clean) -> Result<(), Failure> {
    let cleaned = papsynth_dataset::clean(&place::home(&args.dir)?, args.strays)?;
    let (dir, left, strays) = (args.dir.display(), cleaned.temporary, cleaned.strays);
    exit::print(&format!("{dir}: {left} files of killed runs and {strays} others removed\n"))
}
