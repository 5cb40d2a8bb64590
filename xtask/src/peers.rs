//! The whole simulator against a good Python program, and against itself.

use std::fs;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

use anyhow::{Context, Result};
use serde_json::Value;

use crate::arguments::Arguments;
use crate::outcome::Outcome;
use crate::python::Python;
use crate::shell;
use crate::workspace::Workspace;

/// What is compared: the work, how the peer does it, how often it does, and the ratio that is wanted.
struct Race {
    work: &'static str,
    accelerator: &'static str,
    repetitions: usize,
    wanted: f64,
}

const RACES: [Race; 4] = [
    Race { work: "frame", accelerator: "numba", repetitions: 7, wanted: 8.0 },
    Race { work: "frame", accelerator: "numpy", repetitions: 5, wanted: 15.0 },
    Race { work: "stack", accelerator: "numba", repetitions: 3, wanted: 8.0 },
    Race { work: "stack", accelerator: "numpy", repetitions: 3, wanted: 8.0 },
];

/// Frames a thread makes for a measurement of throughput, and how often both ways are measured in turn.
const FRAMES_EACH: usize = 20;
const TURNS: usize = 3;

/// Runs the race and prints the ratios. Nothing is asserted: a machine has good days and bad ones.
pub(crate) fn run(workspace: &Workspace, mut arguments: Arguments) -> Result<Outcome> {
    let repetitions = arguments.option("--repetitions")?;
    let repetitions: Option<usize> =
        repetitions.map(|n| n.parse().with_context(|| format!("`{n}` is no number of repetitions"))).transpose()?;
    arguments.finish()?;
    let folder = workspace.root.join("benches/peers");
    let requirements =
        fs::read_to_string(folder.join("requirements.txt")).context("cannot read benches/peers/requirements.txt")?;
    let ours = Ours::build(workspace)?;
    let python = match Python::environment(workspace, "peers", &requirements)? {
        Python::Ready(python) => python,
        Python::Missing(reason) => {
            ours.print_throughput()?;
            return Outcome::skipped_unless_ci(format!("no race against the peer: {reason}"));
        }
    };
    let peer = Peer { python, script: folder.join("bench_frame.py"), scratch: workspace.target.join("peers") };
    fs::create_dir_all(&peer.scratch).with_context(|| format!("cannot make {}", peer.scratch.display()))?;
    let mut table = String::from(
        "\nProcess CPU time on one thread (medians) and peak memory, both sides in this run, truth included:\n\n",
    );
    table.push_str("work   peer    peer CPU s  our CPU s  ratio  wanted  peer MB  our MB\n");
    for Race { work, accelerator, repetitions: usual, wanted } in RACES {
        let count = repetitions.unwrap_or(usual);
        let peer = peer.measure(accelerator, work, count)?;
        let ours = ours.measure(work, count)?;
        let ratio = peer.cpu_s / ours.cpu_s;
        table.push_str(&format!(
            "{work:<6} {accelerator:<7} {:>10.3} {:>10.4} {ratio:>5.1}x {wanted:>6}x {:>8.0} {:>7.0}\n",
            peer.cpu_s, ours.cpu_s, peer.peak_mb, ours.peak_mb
        ));
    }
    let (few, many) = (ours.measure("frame", 2)?.peak_mb, ours.measure("frame", 40)?.peak_mb);
    print!("{table}\nOur peak memory after 2 frames {few:.0} MB, after 40 {many:.0} MB.\n");
    ours.print_throughput()?;
    Ok(Outcome::Done)
}

/// Median process CPU time of one piece of work, and the peak memory of the process.
struct Measured {
    cpu_s: f64,
    peak_mb: f64,
}

impl Measured {
    fn read(value: &Value) -> Result<Self> {
        Ok(Self { cpu_s: float(value, "cpu_med")?, peak_mb: float(value, "peak_mb")? })
    }
}

fn float(value: &Value, name: &str) -> Result<f64> {
    value.get(name).and_then(Value::as_f64).with_context(|| format!("`{name}` is missing from {value}"))
}

/// benches/peers/papsim.py.
struct Peer {
    python: PathBuf,
    script: PathBuf,
    scratch: PathBuf,
}

impl Peer {
    fn measure(&self, accelerator: &str, work: &str, repetitions: usize) -> Result<Measured> {
        let mut command = Command::new(&self.python);
        command.arg(&self.script).args([accelerator, work, "1", &repetitions.to_string()]).current_dir(&self.scratch);
        // What Python compiles goes below the target folder, not beside the sources.
        command
            .env("PYTHONPYCACHEPREFIX", self.scratch.join("bytecode"))
            .env("NUMBA_CACHE_DIR", self.scratch.join("numba"));
        shell::run(&mut command)?;
        let report = self.scratch.join(format!("peer_out/{work}_{accelerator}_t1.json"));
        let report = fs::read_to_string(&report).with_context(|| format!("cannot read {}", report.display()))?;
        Measured::read(&shell::last_json(&report)?)
    }
}

/// The same work by the engine: its example `peer_workload`, which images benches/peer.toml.
struct Ours {
    program: PathBuf,
}

impl Ours {
    fn build(workspace: &Workspace) -> Result<Self> {
        let name = "peer_workload";
        workspace.expect_target("papsynth", "example", name)?;
        shell::run(workspace.cargo().args(["build", "--release", "--package", "papsynth", "--example", name]))?;
        let program = format!("{name}{}", std::env::consts::EXE_SUFFIX);
        Ok(Self { program: workspace.target.join("release/examples").join(program) })
    }

    fn measure(&self, work: &str, repetitions: usize) -> Result<Measured> {
        let report = shell::output(Command::new(&self.program).args([work, &repetitions.to_string()]))?;
        Measured::read(&shell::last_json(&report)?)
    }

    /// Starts a process that makes frames side by side on so many threads.
    fn start(&self, frames: usize, threads: usize) -> Result<Child> {
        let mut command = Command::new(&self.program);
        command.args(["throughput", &frames.to_string(), &threads.to_string()]).stdout(Stdio::piped());
        command.spawn().with_context(|| format!("cannot start {}", self.program.display()))
    }

    /// Frames a second of such processes together, all running at the same moment.
    fn frames_per_s(&self, processes: usize, frames: usize, threads: usize) -> Result<f64> {
        let children = (0..processes).map(|_| self.start(frames, threads)).collect::<Result<Vec<_>>>()?;
        children.into_iter().try_fold(0.0, |sum, child| {
            let report = String::from_utf8(child.wait_with_output()?.stdout)?;
            Ok(sum + float(&shell::last_json(&report)?, "frames_per_s")?)
        })
    }

    /// One process of two threads against two processes of one thread, in turn.
    fn print_throughput(&self) -> Result<()> {
        let (mut threads, mut processes) = (Vec::new(), Vec::new());
        for _ in 0..TURNS {
            threads.push(self.frames_per_s(1, 2 * FRAMES_EACH, 2)?);
            processes.push(self.frames_per_s(2, FRAMES_EACH, 1)?);
        }
        let (threads, processes) = (median(&mut threads), median(&mut processes));
        let ratio = threads / processes;
        println!(
            "Two threads make {threads:.1} frames a second, two processes of one thread {processes:.1}: {ratio:.2} (wanted 0.95)."
        );
        Ok(())
    }
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
