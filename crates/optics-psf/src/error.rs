use core::ops::RangeInclusive;

use thiserror::Error;

/// Why parameters were refused.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// One number lies outside the range its field allows.
    #[error("{field} is {value}; it must be {accepted}")]
    OutOfRange {
        /// Name of the field or argument.
        field: &'static str,
        /// What it held.
        value: f64,
        /// What would be accepted.
        accepted: &'static str,
    },
    /// A window reaches beyond the image, or is too small.
    #[error(
        "the window ({window:?}) must lie inside the image of {width} x {height} pixels and be at least {least} pixels wide and high"
    )]
    Window {
        /// Which window.
        window: crate::window::Window,
        /// Width of the image.
        width: usize,
        /// Height of the image.
        height: usize,
        /// Least side.
        least: usize,
    },
    /// The sharpest plane of a stack is its first or last.
    #[error(
        "the sharpest of {planes} planes is number {sharpest}, the stack's end; it must have planes on both sides of focus"
    )]
    NoFocusInside {
        /// Which plane, counted from 0.
        sharpest: usize,
        /// How many there are.
        planes: usize,
    },
    /// There is nothing in a window to be measured.
    #[error("the window holds no {thing} to measure")]
    Nothing {
        /// What was looked for.
        thing: &'static str,
    },
}

/// `value`, if it is finite and `holds`.
pub(crate) fn require(field: &'static str, value: f64, holds: bool, accepted: &'static str) -> Result<f64, Error> {
    if value.is_finite() && holds { Ok(value) } else { Err(Error::OutOfRange { field, value, accepted }) }
}

/// `value`, if it lies in a range.
pub(crate) fn within(
    field: &'static str,
    value: f64,
    range: RangeInclusive<f64>,
    accepted: &'static str,
) -> Result<f64, Error> {
    require(field, value, range.contains(&value), accepted)
}
