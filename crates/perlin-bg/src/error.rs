use thiserror::Error;

/// Why parameters were refused.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// One number lies outside the range its field allows.
    #[error("{field} is {value}; it must be {accepted}")]
    OutOfRange {
        /// Path of the field, as in `noise.persistence`.
        field: &'static str,
        /// What it held.
        value: f64,
        /// What would be accepted.
        accepted: &'static str,
    },
    /// A field of view without pixels.
    #[error("the field of view is {width} x {height} pixels; both sides must be at least 1")]
    EmptyField {
        /// Its width in pixels.
        width: usize,
        /// Its height in pixels.
        height: usize,
    },
    /// H(x, y) - c · I_pe(x, y) of Eq. 9 would reach zero or fall below it.
    #[error(
        "level {level} minus scatter.strength {strength} leaves no light; \
         scatter.strength must be smaller than level"
    )]
    NoLight {
        /// The level b.
        level: f64,
        /// The strength c of the scatter.
        strength: f64,
    },
    /// The bowl falls to zero or below it somewhere in the field of view.
    #[error(
        "the bowl 1 - {x2} x² - {y2} y² with tilt [{}, {}] falls to {lowest:.3} within the field; \
         its curvatures and tilts must leave it above zero",
        tilt[0], tilt[1]
    )]
    DarkBowl {
        /// Curvature along x.
        x2: f64,
        /// Curvature along y.
        y2: f64,
        /// Slopes along x and y.
        tilt: [f64; 2],
        /// The lowest value it takes.
        lowest: f64,
    },
}

/// `value`, if it is finite and `holds`.
pub(crate) fn require(field: &'static str, value: f64, holds: bool, accepted: &'static str) -> Result<f64, Error> {
    if value.is_finite() && holds { Ok(value) } else { Err(Error::OutOfRange { field, value, accepted }) }
}
