//! Data sets in files.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::Duration;

use papsynth::Threads;
use papsynth::truth::MIN_DETECTABILITY;
use papsynth_dataset::{
    Check, Dataset, DatasetInfo, Extra, Format, Layout, Location, Progress, Run, Task, missing_shards,
};
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyDict, PyList};

use crate::engine::Engine;
use crate::error::{self, wrong};
use crate::frame::checked_detectability;

/// Interval at which Python signals are checked.
const POLL: Duration = Duration::from_millis(50);

/// Maximum number of frames whose shards are listed.
const MAX_FRAMES: u64 = 1_000_000_000;

/// Generates frames for `papsynth.generate` and returns the numbers of frames "written" and "present".
#[pyfunction]
#[pyo3(signature = (
    engine, out, frames, seed=0, *, task=(0, 1), formats=None, frames_per_shard=None, without=None, scenes=false,
    threads=1, verify=false, progress=None, min_detectability=MIN_DETECTABILITY
))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments in Python")]
pub(crate) fn generate<'py>(
    py: Python<'py>,
    engine: &Bound<'py, Engine>,
    out: PathBuf,
    frames: u64,
    seed: u64,
    task: (u64, u64),
    formats: Option<Vec<String>>,
    frames_per_shard: Option<u64>,
    without: Option<Vec<String>>,
    scenes: bool,
    threads: usize,
    verify: bool,
    progress: Option<Bound<'py, PyAny>>,
    min_detectability: f64,
) -> PyResult<Bound<'py, PyDict>> {
    let made_by = engine.get();
    let (index, count) = task;
    if index >= count {
        return Err(wrong(format!("task: ({index}, {count}) is out of range: expected (i, n) with i below n")));
    }
    for (name, number) in [("frames", frames), ("threads", threads as u64)] {
        if number == 0 {
            return Err(wrong(format!("{name}: 0 is out of range: expected 1 or more")));
        }
    }
    let min_detectability = checked_detectability(min_detectability)?;
    let layout = Layout { scenes, min_detectability, ..layout(formats, frames_per_shard, without)? };
    let info = DatasetInfo {
        recipe: made_by.engine.recipe(),
        model: &made_by.model,
        seed,
        map: made_by.map.as_ref(),
        layout: &layout,
    };
    let dataset = py.detach(|| Location::at(&out).and_then(|home| Dataset::create_or_resume(&home, &info)));
    let dataset = dataset.map_err(|error| error::dataset(&error))?;
    let stop = AtomicBool::new(false);
    let check = if verify { Check::Hashes } else { Check::Sizes };
    let task = Task { index, total: count };
    let run =
        Run { frames: 0..frames, task, workers: threads, threads: Threads::One, check, stop: &stop, profile: None };
    let engine = &made_by.engine;
    let mut interrupted: Option<PyErr> = None;
    let progress = progress.map(Bound::unbind);
    let outcome = py.detach(|| {
        let (sender, receiver) = mpsc::channel();
        std::thread::scope(|scope| {
            let (dataset, run) = (&dataset, &run);
            let worker = scope.spawn(move || {
                dataset.generate(engine, run, &|step| {
                    let done = match step {
                        Progress::Present(index) => index,
                        Progress::Written(frame) => frame.index,
                    };
                    // The receiver is gone after an interrupt.
                    let _ = sender.send(done);
                })
            });
            loop {
                let found = receiver.recv_timeout(POLL);
                let heard = Python::attach(|py| {
                    if let (Ok(index), Some(progress)) = (&found, &progress) {
                        progress.call1(py, (*index,))?;
                    }
                    py.check_signals()
                });
                if let Err(error) = heard {
                    stop.store(true, Ordering::Relaxed);
                    interrupted.get_or_insert(error);
                    break;
                }
                if matches!(found, Err(mpsc::RecvTimeoutError::Disconnected)) {
                    break;
                }
            }
            worker.join()
        })
    });
    if let Some(error) = interrupted {
        return Err(error);
    }
    let outcome =
        outcome.map_err(|_| wrong("internal error: a worker thread panicked"))?.map_err(|error| match error {
            papsynth_dataset::Error::Engine(error) => error::engine(py, &made_by.source, &error),
            other => error::dataset(&other),
        })?;
    [("written", outcome.written), ("present", outcome.present)].into_py_dict(py)
}

