//! What is refused.

/// Why nothing could be matched.
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
    /// There is no picture.
    #[error("there is no field to match")]
    NoField,
    /// Pictures of different sizes.
    #[error(
        "field `{name}` is {width} x {height} pixels, the first is {of_first}; one microscope takes fields of one size"
    )]
    Size {
        /// Name of the picture.
        name: String,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Size of the first.
        of_first: String,
    },
    /// A picture without light.
    #[error(
        "field `{name}` is black: its brightest pixels are at {level:.1} of 255, and an empty slide is expected to be brighter than {least:.0}"
    )]
    Black {
        /// Name of the picture.
        name: String,
        /// Its brightest level.
        level: f64,
        /// What is expected.
        least: f64,
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
    /// The judge refuses a picture.
    #[error(transparent)]
    Judge(#[from] papsynth_judge::Error),
    /// The engine refuses the recipe to begin with.
    #[error("the recipe to begin with cannot be used: {0}")]
    Engine(String),
    /// Someone asked to stop.
    #[error("stopped")]
    Stopped,
}
