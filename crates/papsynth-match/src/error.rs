//! What is refused.

/// Why nothing could be matched.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// There is no picture.
    #[error("there is no field to match")]
    NoField,
    /// A picture of another size than the first, or without light.
    #[error("field `{name}` {what}")]
    Field {
        /// Name of the picture.
        name: String,
        /// What is wrong with it.
        what: String,
    },
    /// There is nothing to learn stain and sizes from.
    #[error(
        "{found} nuclei were found in {fields} fields; at least {least} are needed. Is the size of a pixel right ({pixel_um} um)?"
    )]
    Nuclei {
        /// How many there are.
        found: usize,
        /// Fields.
        fields: usize,
        /// How many are needed.
        least: usize,
        /// Size of a pixel, µm.
        pixel_um: f64,
    },
    /// Most simulated recipes could not be drawn.
    #[error("only {made} of {asked} simulated recipes could be made: {reason}")]
    Table {
        /// How many could.
        made: usize,
        /// How many were tried.
        asked: usize,
        /// Why the last one could not.
        reason: String,
    },
    /// A parameter is outside its range, or the judge refuses a picture.
    #[error(transparent)]
    Judge(#[from] papsynth_judge::Error),
    /// The engine refuses the recipe to begin with.
    #[error("the recipe to begin with cannot be used: {0}")]
    Engine(String),
    /// Someone asked to stop.
    #[error("stopped")]
    Stopped,
}

impl From<papsynth::Error> for Error {
    fn from(error: papsynth::Error) -> Self {
        Self::Engine(error.to_string())
    }
}
