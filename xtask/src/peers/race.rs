//! Alternating measurements of the Python programs of benches/peers and of ours.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use anyhow::{Context, Result, ensure};
use serde::Deserialize;
use serde_json::Value;

use super::rows::{Growth, Row, Source};
use crate::shell;
use crate::workspace::Workspace;

/// Frames and stacks of a measurement: peer, ours.
const FRAMES: [usize; 2] = [3, 15];
const STACKS: [usize; 2] = [1, 3];

/// Frames of a measurement of concurrent processes: peer, ours.
const AT_ONCE: [usize; 2] = [6, 60];

/// Duration of a kernel measurement, seconds.
const KERNEL_S: f64 = 0.25;

/// The figures of a row: time in milliseconds, memory in MB, or an exponent.
pub(super) struct Figures {
    pub(super) peer: Option<f64>,
    pub(super) ours: f64,
}

impl Figures {
    /// Returns the ratio of ours and the peer's.
    pub(super) fn ratio(&self) -> Option<f64> {
        self.peer.map(|peer| self.ours / peer)
    }

    /// Computes medians of times in seconds.
    fn of_times([mut peer, mut ours]: [Vec<f64>; 2]) -> Self {
        Self { peer: Some(1e3 * median(&mut peer)), ours: 1e3 * median(&mut ours) }
    }
}

/// The figures of a row, or the reason why they are missing.
pub(super) type Found = Result<Figures, String>;

/// Median CPU and wall time of one repetition, and the peak memory of the process.
#[derive(Clone, Copy, Deserialize)]
struct Measured {
    #[serde(rename = "cpu_med")]
    cpu_s: f64,
    #[serde(rename = "wall_med")]
    wall_s: f64,
    peak_mb: f64,
}

/// The programs that are compared.
pub(super) struct Race {
    /// Python with the packages of the peer, if available.
    python: Option<PathBuf>,
    scripts: PathBuf,
    scratch: PathBuf,
    /// The example `peer_workload` of the engine, which renders benches/peer.toml.
    workload: PathBuf,
    /// The program papsynth-benches.
    works: PathBuf,
    /// Kernel programs: peer, ours.
    kernels: Option<[Kernels; 2]>,
    /// Cached measurements of complete programs: peer, ours.
    programs: BTreeMap<&'static str, [Vec<Measured>; 2]>,
    /// Number of alternating measurements.
    turns: usize,
    /// Notes below the table.
    pub(super) notes: Vec<String>,
}

impl Race {
    /// Builds our programs.
    pub(super) fn new(workspace: &Workspace, python: Option<PathBuf>, turns: usize) -> Result<Self> {
        let (example, works) = ("peer_workload", "papsynth-benches");
        shell::run(workspace.cargo().args(["build", "--release", "--package", "papsynth", "--example", example]))?;
        shell::run(workspace.cargo().args(["build", "--release", "--package", works, "--bin", works]))?;
        let scratch = workspace.target.join("peers");
        shell::make(&scratch)?;
        Ok(Self {
            python,
            scripts: workspace.root.join("benches/peers"),
            scratch,
            workload: workspace.program("release/examples", example),
            works: workspace.program("release", works),
            kernels: None,
            programs: BTreeMap::new(),
            turns,
            notes: Vec::new(),
        })
    }

    pub(super) fn row(&mut self, row: &Row) -> Result<Found> {
        if self.python.is_none() && !matches!(row.source, Source::TwoThreads | Source::Growth(_)) {
            return Ok(Err("the peer is not installed".to_owned()));
        }
        Ok(Ok(match row.source {
            Source::Kernel(theirs, ours) => return self.kernel(theirs, ours),
            Source::Program(work) => {
                let both = self.program(work)?;
                Figures::of_times(both.each_ref().map(|all| all.iter().map(|m| m.cpu_s).collect()))
            }
            Source::Memory(work) => {
                let both = self.program(work)?;
                let [peer, ours] = both.each_ref().map(|all| all.iter().map(|m| m.peak_mb).fold(0.0, f64::max));
                Figures { peer: Some(peer), ours }
            }
            Source::TwoCores => Figures::of_times(self.in_turn(
                |race| Ok(1.0 / race.peer(2, "frame", AT_ONCE[0])?.iter().map(|side| 1.0 / side.wall_s).sum::<f64>()),
                |race| race.own_frame_s(1, 2),
            )?),
            Source::TwoThreads => {
                Figures::of_times(self.in_turn(|race| race.own_frame_s(2, 1), |race| race.own_frame_s(1, 2))?)
            }
            Source::Growth(growth) => Figures { peer: None, ours: self.growth(growth)? },
        }))
    }

