use thiserror::Error as ThisError;

/// Invalid parameters, images or [`Statistics`](crate::Statistics).
#[derive(Debug, Clone, PartialEq, ThisError)]
#[non_exhaustive]
pub enum Error {
    /// A side of the image is not a power of two, or is out of range.
    #[error("{field} is {value} px; accepted: powers of two from {least} to {most}")]
    Side {
        /// `width` or `height`.
        field: &'static str,
        /// The rejected value.
        value: usize,
        /// The smallest accepted value. It grows with the number of scales.
        least: usize,
        /// The largest accepted value.
        most: usize,
    },
    /// A parameter is out of range.
    #[error("{field} is {value}; accepted: {accepted}")]
    Parameter {
        /// The invalid field.
        field: &'static str,
        /// The rejected value.
        value: usize,
        /// The accepted range.
        accepted: &'static str,
    },
    /// Pixels, mask and width are inconsistent.
    #[error(
        "{pixels} pixels, {mask} mask values, width {width}: expected as many mask values as pixels, and a width of at \
         least 1 that divides their number"
    )]
    Shape {
        /// Number of pixels.
        pixels: usize,
        /// Number of mask values.
        mask: usize,
        /// Width in pixels.
        width: usize,
    },
    /// A pixel under the mask is NaN or out of the range −10⁶ to 10⁶.
    #[error("image[{index}] = {value}: expected a number from -1e6 to 1e6")]
    Pixel {
        /// Index of the pixel.
        index: usize,
        /// The value.
        value: f32,
    },
    /// A value of the mask is not in the range 0 to 1.
    #[error("mask[{index}] = {value}: expected a number from 0 to 1")]
    Mask {
        /// Index of the pixel.
        index: usize,
        /// The value.
        value: f32,
    },
    /// All values of the mask are 0.
    #[error("the mask is empty: expected at least one value above 0")]
    EmptyMask,
    /// A field of [`Statistics`](crate::Statistics) is invalid.
    #[error("{field} of the statistics: expected {accepted}")]
    Statistics {
        /// The invalid field.
        field: &'static str,
        /// The accepted values.
        accepted: String,
    },
    /// Statistics have other parameters than the first in the list, or than the synthesizer.
    #[error(
        "statistics {index} have other parameters: expected {scales} scales, {orientations} orientations, \
         neighbourhood {neighbourhood}"
    )]
    Mismatch {
        /// Index in the list; 0 for the statistics of a synthesis.
        index: usize,
        /// Expected number of scales.
        scales: usize,
        /// Expected number of orientations.
        orientations: usize,
        /// Expected side of the autocorrelation windows.
        neighbourhood: usize,
    },
    /// The weights of a mean are negative, not finite, or all 0.
    #[error("invalid weights: expected finite numbers of at least 0, at least one above 0")]
    Weights,
}
