use core::ops::RangeInclusive;

use thiserror::Error;

/// Error of invalid parameters or unusable frames.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// A number is out of range.
    #[error("{field} is {value}; it must be {accepted}")]
    OutOfRange {
        /// Path of the field, such as `photon_noise.mean_e`.
        field: &'static str,
        /// The rejected value.
        value: f64,
        /// Description of the accepted values.
        accepted: &'static str,
    },
    /// Too few frames or levels to measure.
    #[error("too few {what}: {found}, expected at least {needed}")]
    TooFew {
        /// Plural noun of the counted items.
        what: &'static str,
        /// Number of items found.
        found: usize,
        /// Number of items required.
        needed: usize,
    },
    /// Frames differ in size.
    #[error(
        "a frame has {} x {} pixels ({pixels} in total), but the previous frames have {} x {}",
        found[0], found[1], expected[0], expected[1]
    )]
    Size {
        /// Width and height of the first frame.
        expected: [usize; 2],
        /// Width and number of complete rows of this frame.
        found: [usize; 2],
        /// Number of pixels of this frame.
        pixels: usize,
    },
    /// No dark frames were added.
    #[error("no dark frames: add at least two, taken with the shutter closed")]
    NoDark,
    /// All flats are saturated.
    #[error(
        "all levels of flats are saturated ({levels} in total): more than 0.2 % of the pixels are at {highest}, the \
         highest grey level; take flats with less light"
    )]
    Saturated {
        /// Number of levels.
        levels: usize,
        /// Highest grey level.
        highest: u16,
    },
    /// Dark frames are clipped at 0.
    #[error(
            "{:.1} % of the dark frames' pixels are at 0, expected at most 0.5 %: raise the offset of the camera",
            100.0 * fraction
    )]
    DarkClipped {
        /// Fraction of pixels at 0.
        fraction: f64,
    },
    /// The gain cannot be determined.
    #[error(
        "mean and variance do not increase with light (the brightest unsaturated flat is {above_dark_dn:.1} grey \
             levels above dark)"
    )]
    NoResponse {
        /// Mean of the brightest unsaturated flat minus the mean dark level, in grey levels.
        above_dark_dn: f64,
    },
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

/// Returns `value` if it is finite and `holds` is true.
pub(crate) fn require(field: &'static str, value: f64, holds: bool, accepted: &'static str) -> Result<f64, Error> {
    if value.is_finite() && holds { Ok(value) } else { Err(Error::OutOfRange { field, value, accepted }) }
}
