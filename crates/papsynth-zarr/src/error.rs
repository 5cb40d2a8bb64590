//! Errors.

use std::io;

/// Errors of this crate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument is invalid.
    #[error("{what}")]
    Argument {
        /// The argument, its value, and the accepted values.
        what: String,
    },
    /// The file of a shard does not match its array: it was truncated or changed, or belongs to another array.
    #[error("the shard is damaged: {what}")]
    Damaged {
        /// Description of the damage.
        what: String,
    },
    /// A file cannot be read, or the compressor has no memory.
    #[error(transparent)]
    Io(#[from] io::Error),
}

pub(crate) fn argument<T>(what: String) -> Result<T, Error> {
    Err(Error::Argument { what })
}

pub(crate) fn damaged<T>(what: String) -> Result<T, Error> {
    Err(Error::Damaged { what })
}
