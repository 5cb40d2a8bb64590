//! What can go wrong.

use std::fmt::Display;
use std::io;
use std::path::Path;

/// Why a study cannot begin or go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// What was asked for cannot be, or what lies there is not what is expected; the message names it.
    #[error("{0}")]
    Refused(String),
    /// An image or a data set cannot be read, or the system refused to read or write.
    #[error(transparent)]
    Dataset(#[from] papsynth_dataset::Error),
}

impl Error {
    /// Whether the system failed (full disk, no permission), so that trying again may help; everything else lies in what was
    /// asked for.
    #[must_use]
    pub fn is_io(&self) -> bool {
        matches!(self, Self::Dataset(error) if error.is_io())
    }

    pub(crate) fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| match source.kind() {
            // A name that leads nowhere is what was asked for.
            io::ErrorKind::NotFound => Self::Refused(format!("cannot {action} {}: {source}", path.display())),
            _ => papsynth_dataset::Error::Io { action, path: path.to_owned(), source }.into(),
        }
    }

    pub(crate) fn parameter(field: &str, value: impl Display, expected: &str) -> Self {
        Self::Refused(format!("{field}: {value} is not accepted; expected {expected}"))
    }

    pub(crate) fn folder(path: &Path, message: impl Display) -> Self {
        Self::Refused(format!("{}: {message}", path.display()))
    }
}
