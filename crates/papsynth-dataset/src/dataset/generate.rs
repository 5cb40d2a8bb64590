//! Generation of frames, several at once, except those that are complete.

use std::iter::StepBy;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::Builder;

use papsynth::key::Key;
use papsynth::profile::{Profile, Stage};
use papsynth::{Engine, Threads};

use super::set::Dataset;
use crate::bytes::sha256;
use crate::error::Error;
use crate::files::Check;
use crate::truth::FrameSummary;

/// Options of [`Dataset::generate`].
#[derive(Debug, Clone)]
pub struct Run<'a> {
    /// Indices of the frames.
    pub frames: Range<u64>,
    /// The part of the shards to generate.
    pub task: Task,
    /// Number of shards at once, each on one thread. With 1, the calling thread generates all.
    pub workers: usize,
    /// Number of threads for one frame. It does not change the output.
    pub threads: Threads,
    /// The check of shards that are already present.
    pub check: Check,
    /// Set it to stop early: frames in work are completed, unfinished shards are discarded.
    pub stop: &'a AtomicBool,
    /// Accumulates the time of writing.
    pub profile: Option<&'a Profile>,
}

/// One of several tasks that generate a data set together: the shards whose number modulo `total` is `index`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Task {
    /// Number of the task, from 0.
    pub index: u64,
    /// Number of tasks, at least 1.
    pub total: u64,
}

impl Task {
    /// The only task: all shards.
    pub const ALL: Self = Self { index: 0, total: 1 };

    /// Returns the numbers in a range that belong to the task, in order.
    pub(crate) fn select(self, numbers: Range<u64>) -> StepBy<Range<u64>> {
        let total = self.total.max(1);
        // A remainder is below `total`: tasks beyond it are empty.
        let end = if self.index < total { numbers.end } else { numbers.start };
        let first = numbers.start.saturating_add((self.index % total + total - numbers.start % total) % total);
        (first..end).step_by(usize::try_from(total).unwrap_or(usize::MAX))
    }
}

/// Progress of a run: one frame is done.
#[derive(Debug, Clone, Copy)]
pub enum Progress<'a> {
    /// The frame with this index was already present.
    Present(u64),
    /// The frame was written.
    Written(&'a FrameSummary),
}

/// The result of a run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Outcome {
    /// Number of frames that were already present.
    pub present: u64,
    /// Number of frames that were written.
    pub written: u64,
    /// Whether it was stopped before its end.
    pub stopped: bool,
}

impl Dataset {
    /// Generates the incomplete shards of a range of frames. Calls `report` after each frame, in any order.
    ///
    /// The merged files are not changed: see [`finish`](Self::finish).
    ///
    /// # Errors
    /// If the range begins inside a shard, the engine has another recipe, the engine fails, or a file cannot be
    /// written. After an error, frames in work are completed and no other frame is started.
    pub fn generate(&self, engine: &Engine, run: &Run, report: &(dyn Fn(Progress) + Sync)) -> Result<Outcome, Error> {
        if sha256(engine.recipe().to_toml().as_bytes()) != self.identity.recipe_sha256 {
            return Err(Error::folder(self.path(), "the recipe of the engine is not that of the data set"));
        }
        if let Some(message) = self.layout.refusal_of(&run.frames) {
            return Err(Error::folder(self.path(), message));
        }
        let each = self.layout.frames_per_shard;
        let shards = run.task.select(run.frames.start / each..run.frames.end.div_ceil(each));
        let workers = run.workers.min(shards.size_hint().0);
        let (shards, outcome) = (Mutex::new(shards), Mutex::new(Ok(Outcome::default())));
        let work = || {
            loop {
                let Some(shard) = locked(&shards).next() else { return };
                if locked(&outcome).is_err() {
                    return;
                }
                let stops = run.stop.load(Ordering::Relaxed);
                let done = if stops { Ok(STOPPED) } else { self.generate_shard(engine, shard, run, report) };
                let is_stopped = done.as_ref().is_ok_and(|done| done.stopped);
                let mut outcome = locked(&outcome);
                match (&mut *outcome, done) {
                    (Ok(sum), Ok(done)) => {
                        let stopped = sum.stopped || done.stopped;
                        *sum = Outcome {
                            present: sum.present + done.present,
                            written: sum.written + done.written,
                            stopped,
                        };
                    }
                    (Ok(_), Err(error)) => *outcome = Err(error),
                    (Err(_), _) => {}
                }
                // Skipping the remaining shards one by one could take long.
                if is_stopped {
                    return;
                }
            }
        };
        std::thread::scope(|scope| {
            for _ in 1..workers {
                // Threads that the system does not start are not needed: the others do the work.
                if Builder::new().spawn_scoped(scope, work).is_err() {
                    break;
                }
            }
            work();
        });
        outcome.into_inner().unwrap_or_else(PoisonError::into_inner)
    }

    fn frames_of(&self, shard: u64, run: &Run) -> Range<u64> {
        let own = self.frames_of_shard(shard);
        own.start.max(run.frames.start)..own.end.min(run.frames.end)
    }

    fn generate_shard(
        &self,
        engine: &Engine,
        shard: u64,
        run: &Run,
        report: &dyn Fn(Progress),
    ) -> Result<Outcome, Error> {
        let frames = self.frames_of(shard, run);
        let count = frames.end.saturating_sub(frames.start);
        if self.complete_record(shard, run.check)?.is_some_and(|record| record.covers(&frames)) {
            frames.for_each(|index| report(Progress::Present(index)));
            return Ok(Outcome { present: count, ..Outcome::default() });
        }
        let mut writer = run.files(|| self.shard_writer(shard))?;
        for index in frames.clone() {
            // A shard may take minutes, so it is discarded.
            if index > frames.start && run.stop.load(Ordering::Relaxed) {
                return Ok(STOPPED);
            }
            let scene = engine.scene(Key { seed: self.identity.seed, index })?;
            run.files(|| writer.begin(&scene))?;
            let finished =
                engine.image::<Error>(scene, run.threads, |plane| run.files(|| writer.write_plane(plane)))?;
            report(Progress::Written(run.files(|| writer.end(&finished))?));
        }
        run.files(|| writer.commit())?;
        Ok(Outcome { written: count, ..Outcome::default() })
    }
}

/// The outcome of a shard that was discarded or not started.
const STOPPED: Outcome = Outcome { present: 0, written: 0, stopped: true };

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Run<'_> {
    /// Adds the time of `work` to the profile.
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
    fn a_task_contains_the_numbers_with_its_remainder() {
        for (start, end) in [(0, 0), (0, 1), (0, 17), (5, 17), (6, 6), (9, 4)] {
            for (index, total) in [(0, 1), (0, 4), (1, 4), (3, 4), (4, 4), (7, 4), (16, 40), (30, 40)] {
                let found: Vec<u64> = Task { index, total }.select(start..end).collect();
                let slow: Vec<u64> = (start..end).filter(|number| number % total == index).collect();
                assert_eq!(found, slow, "{index}/{total} of {start}..{end}");
            }
        }
        assert_eq!(Task::ALL.select(0..u64::MAX).nth(7), Some(7));
    }
}
