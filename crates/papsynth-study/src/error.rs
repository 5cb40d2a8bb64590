//! Errors.

use std::fmt::Display;
use std::io;
use std::path::Path;

/// An error of a study.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The input is invalid; the message states what and why.
    #[error("{0}")]
    Refused(String),
    /// An image or a data set cannot be read, or a file operation failed.
    #[error(transparent)]
    Dataset(#[from] papsynth_dataset::Error),
}

impl Error {
    /// Whether the system failed (full disk, no permission), so that a retry may succeed. All other errors are in the
    /// input.
    #[must_use]
    pub fn is_io(&self) -> bool {
        matches!(self, Self::Dataset(error) if error.is_io())
    }

    pub(crate) fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| match source.kind() {
            // A missing file is an error of the input.
            io::ErrorKind::NotFound => Self::Refused(format!("cannot {action} {}: {source}", path.display())),
            _ => papsynth_dataset::Error::Io { action, path: path.to_owned(), source }.into(),
        }
    }

    pub(crate) fn parameter(field: &str, value: impl Display, expected: &str) -> Self {
        Self::Refused(format!("{field}: {value} is invalid; expected {expected}"))
    }

    pub(crate) fn folder(path: &Path, message: impl Display) -> Self {
        Self::Refused(format!("{}: {message}", path.display()))
    }
}
