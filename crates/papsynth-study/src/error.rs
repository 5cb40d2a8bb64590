//! What can go wrong.

use std::io;
use std::path::{Path, PathBuf};

/// Why a study cannot begin or go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A parameter is out of its range.
    #[error("{field}: {value} is not accepted; expected {expected}")]
    Parameter {
        /// Its name.
        field: &'static str,
        /// What it was.
        value: String,
        /// What it could be.
        expected: &'static str,
    },
    /// An image or a data set cannot be read, or a file cannot be written.
    #[error(transparent)]
    Dataset(#[from] papsynth_dataset::Error),
    /// The system refused to read or write.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        /// What was tried: "read", "write", ….
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A file that was given lies elsewhere than in the folder that was given.
    #[error("{}: leads out of {}; only files in the folder itself are shown", path.display(), folder.display())]
    Outside {
        /// The file.
        path: PathBuf,
        /// The folder.
        folder: PathBuf,
    },
    /// A folder or file is not what is expected.
    #[error("{}: {message}", path.display())]
    Folder {
        /// The folder or file.
        path: PathBuf,
        /// What is wrong, and what would help.
        message: String,
    },
    /// The fields do not give enough patches.
    #[error(
        "{side}: {fields} fields give {found} patches with something on them that do not overlap much, {needed} are needed; \
         expected more or larger fields, fewer trials or smaller patches"
    )]
    TooFew {
        /// "real" or "synthetic".
        side: &'static str,
        /// Number of fields.
        fields: usize,
        /// Patches that were found.
        found: usize,
        /// Patches that the study shows.
        needed: usize,
    },
}

impl Error {
    /// Whether the system failed (full disk, no permission), so that trying again may help; everything else lies in what was
    /// asked for.
    #[must_use]
    pub fn is_io(&self) -> bool {
        match self {
            Self::Io { source, .. } => !matches!(
                source.kind(),
                io::ErrorKind::NotFound
                    | io::ErrorKind::IsADirectory
                    | io::ErrorKind::NotADirectory
                    | io::ErrorKind::AlreadyExists
                    | io::ErrorKind::InvalidInput
            ),
            Self::Dataset(error) => error.is_io(),
            _ => false,
        }
    }

    pub(crate) fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io { action, path: path.to_owned(), source }
    }

    pub(crate) fn folder(path: &Path, message: impl Into<String>) -> Self {
        Self::Folder { path: path.to_owned(), message: message.into() }
    }
}
