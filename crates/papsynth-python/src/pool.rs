//! The thread pool. A forked process has no threads of its parent, so each process creates its own pool.

use std::process;
use std::sync::{Arc, Mutex, PoisonError};

use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::wrong;

const MAX_THREADS: usize = 1024;

/// The pool of a process.
struct ProcessPool {
    process: u32,
    threads: usize,
    pool: Arc<ThreadPool>,
}

/// Locked only by threads attached to the interpreter, and so is a fork: the lock is free in a forked process.
static POOL: Mutex<Option<ProcessPool>> = Mutex::new(None);

/// Returns the pool of this process with a number of threads; 0 means all processors.
pub(crate) fn of(py: Python<'_>, threads: usize) -> PyResult<Arc<ThreadPool>> {
    if threads > MAX_THREADS {
        return Err(wrong(format!("threads: {threads} is out of range: expected 0 to {MAX_THREADS}")));
    }
    if let Some(ProcessPool { process, threads: found, pool }) =
        POOL.lock().unwrap_or_else(PoisonError::into_inner).as_ref()
        && *process == process::id()
        && *found == threads
    {
        return Ok(Arc::clone(pool));
    }
    let built = py.detach(|| ThreadPoolBuilder::new().num_threads(threads).build());
    let pool = Arc::new(built.map_err(|error| wrong(format!("threads: {threads}: {error}")))?);
    let own = ProcessPool { process: process::id(), threads, pool: Arc::clone(&pool) };
    let before = POOL.lock().unwrap_or_else(PoisonError::into_inner).replace(own);
    // The pool of a parent is leaked: dropping it would wait for threads that do not exist.
    if let Some(ProcessPool { process, pool, .. }) = before
        && process != process::id()
    {
        std::mem::forget(pool);
    }
    Ok(pool)
}

/// Discards the pool of the parent in a forked process.
#[pyfunction]
#[pyo3(name = "_after_fork")]
pub(crate) fn after_fork() {
    if let Ok(mut own) = POOL.try_lock()
        && let Some(ProcessPool { pool, .. }) = own.take()
    {
        std::mem::forget(pool);
    }
}
