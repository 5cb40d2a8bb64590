//! Progress of a run: a bar on a terminal, lines elsewhere, JSON events, or nothing.

use std::io::{self, IsTerminal, Write};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use papsynth_dataset::{Extra, Outcome, Progress as Step, Task};
use serde_json::json;

use crate::args::Generate;
use crate::exit::{self, ExitError, escaped};
use crate::memory;
use crate::words::{counted, frames_written};

/// Progress lines of a run at most, for any number of frames.
const MAX_LINES: u64 = 100;

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

    /// A bar with this many steps. All styles use it to count and to estimate; only `Bar` draws it.
    fn bar(self, steps: u64) -> ProgressBar {
        let target = if self == Self::Bar { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(steps), target);
        redraw(&bar, Duration::from_secs(1));
        bar
    }
}

/// Progress of `papsynth generate`. Shared by all threads.
#[derive(Debug)]
pub(crate) struct Progress<'a> {
    style: Style,
    dir: &'a Path,
    bar: ProgressBar,
    /// Number of written frames that lack cells for which there was no room.
    crowded: AtomicU64,
    /// Whether the data set has a contact sheet.
    has_sheet: bool,
}

impl<'a> Progress<'a> {
    /// Starts the progress of a run; `memory` is the expected peak, bytes.
    pub(crate) fn start(args: &'a Generate, frames: u64, threads: usize, memory: u64) -> Result<Self, ExitError> {
        let style = Style::of(args.quiet, args.json);
        let (dir, bar) = (args.out.as_path(), style.bar(frames));
        bar.set_style(bar_style("{msg}", "frames, {elapsed} elapsed"));
        bar.set_message(escaped(&dir.display().to_string()).into_owned());
        if style == Style::Json {
            let seed = args.engine.seed;
            event(&json!({
                "event": "start", "dir": dir, "seed": seed, "frames": frames, "threads": threads, "memory_bytes": memory,
            }))?;
        }
        let has_sheet = !args.layout.files.without.contains(&Extra::ContactSheet);
        Ok(Self { style, dir, bar, crowded: AtomicU64::new(0), has_sheet })
    }

    /// Counts a frame. Ignores broken pipes.
    pub(crate) fn step(&self, step: Step) {
        let summary = match step {
            // Frames that are already present do not count towards the estimate.
            Step::Present(_) => return self.bar.dec_length(1),
            Step::Written(summary) => summary,
        };
        self.bar.inc(1);
        if summary.unplaced() > 0 && self.crowded.fetch_add(1, Ordering::Relaxed) == 0 {
            let requested: u64 = summary.cells.values().map(|count| count.requested).sum();
            let text = format!(
                "frame {}: {} of {requested} cells found no room in {} draws; the ground truth has the numbers",
                summary.index,
                summary.unplaced(),
                summary.attempts
            );
            self.bar.suspend(|| exit::note(text));
        }
        if self.style == Style::Bar && self.bar.position() == 1 {
            // There is no estimate before the first frame.
            self.bar.set_style(bar_style("{msg}", "frames, {elapsed} elapsed, about {eta} left"));
        }
        let (index, objects) = (summary.index, summary.objects.values().sum::<u64>());
        match self.style {
            Style::Json => {
                let (done, total) = (self.bar.position(), self.bar.length().unwrap_or_default());
                let eta_s = self.bar.eta().as_secs();
                let _ = event(&json!({
                    "event": "frame", "index": index, "objects": summary.objects, "unplaced_cells": summary.unplaced(), "done": done, "total": total, "eta_s": eta_s,
                }));
            }
            Style::Lines => {
                let objects = counted(objects, "object or part", "objects and parts");
                print_line(&self.bar, &format!("frame {index}: {objects}"));
            }
            Style::Bar | Style::Quiet => {}
        }
    }

    pub(crate) fn clear(&self) {
        self.bar.finish_and_clear();
    }

    /// Prints the result of a run of frames up to index `end`.
    pub(crate) fn done(&self, outcome: &Outcome, task: Task, end: u64) -> Result<(), ExitError> {
        let (dir, Outcome { written, present, .. }) = (self.dir, outcome);
        let crowded = self.crowded.load(Ordering::Relaxed);
        if crowded > 1 {
            exit::note(format!("{crowded} frames lack cells for which there was no room"));
        }
        match self.style {
            Style::Json => event(&json!({
                "event": "done", "dir": dir, "written": written, "present": present, "crowded_frames": crowded, "peak_memory_bytes": memory::peak(),
            })),
            Style::Quiet => Ok(()),
            Style::Bar | Style::Lines => {
                let (dir, frames) = (dir.display(), frames_written(*written, *present));
                let next = match task {
                    Task::ALL if self.has_sheet => format!("Look at: {dir}/contact-sheet.png\n"),
                    Task::ALL => String::new(),
                    Task { index, total } => format!(
                        "Task {index} of {total} is done. When all tasks are done, run: papsynth merge {dir} --frames {end}\n"
                    ),
                };
                exit::print(&format!("{dir}: {frames}\n{next}"))
            }
        }
    }
}

/// Progress of work in phases with steps.
#[derive(Debug)]
pub(crate) struct Bar {
    style: Style,
    bar: ProgressBar,
    phase: Mutex<Phase>,
}

/// The current phase: its name, its first and last completed steps, and the time of the bar at the first.
#[derive(Debug, Default)]
struct Phase {
    name: String,
    first: u64,
    done: u64,
    total: u64,
    begin: Duration,
}

