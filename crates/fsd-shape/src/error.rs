//! Errors.

/// An invalid mask, outline, parameter or set of statistics.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The length of the mask is not a multiple of its width.
    #[error("mask of {len} values, width {width}: expected a width of at least 1 that divides the number of values")]
    MaskSize {
        /// Number of values.
        len: usize,
        /// The width.
        width: usize,
    },
    /// A value of the mask is NaN or infinite.
    #[error("mask value {value} at x {x}, y {y}: expected a finite number")]
    MaskValue {
        /// The value.
        value: f32,
        /// Its column.
        x: usize,
        /// Its row.
        y: usize,
    },
    /// No value of the mask exceeds the level.
    #[error("empty mask: no value exceeds the level {level}")]
    EmptyMask {
        /// The level.
        level: f32,
    },
    /// The mask contains more than one object.
    #[error("the mask has {count} components above the level: expected 1")]
    SeveralComponents {
        /// Number of components.
        count: usize,
    },
    /// An outline has too few points.
    #[error("the outline has {count} points: expected at least {needed}")]
    TooFewPoints {
        /// Number of points.
        count: usize,
        /// Smallest accepted number.
        needed: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("point {index} of the outline: expected finite coordinates")]
    PointValue {
        /// Index of the point.
        index: usize,
    },
    /// An outline encloses no area.
    #[error("the outline encloses no area")]
    NoArea,
    /// An outline of a training set is invalid.
    #[error("outline {index} of the training set: {source}")]
    TrainingOutline {
        /// Index of the outline, from 0.
        index: usize,
        /// The cause.
        source: Box<Error>,
    },
    /// Too few outlines to fit a model.
    #[error("{count} outlines are too few for a shape model: expected at least {needed}")]
    TooFewOutlines {
        /// Number of outlines.
        count: usize,
        /// Smallest accepted number.
        needed: usize,
    },
    /// A parameter is out of range.
    #[error("{field} = {value} is out of range: expected {accepted}")]
    Parameter {
        /// Name of the parameter.
        field: &'static str,
        /// The value.
        value: f64,
        /// The accepted range.
        accepted: &'static str,
    },
    /// Inconsistent statistics.
    #[error("shape statistics: {field} {problem}")]
    Statistics {
        /// Name of the field.
        field: &'static str,
        /// The problem.
        problem: String,
    },
    /// All attempts of a draw intersected themselves or had negative area.
    #[error("no simple outline in {tries} attempts: the standard deviations are too large for {harmonics} harmonics")]
    NoSimpleOutline {
        /// Number of attempts.
        tries: u32,
        /// Harmonics of the model.
        harmonics: usize,
    },
}
