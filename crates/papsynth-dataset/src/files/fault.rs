//! Injected failures of the disk for tests: every call that accesses the disk passes a fault point.

#[cfg(test)]
thread_local! {
    /// Fault points that still succeed; `None`: all succeed.
    pub(crate) static LEFT: std::cell::Cell<Option<usize>> = const { std::cell::Cell::new(None) };
    /// Error kind of the next failure.
    pub(crate) static KIND: std::cell::Cell<std::io::ErrorKind> = const { std::cell::Cell::new(std::io::ErrorKind::StorageFull) };
}

#[cfg(not(test))]
#[expect(clippy::unnecessary_wraps, reason = "fails in tests")]
pub(crate) fn point() -> std::io::Result<()> {
    Ok(())
}

#[cfg(not(test))]
pub(crate) fn sync(file: &std::fs::File) -> std::io::Result<()> {
    file.sync_all()
}

/// Tests skip the slow sync.
#[cfg(test)]
pub(crate) fn sync(_: &std::fs::File) -> std::io::Result<()> {
    point()
}

#[cfg(test)]
pub(crate) fn point() -> std::io::Result<()> {
    LEFT.with(|left| match left.get() {
        None => Ok(()),
        Some(0) => Err(std::io::Error::new(KIND.get(), "injected failure")),
        Some(n) => {
            left.set(Some(n - 1));
            Ok(())
        }
    })
}

/// Runs `make` repeatedly; in each run the disk fails at another call: at each of the `first` calls, then at every
/// seventh. Checks that no file is partial except `may_change`, that the error names the folder, and that the next run
/// completes the output. Returns the number of failures.
#[cfg(test)]
pub(crate) fn everywhere<T: std::fmt::Debug>(
    name: &str,
    first: usize,
    may_change: &str,
    make: impl Fn(&std::path::Path) -> Result<T, crate::error::Error>,
) -> usize {
    use std::io::ErrorKind;

    use crate::support::{Scratch, contents};

    let good = Scratch::new(&format!("{name}-none"));
    make(good.path()).unwrap();
    let expected = contents(good.path());
    let kinds = [ErrorKind::StorageFull, ErrorKind::PermissionDenied, ErrorKind::Other];
    for (failures, passed) in (0..first).chain((first..).step_by(7)).enumerate() {
        let scratch = Scratch::new(name);
        KIND.set(kinds[failures % 3]);
        LEFT.set(Some(passed));
        let result = make(scratch.path());
        LEFT.set(None);
        let Err(error) = result else { return failures };
        assert!(error.is_io() && error.to_string().contains(&*scratch.path().to_string_lossy()), "{error}");
        for (name, bytes) in contents(scratch.path()) {
            let whole = expected.iter().any(|(n, b)| *n == name && (*b == bytes || name == may_change));
            assert!(whole, "{name} after {passed} calls");
        }
        make(scratch.path()).unwrap();
        assert_eq!(contents(scratch.path()), expected, "after {passed} calls");
    }
    unreachable!("a run ends")
}
