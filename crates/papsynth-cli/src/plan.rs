//! `papsynth plan`: what a data set will cost.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use papsynth_dataset::{Check, Dataset, Format, Layout, Progress};

use crate::args::Plan;
use crate::exit::{self, Failure};
use crate::memory;
use crate::setup::{Setup, run_of};
use crate::words::size;

/// Student's t for a two-sided interval of 95 %, for 1, 2, … degrees of freedom; beyond the table that of the normal distribution.
const T: [f64; 15] = [12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31, 2.26, 2.23, 2.20, 2.18, 2.16, 2.14, 2.13];

pub(crate) fn run(args: &Plan) -> Result<(), Failure> {
    if args.per_core_hour.is_some_and(|price| !(price >= 0.0 && price.is_finite())) {
        return Err(Failure::input("--per-core-hour: a price of 0 or more is expected"));
    }
    let setup = Setup::load(&args.engine, None)?;
    let (layout, _) = args.layout.layout(args.frames);
    let scratch = Scratch::new()?;
    let samples = sample(args, &setup, &layout, &scratch)?;
    exit::print(&table(args, &setup, &layout, &samples))
}

/// What the frames that were made for it cost.
struct Samples {
    /// Seconds of each but the first.
    seconds: Vec<f64>,
    /// Bytes of all, by the folder that they lie in.
    bytes: BTreeMap<String, u64>,
    count: u64,
}

#[expect(clippy::disallowed_methods, reason = "the time goes to whoever asks for it, and into no image")]
fn sample(args: &Plan, setup: &Setup, layout: &Layout, scratch: &Scratch) -> Result<Samples, Failure> {
    // The first frame also makes what later ones keep: it is not counted.
    let frames = 0..args.samples + 1;
    let layout = Layout { frames_per_shard: 1, ..layout.clone() };
    let dataset = Dataset::create_or_resume(&scratch.0, &setup.info(args.engine.seed, &layout))?;
    let times = Mutex::new(vec![Instant::now()]);
    let stop = AtomicBool::new(false);
    let run = run_of(frames.clone(), 1, &stop);
    let report = |_: Progress| times.lock().unwrap_or_else(|e| e.into_inner()).push(Instant::now());
    dataset.generate(&setup.engine, &run, &report).map_err(|error| setup.failure(error))?;
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

/// The format that a file belongs to.
fn format_of(path: &str) -> &str {
    let folder = path.split('/').next().unwrap_or(path);
    match Format::ALL.iter().find(|format| format.name() == folder) {
        Some(format) => format.name(),
        None if folder == "shards" || folder == "objects" => "truth",
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
    row("frames", format!("{} in {shards} shards of {} ({layout})", args.frames, layout.frames_per_shard));
    let [ms, low, high] = [mean, (mean - half).max(0.0), mean + half].map(|seconds| 1e3 * seconds);
    row("a frame", format!("{ms:.0} ms on one thread, {low:.0} to {high:.0} (95 %, {count} frames)"));
    let [all, low, high] = [mean, mean - half, mean + half].map(hours);
    row("all", format!("{all:.2} core hours, {low:.2} to {high:.2}"));
    let tasks = args.tasks.unwrap_or(1).min(shards);
    // The slowest task has the most shards; each of its threads makes whole ones.
    let most = shards.div_ceil(tasks).div_ceil(setup.threads as u64) * layout.frames_per_shard;
    let wall = duration(mean * most.min(args.frames) as f64);
    row("wall time", format!("{wall} on {tasks} x {} threads", setup.threads));
    if let Some(price) = args.per_core_hour {
        row("price", format!("{:.2}, {:.2} to {:.2}", price * all, price * low, price * high));
    }
    let each = |bytes: u64| bytes as f64 / samples.count as f64;
    for (format, bytes) in &samples.bytes {
        row(format, format!("{:.2} MB a frame, {} in all", each(*bytes) / 1e6, size(each(*bytes) * frames)));
    }
    let sum: u64 = samples.bytes.values().sum();
    row("on disk", size(each(sum) * frames));
    if let Some(peak) = memory::peak() {
        row("memory", format!("{} with one thread; about as much again for each further one", size(peak as f64)));
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

/// A folder that vanishes.
struct Scratch(std::path::PathBuf);

impl Scratch {
    fn new() -> Result<Self, Failure> {
        let path = std::env::temp_dir().join(format!("papsynth-plan-{}", std::process::id()));
        std::fs::create_dir_all(&path).map_err(|error| Failure::file("write", &path, &error))?;
        Ok(Self(path))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // What cannot be removed is left to the system.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_counted_to_their_format() {
        let of = ["images/1.png", "cellpose/nucleus/1.tif", "shards/1.json", "objects/1.csv"].map(format_of);
        assert_eq!(of, ["folder", "cellpose", "truth", "truth"]);
        assert_eq!([90.0, 36_000.0].map(duration), ["90 s", "10.0 h"]);
    }
}
