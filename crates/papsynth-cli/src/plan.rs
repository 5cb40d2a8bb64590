//! `papsynth plan`: the cost of a data set.

use std::collections::BTreeMap;
use std::fs;
use std::io::ErrorKind;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use papsynth_dataset::{Check, Dataset, Format, Layout, Progress};

use crate::args::Plan;
use crate::exit::{self, ErrorReport, ExitError};
use crate::memory;
use crate::setup::{Setup, run_of};
use crate::words::{counted, size};

/// Student's t of a two-sided 95 % interval for 1, 2, … degrees of freedom. Beyond the table, the normal distribution
/// is used.
const T: [f64; 15] = [12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31, 2.26, 2.23, 2.20, 2.18, 2.16, 2.14, 2.13];

/// Largest number of temporary folders of one process number that earlier runs can have left.
const MAX_SCRATCH: u32 = 1000;

pub(crate) fn run(args: &Plan) -> Result<(), ExitError> {
    if let Some(price) = args.per_core_hour.filter(|price| !(*price >= 0.0 && price.is_finite())) {
        return Err(ExitError::input(format!("--per-core-hour: {price} is out of range: expected 0 or more")));
    }
    let setup = Setup::load(&args.engine, None)?;
    let (layout, _) = args.layout.layout(args.frames);
    memory::frames_at_once(&setup, &layout, 1)?;
    // Before the folder, so that a signal cannot leave it.
    let stop = exit::stop_flag()?;
    let scratch = Scratch::new()?;
    let samples = sample(args, &setup, &layout, &scratch, stop)?;
    exit::print(&table(args, &setup, &layout, &samples))
}

/// Time and size of the sample frames.
struct Samples {
    /// Seconds of each frame except the first.
    seconds: Vec<f64>,
    /// Bytes of all frames, by format.
    bytes: BTreeMap<String, u64>,
    count: u64,
}

#[expect(clippy::disallowed_methods, reason = "the time is printed and reaches no image")]
fn sample(
    args: &Plan,
    setup: &Setup,
    layout: &Layout,
    scratch: &Scratch,
    stop: &AtomicBool,
) -> Result<Samples, ExitError> {
    // The first frame also fills caches, so it is not timed.
    let frames = 0..args.samples + 1;
    let layout = Layout { frames_per_shard: 1, ..layout.clone() };
    let dataset = Dataset::create_or_resume(&scratch.0, &setup.info(args.engine.seed, &layout))?;
    let times = Mutex::new(vec![Instant::now()]);
    let run = run_of(frames.clone(), 1, stop);
    let report = |_: Progress| times.lock().unwrap_or_else(|e| e.into_inner()).push(Instant::now());
    if dataset.generate(&setup.engine, &run, &report).map_err(|error| setup.error(error))?.stopped {
        return Err(ExitError::interrupted(ErrorReport::new("stopped; no file was written")));
    }
    let times = times.into_inner().unwrap_or_else(|e| e.into_inner());
    let seconds = times.windows(2).skip(1).map(|pair| (pair[1] - pair[0]).as_secs_f64()).collect();
    let mut bytes = BTreeMap::new();
    for shard in frames.clone() {
        let files = dataset.complete_record(shard, Check::Sizes)?.map_or_else(Vec::new, |record| record.files);
        for file in files {
            *bytes.entry(format_of(&file.path).to_owned()).or_insert(0) += file.bytes;
        }
    }
    Ok(Samples { seconds, bytes, count: frames.end })
}

/// The format of a file of a data set.
fn format_of(path: &str) -> &str {
    let folder = path.split('/').next().unwrap_or(path);
    match Format::ALL.iter().find(|format| format.name() == folder) {
        Some(format) => format.name(),
        None if folder == "shards" || folder == "objects" => "ground truth",
        None => Format::Folder.name(),
    }
}

