//! Threads that frames share. A process that was forked has none of its parent's, so each makes its own.

use std::process;
use std::sync::{Arc, Mutex, PoisonError};

use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::wrong;

const MOST: usize = 1024;

/// The pool of the process of that number, with so many threads.
struct Own {
    process: u32,
    threads: usize,
    pool: Arc<ThreadPool>,
}

/// Held only by who is attached to the interpreter, as is whoever forks: in the child of a fork nobody holds it.
static POOL: Mutex<Option<Own>> = Mutex::new(None);

/// The pool of this process with as many threads as are asked for, 0 for as many as there are processors.
pub(crate) fn of(py: Python<'_>, threads: usize) -> PyResult<Arc<ThreadPool>> {
    if threads > MOST {
        return Err(wrong(format!("threads: {threads}; expected 0 to {MOST}")));
    }
    if let Some(Own { process, threads: found, pool }) = POOL.lock().unwrap_or_else(PoisonError::into_inner).as_ref()
        && *process == process::id()
        && *found == threads
    {
        return Ok(Arc::clone(pool));
    }
    let built = py.detach(|| ThreadPoolBuilder::new().num_threads(threads).build());
    let pool = Arc::new(built.map_err(|error| wrong(format!("threads: {threads}: {error}")))?);
    let own = Own { process: process::id(), threads, pool: Arc::clone(&pool) };
    let before = POOL.lock().unwrap_or_else(PoisonError::into_inner).replace(own);
    // What a parent has left is not dropped: its threads are not there to be waited for.
    if let Some(Own { process, pool, .. }) = before
        && process != process::id()
    {
        std::mem::forget(pool);
    }
    Ok(pool)
}

/// Called in the child of a fork: what is left of the parent's threads is forgotten.
#[pyfunction]
#[pyo3(name = "_after_fork")]
pub(crate) fn after_fork() {
    if let Ok(mut own) = POOL.try_lock()
        && let Some(Own { pool, .. }) = own.take()
    {
        std::mem::forget(pool);
    }
}
