//! Where the time goes, stage by stage.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use crate::words::words;

words! {
    /// A stage of the way from recipe to files. Stages do not overlap.
    pub enum Stage {
        /// Which objects there are, and where.
        Scene = "scene",
        /// Outlines of cells.
        Outlines = "outlines of cells",
        /// Nuclei: outline, chromatin, membrane.
        Nuclei = "nuclei",
        /// Sheets pressed into outlines.
        Sheets = "sheets pressed",
        /// Sheets folded, drawn, wrinkled, stained; with the first of a field the fields that all look their texture up in.
        Cytoplasm = "cytoplasm",
        /// Everything that is no cell.
        Debris = "debris",
        /// Complete masks.
        Masks = "masks",
        /// What comes through the slide, imaged.
        Light = "light",
        /// Light on the sensor, noise, grey levels.
        Camera = "camera",
        /// Fronts and layers, rows of the table.
        Truth = "truth",
        /// Files encoded and written.
        Files = "files",
    }
}

/// Adds up how long the stages take, over all frames and threads.
///
/// The engine has no clock of its own: the caller gives one, such as the time since the program began.
#[derive(Debug)]
pub struct Profile {
    now: fn() -> Duration,
    nanoseconds: [AtomicU64; Stage::ALL.len()],
}

impl Profile {
    /// A profile of nothing yet, by a clock that never runs backwards.
    #[must_use]
    pub fn new(now: fn() -> Duration) -> Self {
        Self { now, nanoseconds: Default::default() }
    }

    /// Does some work, and counts its time to a stage.
    pub fn time<T>(&self, stage: Stage, work: impl FnOnce() -> T) -> T {
        let begun = (self.now)();
        let done = work();
        let spent = (self.now)().saturating_sub(begun).as_nanos();
        self.nanoseconds[stage as usize].fetch_add(u64::try_from(spent).unwrap_or(u64::MAX), Ordering::Relaxed);
        done
    }

    /// What a stage took so far: the sum over all threads.
    #[must_use]
    pub fn spent(&self, stage: Stage) -> Duration {
        Duration::from_nanos(self.nanoseconds[stage as usize].load(Ordering::Relaxed))
    }
}

/// A profile, if anyone wants one.
#[derive(Debug, Clone, Default)]
pub(crate) struct Watch(pub(crate) Option<Arc<Profile>>);

impl Watch {
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
    fn times_add_up_by_stage() {
        static TICKS: AtomicU64 = AtomicU64::new(0);
        let profile = Profile::new(|| Duration::from_millis(TICKS.fetch_add(7, Ordering::Relaxed)));
        assert_eq!(profile.time(Stage::Light, || 3), 3);
        profile.time(Stage::Light, || ());
        profile.time(Stage::Files, || ());
        for stage in Stage::ALL {
            let wanted = match stage {
                Stage::Light => 14,
                Stage::Files => 7,
                _ => 0,
            };
            assert_eq!(profile.spent(stage), Duration::from_millis(wanted), "{}", stage.name());
        }
    }
}
