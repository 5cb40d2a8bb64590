//! Making frames: several side by side, skipping those that are whole.

use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

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

/// Shards with the same number of others between them: there may be more of them than numbers fit into memory.
#[derive(Debug, Clone, Copy)]
struct Shards {
    first: u64,
    step: u64,
    count: u64,
}

impl Shards {
    /// A share of these numbers.
    fn of(numbers: Range<u64>, Share { index, of }: Share) -> Self {
        let step = of.max(1);
        // No number leaves more than it is divided by.
        let end = if index < step { numbers.end } else { numbers.start };
        // The first from the start on that leaves `index`.
        let first = numbers.start.saturating_add((index % step + step - numbers.start % step) % step);
        Self { first, step, count: end.saturating_sub(first).div_ceil(step) }
    }

    fn get(&self, place: u64) -> Option<u64> {
        (place < self.count).then(|| self.first + place * self.step)
    }

    fn last(&self) -> Option<u64> {
        self.get(self.count.checked_sub(1)?)
    }
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
        let shards = self.shards_of(run)?;
        let wanted = shards.last().map_or(0, |last| {
            (shards.count - 1) * self.layout.frames_per_shard + range_len(&self.frames_of(last, run))
        });
        let (next, kept, made) = (AtomicU64::new(0), AtomicU64::new(0), AtomicU64::new(0));
        let failure = Mutex::new(None);
        let failed = AtomicBool::new(false);
        let work = || {
            while !run.stop.load(Ordering::Relaxed) && !failed.load(Ordering::Relaxed) {
                let Some(shard) = shards.get(next.fetch_add(1, Ordering::Relaxed)) else { return };
                match self.make(engine, shard, run, report) {
                    Ok(Made::Now(frames)) => made.fetch_add(frames, Ordering::Relaxed),
                    Ok(Made::Before(frames)) => kept.fetch_add(frames, Ordering::Relaxed),
                    Ok(Made::Stopped) => return,
                    Err(error) => {
                        failed.store(true, Ordering::Relaxed);
                        failure.lock().unwrap_or_else(|e| e.into_inner()).get_or_insert(error);
                        return;
                    }
                };
            }
        };
        let workers = run.at_once.min(usize::try_from(shards.count).unwrap_or(usize::MAX));
        if workers <= 1 {
            work();
        } else {
            std::thread::scope(|scope| (0..workers).for_each(|_| drop(scope.spawn(work))));
        }
        if let Some(error) = failure.into_inner().unwrap_or_else(|e| e.into_inner()) {
            return Err(error);
        }
        let (kept, made) = (kept.into_inner(), made.into_inner());
        Ok(Outcome { kept, made, stopped: kept + made < wanted })
    }

    /// The shards that a run makes.
    fn shards_of(&self, run: &Run) -> Result<Shards, Error> {
        let (frames, each) = (&run.frames, self.layout.frames_per_shard);
        if let Some(message) = self.layout.refusal_of(frames) {
            return Err(Error::folder(self.path(), message));
        }
        Ok(Shards::of(frames.start / each..frames.end.div_ceil(each), run.share))
    }

    /// The frames of a shard that a run makes.
    fn frames_of(&self, shard: u64, run: &Run) -> Range<u64> {
        let room = self.frames_of_shard(shard);
        room.start.max(run.frames.start)..room.end.min(run.frames.end)
    }

    fn make(&self, engine: &Engine, shard: u64, run: &Run, report: &dyn Fn(Progress)) -> Result<Made, Error> {
        let frames = self.frames_of(shard, run);
        if self.whole(shard, run.check)?.is_some_and(|record| record.covers(&frames)) {
            frames.clone().for_each(|index| report(Progress::Kept(index)));
            return Ok(Made::Before(range_len(&frames)));
        }
        let mut writer = run.files(|| self.shard_writer(shard))?;
        for index in frames.clone() {
            // A shard may take minutes: it is given up, and made again from its beginning.
            if index > frames.start && run.stop.load(Ordering::Relaxed) {
                return Ok(Made::Stopped);
            }
            let scene = engine.scene(Key { seed: self.identity.seed, index })?;
            run.files(|| writer.begin(&scene))?;
            let finished =
                engine.image::<Error>(scene, run.threads, |plane| run.files(|| writer.write_plane(plane)))?;
            report(Progress::Made(run.files(|| writer.end(&finished))?));
        }
        run.files(|| writer.commit())?;
        Ok(Made::Now(range_len(&frames)))
    }
}

fn range_len(range: &Range<u64>) -> u64 {
    range.end.saturating_sub(range.start)
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

/// Frames of a shard.
enum Made {
    Before(u64),
    Now(u64),
    Stopped,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_is_what_leaves_its_number_when_divided() {
        for (start, end) in [(0, 0), (0, 1), (0, 17), (5, 17), (6, 6), (9, 4)] {
            for (index, of) in [(0, 1), (0, 4), (1, 4), (3, 4), (4, 4), (7, 4), (16, 40), (30, 40)] {
                let shards = Shards::of(start..end, Share { index, of });
                let found: Vec<u64> = (0..).map_while(|place| shards.get(place)).collect();
                let slow: Vec<u64> = (start..end).filter(|number| number % of == index).collect();
                assert_eq!(found, slow, "{index}/{of} of {start}..{end}");
                assert_eq!(shards.last(), slow.last().copied());
            }
        }
        let all = Shards::of(0..u64::MAX, Share::ALL);
        assert_eq!((all.get(7), all.last()), (Some(7), Some(u64::MAX - 1)));
    }
}
