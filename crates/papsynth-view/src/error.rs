//! What can go wrong before anything is shown.

use std::path::{Path, PathBuf};

/// Why a folder cannot be shown.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A data set or slide cannot be read.
    #[error(transparent)]
    Dataset(#[from] papsynth_dataset::Error),
    /// The folder holds nothing that is shown.
    #[error("{}: {message}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What is wrong, and what would help.
        message: String,
    },
}

impl Error {
    /// Whether the system failed, so that trying again may help; everything else lies in what was asked for.
    #[must_use]
    pub fn is_io(&self) -> bool {
        match self {
            Self::Dataset(error) => error.is_io(),
            Self::Folder { .. } => false,
        }
    }

    pub(crate) fn folder(path: &Path, message: impl Into<String>) -> Self {
        Self::Folder { path: path.to_owned(), message: message.into() }
    }
}
