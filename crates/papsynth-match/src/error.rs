//! Errors.

/// A match that failed or was stopped.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// No images.
    #[error("no fields; expected 2 or more")]
    NoField,
    /// Too few images.
    #[error("{} for {what}; expected {least} or more, because fields differ", counted(*found, "field", "fields"))]
    Fields {
        /// Number of images.
        found: usize,
        /// Minimum number.
        least: usize,
        /// What they are for.
        what: &'static str,
    },
    /// An image of another size than the first one, or a black image.
    #[error("field `{name}` {what}")]
    Field {
        /// Name of the image.
        name: String,
        /// Description of the error.
        what: String,
    },
    /// Too few nuclei to estimate stain and sizes.
    #[error(
        "found {} in {}; expected {least} or more nuclei. Check the pixel size ({pixel_um} µm)",
        counted(*found, "nucleus", "nuclei"),
        counted(*fields, "field", "fields")
    )]
    Nuclei {
        /// Number of nuclei.
        found: usize,
        /// Number of fields.
        fields: usize,
        /// Minimum number of nuclei.
        least: usize,
        /// Pixel size, µm.
        pixel_um: f64,
    },
    /// Too many simulated recipes failed.
    #[error("only {succeeded} of {total} recipes could be simulated: {reason}")]
    Simulation {
        /// Recipes that could be simulated.
        succeeded: usize,
        /// All recipes.
        total: usize,
        /// Error of the last failed recipe.
        reason: String,
    },
    /// A parameter is out of range, or an image cannot be measured.
    #[error(transparent)]
    Judge(papsynth_judge::Error),
    /// The engine cannot render a recipe.
    #[error("the initial recipe cannot be simulated: {0}")]
    Engine(String),
    /// The stop flag was set.
    #[error("stopped")]
    Stopped,
}

/// Returns a count with its noun: "1 field", "2 fields".
fn counted(count: usize, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

impl From<papsynth_judge::Error> for Error {
    fn from(error: papsynth_judge::Error) -> Self {
        match error {
            papsynth_judge::Error::Stopped => Self::Stopped,
            other => Self::Judge(other),
        }
    }
}

impl From<papsynth::Error> for Error {
    fn from(error: papsynth::Error) -> Self {
        Self::Engine(error.to_string())
    }
}
