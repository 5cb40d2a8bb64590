//! `papsynth status`, `merge`, `verify` and `clean`: progress, merge, checks and cleaning of a data set.

use std::collections::BTreeSet;
use std::ops::Range;

use papsynth_dataset::{Check, Dataset, Extra, Location, VerifyProgress, missing_shards};

use crate::args::{Clean, Merge, Status, Verify, check_of};
use crate::exit::{self, ExitError};
use crate::findings::{check, print_findings};
use crate::report::Bar;
use crate::words::{counted, ranges};

pub(crate) fn run(args: &Status) -> Result<(), ExitError> {
    #[cfg(feature = "zarr")]
    if papsynth_dataset::slide::SlideSet::is_in(&args.dir) {
        let (missing, shards, is_finished) = crate::slide::progress_of(&args.dir)?;
        let finish = (!is_finished).then(|| format!("papsynth slide finalize {}", args.dir.display()));
        return print_status(args, &ranges(&missing), shards, finish.as_deref());
    }
    let dataset = Dataset::open(&Location::at(&args.dir)?)?;
    let merged = dataset.merged_frames()?;
    let Some(frames) = args.frames.map(|frames| 0..frames).or((!merged.is_empty()).then_some(merged)) else {
        return Err(ExitError::with_help(
            "--frames is missing".to_owned(),
            "give the number of frames of the complete data set; slides and merged data sets record it",
        ));
    };
    let missing = missing_shards(&dataset, frames.clone(), Check::Sizes)?;
    let each = dataset.layout().frames_per_shard;
    let all = frames.end.div_ceil(each) - frames.start / each;
    let finish = format!("papsynth merge {} --frames {}", args.dir.display(), frames.end);
    print_status(args, &missing, all, (!dataset.is_finished()?).then_some(&finish))
}

/// Prints the missing ones of `all` shards; if none is missing, the command that finishes the data set.
fn print_status(args: &Status, missing: &[Range<u64>], all: u64, finish: Option<&str>) -> Result<(), ExitError> {
    if args.missing {
        let text = match args.tasks {
            Some(tasks) => listed(&of_tasks(missing, tasks)),
            None => listed(missing),
        };
        return exit::print(&if text.is_empty() { text } else { format!("{text}\n") });
    }
    let present = all - count(missing);
    let percent = 100.0 * present as f64 / all as f64;
    let shards = counted(all, "shard", "shards");
    exit::print(&format!("{}: {present} of {shards} present ({percent:.1} %)\n", args.dir.display()))?;
    match finish {
        _ if !missing.is_empty() => exit::print(&format!("missing shards: {}\n", listed(missing))),
        Some(finish) => exit::print(&format!("To finish it, run: {finish}\n")),
        None => exit::print("finished\n"),
    }
}

pub(crate) fn merge(args: &Merge) -> Result<(), ExitError> {
    let dataset = Dataset::open(&Location::at(&args.dir)?)?;
    let missing = missing_shards(&dataset, 0..args.frames, check_of(args.verify))?;
    let dir = args.dir.display();
    if !missing.is_empty() {
        let shards = counted(count(&missing), "shard is", "shards are");
        let message = format!("{dir}: {shards} missing or damaged: {}", listed(&missing));
        let help = "run the command that writes the data set with --verify, then merge again";
        return Err(ExitError::with_help(message, help));
    }
    let summary = dataset.finish()?;
    if summary.frames != args.frames {
        let found = counted(summary.frames, "frame", "frames");
        let message = format!("{dir}: found {found}; --frames is {}", args.frames);
        return Err(ExitError::with_help(
            message,
            "give the number of frames that were written, or remove other frames",
        ));
    }
    let (frames, root) = (counted(summary.frames, "frame", "frames"), summary.root);
    let sheet = match dataset.layout().has_extra(Extra::ContactSheet) {
        true => format!("Look at: {dir}/contact-sheet.png\n"),
        false => String::new(),
    };
    exit::print(&format!("{dir}: {frames}\nroot {root}\n{sheet}"))
}

