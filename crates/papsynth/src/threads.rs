//! Work on one frame by one thread or by several, with the same results in the same order.

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
        Threads::One => items.iter().map(work).collect(),
        Threads::All => map_all(items, work),
    }
}

/// How many items are worked on side by side.
pub(crate) fn count(threads: Threads) -> usize {
    match threads {
        Threads::One => 1,
        Threads::All => all(),
    }
}

#[cfg(feature = "threads")]
fn all() -> usize {
    rayon::current_num_threads()
}

#[cfg(not(feature = "threads"))]
fn all() -> usize {
    1
}

#[cfg(feature = "threads")]
fn map_all<T: Sync, R: Send>(items: &[T], work: impl Fn(&T) -> R + Sync + Send) -> Vec<R> {
    use rayon::prelude::*;
    items.par_iter().map(work).collect()
}

#[cfg(not(feature = "threads"))]
fn map_all<T: Sync, R: Send>(items: &[T], work: impl Fn(&T) -> R + Sync + Send) -> Vec<R> {
    items.iter().map(work).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn order_is_kept() {
        let items: Vec<u32> = (0..1000).collect();
        assert_eq!(map(Threads::All, &items, |x| x * 3), map(Threads::One, &items, |x| x * 3));
    }
}
