/// An invalid parameter or outline.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A parameter is out of range.
    #[error("{field} = {value} is out of range: expected {accepted}")]
    Parameter {
        /// Name of the field.
        field: &'static str,
        /// The value.
        value: f64,
        /// The accepted range.
        accepted: &'static str,
    },
    /// The outline has too few points.
    #[error("the outline has {points} points: expected at least 3")]
    TooFewPoints {
        /// Number of points.
        points: usize,
    },
    /// A point of the outline is NaN or infinite.
    #[error("outline[{index}] = ({x}, {y}): expected finite coordinates")]
    NotFinite {
        /// Index of the point.
        index: usize,
        /// x coordinate of the point.
        x: f64,
        /// y coordinate of the point.
        y: f64,
    },
    /// The outline encloses no area.
    #[error("the outline encloses an area of {area}: expected more than 0")]
    NoArea {
        /// The area.
        area: f64,
    },
}
