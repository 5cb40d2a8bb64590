use thiserror::Error as ThisError;

/// An invalid [`Source`](crate::Source) or invalid parameters of a [`Quilter`](crate::Quilter).
#[derive(Debug, Clone, PartialEq, ThisError)]
#[non_exhaustive]
pub enum Error {
    /// Pixels, mask and width of a source are inconsistent.
    #[error(
        "{pixels} pixels, {mask} mask values, width {width}: expected as many mask values as pixels, and a width of at \
         least 1 that divides their number"
    )]
    Shape {
        /// Number of pixels.
        pixels: usize,
        /// Number of mask values.
        mask: usize,
        /// Width, px.
        width: usize,
    },
    /// A pixel under the mask, or a value of the mask, is NaN or infinite.
    #[error("{slice}[{index}] = {value}: expected a finite number")]
    NotFinite {
        /// `pixels` or `mask`.
        slice: &'static str,
        /// Index of the value.
        index: usize,
        /// The value.
        value: f32,
    },
    /// No value of the mask of a source is 0.5 or more.
    #[error("the mask is empty: expected at least one value of 0.5 or more")]
    EmptyMask,
    /// A parameter is out of range.
    #[error("{field} = {value} is out of range: expected {accepted}")]
    Parameter {
        /// The field of [`QuiltParams`](crate::QuiltParams).
        field: &'static str,
        /// The value.
        value: f64,
        /// The accepted range.
        accepted: &'static str,
    },
    /// There is no source.
    #[error("sources is empty: expected at least one source")]
    NoSource,
    /// No patch fits completely inside the mask of a source.
    #[error("sources[{index}] is too small for a patch of {patch_px} px: use smaller patches or larger sources")]
    SourceTooSmall {
        /// Index of the source.
        index: usize,
        /// Size of a patch, px.
        patch_px: usize,
    },
}
