//! Failures of the disk, made on purpose: every call that touches it passes a point.

#[cfg(test)]
thread_local! {
    /// Points that are still passed without harm; none set, all are.
    pub(crate) static LEFT: std::cell::Cell<Option<usize>> = const { std::cell::Cell::new(None) };
    /// How the next one fails: full disk, refused, broken.
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

/// No power will fail in a test, and the disk is slow.
#[cfg(test)]
pub(crate) fn sync(_: &std::fs::File) -> std::io::Result<()> {
    point()
}

#[cfg(test)]
pub(crate) fn point() -> std::io::Result<()> {
    LEFT.with(|left| match left.get() {
        None => Ok(()),
        Some(0) => Err(std::io::Error::new(KIND.get(), "on purpose")),
        Some(n) => {
            left.set(Some(n - 1));
            Ok(())
        }
    })
}
