use core::ops::RangeInclusive;

use thiserror::Error;

/// Error of invalid parameters or images.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// A number is out of range.
    #[error("{field} is {value}; it must be {accepted}")]
    OutOfRange {
        /// Name of the field or argument.
        field: &'static str,
        /// The rejected value.
        value: f64,
        /// Description of the accepted values.
        accepted: &'static str,
    },
    /// A window exceeds the image or is too small.
    #[error(
        "the window must be inside the image of {width} x {height} pixels and at least {min_side} pixels wide and high"
    )]
    Window {
        /// The window.
        window: crate::window::Window,
        /// Width of the image.
        width: usize,
        /// Height of the image.
        height: usize,
        /// Smallest width and height.
        min_side: usize,
    },
    /// The sharpest plane of a stack is its first or last.
    #[error(
        "plane {} of {planes} is the sharpest, but it is the first or last plane: record planes on both sides of focus",
        sharpest + 1
    )]
    FocusAtStackEnd {
        /// Index of the sharpest plane, from 0.
        sharpest: usize,
        /// Number of planes.
        planes: usize,
    },
    /// A window contains nothing measurable.
    #[error("the window holds no {what} to measure")]
    NothingToMeasure {
        /// The missing structure.
        what: &'static str,
    },
}

/// Returns `value` if it is finite and `holds` is true.
pub(crate) fn require(field: &'static str, value: f64, holds: bool, accepted: &'static str) -> Result<f64, Error> {
    if value.is_finite() && holds { Ok(value) } else { Err(Error::OutOfRange { field, value, accepted }) }
}

/// Returns `value` if it is in `range`.
pub(crate) fn within(
    field: &'static str,
    value: f64,
    range: RangeInclusive<f64>,
    accepted: &'static str,
) -> Result<f64, Error> {
    require(field, value, range.contains(&value), accepted)
}