fn count(ranges: &[Range<u64>]) -> u64 {
    ranges.iter().map(|range| range.end - range.start).sum()
}

/// The tasks, of `tasks` tasks, that write these shards.
fn of_tasks(shards: &[Range<u64>], tasks: u64) -> Vec<Range<u64>> {
    let of_range =
        |range: &Range<u64>| (range.start..range.end.min(range.start.saturating_add(tasks))).map(|n| n % tasks);
    let numbers: BTreeSet<u64> = shards.iter().flat_map(of_range).collect();
    ranges(&Vec::from_iter(numbers))
}

/// Numbers and ranges in the syntax of `sbatch --array`.
fn listed(ranges: &[Range<u64>]) -> String {
    let text = ranges
        .iter()
        .map(|r| if r.end - r.start == 1 { r.start.to_string() } else { format!("{}-{}", r.start, r.end - 1) });
    text.collect::<Vec<_>>().join(",")
}

pub(crate) fn verify(args: &Verify) -> Result<(), ExitError> {
    #[cfg(feature = "zarr")]
    if papsynth_dataset::slide::SlideSet::is_in(&args.dir) {
        return crate::slide::verify(&args.dir, args.json);
    }
    let (location, frames) = (Location::at(&args.dir)?, args.frames.map(|frames| 0..frames));
    let bar = Bar::on_terminal();
    let count = |progress: VerifyProgress| bar.update(progress.done, progress.total, "shards checked");
    let report = papsynth_dataset::verify_with_progress(&location, frames, &count);
    bar.clear();
    let report = report?;
    let dir = args.dir.display();
    if args.json {
        let text = serde_json::to_string_pretty(&report).unwrap_or_default();
        exit::print(&format!("{text}\n"))?;
    } else if let Some(root) = &report.root {
        let (frames, files) = (counted(report.frames, "frame", "frames"), counted(report.files, "file", "files"));
        exit::print(&format!("{dir}: no problems found, {frames} in {files}\nroot {root}\n"))?;
        if !report.not_generated.is_empty() {
            exit::note(format!("frames that were not generated: {}", listed(&report.not_generated)));
        }
    } else {
        print_findings(&report.findings)?;
    }
    check(&args.dir, &report.findings)
}

pub(crate) fn clean(args: &Clean) -> Result<(), ExitError> {
    let location = Location::at(&args.dir)?;
    let (cleaned, removed) = match args.dry_run {
        true => (papsynth_dataset::cleanable(&location, args.untracked)?, "would remove"),
        false => (papsynth_dataset::clean(&location, args.untracked)?, "removed"),
    };
    let files = cleaned.temporary.iter().chain(&cleaned.untracked);
    let mut text: String = files.map(|path| format!("{removed} {path}\n")).collect();
    let temporary = counted(cleaned.temporary.len() as u64, "temporary file", "temporary files");
    let untracked = counted(cleaned.untracked.len() as u64, "untracked file", "untracked files");
    text.push_str(&format!("{}: {removed} {temporary} and {untracked}\n", args.dir.display()));
    exit::print(&text)?;
    if cleaned.skipped > 0 {
        let files = counted(cleaned.skipped, "file was", "files were");
        exit::note(format!("{files} not removed: in use, of another user, or with a name that is not UTF-8"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_listed_in_the_syntax_of_schedulers() {
        assert_eq!(listed(&[0..1, 2..5, 9..10]), "0,2-4,9");
        assert_eq!(listed(&[]), "");
        assert_eq!(listed(&of_tasks(&[0..1, 12..15, 19..20], 10)), "0,2-4,9");
        assert_eq!(listed(&of_tasks(&[1..2, 7..u64::MAX], 3)), "0-2");
        assert_eq!(count(&[0..1, 2..5]), 4);
    }
}
