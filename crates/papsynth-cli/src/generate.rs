//! `papsynth generate`: frames with ground truth, and the time of each stage.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use papsynth::Threads;
use papsynth::key::Key;
use papsynth::profile::{Profile, Stage};
use papsynth_dataset::memory::{MemoryEstimate, MemoryPlan};
use papsynth_dataset::{Dataset, Error, Format, FrameSummary, Layout, Location, Progress as Step, Run, Task};
use serde_json::json;

use crate::args::{Generate, LayoutArgs, check_of};
use crate::exit::{self, ErrorReport, ExitError};
use crate::memory::{self, Budget};
use crate::report::{self, Progress};
use crate::setup::Setup;
use crate::words::counted;

pub(crate) fn run(args: &Generate) -> Result<(), ExitError> {
    let timing = args.profile.then(Timing::start);
    let profile = timing.as_ref().map(|timing| timing.profile.clone());
    let home = Location::at(&args.out)?;
    let setup = Setup::load(&args.engine, profile.clone())?;
    let seed = args.engine.seed;
    let frames = args.indices();
    let count = frames.end - frames.start;
    // A damaged manifest is reported, or repaired, by `create_or_resume`.
    let existing = Dataset::open(&home).ok();
    let (layout, chosen) = args.layout.layout_in(existing.as_ref().map(Dataset::layout), frames.end);
    if let Some(message) = layout.refusal_of(&frames).or_else(|| layout.refusal()) {
        return Err(ExitError::input(message));
    }
    let task = args.task.task()?;
    // One frame per thread is fastest; threads share a frame only if there are fewer shards than threads.
    let shards = count.div_ceil(layout.frames_per_shard).div_ceil(task.total);
    let few = usize::try_from(shards).ok().filter(|shards| *shards < setup.threads);
    let fit = fit(args, &setup, few, &layout)?;
    // Errors in the scene are reported before any file is written.
    setup.engine.scene(Key { seed, index: frames.start }).map_err(|error| setup.recipe.error(&error))?;

    if chosen {
        let limit = LayoutArgs::MAX_IN_FOLDERS;
        exit::note(format!(
            "more than {limit} frames are written as webdataset, in tar files; --format folder writes single files"
        ));
    }
    let stop = exit::stop_flag()?;
    let dataset = Dataset::create_or_resume(&home, &setup.info(seed, &layout))?;
    let workers = fit.workers;
    let (threads, working) = match fit.shared {
        true => (setup.threads_of_a_frame(), setup.threads),
        false => (Threads::One, workers),
    };
    let progress = Progress::start(args, frames_of(task, &frames, layout.frames_per_shard), working, fit.bytes)?;
    let check = check_of(args.verify);
    let end = frames.end;
    let run = Run { frames, task, workers, threads, check, stop, profile: profile.as_deref() };
    let step = |step: Step| {
        timing.iter().for_each(|timing| timing.step(step));
        progress.step(step);
    };
    let outcome = dataset.generate(&setup.engine, &run, &step);
    progress.clear();
    let outcome = outcome.map_err(|error| setup.error(error))?;
    if outcome.stopped {
        let complete = counted(outcome.present + outcome.written, "complete frame", "complete frames");
        let message = format!("stopped with {complete}; every file in {} is complete", args.out.display());
        return Err(ExitError::stopped(message));
    }
    // A complete data set is not written again, so that it may lie on a read-only disk.
    // `papsynth merge` finishes the data set of several tasks.
    if task == Task::ALL && (outcome.written > 0 || args.verify || !dataset.is_finished()?) {
        let summary = dataset.finish().map_err(|error| damaged(&error))?;
        if !args.quiet && [Format::YoloSeg, Format::Huggingface].into_iter().any(|format| layout.has(format)) {
            note_empty_splits(&summary.empty_splits);
        }
    }
    progress.done(&outcome, task, end)?;
    match timing {
        Some(timing) if args.json => report::event(&timing.event(setup.threads)),
        Some(timing) => exit::print(&timing.table(setup.threads)),
        None => Ok(()),
    }
}

/// Prints which splits by slide have no frames.
fn note_empty_splits(empty: &[String]) {
    if !empty.is_empty() {
        let names = empty.join(" and ");
        let are = if empty.len() == 1 { format!("the split {names} is") } else { format!("the splits {names} are") };
        exit::note(format!("{are} empty; for splits by slide, generate more frames or set slide.fields_per_slide = 1"));
    }
}

/// The number of frames of a task, of shards with `each` frames.
fn frames_of(task: Task, frames: &Range<u64>, each: u64) -> u64 {
    let (first, last) = (frames.start / each, frames.end.div_ceil(each));
    let below = |shard: u64| shard / task.total + u64::from(shard % task.total > task.index);
    let is_last = last > first && (last - 1) % task.total == task.index;
    let missing = if is_last { last.saturating_mul(each).saturating_sub(frames.end) } else { 0 };
    (below(last) - below(first)).saturating_mul(each).saturating_sub(missing)
}

