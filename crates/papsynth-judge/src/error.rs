//! What is refused.

/// Why something cannot be judged.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A parameter is outside its range.
    #[error("{field} is {value}; accepted is {accepted}")]
    Parameter {
        /// Name of the field.
        field: &'static str,
        /// Its value.
        value: f64,
        /// What would be accepted.
        accepted: &'static str,
    },
    /// A picture whose size, grey levels or nuclei cannot be right.
    #[error("picture `{name}` {what}")]
    Picture {
        /// Name of the picture.
        name: String,
        /// What is wrong with it.
        what: String,
    },
    /// Too few pictures to set some aside.
    #[error("there are {count} {side} fields; at least {least} are needed, since fields are never split between folds")]
    Fields {
        /// "real" or "synthetic".
        side: &'static str,
        /// How many there are.
        count: usize,
        /// How many are needed.
        least: usize,
    },
    /// Pictures that were measured in different ways.
    #[error("field `{name}` was measured with other parameters than the first; measure both sides with one gauge")]
    Gauge {
        /// Name of the field.
        name: String,
    },
}

impl Error {
    /// Refuses the first parameter that is outside its range: each with its name, value, least and most, and what would be accepted.
    ///
    /// # Errors
    /// If one is.
    pub fn check(parameters: &[(&'static str, f64, [f64; 2], &'static str)]) -> Result<(), Self> {
        let bad = parameters.iter().find(|(_, value, [least, most], _)| !(value >= least && value <= most));
        bad.map_or(Ok(()), |&(field, value, _, accepted)| Err(Self::Parameter { field, value, accepted }))
    }
}
