//! What can go wrong.

use std::io;

/// Why something cannot be described, written or read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// What was asked for makes no sense.
    #[error("{what}")]
    Argument {
        /// What it is, and what would be accepted.
        what: String,
    },
    /// A file is not as its array says: it was cut, changed, or is another's.
    #[error("the shard is damaged: {what}")]
    Damaged {
        /// What is wrong with it.
        what: String,
    },
    /// The system refused to read, or there is no memory for the compressor.
    #[error(transparent)]
    Io(#[from] io::Error),
}

pub(crate) fn argument<T>(what: String) -> Result<T, Error> {
    Err(Error::Argument { what })
}

pub(crate) fn damaged<T>(what: String) -> Result<T, Error> {
    Err(Error::Damaged { what })
}