    /// Measures both alternately.
    fn in_turn<T>(&self, peer: impl Fn(&Self) -> Result<T>, ours: impl Fn(&Self) -> Result<T>) -> Result<[Vec<T>; 2]> {
        let mut found = [Vec::new(), Vec::new()];
        for _ in 0..self.turns {
            found[0].push(peer(self)?);
            found[1].push(ours(self)?);
        }
        Ok(found)
    }

    fn kernel(&mut self, theirs: &str, ours: &str) -> Result<Found> {
        if self.kernels.is_none() {
            self.kernels = Some([Kernels::start(self.python("kernels.py", &self.scratch)?)?, self.own_kernels()?]);
        }
        let programs = self.kernels.as_mut().context("they were just started")?;
        let mut seconds = [Vec::new(), Vec::new()];
        for _ in 0..self.turns {
            for ((program, work), seconds) in programs.iter_mut().zip([theirs, ours]).zip(&mut seconds) {
                match program.measure(work, KERNEL_S)? {
                    Ok(figures) => seconds.extend(figures),
                    Err(reason) => return Ok(Err(reason)),
                }
            }
        }
        Ok(Ok(Figures::of_times(seconds)))
    }

    /// Measures complete programs: `frame` or `stack`.
    fn program(&mut self, work: &'static str) -> Result<&[Vec<Measured>; 2]> {
        if !self.programs.contains_key(work) {
            let [theirs, own] = if work == "stack" { STACKS } else { FRAMES };
            let both = self.in_turn(
                |race| race.peer(1, work, theirs)?.first().copied().context("one process was started"),
                |race| {
                    let report = shell::output(Command::new(&race.workload).args([work, &own.to_string()]))?;
                    Ok(serde_json::from_value(shell::last_json(&report)?)?)
                },
            )?;
            self.programs.insert(work, both);
        }
        self.programs.get(work).context("it was just measured")
    }

    /// Measures the peer's program in several concurrent processes.
    fn peer(&self, processes: usize, work: &str, repetitions: usize) -> Result<Vec<Measured>> {
        let folders: Vec<PathBuf> = (0..processes).map(|k| self.scratch.join(format!("process-{k}"))).collect();
        let start = |folder: &PathBuf| {
            let mut command = self.python("bench_frame.py", folder)?;
            command.args(["numba", work, "1", &repetitions.to_string()]).stdout(Stdio::null());
            command.spawn().context("cannot start Python")
        };
        for mut child in folders.iter().map(start).collect::<Result<Vec<_>>>()? {
            let status = child.wait()?;
            ensure!(status.success(), "bench_frame.py failed ({status})");
        }
        let read = |folder: &PathBuf| {
            let report = shell::read(&folder.join(format!("peer_out/{work}_numba_t1.json")))?;
            Ok(serde_json::from_value(shell::last_json(&report)?)?)
        };
        folders.iter().map(read).collect()
    }

    /// Returns a script of the peer, to run in a folder.
    fn python(&self, script: &str, folder: &Path) -> Result<Command> {
        shell::make(folder)?;
        let mut command = Command::new(self.python.as_ref().context("there is no peer")?);
        // Keeps compiled Python code out of the source folder.
        command.env("PYTHONPYCACHEPREFIX", self.scratch.join("bytecode"));
        command.env("NUMBA_CACHE_DIR", self.scratch.join("numba"));
        command.arg(self.scripts.join(script)).current_dir(folder);
        Ok(command)
    }

    /// Returns our seconds per frame with several concurrent processes and threads.
    fn own_frame_s(&self, processes: usize, threads: usize) -> Result<f64> {
        let frames = AT_ONCE[1] * threads;
        let start = |_| {
            let mut command = Command::new(&self.workload);
            command.args(["throughput", &frames.to_string(), &threads.to_string()]).stdout(Stdio::piped());
            command.spawn().with_context(|| format!("cannot start {}", self.workload.display()))
        };
        let children = (0..processes).map(start).collect::<Result<Vec<_>>>()?;
        let per_s = children.into_iter().try_fold(0.0, |sum, child| {
            let report = shell::last_json(&String::from_utf8(child.wait_with_output()?.stdout)?)?;
            let own = report["frames_per_s"].as_f64();
            Ok::<_, anyhow::Error>(sum + own.with_context(|| format!("`frames_per_s` is missing from {report}"))?)
        })?;
        Ok(1.0 / per_s)
    }

