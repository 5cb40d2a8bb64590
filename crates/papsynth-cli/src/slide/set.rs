//! Slides on the disk.

use std::collections::BTreeSet;
use std::path::Path;

use papsynth::Threads;
use papsynth_dataset::memory::{MemoryEstimate, format_bytes};
use papsynth_dataset::slide::{SlideInfo, SlideProgress, SlideRun, SlideSet};
use papsynth_dataset::{Check, Task};

use crate::args::{SlideFinalize, SlideMake, check_of};
use crate::exit::{self, Failure};
use crate::findings::{judge, print_findings};
use crate::memory;
use crate::report::Bar;
use crate::setup::Setup;
use crate::words::counted;

pub(super) fn make(mut args: SlideMake) -> Result<(), Failure> {
    if let Some([width, height]) = args.size {
        let sides = [("width_px", width), ("height_px", height)];
        args.engine.recipe.set.extend(sides.map(|(name, side)| format!("scan.{name}={side}")));
    }
    let mut setup = Setup::load(&args.engine, None)?;
    // One of the sizes that can be typed.
    let shard_px = args.shard_px.parse().unwrap_or(4096);
    setup.threads = fitting(&args, &setup, shard_px)?;
    let seed = args.engine.seed;
    let slide = setup.slide(seed, args.slide)?;
    let share = args.share.share()?;
    let stop = exit::watch()?;
    #[cfg(feature = "parquet")]
    let objects_parquet = !args.no_parquet;
    #[cfg(not(feature = "parquet"))]
    let objects_parquet = false;
    let (recipe, model) = (&setup.recipe.recipe, &setup.model);
    let info = SlideInfo { recipe, model, seed, shard_px, objects_parquet };
    let set = SlideSet::create_or_resume(&args.out, &slide, &info)?;
    let threads = if setup.threads == 1 { Threads::One } else { setup.threads_of_a_frame() };
    let check = check_of(args.verify);
    let run = SlideRun { task: share, threads, check, stop };
    let bar = Bar::start(args.quiet);
    let stopped = set.generate(&slide, &run, &|progress: SlideProgress| {
        let (done, all) = (progress.done, progress.total);
        let what = if progress.present { "was there" } else { "made" };
        bar.say(
            done,
            all,
            &format!("shard {}: {} objects and parts, {what}", SlideSet::shard_name(progress.shard), progress.objects),
        );
    });
    bar.clear();
    if stopped.map_err(|error| setup.failure(error))? {
        let message = format!("stopped; every file in {} is whole", args.out.display());
        return Err(Failure::stopped(message, "make"));
    }
    if share == Task::ALL { close(&set, Check::Sizes, args.quiet) } else { Ok(()) }
}

/// As many threads as fit, each with a frame of its own.
fn fitting(args: &SlideMake, setup: &Setup, shard_px: u32) -> Result<usize, Failure> {
    let recipe = &setup.recipe.recipe;
    let need = MemoryEstimate::of_slide(recipe, shard_px);
    let fit = memory::fit(&need, setup.threads, (setup.threads, false), args.max_memory, |budget| {
        let (frame_px, needed, may) =
            (recipe.scan.frame_px, format_bytes(need.of_one_frame()), format_bytes(budget as f64));
        let sides = format!("shards of {shard_px} pixels a side with frames of {frame_px}");
        let message = format!("{sides} need about {needed}; {may} may be used");
        let help = "--shard-px 2048 or less, or a smaller scan.frame_px, needs less; --max-memory allows more";
        Failure::wrong(message, help)
    });
    Ok(fit?.workers)
}

/// Numbers of the shards of a slide that are missing, row by row, how many there are in all, and whether it was closed.
pub(crate) fn there(dir: &Path) -> Result<(Vec<u64>, u64, bool), Failure> {
    let set = SlideSet::open(dir)?;
    let missing: BTreeSet<[u32; 2]> = set.missing(Check::Sizes)?.into_iter().collect();
    let numbers = (0_u64..).zip(set.all_shards()).filter(|(_, at)| missing.contains(at)).map(|(number, _)| number);
    Ok((numbers.collect(), set.all_shards().count() as u64, missing.is_empty() && set.is_finished()?))
}

pub(super) fn finalize(args: &SlideFinalize) -> Result<(), Failure> {
    close(&SlideSet::open(&args.dir)?, check_of(args.verify), false)
}

fn close(set: &SlideSet, check: Check, quiet: bool) -> Result<(), Failure> {
    let finished = set.finish(check)?;
    if quiet {
        return Ok(());
    }
    let (shards, objects, megabytes) = (finished.shards, finished.objects, finished.bytes / 1_000_000);
    let (dir, shards, root) = (set.path().display(), counted(shards, "shard", "shards"), finished.root_sha256);
    let look = set.path().join("thumbnail.png");
    exit::print(&format!(
        "{dir}: {shards}, {objects} objects and parts of cells, {megabytes} MB, root {root}\nLook at: {}\n",
        look.display()
    ))
}

pub(crate) fn verify(dir: &Path, json: bool) -> Result<(), Failure> {
    let findings = SlideSet::open(dir)?.verify()?;
    if json {
        exit::print(&format!("{:#}\n", serde_json::json!({ "findings": findings })))?;
    } else if findings.is_empty() {
        exit::print(&format!("{}: whole\n", dir.display()))?;
    } else {
        print_findings(&findings)?;
    }
    judge(dir, &findings)
}