fn table(args: &Plan, setup: &Setup, layout: &Layout, samples: &Samples) -> String {
    let (frames, count) = (args.frames as f64, samples.seconds.len() as f64);
    let mean = samples.seconds.iter().sum::<f64>() / count;
    let variance = samples.seconds.iter().map(|s| (s - mean) * (s - mean)).sum::<f64>() / (count - 1.0).max(1.0);
    let t = T.get(samples.seconds.len().saturating_sub(2)).copied().unwrap_or(1.96);
    let half = t * libm::sqrt(variance / count);
    let hours = |seconds: f64| seconds.max(0.0) * frames / 3600.0;
    let shards = args.frames.div_ceil(layout.frames_per_shard);
    let mut out = String::new();
    let mut row = |name: &str, value: String| out.push_str(&format!("{name:<14}{value}\n"));
    row("frames", format!("{} in {} ({layout})", args.frames, counted(shards, "shard", "shards")));
    let recipe = setup.engine.recipe();
    row("field", format!("{:.4} mm², with these mean numbers of objects:", recipe.field_mm2()));
    for (key, mean) in recipe.expected_counts() {
        row("", format!("{mean:8.1}  {key}"));
    }
    let [ms, low, high] = [mean, (mean - half).max(0.0), mean + half].map(|seconds| 1e3 * seconds);
    row("time", format!("{ms:.0} ms per frame and thread, 95 % interval {low:.0} to {high:.0} ({count} frames)"));
    let [all, low, high] = [mean, mean - half, mean + half].map(hours);
    row("total", format!("{all:.2} core hours, {low:.2} to {high:.2}"));
    let tasks = args.tasks.unwrap_or(1).min(shards);
    // The slowest task has the most shards; each of its threads writes complete shards.
    let most = shards.div_ceil(tasks).div_ceil(setup.threads as u64) * layout.frames_per_shard;
    let wall = duration(mean * most.min(args.frames) as f64);
    let [tasks, threads] = [(tasks, "task", "tasks"), (setup.threads as u64, "thread", "threads")]
        .map(|(n, one, many)| counted(n, one, many));
    row("wall time", format!("{wall} on {tasks} with {threads}"));
    if let Some(price) = args.per_core_hour {
        row("price", format!("{:.2}, {:.2} to {:.2}", price * all, price * low, price * high));
    }
    let each = |bytes: u64| bytes as f64 / samples.count as f64;
    for (format, bytes) in &samples.bytes {
        row(format, format!("{:.2} MB per frame, {} in total", each(*bytes) / 1e6, size(each(*bytes) * frames)));
    }
    let sum: u64 = samples.bytes.values().sum();
    row("on disk", size(each(sum) * frames));
    if let Some(peak) = memory::peak() {
        row("memory", format!("{} with 1 thread, and about as much for each other thread", size(peak as f64)));
    }
    out
}

fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 120.0 => format!("{s:.0} s"),
        s if s < 7200.0 => format!("{:.0} min", s / 60.0),
        s if s < 172_800.0 => format!("{:.1} h", s / 3600.0),
        s => format!("{:.1} days", s / 86_400.0),
    }
}

/// A temporary folder, removed on drop.
struct Scratch(PathBuf);

impl Scratch {
    /// Creates a folder; an existing one, which another run may have left, is not used.
    fn new() -> Result<Self, ExitError> {
        let name = |number: u32| format!("papsynth-plan-{}-{number}", std::process::id());
        let mut paths = (0..MAX_SCRATCH).map(|number| std::env::temp_dir().join(name(number)));
        loop {
            let Some(path) = paths.next() else {
                let message = format!("{}: too many folders papsynth-plan-*", std::env::temp_dir().display());
                return Err(ExitError::with_help(message, "delete those of earlier runs"));
            };
            match fs::create_dir(&path) {
                Ok(()) => return Ok(Self(path)),
                Err(error) if error.kind() == ErrorKind::AlreadyExists => (),
                Err(error) => return Err(ExitError::file("write", &path, &error)),
            }
        }
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // The system removes temporary files that remain.
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_own_temporary_folder_is_used_and_removed() {
        let [first, second] = [Scratch::new().unwrap(), Scratch::new().unwrap()];
        let (kept, removed) = (first.0.join("kept.txt"), second.0.clone());
        fs::write(&kept, "kept").unwrap();
        drop(second);
        assert!(kept.exists() && !removed.exists());
        drop(first);
        assert!(!kept.exists());
    }

    #[test]
    fn the_format_of_a_file_follows_from_its_path() {
        let of = ["images/1.png", "cellpose/nucleus/1.tif", "shards/1.json", "objects/1.csv"].map(format_of);
        assert_eq!(of, ["folder", "cellpose", "ground truth", "ground truth"]);
        assert_eq!([90.0, 36_000.0].map(duration), ["90 s", "10.0 h"]);
    }
}
