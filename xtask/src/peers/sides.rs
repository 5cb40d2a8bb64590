//! The programs that are timed: the peer's and ours, whole ones and kernels.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::shell;
use crate::workspace::Workspace;

/// Median CPU and wall time of one piece of work, and the peak memory of the process.
#[derive(Clone, Copy)]
pub(crate) struct Measured {
    pub(crate) cpu_s: f64,
    pub(crate) wall_s: f64,
    pub(crate) peak_mb: f64,
}

impl Measured {
    fn read(value: &Value) -> Result<Self> {
        Ok(Self {
            cpu_s: float(value, "cpu_med")?,
            wall_s: float(value, "wall_med")?,
            peak_mb: float(value, "peak_mb")?,
        })
    }
}

fn float(value: &Value, name: &str) -> Result<f64> {
    value.get(name).and_then(Value::as_f64).with_context(|| format!("`{name}` is missing from {value}"))
}

/// The Python programs of benches/peers.
pub(crate) struct Peer {
    python: PathBuf,
    scripts: PathBuf,
    scratch: PathBuf,
}

impl Peer {
    pub(crate) fn new(python: PathBuf, scripts: PathBuf, scratch: PathBuf) -> Self {
        Self { python, scripts, scratch }
    }

    fn command(&self, script: &str, folder: &Path) -> Result<Command> {
        fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
        let mut command = Command::new(&self.python);
        command.arg(self.scripts.join(script)).current_dir(folder);
        // What Python compiles goes below the target folder, not beside the sources.
        command
            .env("PYTHONPYCACHEPREFIX", self.scratch.join("bytecode"))
            .env("NUMBA_CACHE_DIR", self.scratch.join("numba"));
        Ok(command)
    }

    /// The whole program: `frame` or `stack`.
    pub(crate) fn measure(&self, work: &str, repetitions: usize) -> Result<Measured> {
        let sides = self.side_by_side(1, work, repetitions)?;
        sides.first().copied().context("one process was started")
    }

    /// The whole program in so many processes at the same moment.
    pub(crate) fn side_by_side(&self, processes: usize, work: &str, repetitions: usize) -> Result<Vec<Measured>> {
        let folders: Vec<PathBuf> = (0..processes).map(|k| self.scratch.join(format!("process-{k}"))).collect();
        let start = |folder: &PathBuf| {
            let mut command = self.command("bench_frame.py", folder)?;
            command.args(["numba", work, "1", &repetitions.to_string()]).stdout(Stdio::null());
            command.spawn().context("cannot start Python")
        };
        let children = folders.iter().map(start).collect::<Result<Vec<_>>>()?;
        for mut child in children {
            let status = child.wait()?;
            ensure!(status.success(), "bench_frame.py failed ({status})");
        }
        let read = |folder: &PathBuf| {
            let report = folder.join(format!("peer_out/{work}_numba_t1.json"));
            let report = fs::read_to_string(&report).with_context(|| format!("cannot read {}", report.display()))?;
            Measured::read(&shell::last_json(&report)?)
        };
        folders.iter().map(read).collect()
    }

    pub(crate) fn kernels(&self) -> Result<Kernels> {
        Kernels::start(self.command("kernels.py", &self.scratch)?)
    }
}

/// The same work by the engine: its example `peer_workload`, which images benches/peer.toml, and the works of papsynth-benches.
pub(crate) struct Ours {
    program: PathBuf,
    works: PathBuf,
    scratch: PathBuf,
}

impl Ours {
    pub(crate) fn build(workspace: &Workspace, scratch: PathBuf) -> Result<Self> {
        let (example, works) = ("peer_workload", "papsynth-benches");
        shell::run(workspace.cargo().args(["build", "--release", "--package", "papsynth", "--example", example]))?;
        shell::run(workspace.cargo().args(["build", "--release", "--package", works, "--bin", works]))?;
        let release = workspace.target.join("release");
        let program = |folder: &Path, name: &str| folder.join(format!("{name}{}", std::env::consts::EXE_SUFFIX));
        Ok(Self { program: program(&release.join("examples"), example), works: program(&release, works), scratch })
    }

    pub(crate) fn measure(&self, work: &str, repetitions: usize) -> Result<Measured> {
        let report = shell::output(Command::new(&self.program).args([work, &repetitions.to_string()]))?;
        Measured::read(&shell::last_json(&report)?)
    }

    /// Frames a second of such processes together, all running at the same moment.
    pub(crate) fn frames_per_s(&self, processes: usize, frames: usize, threads: usize) -> Result<f64> {
        let start = |_| {
            let mut command = Command::new(&self.program);
            command.args(["throughput", &frames.to_string(), &threads.to_string()]).stdout(Stdio::piped());
            command.spawn().with_context(|| format!("cannot start {}", self.program.display()))
        };
        let children = (0..processes).map(start).collect::<Result<Vec<_>>>()?;
        children.into_iter().try_fold(0.0, |sum, child| {
            let report = String::from_utf8(child.wait_with_output()?.stdout)?;
            Ok(sum + float(&shell::last_json(&report)?, "frames_per_s")?)
        })
    }

    pub(crate) fn kernels(&self) -> Result<Kernels> {
        fs::create_dir_all(&self.scratch).with_context(|| format!("cannot make {}", self.scratch.display()))?;
        let mut command = Command::new(&self.works);
        command.arg(&self.scratch);
        Kernels::start(command)
    }
}

/// A program that does the works it is asked for, line by line.
pub(crate) struct Kernels {
    child: Child,
    /// Closed to end the program.
    asked: Option<ChildStdin>,
    answers: BufReader<ChildStdout>,
}

/// CPU seconds of each time, or why a work cannot be done here.
pub(crate) enum Answer {
    Figures(Vec<f64>),
    Missing(String),
}

impl Kernels {
    fn start(mut command: Command) -> Result<Self> {
        let child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
        let mut child = child.with_context(|| format!("cannot start {}", command.get_program().display()))?;
        let (asked, answers) = (child.stdin.take(), child.stdout.take());
        Ok(Self { child, asked, answers: BufReader::new(answers.context("its output is ours")?) })
    }

    /// Has a work done for about so many seconds.
    pub(crate) fn measure(&mut self, work: &str, seconds: f64) -> Result<Answer> {
        let asked = self.asked.as_mut().context("the program was ended")?;
        writeln!(asked, "{work} {seconds}").with_context(|| format!("cannot ask for `{work}`"))?;
        asked.flush()?;
        let mut line = String::new();
        let read = self.answers.read_line(&mut line)?;
        ensure!(read > 0, "no answer to `{work}`: its program has ended");
        let value: Value = serde_json::from_str(&line).with_context(|| format!("`{work}`: no JSON, but `{line}`"))?;
        if let Some(reason) = value.get("missing").and_then(Value::as_str) {
            return Ok(Answer::Missing(reason.to_owned()));
        }
        let figures = value.get("cpu_s").and_then(Value::as_array).with_context(|| format!("no figures in {value}"))?;
        let figures: Option<Vec<f64>> = figures.iter().map(Value::as_f64).collect();
        Ok(Answer::Figures(figures.with_context(|| format!("no numbers in {value}"))?))
    }
}

impl Drop for Kernels {
    fn drop(&mut self) {
        // The end of its input ends it; whether it ended well is of no matter any more.
        self.asked = None;
        let _ = self.child.wait();
    }
}
