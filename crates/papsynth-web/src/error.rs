//! The error type.

use std::io;

/// An error of the server or of a page.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The port is not available.
    #[error("cannot listen on 127.0.0.1:{port}: {source}; choose a free port, or omit it")]
    Listen {
        /// The port.
        port: u16,
        /// The system error.
        source: io::Error,
    },
    /// The system clock shows a time before 1970 or after 9999, which HTTP cannot express.
    #[error("the system clock is outside the years 1970 to 9999; set the date")]
    Clock,
    /// A data set or slide cannot be read, or the folder contains neither.
    #[error(transparent)]
    Dataset(Box<papsynth_dataset::Error>),
    /// The model of a workbench is invalid.
    #[error(transparent)]
    Engine(Box<papsynth::Error>),
    /// A study cannot be saved.
    #[cfg(feature = "server")]
    #[error(transparent)]
    Study(Box<papsynth_study::Error>),
}

impl From<papsynth_dataset::Error> for Error {
    fn from(error: papsynth_dataset::Error) -> Self {
        Self::Dataset(Box::new(error))
    }
}

impl From<papsynth::Error> for Error {
    fn from(error: papsynth::Error) -> Self {
        Self::Engine(Box::new(error))
    }
}

#[cfg(feature = "server")]
impl From<papsynth_study::Error> for Error {
    fn from(error: papsynth_study::Error) -> Self {
        Self::Study(Box::new(error))
    }
}

impl Error {
    /// Whether this is an I/O error, for which a retry may help.
    #[must_use]
    pub fn is_io(&self) -> bool {
        match self {
            Self::Dataset(error) => error.is_io(),
            #[cfg(feature = "server")]
            Self::Study(error) => error.is_io(),
            Self::Engine(_) | Self::Listen { .. } | Self::Clock => false,
        }
    }
}
