//! Progress of long functions, and the flag that stops them.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use crate::error::Error;

/// Progress of a long function: `done` of `total` steps of a phase are complete.
///
/// The steps of a phase take about the same time, so the phase needs another `elapsed * (total - done) / done`. Threads
/// may report steps out of order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress<'a> {
    /// Name of the phase, to print before the numbers: "measuring fields", "classifying nuclei", ….
    pub phase: &'a str,
    /// Completed steps.
    pub done: usize,
    /// Steps of the phase.
    pub total: usize,
}

/// A stop flag and a progress callback for a long function.
///
/// ```
/// use std::sync::atomic::AtomicBool;
/// use papsynth_judge::{Control, Progress};
///
/// let stop = AtomicBool::new(false);
/// let print = |p: Progress| eprintln!("{}: {} of {}", p.phase, p.done, p.total);
/// let control = Control { stop: &stop, report: &print };
/// assert!(!control.is_stopped());
/// ```
#[derive(Clone, Copy)]
pub struct Control<'a> {
    /// Set it to end the function early: it then returns [`Error::Stopped`].
    pub stop: &'a AtomicBool,
    /// Receives each completed step, on any thread.
    pub report: &'a (dyn Fn(Progress) + Sync),
}

static NEVER: AtomicBool = AtomicBool::new(false);

impl Control<'static> {
    /// No progress reports, and no stop.
    pub const NONE: Self = Self { stop: &NEVER, report: &|_| () };
}

impl<'a> Control<'a> {
    /// Returns the same stop flag without progress reports.
    #[must_use]
    pub fn silent(&self) -> Control<'a> {
        Control { stop: self.stop, report: &|_| () }
    }

    /// Returns whether the stop flag is set.
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Checks the stop flag.
    ///
    /// # Errors
    /// [`Error::Stopped`] if it is set.
    pub fn check(&self) -> Result<(), Error> {
        if self.is_stopped() { Err(Error::Stopped) } else { Ok(()) }
    }

    /// Begins a phase.
    #[must_use]
    pub fn phase<'p>(&'p self, name: &'p str, total: usize) -> Phase<'p> {
        self.resume(name, 0, total)
    }

    /// Continues the count of a phase under another name, with `done` completed steps.
    #[must_use]
    pub fn resume<'p>(&'p self, name: &'p str, done: usize, total: usize) -> Phase<'p> {
        Phase { control: self, name, total, done: AtomicUsize::new(done) }
    }
}

impl std::fmt::Debug for Control<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.debug_struct("Control").field("stop", self.stop).finish_non_exhaustive()
    }
}

/// Counts the completed steps of a phase.
pub struct Phase<'a> {
    control: &'a Control<'a>,
    name: &'a str,
    total: usize,
    done: AtomicUsize,
}

impl Phase<'_> {
    /// Reports one more completed step, and checks the stop flag.
    ///
    /// # Errors
    /// [`Error::Stopped`] if it is set.
    pub fn step(&self) -> Result<(), Error> {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        (self.control.report)(Progress { phase: self.name, done, total: self.total.max(done) });
        self.check()
    }

    /// Returns the stop flag and the callback of the phase.
    #[must_use]
    pub fn control(&self) -> &Control<'_> {
        self.control
    }

    /// Returns the number of completed steps.
    #[must_use]
    pub fn done(&self) -> usize {
        self.done.load(Ordering::Relaxed)
    }

    /// Checks the stop flag.
    ///
    /// # Errors
    /// [`Error::Stopped`] if it is set.
    pub fn check(&self) -> Result<(), Error> {
        self.control.check()
    }
}

impl std::fmt::Debug for Phase<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.debug_struct("Phase").field("name", &self.name).field("total", &self.total).finish_non_exhaustive()
    }
}
