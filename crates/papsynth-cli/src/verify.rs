//! `papsynth verify` and `papsynth clean`: whether a data set is whole, and what does not belong there.

use crate::args::{Clean, Verify};
use crate::exit::{self, Failure};
use crate::findings;
use crate::place;
use crate::words::counted;

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
        let (frames, files) = (counted(verdict.frames, "frame", "frames"), counted(verdict.files, "file", "files"));
        exit::print(&format!("{dir}: whole, {frames} in {files}\nroot {root}\n"))?;
    } else {
        findings::print(&verdict.findings)?;
    }
    findings::judge(&args.dir, &verdict.findings)
}

pub(crate) fn clean(args: &Clean) -> Result<(), Failure> {
    let cleaned = papsynth_dataset::clean(&place::home(&args.dir)?, args.strays)?;
    let (dir, strays) = (args.dir.display(), counted(cleaned.strays, "other", "others"));
    let left = counted(cleaned.temporary, "file", "files");
    exit::print(&format!("{dir}: {left} of killed runs and {strays} removed\n"))?;
    if cleaned.stayed > 0 {
        let stay = counted(cleaned.stayed, "file stays", "files stay");
        exit::note(&format!("{stay}: at work, another user's, or of a name that is no UTF-8"));
    }
    Ok(())
}
