//! Errors.

/// An invalid parameter or input, or a stop.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A parameter is out of range.
    #[error("{field} = {value} is out of range: expected {accepted}")]
    Parameter {
        /// Name of the field.
        field: &'static str,
        /// Its value.
        value: f64,
        /// Accepted range.
        accepted: &'static str,
    },
    /// An image with an invalid size, invalid grey levels or invalid nuclei.
    #[error("image `{name}` {what}")]
    Image {
        /// Name of the image.
        name: String,
        /// Description of the error.
        what: String,
    },
    /// Too few fields for cross-validation.
    #[error("{count} {side} {}; expected {least} or more, because cross-validation never splits a field", if *count == 1 { "field" } else { "fields" })]
    Fields {
        /// "real" or "synthetic".
        side: &'static str,
        /// Number of fields.
        count: usize,
        /// Minimum number.
        least: usize,
    },
    /// Fields that were measured with different parameters.
    #[error("field `{name}` was measured with other parameters than the first; measure both sides with one `Measurer`")]
    Measurer {
        /// Name of the field.
        name: String,
    },
    /// The stop flag was set.
    #[error("stopped")]
    Stopped,
}

impl Error {
    /// Checks parameters: each with its name, value, minimum and maximum, and the accepted range in words.
    ///
    /// # Errors
    /// [`Error::Parameter`] for the first one out of range.
    pub fn check(parameters: &[(&'static str, f64, [f64; 2], &'static str)]) -> Result<(), Self> {
        let bad = parameters.iter().find(|(_, value, [least, most], _)| !(value >= least && value <= most));
        bad.map_or(Ok(()), |&(field, value, _, accepted)| Err(Self::Parameter { field, value, accepted }))
    }
}
