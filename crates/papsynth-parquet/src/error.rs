//! What can go wrong.

use std::io;

use parquet::errors::ParquetError;

/// Why a table cannot be written or read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The system refused to read or write.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The file is no Parquet file, or not one that is read here.
    #[error("{0}")]
    Broken(String),
    /// A row does not fit the columns, or the columns fit no file.
    #[error("{0}")]
    Table(String),
}

impl Error {
    pub(crate) fn broken<T>(message: impl Into<String>) -> Result<T, Self> {
        Err(Self::Broken(message.into()))
    }

    pub(crate) fn table<T>(message: impl Into<String>) -> Result<T, Self> {
        Err(Self::Table(message.into()))
    }
}

impl From<ParquetError> for Error {
    fn from(error: ParquetError) -> Self {
        match error {
            ParquetError::External(inner) => match inner.downcast::<io::Error>() {
                Ok(io) => Self::Io(*io),
                Err(other) => Self::Broken(other.to_string()),
            },
            other => Self::Broken(other.to_string()),
        }
    }
}
