//! Threads that frames share. A process that was forked has none of its parent's, so each makes its own.

use std::process;
use std::sync::{Arc, Mutex, PoisonError};

use pyo3::pyfunction;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// The pool of the process of that number, with so many threads.
struct Own {
    process: u32,
    threads: usize,
    pool: Arc<ThreadPool>,
}

static POOL: Mutex<Option<Own>> = Mutex::new(None);

/// The pool of this process with as many threads as are asked for, 0 for as many as there are processors.
pub(crate) fn of(threads: usize) -> Result<Arc<ThreadPool>, String> {
    let mut own = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(Own { process, threads: found, pool }) = own.as_ref()
        && *process == process::id()
        && *found == threads
    {
        return Ok(Arc::clone(pool));
    }
    let pool = ThreadPoolBuilder::new().num_threads(threads).build().map_err(|error| error.to_string())?;
    let pool = Arc::new(pool);
    // What a parent has left is not dropped: its threads are not there to be waited for.
    if let Some(Own { process, pool, .. }) =
        own.replace(Own { process: process::id(), threads, pool: Arc::clone(&pool) })
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
