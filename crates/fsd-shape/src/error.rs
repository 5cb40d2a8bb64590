//! What can be wrong with a mask, an outline, a parameter or a set of statistics.

/// Everything this crate can refuse.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The mask's length is no multiple of its width.
    #[error(
        "mask of {len} values is no whole number of rows of width {width}; width must be at least 1 and divide the length"
    )]
    MaskSize {
        /// Number of values given.
        len: usize,
        /// Width given.
        width: usize,
    },
    /// A value of the mask is NaN or infinite.
    #[error("mask value {value} at x {x}, y {y} is not finite")]
    MaskValue {
        /// The value.
        value: f32,
        /// Its column.
        x: usize,
        /// Its row.
        y: usize,
    },
    /// No value of the mask exceeds the level.
    #[error("mask is empty: no value exceeds the level {level}")]
    EmptyMask {
        /// The level asked for.
        level: f32,
    },
    /// The mask holds more than one object.
    #[error("mask holds {count} components above the level; an outline needs exactly 1")]
    SeveralComponents {
        /// How many there are.
        count: usize,
    },
    /// An outline has too few points.
    #[error("outline has {count} points; at least {needed} are needed")]
    TooFewPoints {
        /// Number of points given.
        count: usize,
        /// Fewest accepted.
        needed: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("point {index} of the outline is not finite")]
    PointValue {
        /// Which point.
        index: usize,
    },
    /// An outline encloses nothing.
    #[error("outline encloses no area")]
    NoArea,
    /// One outline of a training set is unusable.
    #[error("outline {index} of the training set: {source}")]
    TrainingOutline {
        /// Which outline, from 0.
        index: usize,
        /// What is wrong with it.
        source: Box<Error>,
    },
    /// Too few outlines to fit a model to.
    #[error("{count} outlines to fit a shape model to; at least {needed} are needed")]
    TooFewOutlines {
        /// Number of outlines given.
        count: usize,
        /// Fewest accepted.
        needed: usize,
    },
    /// A parameter lies outside its range.
    #[error("{field} is {value}; accepted: {accepted}")]
    Parameter {
        /// Name of the parameter.
        field: &'static str,
        /// Value given.
        value: f64,
        /// What would be accepted.
        accepted: &'static str,
    },
    /// Statistics that do not fit together.
    #[error("shape statistics: {field} {problem}")]
    Statistics {
        /// Name of the field.
        field: &'static str,
        /// What is wrong with it.
        problem: String,
    },
    /// Every try of a draw crossed itself or ran the wrong way round.
    #[error("no simple outline in {tries} tries; the statistics are too wild for {harmonics} harmonics")]
    NoSimpleOutline {
        /// Number of tries made.
        tries: u32,
        /// Harmonics of the model.
        harmonics: usize,
    },
}
