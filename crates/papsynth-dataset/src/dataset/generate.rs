//! Making frames: several side by side, skipping those that are whole.

use std::iter::StepBy;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use papsynth::key::Key;
use papsynth::profile::{Profile, Stage};
use papsynth::{Engine, Threads};

use super::set::Dataset;
use crate::bytes::sha256;
use crate::error::Error;
use crate::files::Check;
use crate::truth::FrameSummary;

/// Which frames to make, and how.
#[derive(Debug, Clone)]
pub struct Run<'a> {
    /// Indices of the frames.
    pub frames: Range<u64>,
    /// Which of the shards: all, or every so many.
    pub share: Share,
    /// How many shards are worked on side by side, each on a thread of its own; with 1, all are made on the calling thread.
    pub at_once: usize,
    /// How many threads work on one frame. The bytes are the same.
    pub threads: Threads,
    /// How carefully shards that are there are looked at, before they are kept.
    pub check: Check,
    /// Set to end early: frames that are being made are completed, no other is begun; shards that lack frames are given up.
    pub stop: &'a AtomicBool,
    /// What adds up how long writing takes.
    pub profile: Option<&'a Profile>,
}

/// The shards of one of several runs that share the work: those whose number divided by `of` leaves `index`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Share {
    /// Which, from 0.
    pub index: u64,
    /// Of how many, at least 1.
    pub of: u64,
}

impl Share {
    /// All shards.
    pub const ALL: Self = Self { index: 0, of: 1 };

    /// Those of these numbers that are its own, in order: there may be more of them than fit into memory.
    pub(crate) fn among(self, numbers: Range<u64>) -> StepBy<Range<u64>> {
        let of = self.of.max(1);
        // No number leaves more than it is divided by.
        let end = if self.index < of { numbers.end } else { numbers.start };
        // The first from the start on that leaves `index`.
        let first = numbers.start.saturating_add((self.index % of + of - numbers.start % of) % of);
        (first..end).step_by(usize::try_from(of).unwrap_or(usize::MAX))
    }
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
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Outcome {
    /// Frames that were whole already.
    pub kept: u64,
    /// Frames that were made.
    pub made: u64,
    /// Whether it was stopped before its end.
    pub stopped: bool,
}

impl Dataset {
    /// Makes the shards of a range of frames that are not whole, and reports each frame as it is done, in any order.
    ///
    /// The merged files are not touched: see [`finish`](Self::finish).
    ///
    /// # Errors
    /// If the range begins within a shard; else the first failure of the engine or the system: frames that are being made are
    /// completed, no other is begun.
    pub fn generate(&self, engine: &Engine, run: &Run, report: &(dyn Fn(Progress) + Sync)) -> Result<Outcome, Error> {
        if sha256(engine.recipe().to_toml().as_bytes()) != self.identity.recipe_sha256 {
            let message = "the engine is of another recipe than the data set".to_owned();
            return Err(Error::folder(self.path(), message));
        }
        if let Some(message) = self.layout.refusal_of(&run.frames) {
            return Err(Error::folder(self.path(), message));
        }
        let each = self.layout.frames_per_shard;
        let shards = run.share.among(run.frames.start / each..run.frames.end.div_ceil(each));
        let workers = run.at_once.min(shards.size_hint().0);
        let (shards, outcome) = (Mutex::new(shards), Mutex::new(Ok(Outcome::default())));
        let work = || {
            loop {
                let Some(shard) = locked(&shards).next() else { return };
                if locked(&outcome).is_err() {
                    return;
                }
                let stops = run.stop.load(Ordering::Relaxed);
                let made = if stops { Ok(STOPPED) } else { self.make(engine, shard, run, report) };
                let gave_up = made.as_ref().is_ok_and(|made| made.stopped);
                let mut outcome = locked(&outcome);
                match (&mut *outcome, made) {
                    (Ok(sum), Ok(made)) => {
                        let stopped = sum.stopped || made.stopped;
                        *sum = Outcome { kept: sum.kept + made.kept, made: sum.made + made.made, stopped };
                    }
                    (Ok(_), Err(error)) => *outcome = Err(error),
                    (Err(_), _) => {}
                }
                // There may be more shards than could be gone through.
                if gave_up {
                    return;
                }
            }
        };
        if workers <= 1 {
            work();
        } else {
            std::thread::scope(|scope| (0..workers).for_each(|_| drop(scope.spawn(work))));
        }
        outcome.into_inner().unwrap_or_else(PoisonError::into_inner)
    }

    fn frames_of(&self, shard: u64, run: &Run) -> Range<u64> {
        let room = self.frames_of_shard(shard);
        room.start.max(run.frames.start)..room.end.min(run.frames.end)
    }

    fn make(&self, engine: &Engine, shard: u64, run: &Run, report: &dyn Fn(Progress)) -> Result<Outcome, Error> {
        let frames = self.frames_of(shard, run);
        let count = frames.end.saturating_sub(frames.start);
        if self.whole(shard, run.check)?.is_some_and(|record| record.covers(&frames)) {
            frames.for_each(|index| report(Progress::Kept(index)));
            return Ok(Outcome { kept: count, ..Outcome::default() });
        }
        let mut writer = run.files(|| self.shard_writer(shard))?;
        for index in frames.clone() {
            // A shard may take minutes: it is given up, and made again from its beginning.
            if index > frames.start && run.stop.load(Ordering::Relaxed) {
                return Ok(STOPPED);
            }
            let scene = engine.scene(Key { seed: self.identity.seed, index })?;
            run.files(|| writer.begin(&scene))?;
            let finished =
                engine.image::<Error>(scene, run.threads, |plane| run.files(|| writer.write_plane(plane)))?;
            report(Progress::Made(run.files(|| writer.end(&finished))?));
        }
        run.files(|| writer.commit())?;
        Ok(Outcome { made: count, ..Outcome::default() })
    }
}

/// A shard that was given up, or not begun.
const STOPPED: Outcome = Outcome { kept: 0, made: 0, stopped: true };

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Run<'_> {
    fn files<T>(&self, work: impl FnOnce() -> T) -> T {
        match self.profile {
            Some(profile) => profile.time(Stage::Files, work),
            None => work(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_is_what_leaves_its_number_when_divided() {
        for (start, end) in [(0, 0), (0, 1), (0, 17), (5, 17), (6, 6), (9, 4)] {
            for (index, of) in [(0, 1), (0, 4), (1, 4), (3, 4), (4, 4), (7, 4), (16, 40), (30, 40)] {
                let found: Vec<u64> = Share { index, of }.among(start..end).collect();
                let slow: Vec<u64> = (start..end).filter(|number| number % of == index).collect();
                assert_eq!(found, slow, "{index}/{of} of {start}..{end}");
            }
        }
        assert_eq!(Share::ALL.among(0..u64::MAX).nth(7), Some(7));
    }
}
