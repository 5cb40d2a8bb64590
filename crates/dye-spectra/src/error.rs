use thiserror::Error;

/// Why parameters were refused.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// One number lies outside the range its field allows.
    #[error("{field} is {value}; it must be {accepted}")]
    OutOfRange {
        /// Path of the field, as in `lamp.temperature_k`.
        field: &'static str,
        /// What it held.
        value: f64,
        /// What would be accepted.
        accepted: &'static str,
    },
}

/// Fails unless `value` is finite and `holds`.
pub(crate) fn require(field: &'static str, value: f64, holds: bool, accepted: &'static str) -> Result<(), Error> {
    if value.is_finite() && holds { Ok(()) } else { Err(Error::OutOfRange { field, value, accepted }) }
}
