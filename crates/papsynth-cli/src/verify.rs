//! `papsynth verify` and `papsynth clean`: whether a data set is whole, and what does not belong there.

use std::path::Path;

use papsynth_dataset::{Finding, Home, Mend};

use crate::args::{Clean, Verify};
use crate::exit::{self, Failure};
use crate::words::counted;

pub(crate) fn run(args: &Verify) -> Result<(), Failure> {
    #[cfg(feature = "zarr")]
    if papsynth_dataset::slide::SlideSet::is_in(&args.dir) {
        return crate::slide::verify(&args.dir, args.json);
    }
    let verdict = papsynth_dataset::verify(&Home::at(&args.dir)?, args.frames.map(|frames| 0..frames))?;
    let dir = args.dir.display();
    if args.json {
        let text = serde_json::to_string_pretty(&verdict).unwrap_or_default();
        exit::print(&format!("{text}\n"))?;
    } else if let Some(root) = &verdict.root {
        let (frames, files) = (counted(verdict.frames, "frame", "frames"), counted(verdict.files, "file", "files"));
        exit::print(&format!("{dir}: whole, {frames} in {files}\nroot {root}\n"))?;
    } else {
        print_findings(&verdict.findings)?;
    }
    judge(&args.dir, &verdict.findings)
}

pub(crate) fn clean(args: &Clean) -> Result<(), Failure> {
    let cleaned = papsynth_dataset::clean(&Home::at(&args.dir)?, args.strays)?;
    let (dir, strays) = (args.dir.display(), counted(cleaned.strays, "other", "others"));
    let left = counted(cleaned.temporary, "file", "files");
    exit::print(&format!("{dir}: {left} of killed runs and {strays} removed\n"))?;
    if cleaned.stayed > 0 {
        let stay = counted(cleaned.stayed, "file stays", "files stay");
        exit::note(&format!("{stay}: at work, another user's, or of a name that is no UTF-8"));
    }
    Ok(())
}

/// Findings that are printed in full; the rest is counted.
const MOST: usize = 50;

/// Prints what was found, up to a number.
pub(crate) fn print_findings(findings: &[Finding]) -> Result<(), Failure> {
    let mut text = String::new();
    for finding in findings.iter().take(MOST) {
        text.push_str(&format!("{}: {}\n", finding.path, finding.message));
    }
    if findings.len() > MOST {
        text.push_str(&format!("and {} more\n", findings.len() - MOST));
    }
    exit::print(&text)
}

/// Nothing found is good; else there is something to do.
pub(crate) fn judge(dir: &Path, findings: &[Finding]) -> Result<(), Failure> {
    if findings.is_empty() {
        return Ok(());
    }
    let things = counted(findings.len() as u64, "thing is", "things are");
    let wants = |mend: Mend| findings.iter().any(|finding| finding.mend == mend);
    let mends: Vec<&str> = [
        (Mend::Generate, "the command that made it, with --verify, makes again what is wrong"),
        (Mend::Merge, "`papsynth merge` closes it when all shards are there"),
        (Mend::Clean, "`papsynth clean --strays` takes away what does not belong there"),
    ]
    .into_iter()
    .filter(|(mend, _)| wants(*mend))
    .map(|(_, words)| words)
    .collect();
    Err(Failure::wrong(format!("{}: {things} wrong", dir.display()), mends.join("; ")))
}
