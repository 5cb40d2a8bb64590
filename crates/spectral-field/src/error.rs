use thiserror::Error as ThisError;

/// Error of invalid [`FieldParams`](crate::FieldParams).
#[derive(Debug, Clone, PartialEq, ThisError)]
#[non_exhaustive]
pub enum Error {
    /// The width or height is zero, or the FFT grid would be too large.
    #[error("{field} is {value} px; accepted: 1 to {largest}")]
    Size {
        /// The invalid field of [`FieldParams`](crate::FieldParams).
        field: &'static str,
        /// The rejected value.
        value: usize,
        /// The largest accepted value.
        largest: usize,
    },
    /// A parameter of the spectrum is out of range.
    #[error("{field} is {value}; accepted: {accepted}")]
    Spectrum {
        /// The invalid field of [`Spectrum`](crate::Spectrum).
        field: &'static str,
        /// The rejected value.
        value: f64,
        /// The accepted range.
        accepted: &'static str,
    },
}
