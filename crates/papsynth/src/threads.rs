//! Serial and parallel loops over the parts of one frame; both return the same results in the same order.

#[cfg(feature = "threads")]
use rayon::prelude::*;

/// The threads that render one frame. The output does not depend on this choice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Threads {
    /// The calling thread only, for callers that render several frames in parallel.
    One,
    /// All threads of the current rayon pool; without the feature `threads`, the calling thread only.
    All,
}

/// Applies a function to every item and returns the results in the order of the items.
pub(crate) fn map<T: Sync, R: Send>(threads: Threads, items: &[T], work: impl Fn(&T) -> R + Sync + Send) -> Vec<R> {
    match threads {
        #[cfg(feature = "threads")]
        Threads::All => items.par_iter().map(work).collect(),
        _ => items.iter().map(work).collect(),
    }
}

/// Applies a function to all numbers below `count` and passes each result to `visit`, in order.
pub(crate) fn each<R: Send, E>(
    threads: Threads,
    count: usize,
    work: impl Fn(usize) -> R + Sync + Send,
    mut visit: impl FnMut(usize, R) -> Result<(), E>,
) -> Result<(), E> {
    let numbers: Vec<usize> = (0..count).collect();
    // With one thread, each result is still in the cache when it is visited; with several, this bounds memory.
    let chunk = match threads {
        Threads::One => 1,
        Threads::All => 64,
    };
    for chunk in numbers.chunks(chunk) {
        for (&number, result) in chunk.iter().zip(map(threads, chunk, |&number| work(number))) {
            visit(number, result)?;
        }
    }
    Ok(())
}

/// Returns the number of items that are processed in parallel.
pub(crate) fn count(threads: Threads) -> usize {
    match threads {
        #[cfg(feature = "threads")]
        Threads::All => rayon::current_num_threads(),
        _ => 1,
    }
}
