//! What can go wrong.

use std::io;

/// Why a page cannot be served.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The port cannot be listened at.
    #[error("cannot listen at 127.0.0.1, port {port}: {source}; expected a port that is free, or none for any")]
    Listen {
        /// The port.
        port: u16,
        /// What the system said.
        source: io::Error,
    },
    /// The system clock shows a time before 1970 or after 9999, which HTTP cannot express.
    #[error("the system clock is outside the years 1970 to 9999; set the date")]
    Clock,
    /// A data set or slide cannot be read, or a folder holds nothing that is shown.
    #[error(transparent)]
    Dataset(Box<papsynth_dataset::Error>),
    /// A study cannot be kept on the disk.
    #[error(transparent)]
    Study(Box<papsynth_study::Error>),
}

impl From<papsynth_dataset::Error> for Error {
    fn from(error: papsynth_dataset::Error) -> Self {
        Self::Dataset(Box::new(error))
    }
}

impl From<papsynth_study::Error> for Error {
    fn from(error: papsynth_study::Error) -> Self {
        Self::Study(Box::new(error))
    }
}

impl Error {
    /// Whether the system failed, so that trying again may help; everything else lies in what was asked for.
    #[must_use]
    pub fn is_io(&self) -> bool {
        match self {
            Self::Dataset(error) => error.is_io(),
            Self::Study(error) => error.is_io(),
            Self::Listen { .. } | Self::Clock => false,
        }
    }
}
