use core::ops::RangeInclusive;

use thiserror::Error;

/// Why parameters or frames were refused.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// One number lies outside the range its field allows.
    #[error("{field} is {value}; it must be {accepted}")]
    OutOfRange {
        /// Path of the field, as in `photon_noise.mean_e`.
        field: &'static str,
        /// What it held.
        value: f64,
        /// What would be accepted.
        accepted: &'static str,
    },
    /// There is too little to measure on.
    #[error("{found} {what}; {needed} or more are needed")]
    TooFew {
        /// Of what.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many would do.
        needed: usize,
    },
    /// Frames differ in size.
    #[error(
        "a frame has {} x {} pixels ({pixels} in all); the frames before it have {} x {}",
        found[0], found[1], expected[0], expected[1]
    )]
    Size {
        /// Width and height of the first frame.
        expected: [usize; 2],
        /// Width, and whole rows of it.
        found: [usize; 2],
        /// How many pixels it has.
        pixels: usize,
    },
    /// There is no level without light.
    #[error("no dark frames; two or more, taken with the shutter closed, are needed")]
    NoDark,
    /// No flat is usable.
    #[error(
        "all {levels} levels of flats are saturated: more than 0.2 % of their pixels are at {highest}, the highest \
         level; take some in less light"
    )]
    Saturated {
        /// How many levels there are.
        levels: usize,
        /// The highest grey level.
        highest: u16,
    },
    /// The dark frames' noise is lost.
    #[error(
        "{:.1} % of the dark frames' pixels are at 0; at most 0.5 % may be: raise the offset of the camera",
        100.0 * share
    )]
    CutOff {
        /// The share of pixels at 0.
        share: f64,
    },
    /// The levels say nothing about the gain.
    #[error(
        "the levels are all alike: neither mean nor variance rises with light (the brightest flat in use is \
         {above_dark_dn:.1} grey levels above the dark)"
    )]
    Alike {
        /// Mean of the brightest flat in use, above that of the dark, in grey levels.
        above_dark_dn: f64,
    },
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

/// `value`, if it is finite and `holds`.
pub(crate) fn require(field: &'static str, value: f64, holds: bool, accepted: &'static str) -> Result<f64, Error> {
    if value.is_finite() && holds { Ok(value) } else { Err(Error::OutOfRange { field, value, accepted }) }
}
