//! How far the work is: a bar on a terminal, lines elsewhere, JSON, or nothing.

use std::io::{self, IsTerminal, Write};
use std::path::Path;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use papsynth_dataset::{Outcome, Progress as Step, Task};
use serde_json::json;

use crate::args::Generate;
use crate::exit::{self, Failure};
use crate::memory;
use crate::words::counted;

/// Lines that a run prints at most, however many frames it makes.
const MOST_LINES: u64 = 100;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Style {
    Bar,
    Lines,
    Json,
    Quiet,
}

impl Style {
    fn of(quiet: bool, json: bool) -> Self {
        match (quiet, json) {
            (true, _) => Self::Quiet,
            (_, true) => Self::Json,
            _ if io::stderr().is_terminal() => Self::Bar,
            _ => Self::Lines,
        }
    }

    /// A bar of so many steps: it counts and estimates in every style, and is drawn in one.
    fn bar(self, steps: u64) -> ProgressBar {
        let target = if self == Self::Bar { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        ProgressBar::with_draw_target(Some(steps), target)
    }
}

/// Says how far a run is. Shared by all threads.
#[derive(Debug)]
pub(crate) struct Progress<'a> {
    style: Style,
    dir: &'a Path,
    bar: ProgressBar,
}

impl<'a> Progress<'a> {
    /// Announces a run that makes so many frames on so many threads, with so many bytes of memory at most.
    pub(crate) fn start(args: &'a Generate, frames: u64, threads: usize, memory: u64) -> Result<Self, Failure> {
        let style = Style::of(args.quiet, args.json);
        let (dir, bar) = (args.out.as_path(), style.bar(frames));
        bar.set_style(look("{msg}", "frames, {elapsed} gone"));
        bar.set_message(dir.display().to_string());
        if style == Style::Json {
            let seed = args.engine.seed;
            event(&json!({
                "event": "start", "dir": dir, "seed": seed, "frames": frames, "threads": threads, "memory_bytes": memory,
            }))?;
        }
        if style == Style::Bar {
            bar.tick();
            // Frames may take a while: the clock runs on between them.
            bar.enable_steady_tick(Duration::from_secs(1));
        }
        Ok(Self { style, dir, bar })
    }

    /// A frame is done, or was there. Whoever closed the stream that this is told on no longer wants to know.
    pub(crate) fn step(&self, step: Step) {
        let summary = match step {
            // What is there already takes no time and says nothing about the time left.
            Step::Present(_) => return self.bar.dec_length(1),
            Step::Written(summary) => summary,
        };
        self.bar.inc(1);
        if self.style == Style::Bar && self.bar.position() == 1 {
            // Before the first frame there is nothing to estimate from.
            self.bar.set_style(look("{msg}", "frames, {elapsed} gone, about {eta} left"));
        }
        let (index, objects) = (summary.index, summary.objects.values().sum::<u64>());
        match self.style {
            Style::Json => {
                let (done, of) = (self.bar.position(), self.bar.length().unwrap_or_default());
                let left_s = self.bar.eta().as_secs();
                let _ = event(&json!({
                    "event": "frame", "index": index, "objects": summary.objects, "done": done, "of": of, "left_s": left_s,
                }));
            }
            Style::Lines => line(&self.bar, &format!("frame {index}: {objects} objects and parts")),
            Style::Bar | Style::Quiet => {}
        }
    }

    pub(crate) fn clear(&self) {
        self.bar.finish_and_clear();
    }

    /// Everything is done.
    pub(crate) fn done(&self, outcome: &Outcome, share: Task) -> Result<(), Failure> {
        let (dir, Outcome { written: made, present: kept, .. }) = (self.dir, outcome);
        match self.style {
            Style::Json => event(&json!({
                "event": "done", "dir": dir, "made": made, "kept": kept, "peak_memory_bytes": memory::peak(),
            })),
            Style::Quiet => Ok(()),
            Style::Bar | Style::Lines => {
                let (dir, frames) = (dir.display(), counted(*made, "frame", "frames"));
                let there = if *kept > 0 { format!(", {kept} were there") } else { String::new() };
                let next = match share {
                    Task::ALL => format!("Look at: {dir}/contact-sheet.png"),
                    Task { index, total: of } => {
                        format!("That was share {index} of {of}; when all are done: papsynth merge {dir} --frames …")
                    }
                };
                exit::print(&format!("{dir}: {frames} made{there}\n{next}\n"))
            }
        }
    }
}

/// Says how far work in few large steps is.
#[derive(Debug)]
#[cfg(any(feature = "judge", feature = "zarr"))]
pub(crate) struct Bar {
    style: Style,
    bar: ProgressBar,
}

#[cfg(any(feature = "judge", feature = "zarr"))]
impl Bar {
    pub(crate) fn start(quiet: bool) -> Self {
        let style = Style::of(quiet, false);
        let bar = style.bar(0);
        bar.set_style(look("", "{msg}, {elapsed} gone, about {eta} left"));
        Self { style, bar }
    }

    /// A step is done. Whoever closed the stream that this is told on no longer wants to know.
    pub(crate) fn say(&self, done: u64, all: u64, what: &str) {
        self.bar.set_length(all);
        self.bar.set_position(done);
        self.bar.set_message(what.to_owned());
        if self.style == Style::Lines {
            line(&self.bar, what);
        }
    }

    pub(crate) fn clear(&self) {
        self.bar.finish_and_clear();
    }
}

/// The bar, between what stands before it and after its numbers.
fn look(before: &str, after: &str) -> ProgressStyle {
    let template = format!("{before} [{{bar:30}}] {{pos}} of {{len}} {after}");
    ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("=> ")
}

/// A line about the last step, if one is due.
fn line(bar: &ProgressBar, what: &str) {
    let (done, all) = (bar.position(), bar.length().unwrap_or_default());
    if is_told(done, all) {
        let left = if done < all { format!(", about {} left", duration(bar.eta().as_secs())) } else { String::new() };
        let _ = writeln!(io::stderr().lock(), "{what} ({done} of {all}{left})");
    }
}

/// Whether a line is due: at most [`MOST_LINES`] in all, and the last frame always.
fn is_told(done: u64, of: u64) -> bool {
    let due = |done: u64| u128::from(done) * u128::from(MOST_LINES) / u128::from(of.max(1));
    of <= MOST_LINES || due(done) > due(done.saturating_sub(1))
}

/// An object on a line of standard output.
pub(crate) fn event(value: &serde_json::Value) -> Result<(), Failure> {
    exit::print(&format!("{value}\n"))
}

fn duration(seconds: u64) -> String {
    match (seconds / 3600, seconds / 60 % 60, seconds % 60) {
        (0, 0, s) => format!("{s} s"),
        (0, m, s) => format!("{m} min {s:02} s"),
        (h, m, _) => format!("{h} h {m:02} min"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_stay_few_and_the_last_frame_is_told() {
        for of in [1, 7, 100, 101, 12_345, 1_000_000] {
            let told = (1..=of).filter(|&done| is_told(done, of)).count();
            assert!(told as u64 <= MOST_LINES && told as u64 >= MOST_LINES.min(of) / 2, "{of}: {told}");
            assert!(is_told(of, of));
        }
    }

    #[test]
    fn durations_are_readable() {
        assert_eq!(duration(9), "9 s");
        assert_eq!(duration(69), "1 min 09 s");
        assert_eq!(duration(3600 * 30 + 61), "30 h 01 min");
    }
}
