//! `papsynth status`, `merge`, `verify` and `clean`: how much is there, the end of the work of several, whether a data set is
//! whole, and what does not belong there.

use std::collections::BTreeSet;
use std::ops::Range;

use papsynth_dataset::{Check, Dataset, Location, missing_shards};

use crate::args::{Clean, Merge, Status, Verify, check_of};
use crate::exit::{self, Failure};
use crate::findings::{judge, print_findings};
use crate::words::{counted, runs};

pub(crate) fn run(args: &Status) -> Result<(), Failure> {
    #[cfg(feature = "zarr")]
    if papsynth_dataset::slide::SlideSet::is_in(&args.dir) {
        let (missing, shards, is_closed) = crate::slide::there(&args.dir)?;
        let close = (!is_closed).then(|| format!("papsynth slide finalize {}", args.dir.display()));
        return tell(args, &runs(&missing), shards, close.as_deref());
    }
    let dataset = Dataset::open(&Location::at(&args.dir)?)?;
    let merged = dataset.merged_frames()?;
    let Some(frames) = args.frames.or((merged > 0).then_some(merged)) else {
        return Err(Failure::wrong(
            "--frames is missing: how many frames there will be".to_owned(),
            "only a slide, or a data set that was merged, knows it by itself",
        ));
    };
    let missing = missing_shards(&dataset, 0..frames, Check::Sizes)?;
    let all = frames.div_ceil(dataset.layout().frames_per_shard);
    let close = format!("papsynth merge {} --frames {frames}", args.dir.display());
    tell(args, &missing, all, (!dataset.is_finished()?).then_some(&close))
}

/// What of so many shards is missing, and how to go on if nothing is, unless that was done.
fn tell(args: &Status, missing: &[Range<u64>], all: u64, close: Option<&str>) -> Result<(), Failure> {
    if args.missing {
        let text = match args.tasks {
            Some(tasks) => listed(&of_tasks(missing, tasks)),
            None => listed(missing),
        };
        return exit::print(&if text.is_empty() { text } else { format!("{text}\n") });
    }
    let whole = all - count(missing);
    let percent = 100.0 * whole as f64 / all as f64;
    exit::print(&format!("{}: {whole} of {all} shards are whole ({percent:.1} %)\n", args.dir.display()))?;
    match close {
        _ if !missing.is_empty() => exit::print(&format!("missing: {}\n", listed(missing))),
        Some(close) => exit::print(&format!("Close it with: {close}\n")),
        None => exit::print("it is closed\n"),
    }
}

pub(crate) fn merge(args: &Merge) -> Result<(), Failure> {
    let dataset = Dataset::open(&Location::at(&args.dir)?)?;
    let missing = missing_shards(&dataset, 0..args.frames, check_of(args.verify))?;
    let dir = args.dir.display();
    if !missing.is_empty() {
        let shards = counted(count(&missing), "shard is", "shards are");
        let message = format!("{dir}: {shards} missing or damaged: {}", listed(&missing));
        let help = "the command that makes the data set, with --verify, makes them, in any share; then merge again";
        return Err(Failure::wrong(message, help));
    }
    let summary = dataset.finish()?;
    if summary.frames != args.frames {
        let message = format!("{dir}: --frames {}, but {} are there", args.frames, summary.frames);
        return Err(Failure::wrong(message, "give the number that was meant, or take away what is too much"));
    }
    let (frames, root) = (counted(summary.frames, "frame", "frames"), summary.root);
    exit::print(&format!("{dir}: {frames}\nroot {root}\nLook at: {dir}/contact-sheet.png\n"))
}

fn count(ranges: &[Range<u64>]) -> u64 {
    ranges.iter().map(|range| range.end - range.start).sum()
}

/// The tasks, of so many, that make these shards.
fn of_tasks(shards: &[Range<u64>], tasks: u64) -> Vec<Range<u64>> {
    let of_range =
        |range: &Range<u64>| (range.start..range.end.min(range.start.saturating_add(tasks))).map(|n| n % tasks);
    let numbers: BTreeSet<u64> = shards.iter().flat_map(of_range).collect();
    runs(&Vec::from_iter(numbers))
}

/// Numbers as `sbatch --array` takes them.
fn listed(ranges: &[Range<u64>]) -> String {
    let text = ranges
        .iter()
        .map(|r| if r.end - r.start == 1 { r.start.to_string() } else { format!("{}-{}", r.start, r.end - 1) });
    text.collect::<Vec<_>>().join(",")
}

pub(crate) fn verify(args: &Verify) -> Result<(), Failure> {
    #[cfg(feature = "zarr")]
    if papsynth_dataset::slide::SlideSet::is_in(&args.dir) {
        return crate::slide::verify(&args.dir, args.json);
    }
    let report = papsynth_dataset::verify(&Location::at(&args.dir)?, args.frames.map(|frames| 0..frames))?;
    let dir = args.dir.display();
    if args.json {
        let text = serde_json::to_string_pretty(&report).unwrap_or_default();
        exit::print(&format!("{text}\n"))?;
    } else if let Some(root) = &report.root {
        let (frames, files) = (counted(report.frames, "frame", "frames"), counted(report.files, "file", "files"));
        exit::print(&format!("{dir}: whole, {frames} in {files}\nroot {root}\n"))?;
    } else {
        print_findings(&report.findings)?;
    }
    judge(&args.dir, &report.findings)
}

pub(crate) fn clean(args: &Clean) -> Result<(), Failure> {
    let cleaned = papsynth_dataset::clean(&Location::at(&args.dir)?, args.strays)?;
    let (dir, strays) = (args.dir.display(), counted(cleaned.untracked, "other", "others"));
    let left = counted(cleaned.temporary, "file", "files");
    exit::print(&format!("{dir}: {left} of killed runs and {strays} removed\n"))?;
    if cleaned.skipped > 0 {
        let stay = counted(cleaned.skipped, "file stays", "files stay");
        exit::note(format!("{stay}: at work, another user's, or of a name that is no UTF-8"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_listed_as_schedulers_take_them() {
        assert_eq!(listed(&[0..1, 2..5, 9..10]), "0,2-4,9");
        assert_eq!(listed(&[]), "");
        assert_eq!(listed(&of_tasks(&[0..1, 12..15, 19..20], 10)), "0,2-4,9");
        assert_eq!(listed(&of_tasks(&[1..2, 7..u64::MAX], 3)), "0-2");
        assert_eq!(count(&[0..1, 2..5]), 4);
    }
}
