//! Time spent in each stage of rendering.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use crate::words::words;

words! {
    /// A stage between recipe and files. Stages do not overlap.
    pub enum Stage {
        /// Drawing of the objects and their positions.
        Scene = "scene",
        /// Outlines of cells.
        Outlines = "outlines of cells",
        /// Nuclei: outline, chromatin, membrane.
        Nuclei = "nuclei",
        /// Simulation of cytoplasm sheets pressed into their outlines.
        Sheets = "sheets",
        /// Folds, wrinkles, texture and stain of cytoplasm; for the first cell of a field also its noise fields.
        Cytoplasm = "cytoplasm",
        /// Objects other than epithelial cells.
        Debris = "debris",
        /// Complete masks.
        Masks = "masks",
        /// Transmission and optics.
        Light = "light",
        /// Blur in the image plane, noise, grey levels.
        Camera = "camera",
        /// Visible masks, overlap counts, rows of the object table.
        Truth = "truth",
        /// Encoding and writing of files.
        Files = "files",
    }
}

/// Adds up the time of each stage over all frames and threads.
///
/// The engine has no clock: the caller provides one, for example the time since program start.
#[derive(Debug)]
pub struct Profile {
    now: fn() -> Duration,
    nanoseconds: [AtomicU64; Stage::ALL.len()],
}

impl Profile {
    /// Creates an empty profile with a monotonic clock.
    #[must_use]
    pub fn new(now: fn() -> Duration) -> Self {
        Self { now, nanoseconds: Default::default() }
    }

    /// Runs a function and adds its time to a stage.
    pub fn time<T>(&self, stage: Stage, work: impl FnOnce() -> T) -> T {
        let start = (self.now)();
        let result = work();
        let spent = (self.now)().saturating_sub(start).as_nanos();
        self.nanoseconds[stage as usize].fetch_add(u64::try_from(spent).unwrap_or(u64::MAX), Ordering::Relaxed);
        result
    }

    /// Returns the time of a stage so far, summed over all threads.
    #[must_use]
    pub fn spent(&self, stage: Stage) -> Duration {
        Duration::from_nanos(self.nanoseconds[stage as usize].load(Ordering::Relaxed))
    }
}

/// Times stages if a profile is set; otherwise only runs them.
#[derive(Debug, Clone, Default)]
pub(crate) struct StageTimer(pub(crate) Option<Arc<Profile>>);

impl StageTimer {
    pub(crate) fn time<T>(&self, stage: Stage, work: impl FnOnce() -> T) -> T {
        match &self.0 {
            Some(profile) => profile.time(stage, work),
            None => work(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_is_added_per_stage() {
        static TICKS: AtomicU64 = AtomicU64::new(0);
        let profile = Profile::new(|| Duration::from_millis(TICKS.fetch_add(7, Ordering::Relaxed)));
        assert_eq!(profile.time(Stage::Light, || 3), 3);
        profile.time(Stage::Light, || ());
        profile.time(Stage::Files, || ());
        for stage in Stage::ALL {
            let expected = match stage {
                Stage::Light => 14,
                Stage::Files => 7,
                _ => 0,
            };
            assert_eq!(profile.spent(stage), Duration::from_millis(expected), "{}", stage.name());
        }
    }
}