impl Bar {
    pub(crate) fn start(quiet: bool) -> Self {
        let style = Style::of(quiet, false);
        let bar = style.bar(0);
        bar.set_style(bar_style("", "{msg}, {elapsed} elapsed"));
        Self { style, bar, phase: Mutex::default() }
    }

    /// A bar on a terminal, and no lines elsewhere.
    pub(crate) fn on_terminal() -> Self {
        Self::start(!io::stderr().is_terminal())
    }

    /// Sets the number of completed steps. A phase with another name continues the former one if `done` increases and
    /// `total` does not change. Ignores steps that arrive late, and broken pipes.
    pub(crate) fn update(&self, done: u64, total: u64, name: &str) {
        let mut phase = self.phase.lock().unwrap_or_else(PoisonError::into_inner);
        let is_later = done <= phase.done;
        let is_repeated = phase.done == phase.total && done == 1;
        if total != phase.total || (is_later && (name != phase.name || is_repeated)) {
            *phase = Phase { name: name.to_owned(), first: done, done, total, begin: self.bar.elapsed() };
            self.bar.set_length(total);
        } else if is_later {
            return;
        }
        (phase.done, phase.name) = (done, name.to_owned());
        let spent = self.bar.elapsed().saturating_sub(phase.begin).as_secs_f64();
        // The time before the first report belongs to the phase before.
        let steps = done - phase.first;
        let left = match done < total && steps > 0 {
            true => format!(", about {} left", duration((spent * (total - done) as f64 / steps as f64).round())),
            false => String::new(),
        };
        self.bar.set_position(done);
        self.bar.set_message(format!("{}{left}", escaped(name)));
        if self.style == Style::Lines && is_line_due(done, total) {
            let _ = writeln!(io::stderr().lock(), "{} ({done} of {total}{left})", escaped(name));
        }
    }

    pub(crate) fn clear(&self) {
        self.bar.finish_and_clear();
    }
}

/// Progress over the frames of `convert`, `rerender` and `sweep`. Shared by all threads.
#[derive(Debug)]
pub(crate) struct FrameCounter {
    bar: Bar,
    what: &'static str,
    done: AtomicU64,
    total: u64,
}

impl FrameCounter {
    pub(crate) fn start(quiet: bool, what: &'static str, total: u64) -> Self {
        Self { bar: Bar::start(quiet), what, done: AtomicU64::new(0), total }
    }

    pub(crate) fn step(&self) {
        self.bar.update(self.done.fetch_add(1, Ordering::Relaxed) + 1, self.total, self.what);
    }

    pub(crate) fn clear(&self) {
        self.bar.clear();
    }
}

/// The elapsed time of work without steps, on a terminal only.
#[derive(Debug)]
pub(crate) struct Spinner(ProgressBar);

impl Spinner {
    pub(crate) fn start(what: &'static str) -> Self {
        let target =
            if io::stderr().is_terminal() { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let style = ProgressStyle::with_template("{spinner} {msg}, {elapsed} elapsed");
        let bar = ProgressBar::with_draw_target(None, target).with_message(what);
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_spinner()));
        redraw(&bar, Duration::from_millis(200));
        Self(bar)
    }
}

impl Drop for Spinner {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

/// Redraws a visible bar at regular intervals, so that its time advances between steps.
fn redraw(bar: &ProgressBar, every: Duration) {
    if bar.is_hidden() {
        return;
    }
    // The bar has a thread for it, and panics if the system does not start one.
    if let Ok(probe) = std::thread::Builder::new().spawn(|| ()) {
        let _ = probe.join();
        bar.enable_steady_tick(every);
    }
}

fn bar_style(before: &str, after: &str) -> ProgressStyle {
    let template = format!("{before} [{{bar:30}}] {{pos}} of {{len}} {after}");
    ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("=> ")
}

/// Prints a line about the last step, if one is due.
fn print_line(bar: &ProgressBar, what: &str) {
    let (done, total) = (bar.position(), bar.length().unwrap_or_default());
    if is_line_due(done, total) {
        let left =
            if done < total { format!(", about {} left", duration(bar.eta().as_secs_f64())) } else { String::new() };
        let _ = writeln!(io::stderr().lock(), "{} ({done} of {total}{left})", escaped(what));
    }
}

/// Whether a line is due: about [`MAX_LINES`] in all, and always the first and the last.
fn is_line_due(done: u64, total: u64) -> bool {
    let due = |done: u64| u128::from(done) * u128::from(MAX_LINES) / u128::from(total.max(1));
    total <= MAX_LINES || done == 1 || due(done) > due(done.saturating_sub(1))
}

/// Prints an object on a line of standard output.
pub(crate) fn event(value: &serde_json::Value) -> Result<(), ExitError> {
    exit::print(&format!("{value}\n"))
}

fn duration(seconds: f64) -> String {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the cast saturates")]
    let seconds = seconds as u64;
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
    fn lines_stay_few_and_the_last_step_has_a_line() {
        for total in [1, 7, 100, 101, 12_345, 1_000_000] {
            let lines = (1..=total).filter(|&done| is_line_due(done, total)).count();
            assert!(lines as u64 <= MAX_LINES + 1 && lines as u64 >= MAX_LINES.min(total) / 2, "{total}: {lines}");
            assert!(is_line_due(total, total));
        }
    }

    #[test]
    fn durations_have_units() {
        assert_eq!(duration(9.0), "9 s");
        assert_eq!(duration(69.0), "1 min 09 s");
        assert_eq!(duration(3600.0 * 30.0 + 61.0), "30 h 01 min");
    }
}
