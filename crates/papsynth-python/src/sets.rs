//! Data sets on the disk.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::Duration;

use papsynth::Threads;
use papsynth_dataset::{Check, Dataset, DatasetInfo, Format, Layout, Location, Progress, Run, Task, missing_shards};
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyDict, PyList};

use crate::engine::Engine;
use crate::error::{self, wrong};

/// How often it is looked whether Python wants to stop.
const LOOK: Duration = Duration::from_millis(50);

/// Most frames whose shards are listed.
const MOST_FRAMES: u64 = 1_000_000_000;

/// What `papsynth.generate` does, where what is given is described: numbers of frames that were "kept" and "made".
#[pyfunction]
#[pyo3(signature = (engine, out, frames, seed=0, *, shard=(0, 1), formats=None, frames_per_shard=None, scenes=false, threads=1, verify=false, progress=None))]
#[expect(clippy::too_many_arguments, reason = "Python names them")]
pub(crate) fn generate<'py>(
    py: Python<'py>,
    engine: &Bound<'py, Engine>,
    out: PathBuf,
    frames: u64,
    seed: u64,
    shard: (u64, u64),
    formats: Option<Vec<String>>,
    frames_per_shard: Option<u64>,
    scenes: bool,
    threads: usize,
    verify: bool,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let made_by = engine.get();
    let (index, of) = shard;
    if of == 0 || index >= of {
        return Err(wrong(format!("shard: ({index}, {of}) is none; expected (i, n) with i below n")));
    }
    for (name, number) in [("frames", frames), ("threads", threads as u64)] {
        if number == 0 {
            return Err(wrong(format!("{name}: 0; expected 1 or more")));
        }
    }
    let layout = Layout { scenes, ..layout(formats, frames_per_shard)? };
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
    let share = Task { index, total: of };
    let run = Run {
        frames: 0..frames,
        task: share,
        workers: threads,
        threads: Threads::One,
        check,
        stop: &stop,
        profile: None,
    };
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
                    // Nobody listens any more where Python has stopped.
                    let _ = sender.send(done);
                })
            });
            loop {
                let found = receiver.recv_timeout(LOOK);
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
    let outcome = outcome.map_err(|_| wrong("the engine has failed"))?.map_err(|error| match error {
        papsynth_dataset::Error::Engine(error) => error::engine(py, &made_by.source, &error),
        other => error::dataset(&other),
    })?;
    [("kept", outcome.present), ("made", outcome.written)].into_py_dict(py)
}

fn layout(formats: Option<Vec<String>>, frames_per_shard: Option<u64>) -> PyResult<Layout> {
    let formats: Vec<Format> = match formats {
        None => vec![Format::Folder],
        Some(names) => names.iter().map(|name| format(name)).collect::<PyResult<_>>()?,
    };
    let mut layout = Layout::new(formats);
    if let Some(frames) = frames_per_shard {
        if !(1..=1_000_000).contains(&frames) {
            return Err(wrong(format!("frames_per_shard: {frames}; expected 1 to 1000000")));
        }
        layout.frames_per_shard = frames;
    }
    Ok(layout)
}

fn format(name: &str) -> PyResult<Format> {
    Format::built().find(|format| format.name() == name).ok_or_else(|| {
        let known: Vec<&str> = Format::built().map(Format::name).collect();
        wrong(format!("formats: `{name}` is not known; expected some of {}", known.join(", ")))
    })
}

/// Number of shards of a data set of so many frames.
#[pyfunction]
#[pyo3(signature = (frames, formats=None, frames_per_shard=None))]
pub(crate) fn shards(frames: u64, formats: Option<Vec<String>>, frames_per_shard: Option<u64>) -> PyResult<u64> {
    Ok(frames.div_ceil(layout(formats, frames_per_shard)?.frames_per_shard))
}

/// What `papsynth.merge` does: the root hash.
#[pyfunction]
pub(crate) fn merge(py: Python<'_>, out: PathBuf, frames: u64) -> PyResult<String> {
    let gaps = missing(py, out.clone(), frames)?;
    if !gaps.is_empty() {
        let some: Vec<String> = gaps.iter().take(20).map(u64::to_string).collect();
        let message = format!("{}: {} shards are missing: {}", out.display(), gaps.len(), some.join(", "));
        return Err(wrong(message));
    }
    let summary =
        py.detach(|| Dataset::open(&Location::at(&out)?)?.finish()).map_err(|error| error::dataset(&error))?;
    if summary.frames != frames {
        let message = format!("frames: {frames}; expected {}, which are there", summary.frames);
        return Err(wrong(message));
    }
    Ok(summary.root)
}

/// Numbers of the shards that are not whole, from commit records: also while others work.
#[pyfunction]
pub(crate) fn missing(py: Python<'_>, out: PathBuf, frames: u64) -> PyResult<Vec<u64>> {
    if frames == 0 || frames > MOST_FRAMES {
        return Err(wrong(format!("frames: {frames}; expected 1 to {MOST_FRAMES}")));
    }
    let found = py.detach(|| missing_shards(&Dataset::open(&Location::at(&out)?)?, 0..frames, Check::Sizes));
    Ok(found.map_err(|error| error::dataset(&error))?.into_iter().flatten().collect())
}

/// What `papsynth.verify` gives, where it is described.
#[pyfunction]
#[pyo3(signature = (out, frames=None))]
pub(crate) fn verify(py: Python<'_>, out: PathBuf, frames: Option<u64>) -> PyResult<Bound<'_, PyDict>> {
    let report = py
        .detach(|| Location::at(&out).and_then(|home| papsynth_dataset::verify(&home, frames.map(|frames| 0..frames))));
    let report = report.map_err(|error| error::dataset(&error))?;
    let told = PyDict::new(py);
    told.set_item("root", report.root)?;
    told.set_item("frames", report.frames)?;
    told.set_item("files", report.files)?;
    let findings = report.findings.into_iter().map(|finding| (finding.path, finding.message));
    told.set_item("findings", PyList::new(py, findings.collect::<Vec<_>>())?)?;
    Ok(told)
}
