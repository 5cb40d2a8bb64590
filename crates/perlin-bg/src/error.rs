use thiserror::Error;

/// Error of invalid parameters.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// A number is out of range.
    #[error("{field} is {value}; it must be {accepted}")]
    OutOfRange {
        /// Path of the field, such as `noise.persistence`.
        field: &'static str,
        /// The rejected value.
        value: f64,
        /// Description of the accepted values.
        accepted: &'static str,
    },
    /// A field of view without pixels.
    #[error("the field of view is {width} x {height} pixels; width and height must be at least 1")]
    EmptyField {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
    },
    /// H(x, y) - c · I_pe(x, y) of Eq. 9 would be zero or negative.
    #[error("texture.strength {strength} must be less than level {level}")]
    NoLight {
        /// The level b.
        level: f64,
        /// The strength c of the texture.
        strength: f64,
    },
    /// The illumination is zero or negative in part of the field of view.
    #[error(
        "the illumination 1 - {falloff_x} x² - {falloff_y} y² with tilt [{}, {}] falls to {lowest:.3} in the field; \
         reduce falloff or tilt so that it stays above 0",
        tilt[0], tilt[1]
    )]
    NegativeIllumination {
        /// Falloff along x.
        falloff_x: f64,
        /// Falloff along y.
        falloff_y: f64,
        /// Slopes along x and y.
        tilt: [f64; 2],
        /// Its lowest value.
        lowest: f64,
    },
}

/// Returns `value` if it is finite and `holds` is true.
pub(crate) fn require(field: &'static str, value: f64, holds: bool, accepted: &'static str) -> Result<f64, Error> {
    if value.is_finite() && holds { Ok(value) } else { Err(Error::OutOfRange { field, value, accepted }) }
}
