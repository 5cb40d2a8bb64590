//! `papsynth generate`: frames and their truth, and where the time went.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use papsynth::Threads;
use papsynth::key::Key;
use papsynth::profile::{Profile, Stage};
use papsynth_dataset::memory::{Fit, Need};
use papsynth_dataset::{Dataset, Error, Format, FrameSummary, Home, Layout, Progress as Step, Run, Share};
use serde_json::json;

use crate::args::{Generate, LayoutArgs, check_of};
use crate::exit::{self, Complaint, Failure};
use crate::memory;
use crate::report::{self, Progress};
use crate::setup::Setup;

pub(crate) fn run(args: &Generate) -> Result<(), Failure> {
    let account = args.profile.then(Account::open);
    let profile = account.as_ref().map(|account| account.profile.clone());
    let home = Home::at(&args.out)?;
    let setup = Setup::load(&args.engine, profile.clone())?;
    let seed = args.engine.seed;
    let frames = args.indices();
    let count = frames.end - frames.start;
    let (layout, chosen) = args.layout.layout(frames.end);
    if let Some(message) = layout.refusal_of(&frames) {
        return Err(Failure::input(message));
    }
    let share = args.share.share()?;
    // Whole frames side by side keep every thread busy to the end; only where there are too few do threads share one.
    let shards = count.div_ceil(layout.frames_per_shard).div_ceil(share.of);
    let few = usize::try_from(shards).ok().filter(|shards| *shards < setup.threads);
    let fit = fit(args, &setup, few, &layout)?;
    // A slide that cannot be drawn is found out before anything is written.
    setup.engine.scene(Key { seed, index: frames.start }).map_err(|error| setup.recipe.refuse(&error))?;

    if chosen && !args.quiet {
        let most = LayoutArgs::MOST_IN_FOLDERS;
        exit::note(format!(
            "more than {most} frames are written as webdataset, in tar files; --format folder forces single files"
        ));
    }
    let stop = exit::watch()?;
    let dataset = Dataset::create_or_resume(&home, &setup.info(seed, &layout))?;
    let at_once = fit.at_once;
    let (threads, working) = match fit.shared {
        true => (setup.threads_of_a_frame(), setup.threads),
        false => (Threads::One, at_once),
    };
    let progress = Progress::start(args, count, working, fit.bytes)?;
    let check = check_of(args.verify);
    let run = Run { frames, share, at_once, threads, check, stop, profile: profile.as_deref() };
    let step = |step: Step| {
        account.iter().for_each(|account| account.step(step));
        progress.step(step);
    };
    let outcome = dataset.generate(&setup.engine, &run, &step);
    progress.clear();
    let outcome = outcome.map_err(|error| setup.failure(error))?;
    if outcome.stopped {
        let whole = outcome.kept + outcome.made;
        let message = format!("stopped with {whole} frames whole; every file in {} is whole", args.out.display());
        return Err(Failure::stopped(message, "make"));
    }
    // What is whole is left alone, which a disk that cannot be written allows too.
    // What others are still making is merged by whoever comes last.
    if share == Share::ALL && (outcome.made > 0 || args.verify || !dataset.is_finished()?) {
        let summary = dataset.finish().map_err(|error| damaged(&error))?;
        if !args.quiet && [Format::YoloSeg, Format::Huggingface].into_iter().any(|format| layout.has(format)) {
            note_empty_splits(&summary.empty_splits);
        }
    }
    progress.done(&outcome, share)?;
    match account {
        Some(account) if args.json => report::event(&account.event(setup.threads)),
        Some(account) => exit::print(&account.table(setup.threads)),
        None => Ok(()),
    }
}

/// Prints which splits by slide have no frames.
fn note_empty_splits(empty: &[String]) {
    if !empty.is_empty() {
        exit::note(format!(
            "no slide is in the split {}; for splits by slide, generate more frames or set slide.fields_per_slide = 1",
            empty.join(" and ")
        ));
    }
}

