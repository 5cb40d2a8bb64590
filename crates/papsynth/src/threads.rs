//! Work on one frame by one thread or by several, with the same results in the same order.

#[cfg(feature = "threads")]
use rayon::prelude::*;

/// How many threads work on one frame. The bytes are the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Threads {
    /// The calling thread alone: for callers who make several frames side by side.
    One,
    /// All of the current rayon pool; the calling thread alone without the feature `threads`.
    All,
}

/// Applies a function to every item; results come in the order of the items.
pub(crate) fn map<T: Sync, R: Send>(threads: Threads, items: &[T], work: impl Fn(&T) -> R + Sync + Send) -> Vec<R> {
    match threads {
        #[cfg(feature = "threads")]
        Threads::All => items.par_iter().map(work).collect(),
        _ => items.iter().map(work).collect(),
    }
}

/// Applies a function to all numbers below `count` and hands over each result, in order.
pub(crate) fn each<R: Send, E>(
    threads: Threads,
    count: usize,
    work: impl Fn(usize) -> R + Sync + Send,
    mut visit: impl FnMut(usize, R) -> Result<(), E>,
) -> Result<(), E> {
    let numbers: Vec<usize> = (0..count).collect();
    // One thread hands a result over while it is still in the cache; of several threads so many are in memory at one time.
    let chunk = match threads {
        Threads::One => 1,
        Threads::All => 64,
    };
    for chunk in numbers.chunks(chunk) {
        for (&number, made) in chunk.iter().zip(map(threads, chunk, |&number| work(number))) {
            visit(number, made)?;
        }
    }
    Ok(())
}

/// How many items are worked on side by side.
pub(crate) fn count(threads: Threads) -> usize {
    match threads {
        #[cfg(feature = "threads")]
        Threads::All => rayon::current_num_threads(),
        _ => 1,
    }
}
