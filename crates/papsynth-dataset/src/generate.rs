//! Making frames: several side by side, skipping those that are whole.

use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use papsynth::key::Key;
use papsynth::profile::{Profile, Stage};
use papsynth::{Engine, Threads};

use crate::dataset::Dataset;
use crate::error::Error;
use crate::files::sha256;
use crate::record::{Check, FrameSummary};

/// Which frames to make, and how.
#[derive(Debug, Clone)]
pub struct Run<'a> {
    /// Indices of the frames.
    pub frames: Range<u64>,
    /// How many frames are worked on side by side, each on a thread of its own; with 1, all are made on the calling thread.
    pub at_once: usize,
    /// How many threads work on one frame. The bytes are the same.
    pub threads: Threads,
    /// How carefully frames that are there are looked at, before they are kept.
    pub check: Check,
    /// Set to end early: frames that are being made are completed, no other is begun.
    pub stop: &'a AtomicBool,
    /// What adds up how long writing takes.
    pub profile: Option<&'a Profile>,
}

/// A frame is done.
#[derive(Debug, Clone, Copy)]
pub enum Progress<'a> {
    /// It was whole already and is left untouched.
    Kept(u64),
    /// It was made.
    Made(&'a FrameSummary),
}

/// What a run did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Outcome {
    /// Frames that were whole already.
    pub kept: u64,
    /// Frames that were made.
    pub made: u64,
    /// Whether it was stopped before its end.
    pub stopped: bool,
}

impl Dataset {
    /// Makes the frames of a range that are not whole, and reports each as it is done, in any order.
    ///
    /// The merged files are not touched: see [`finish`](Self::finish).
    ///
    /// # Errors
    /// The first failure of the engine or the system; frames that are being made are completed, no other is begun.
    pub fn generate(&self, engine: &Engine, run: &Run, report: &(dyn Fn(Progress) + Sync)) -> Result<Outcome, Error> {
        if sha256(engine.recipe().to_toml().as_bytes()) != self.identity.recipe_sha256 {
            let message = "the engine is of another recipe than the data set".to_owned();
            return Err(Error::Folder { path: self.path().to_owned(), message });
        }
        let count = run.frames.end.saturating_sub(run.frames.start);
        let (begun, kept, made) = (AtomicU64::new(0), AtomicU64::new(0), AtomicU64::new(0));
        let failure = Mutex::new(None);
        let failed = AtomicBool::new(false);
        let work = || {
            while !run.stop.load(Ordering::Relaxed) && !failed.load(Ordering::Relaxed) {
                let number = begun.fetch_add(1, Ordering::Relaxed);
                if number >= count {
                    return;
                }
                match self.make(engine, run.frames.start + number, run, report) {
                    Ok(Made::Now) => made.fetch_add(1, Ordering::Relaxed),
                    Ok(Made::Before) => kept.fetch_add(1, Ordering::Relaxed),
                    Err(error) => {
                        failed.store(true, Ordering::Relaxed);
                        failure.lock().unwrap_or_else(|e| e.into_inner()).get_or_insert(error);
                        return;
                    }
                };
            }
        };
        let workers = run.at_once.min(usize::try_from(count).unwrap_or(usize::MAX));
        if workers <= 1 {
            work();
        } else {
            std::thread::scope(|scope| (0..workers).for_each(|_| drop(scope.spawn(work))));
        }
        if let Some(error) = failure.into_inner().unwrap_or_else(|e| e.into_inner()) {
            return Err(error);
        }
        let (kept, made) = (kept.into_inner(), made.into_inner());
        Ok(Outcome { kept, made, stopped: kept + made < count })
    }

    fn make(&self, engine: &Engine, index: u64, run: &Run, report: &dyn Fn(Progress)) -> Result<Made, Error> {
        if self.is_whole(index, run.check)? {
            report(Progress::Kept(index));
            return Ok(Made::Before);
        }
        let key = Key { seed: self.identity.seed, index };
        let scene = engine.scene(key)?;
        let mut writer = run.files(|| self.frame_writer(&scene))?;
        let finished = engine.image::<Error>(scene, run.threads, |plane| run.files(|| writer.write_plane(plane)))?;
        report(Progress::Made(&run.files(|| writer.finish(&finished))?));
        Ok(Made::Now)
    }
}

impl Run<'_> {
    /// Counts the time of some work to the files.
    fn files<T>(&self, work: impl FnOnce() -> T) -> T {
        match self.profile {
            Some(profile) => profile.time(Stage::Files, work),
            None => work(),
        }
    }
}

enum Made {
    Before,
    Now,
}