/// Returns a count with its noun: "1 shard", "2 shards".
fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

fn layout(
    formats: Option<Vec<String>>,
    frames_per_shard: Option<u64>,
    without: Option<Vec<String>>,
) -> PyResult<Layout> {
    let formats: Vec<Format> = match formats {
        None => vec![Format::Folder],
        Some(names) => names.iter().map(|name| format(name)).collect::<PyResult<_>>()?,
    };
    let without: Vec<Extra> = without.iter().flatten().map(|name| extra(name)).collect::<PyResult<_>>()?;
    let mut layout = Layout::new(formats).without(without);
    if let Some(frames) = frames_per_shard {
        if !(1..=1_000_000).contains(&frames) {
            return Err(wrong(format!("frames_per_shard: {frames} is out of range: expected 1 to 1000000")));
        }
        layout.frames_per_shard = frames;
    }
    layout.refusal().map_or(Ok(layout), |message| Err(wrong(format!("without: {message}"))))
}

fn extra(name: &str) -> PyResult<Extra> {
    Extra::ALL.into_iter().find(|extra| extra.name() == name).ok_or_else(|| {
        let known = Extra::ALL.map(Extra::name).join(", ");
        wrong(format!("without: unknown files `{name}`; expected some of {known}"))
    })
}

fn format(name: &str) -> PyResult<Format> {
    Format::built().find(|format| format.name() == name).ok_or_else(|| {
        let known: Vec<&str> = Format::built().map(Format::name).collect();
        wrong(format!("formats: unknown format `{name}`; expected some of {}", known.join(", ")))
    })
}

/// Returns the number of shards of a data set.
#[pyfunction]
#[pyo3(signature = (frames, formats=None, frames_per_shard=None, without=None))]
pub(crate) fn shards(
    frames: u64,
    formats: Option<Vec<String>>,
    frames_per_shard: Option<u64>,
    without: Option<Vec<String>>,
) -> PyResult<u64> {
    Ok(frames.div_ceil(layout(formats, frames_per_shard, without)?.frames_per_shard))
}

/// Completes a data set and returns its root hash.
#[pyfunction]
pub(crate) fn merge(py: Python<'_>, out: PathBuf, frames: u64) -> PyResult<String> {
    let gaps = missing(py, out.clone(), frames)?;
    if !gaps.is_empty() {
        let some: Vec<String> = gaps.iter().take(20).map(u64::to_string).collect();
        let message = format!("{}: {} missing: {}", out.display(), counted(gaps.len(), "shard"), some.join(", "));
        return Err(wrong(message));
    }
    let summary =
        py.detach(|| Dataset::open(&Location::at(&out)?)?.finish()).map_err(|error| error::dataset(&error))?;
    if summary.frames != frames {
        let message = format!("frames: {frames}; the data set has {}", summary.frames);
        return Err(wrong(message));
    }
    Ok(summary.root)
}

/// Returns the numbers of the missing shards, from commit records.
#[pyfunction]
pub(crate) fn missing(py: Python<'_>, out: PathBuf, frames: u64) -> PyResult<Vec<u64>> {
    if frames == 0 || frames > MAX_FRAMES {
        return Err(wrong(format!("frames: {frames} is out of range: expected 1 to {MAX_FRAMES}")));
    }
    let found = py.detach(|| missing_shards(&Dataset::open(&Location::at(&out)?)?, 0..frames, Check::Sizes));
    Ok(found.map_err(|error| error::dataset(&error))?.into_iter().flatten().collect())
}

/// Verifies a data set for `papsynth.verify`.
#[pyfunction]
#[pyo3(signature = (out, frames=None))]
pub(crate) fn verify(py: Python<'_>, out: PathBuf, frames: Option<u64>) -> PyResult<Bound<'_, PyDict>> {
    let report = py.detach(|| {
        Location::at(&out).and_then(|location| papsynth_dataset::verify(&location, frames.map(|frames| 0..frames)))
    });
    let report = report.map_err(|error| error::dataset(&error))?;
    let result = PyDict::new(py);
    result.set_item("root", report.root)?;
    result.set_item("frames", report.frames)?;
    result.set_item("files", report.files)?;
    let findings = report.findings.into_iter().map(|finding| (finding.path, finding.message));
    result.set_item("findings", PyList::new(py, findings.collect::<Vec<_>>())?)?;
    Ok(result)
}
