//! What can go wrong.

use std::io;

/// Why nothing can be served.
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
}