    fn own_kernels(&self) -> Result<Kernels> {
        let mut command = Command::new(&self.works);
        command.arg(&self.scratch);
        Kernels::start(command)
    }

    /// Returns the exponent of time as a function of size, by least squares of logarithms.
    #[expect(clippy::disallowed_methods, reason = "the figure is only printed")]
    fn growth(&mut self, growth: &Growth) -> Result<f64> {
        // A separate process, so that the memory of large fields is released.
        let mut own = self.own_kernels()?;
        let (mut points, mut words) = (Vec::new(), Vec::new());
        for &size in growth.sizes {
            let Ok(mut figures) = own.measure(&format!("{}-{size}", growth.kind), KERNEL_S)? else { continue };
            let seconds = median(&mut figures);
            words.push(format!("{size}: {:.2} ms", 1e3 * seconds));
            if size >= growth.from {
                points.push([growth.power * f64::from(size).ln(), seconds.ln()]);
            }
        }
        self.notes.push(format!(
            "Growth with {} {}. Fitted from {} on, at constant density of objects.",
            growth.what,
            words.join(", "),
            growth.from
        ));
        Ok(slope(&points))
    }
}

/// A program that runs the kernels named on its standard input.
struct Kernels {
    child: Child,
    /// Closing it ends the program.
    asked: Option<ChildStdin>,
    answers: BufReader<ChildStdout>,
}

impl Kernels {
    fn start(mut command: Command) -> Result<Self> {
        let child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
        let mut child = child.with_context(|| format!("cannot start {}", command.get_program().display()))?;
        let (asked, answers) = (child.stdin.take(), child.stdout.take());
        Ok(Self { child, asked, answers: BufReader::new(answers.context("the output is piped")?) })
    }

    /// Runs a kernel for about `seconds` and returns the CPU seconds of each repetition, or the reason why it is not
    /// available.
    fn measure(&mut self, work: &str, seconds: f64) -> Result<Result<Vec<f64>, String>> {
        let asked = self.asked.as_mut().context("the program was ended")?;
        writeln!(asked, "{work} {seconds}").with_context(|| format!("cannot request `{work}`"))?;
        asked.flush()?;
        let mut line = String::new();
        let read = self.answers.read_line(&mut line)?;
        ensure!(read > 0, "no answer to `{work}`: the program has ended");
        let value: Value =
            serde_json::from_str(&line).with_context(|| format!("`{work}`: expected JSON, found `{line}`"))?;
        if let Some(reason) = value["missing"].as_str() {
            return Ok(Err(reason.to_owned()));
        }
        let figures = serde_json::from_value(value["cpu_s"].clone());
        Ok(Ok(figures.with_context(|| format!("no figures in {value}"))?))
    }
}

impl Drop for Kernels {
    fn drop(&mut self) {
        // The end of its input ends the program; its exit status is ignored.
        self.asked = None;
        let _ = self.child.wait();
    }
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Returns the slope of the least-squares line.
fn slope(points: &[[f64; 2]]) -> f64 {
    let mean = |k: usize| points.iter().map(|point| point[k]).sum::<f64>() / points.len() as f64;
    let (x, y) = (mean(0), mean(1));
    let sum = |f: fn(f64, f64) -> f64| points.iter().map(|point| f(point[0] - x, point[1] - y)).sum::<f64>();
    sum(|x, y| x * y) / sum(|x, _| x * x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_of_a_line_is_found() {
        let points = [[0.0, 1.0], [1.0, 3.0], [2.0, 5.0], [5.0, 11.0]];
        assert!((slope(&points) - 2.0).abs() < 1e-12);
    }

    #[test]
    fn the_median_is_the_central_value() {
        assert_eq!(median(&mut [9.0, 1.0, 5.0]), 5.0);
        assert!(median(&mut []).is_nan());
    }
}
