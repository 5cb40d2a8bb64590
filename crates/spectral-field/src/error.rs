use thiserror::Error as ThisError;

/// Why a [`SpectralField`](crate::SpectralField) could not be planned.
#[derive(Debug, Clone, PartialEq, ThisError)]
#[non_exhaustive]
pub enum Error {
    /// A side of the window is zero, or the FFT grid around it would be too large.
    #[error("{field} is {value} px; accepted: 1 to {largest}")]
    Size {
        /// The field of [`FieldParams`](crate::FieldParams) at fault.
        field: &'static str,
        /// What it held.
        value: usize,
        /// The largest accepted value.
        largest: usize,
    },
    /// A number of the spectrum lies outside its range.
    #[error("{field} is {value}; accepted: {accepted}")]
    Spectrum {
        /// The field of [`Spectrum`](crate::Spectrum) at fault.
        field: &'static str,
        /// What it held.
        value: f64,
        /// The accepted range.
        accepted: &'static str,
    },
}
