//! Slides on the disk.

use std::path::Path;

use papsynth::Threads;
use papsynth_dataset::memory::{Need, shown};
use papsynth_dataset::slide::{SlideInfo, SlideProgress, SlideRun, SlideSet};
use papsynth_dataset::{Check, Error, Share};

use super::open;
use crate::args::{SlideFinalize, SlideMake};
use crate::exit::{self, Complaint, Failure};
use crate::interrupt::Interrupt;
use crate::memory;
use crate::report::Bar;
use crate::setup::Setup;
use crate::share;
use crate::verify::MOST;

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
    let slide = open(&setup, seed, args.slide)?;
    let share = match args.share.shard {
        Some(shards) => share::of(shards)?,
        None => Share::ALL,
    };
    let interrupt = Interrupt::watch()?;
    #[cfg(feature = "parquet")]
    let objects_parquet = !args.no_parquet;
    #[cfg(not(feature = "parquet"))]
    let objects_parquet = false;
    let (recipe, model) = (&setup.recipe.recipe, &setup.model);
    let info = SlideInfo { recipe, model, seed, shard_px, objects_parquet };
    let set = SlideSet::create_or_resume(&args.out, &slide, &info)?;
    let threads = if setup.threads == 1 { Threads::One } else { setup.threads_of_a_frame() };
    let check = if args.verify { Check::Hashes } else { Check::Sizes };
    let run = SlideRun { share, threads, check, stop: interrupt.flag() };
    let bar = Bar::start(args.quiet);
    let stopped = set.make(&slide, &run, &|progress: SlideProgress| {
        let [done, all] = progress.done;
        let what = if progress.kept { "was there" } else { "made" };
        bar.say(
            done,
            all,
            &format!("shard {}: {} objects and parts, {what}", SlideSet::name_of(progress.at), progress.objects),
        );
    });
    bar.clear();
    let stopped = stopped.map_err(|error| match error {
        Error::Engine(error) => setup.recipe.refuse(&error),
        other => other.into(),
    })?;
    if stopped {
        let message = format!("stopped; every file in {} is whole", args.out.display());
        return Err(Failure::interrupted(Complaint::new(message).help("run the same command again to make the rest")));
    }
    if share == Share::ALL { close(&set, args.quiet) } else { Ok(()) }
}

/// As many threads as fit, each with a frame of its own.
fn fitting(args: &SlideMake, setup: &Setup, shard_px: u32) -> Result<usize, Failure> {
    let recipe = &setup.recipe.recipe;
    let need = Need::of_slide(recipe, shard_px);
    let budget = memory::budget(args.max_memory);
    let Some(fit) = need.fit(setup.threads, false, budget) else {
        return Err(memory::refuse_slide(&need, recipe, shard_px, budget.unwrap_or_default()));
    };
    if fit.at_once < setup.threads {
        let may = shown(budget.unwrap_or_default() as f64);
        exit::note(&format!("{} of {} threads make frames, so that they fit into {may}", fit.at_once, setup.threads));
    }
    Ok(fit.at_once)
}

/// Numbers of the shards that are missing, row by row, and how many there are in all.
pub(crate) fn missing(dir: &Path) -> Result<(Vec<u64>, u64), Failure> {
    let set = SlideSet::open(dir)?;
    let missing = set.missing(Check::Sizes)?;
    let numbers = (0_u64..).zip(set.all()).filter(|(_, at)| missing.contains(at)).map(|(number, _)| number);
    Ok((numbers.collect(), set.all().count() as u64))
}

pub(super) fn finalize(args: &SlideFinalize) -> Result<(), Failure> {
    close(&SlideSet::open(&args.dir)?, false)
}

fn close(set: &SlideSet, quiet: bool) -> Result<(), Failure> {
    let finished = set.finish()?;
    if quiet {
        return Ok(());
    }
    let megabytes = finished.bytes / 1_000_000;
    exit::print(&format!(
        "{}: {} shards, {} objects and parts of cells, {megabytes} MB, root {}\nLook at: {}\n",
        set.path().display(),
        finished.shards,
        finished.objects,
        finished.root_sha256,
        set.path().join("thumbnail.png").display()
    ))
}

/// `papsynth verify` of a slide.
pub(crate) fn verify(dir: &Path, json: bool) -> Result<(), Failure> {
    let findings = SlideSet::open(dir)?.verify()?;
    let there = dir.display();
    if json {
        let list =
            findings.iter().map(|finding| serde_json::json!({ "path": finding.path, "message": finding.message }));
        exit::print(&format!("{:#}\n", serde_json::json!({ "findings": list.collect::<Vec<_>>() })))?;
    } else if findings.is_empty() {
        exit::print(&format!("{there}: whole\n"))?;
    } else {
        let mut text = String::new();
        for finding in findings.iter().take(MOST) {
            text.push_str(&format!("{}: {}\n", finding.path, finding.message));
        }
        if findings.len() > MOST {
            text.push_str(&format!("and {} more\n", findings.len() - MOST));
        }
        exit::print(&text)?;
    }
    if findings.is_empty() {
        return Ok(());
    }
    let help = if findings.iter().any(|finding| finding.mended_by_making) {
        "the command that made the slide, with --verify, makes again what is wrong"
    } else {
        "remove what does not belong there"
    };
    Err(Failure::input(Complaint::new(format!("{there}: {} things are wrong", findings.len())).help(help)))
}