/// How the run goes with the memory that it may use; of `few` shards, if there are fewer than threads.
fn fit(args: &Generate, setup: &Setup, few: Option<usize>, layout: &Layout) -> Result<Fit, Failure> {
    let recipe = &setup.recipe.recipe;
    let need = Need::of(recipe, layout);
    let wanted = (few.map_or(setup.threads, |_| 1), few.is_some() && setup.threads > 1);
    memory::fit(&need, setup.threads, wanted, args.max_memory, |budget| {
        let source = if args.max_memory.is_some() { "--max-memory" } else { "80 % of what is available" };
        let help = "smaller fields, fewer cells, one plane, grey light and less oversampling need less; \
                    --max-memory allows more";
        Failure::wrong(format!("{} ({source})", need.too_large(recipe, budget)), help)
    })
}

/// A frame of the right size that cannot be read.
fn damaged(error: &Error) -> Failure {
    let help = "a frame is damaged: the same command with --verify reads all files and makes such frames again";
    Failure::new(error.is_io(), Complaint::new(error).help(help))
}

/// What a run made, and how long it took.
#[derive(Debug)]
struct Account {
    profile: Arc<Profile>,
    begun: Duration,
    frames: AtomicU64,
    pixels: AtomicU64,
    objects: AtomicU64,
}

/// Time since this was first asked for.
#[expect(clippy::disallowed_methods, reason = "how long something took is what is asked for; it reaches no image")]
fn now() -> Duration {
    static BEGUN: OnceLock<Instant> = OnceLock::new();
    BEGUN.get_or_init(Instant::now).elapsed()
}

impl Account {
    fn open() -> Self {
        let profile = Arc::new(Profile::new(now));
        let zero = AtomicU64::default;
        Self { profile, begun: now(), frames: zero(), pixels: zero(), objects: zero() }
    }

    /// A frame is done, or was there.
    fn step(&self, step: Step) {
        let Step::Made(FrameSummary { width, height, channels, planes_um, objects, .. }) = step else { return };
        let add = |sum: &AtomicU64, value: u64| sum.fetch_add(value, Ordering::Relaxed);
        add(&self.frames, 1);
        add(&self.pixels, (width * height * channels * planes_um.len()) as u64);
        add(&self.objects, objects.values().sum());
    }

    fn rates(&self) -> [f64; 3] {
        let seconds = now().saturating_sub(self.begun).as_secs_f64().max(1e-9);
        [&self.frames, &self.pixels, &self.objects].map(|sum| sum.load(Ordering::Relaxed) as f64 / seconds)
    }

    fn milliseconds_a_frame(&self, stage: Stage) -> f64 {
        self.profile.spent(stage).as_secs_f64() * 1e3 / self.frames.load(Ordering::Relaxed).max(1) as f64
    }

    fn table(&self, threads: usize) -> String {
        let rows = Stage::ALL.map(|stage| (stage.name(), self.milliseconds_a_frame(stage)));
        let all: f64 = rows.iter().map(|row| row.1).sum();
        let mut text = format!("{:<20}{:>12}{:>8}\n", "stage", "ms a frame", "share");
        for (name, spent) in rows.into_iter().chain([("all stages", all)]) {
            text.push_str(&format!("{name:<20}{spent:>12.2}{:>6.1} %\n", 100.0 * spent / all.max(1e-9)));
        }
        let [frames, pixels, objects] = self.rates();
        let s = if threads == 1 { "" } else { "s" };
        text.push_str(&format!(
            "{frames:.1} frames a second on {threads} thread{s}: {:.1} million pixels, {objects:.0} objects and parts a second\n",
            pixels / 1e6
        ));
        text
    }

    fn event(&self, threads: usize) -> serde_json::Value {
        let stages =
            Stage::ALL.map(|stage| json!({ "stage": stage.name(), "ms_a_frame": self.milliseconds_a_frame(stage) }));
        let [frames, pixels, objects] = self.rates();
        json!({
            "event": "profile", "threads": threads, "stages": stages,
            "frames_per_s": frames, "pixels_per_s": pixels, "objects_per_s": objects,
        })
    }
}