/// The parallelism that fits into memory. `few` is the number of shards if it is below the number of threads.
fn fit(args: &Generate, setup: &Setup, few: Option<usize>, layout: &Layout) -> Result<MemoryPlan, ExitError> {
    let recipe = &setup.recipe.recipe;
    let need = MemoryEstimate::of(recipe, &setup.model, layout);
    let wanted = (few.map_or(setup.threads, |_| 1), few.is_some() && setup.threads > 1);
    memory::fit(&need, setup.threads, wanted, args.max_memory, |Budget { bytes, source }| {
        let help = "smaller fields, fewer cells, one plane, monochrome light and less oversampling need less memory; \
                    --max-memory sets another limit, for example 2GiB";
        ExitError::with_help(format!("{} ({source})", need.too_large(recipe, bytes)), help)
    })
}

/// A file of the right size that cannot be read.
fn damaged(error: &Error) -> ExitError {
    let help = "a frame is damaged: run the same command with --verify to check all files and repair such frames";
    ExitError::new(error.is_io(), ErrorReport::new(error).help(help))
}

/// Time and size of the frames of a run.
#[derive(Debug)]
struct Timing {
    profile: Arc<Profile>,
    begun: Duration,
    frames: AtomicU64,
    pixels: AtomicU64,
    objects: AtomicU64,
}

/// Time since the first call.
#[expect(clippy::disallowed_methods, reason = "the time is shown and reaches no image")]
pub(crate) fn now() -> Duration {
    static BEGUN: OnceLock<Instant> = OnceLock::new();
    BEGUN.get_or_init(Instant::now).elapsed()
}

impl Timing {
    fn start() -> Self {
        let profile = Arc::new(Profile::new(now));
        let zero = AtomicU64::default;
        Self { profile, begun: now(), frames: zero(), pixels: zero(), objects: zero() }
    }

    /// Counts a frame.
    fn step(&self, step: Step) {
        let Step::Written(FrameSummary { width, height, channels, planes_um, objects, .. }) = step else { return };
        let add = |sum: &AtomicU64, value: u64| sum.fetch_add(value, Ordering::Relaxed);
        add(&self.frames, 1);
        add(&self.pixels, (width * height * channels * planes_um.len()) as u64);
        add(&self.objects, objects.values().sum());
    }

    fn rates(&self) -> [f64; 3] {
        let seconds = now().saturating_sub(self.begun).as_secs_f64().max(1e-9);
        [&self.frames, &self.pixels, &self.objects].map(|sum| sum.load(Ordering::Relaxed) as f64 / seconds)
    }

    fn ms_per_frame(&self, stage: Stage) -> f64 {
        self.profile.spent(stage).as_secs_f64() * 1e3 / self.frames.load(Ordering::Relaxed).max(1) as f64
    }

    fn table(&self, threads: usize) -> String {
        let rows = Stage::ALL.map(|stage| (stage.name(), self.ms_per_frame(stage)));
        let all: f64 = rows.iter().map(|row| row.1).sum();
        let mut text = format!("{:<20}{:>14}{:>10}\n", "stage", "ms per frame", "fraction");
        for (name, spent) in rows.into_iter().chain([("all stages", all)]) {
            text.push_str(&format!("{name:<20}{spent:>14.2}{:>8.1} %\n", 100.0 * spent / all.max(1e-9)));
        }
        let [frames, pixels, objects] = self.rates();
        let threads = counted(threads as u64, "thread", "threads");
        text.push_str(&format!(
            "per second on {threads}: {frames:.1} frames, {:.1} million pixels, {objects:.0} objects and parts\n",
            pixels / 1e6
        ));
        text
    }

    fn event(&self, threads: usize) -> serde_json::Value {
        let stages = Stage::ALL.map(|stage| json!({ "stage": stage.name(), "ms_per_frame": self.ms_per_frame(stage) }));
        let [frames, pixels, objects] = self.rates();
        json!({
            "event": "profile", "threads": threads, "stages": stages,
            "frames_per_s": frames, "pixels_per_s": pixels, "objects_per_s": objects,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_frames_of_all_tasks_are_all_frames() {
        for (frames, each, total) in [(0..7, 2, 4), (0..7, 2, 1), (4..9, 2, 3), (0..5, 1, 2), (0..3, 256, 4)] {
            let of = |index| frames_of(Task { index, total }, &frames, each);
            assert_eq!((0..total).map(of).sum::<u64>(), frames.end - frames.start, "{frames:?} {each} {total}");
        }
        assert_eq!(frames_of(Task { index: 3, total: 4 }, &(0..7), 2), 1);
    }
}
