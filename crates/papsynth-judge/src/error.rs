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
    /// A picture's length is no multiple of its width, or it is too small once invalid borders are gone.
    #[error("picture `{name}` is {width} x {height} pixels; accepted are at least {least} a side")]
    Size {
        /// Name of the picture.
        name: String,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Fewest columns and rows.
        least: usize,
    },
    /// A picture holds something that is no grey level, or only one.
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
