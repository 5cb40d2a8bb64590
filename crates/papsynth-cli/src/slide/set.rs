//! Slides as OME-Zarr images.

use std::collections::BTreeSet;
use std::path::Path;

use papsynth::Threads;
use papsynth_dataset::memory::{MemoryEstimate, format_bytes};
use papsynth_dataset::slide::{SlideInfo, SlideProgress, SlideRun, SlideSet};
use papsynth_dataset::{Check, Task};

use crate::args::{SlideFinalize, SlideMake, check_of};
use crate::exit::{self, ExitError};
use crate::findings::{check, print_findings};
use crate::memory::{self, Budget};
use crate::report::Bar;
use crate::setup::Setup;
use crate::words::counted;

pub(super) fn make(mut args: SlideMake) -> Result<(), ExitError> {
    if let Some([width, height]) = args.size {
        let sides = [("width_px", width), ("height_px", height)];
        args.engine.recipe.set.extend(sides.map(|(name, side)| format!("scan.{name}={side}")));
    }
    let mut setup = Setup::load(&args.engine, None)?;
    // clap accepts only valid sizes.
    let shard_px = args.shard_px.parse().unwrap_or(4096);
    setup.threads = fitting(&args, &setup, shard_px)?;
    let seed = args.engine.seed;
    let slide = setup.slide(seed, args.slide)?;
    let task = args.task.task()?;
    let stop = exit::stop_flag()?;
    #[cfg(feature = "parquet")]
    let objects_parquet = !args.no_parquet;
    #[cfg(not(feature = "parquet"))]
    let objects_parquet = false;
    let (recipe, model) = (&setup.recipe.recipe, &setup.model);
    let info = SlideInfo { recipe, model, seed, shard_px, objects_parquet };
    let set = SlideSet::create_or_resume(&args.out, &slide, &info)?;
    let threads = if setup.threads == 1 { Threads::One } else { setup.threads_of_a_frame() };
    let check = check_of(args.verify);
    let run = SlideRun { task, threads, check, stop };
    let bar = Bar::start(args.quiet);
    let stopped = set.generate(&slide, &run, &|progress: SlideProgress| {
        let what = if progress.present { "already present" } else { "written" };
        let objects = counted(progress.objects, "object or part", "objects and parts");
        let name = format!("shard {}: {objects}, {what}", SlideSet::shard_name(progress.shard));
        bar.update(progress.done, progress.total, &name);
    });
    bar.clear();
    if stopped.map_err(|error| setup.error(error))? {
        return Err(ExitError::stopped(format!("stopped; every file in {} is complete", args.out.display())));
    }
    if task == Task::ALL {
        return finish(&set, Check::Sizes, args.quiet);
    }
    if args.quiet {
        return Ok(());
    }
    let (Task { index, total }, out) = (task, args.out.display());
    exit::print(&format!(
        "Task {index} of {total} is done. When all tasks are done, run: papsynth slide finalize {out}\n"
    ))
}

/// The number of threads that fits into memory, each with one frame.
fn fitting(args: &SlideMake, setup: &Setup, shard_px: u32) -> Result<usize, ExitError> {
    let recipe = &setup.recipe.recipe;
    let need = MemoryEstimate::of_slide(recipe, &setup.model, shard_px);
    let fit = memory::fit(&need, setup.threads, (setup.threads, false), args.max_memory, |Budget { bytes, source }| {
        let (frame_px, needed, may) =
            (recipe.scan.frame_px, format_bytes(need.of_one_frame()), format_bytes(bytes as f64));
        let message = format!(
            "a shard of {shard_px} x {shard_px} pixels with frames of {frame_px} x {frame_px} needs about {needed}; \
             {may} may be used ({source})"
        );
        let help = "smaller --shard-px and scan.frame_px need less memory; --max-memory sets another limit";
        ExitError::with_help(message, help)
    });
    Ok(fit?.workers)
}

/// Returns the numbers of the missing shards of a slide, row by row, the number of all shards, and whether it is
/// finalized.
pub(crate) fn progress_of(dir: &Path) -> Result<(Vec<u64>, u64, bool), ExitError> {
    let set = SlideSet::open(dir)?;
    let missing: BTreeSet<[u32; 2]> = set.missing(Check::Sizes)?.into_iter().collect();
    let numbers = (0_u64..).zip(set.all_shards()).filter(|(_, at)| missing.contains(at)).map(|(number, _)| number);
    Ok((numbers.collect(), set.all_shards().count() as u64, missing.is_empty() && set.is_finished()?))
}

pub(super) fn finalize(args: &SlideFinalize) -> Result<(), ExitError> {
    finish(&SlideSet::open(&args.dir)?, check_of(args.verify), false)
}

fn finish(set: &SlideSet, check: Check, quiet: bool) -> Result<(), ExitError> {
    let finished = set.finish(check)?;
    if quiet {
        return Ok(());
    }
    let (shards, megabytes) = (finished.shards, finished.bytes / 1_000_000);
    let objects = counted(finished.objects, "object or part", "objects and parts");
    let (dir, shards, root) = (set.path().display(), counted(shards, "shard", "shards"), finished.root_sha256);
    let look = set.path().join("thumbnail.png");
    exit::print(&format!("{dir}: {shards}, {objects}, {megabytes} MB, root {root}\nLook at: {}\n", look.display()))
}

pub(crate) fn verify(dir: &Path, json: bool) -> Result<(), ExitError> {
    let bar = Bar::on_terminal();
    let set = SlideSet::open(dir)?;
    let findings = set.verify_with_progress(&|progress| bar.update(progress.done, progress.total, "files checked"));
    bar.clear();
    let findings = findings?;
    if json {
        exit::print(&format!("{:#}\n", serde_json::json!({ "findings": findings })))?;
    } else if findings.is_empty() {
        exit::print(&format!("{}: complete, no problems found\n", dir.display()))?;
    } else {
        print_findings(&findings)?;
    }
    check(dir, &findings)
}
