/// What can be wrong with parameters or with an outline.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A parameter lies outside its range.
    #[error("{field} = {value}: must be {accepted}")]
    Parameter {
        /// Name of the field.
        field: &'static str,
        /// Value found.
        value: f64,
        /// What would be accepted.
        accepted: &'static str,
    },
    /// The outline is no polygon.
    #[error("outline has {points} points: must have at least 3")]
    TooFewPoints {
        /// Number of points found.
        points: usize,
    },
    /// A point of the outline is NaN or infinite.
    #[error("outline[{index}] = ({x}, {y}): must be finite")]
    NotFinite {
        /// Index of the point.
        index: usize,
        /// Its x.
        x: f64,
        /// Its y.
        y: f64,
    },
    /// The outline encloses nothing.
    #[error("outline encloses an area of {area}: must be greater than 0")]
    NoArea {
        /// Area found.
        area: f64,
    },
}
