use thiserror::Error as ThisError;

/// Why a [`Source`](crate::Source) or a [`Quilter`](crate::Quilter) could not be made.
#[derive(Debug, Clone, PartialEq, ThisError)]
#[non_exhaustive]
pub enum Error {
    /// Pixels, mask and width of a source do not describe one image.
    #[error(
        "a source has {pixels} pixels, {mask} mask values and width {width}; accepted: as many mask \
         values as pixels, in whole rows of at least one pixel"
    )]
    Shape {
        /// Number of pixels.
        pixels: usize,
        /// Number of mask values.
        mask: usize,
        /// Width of a row.
        width: usize,
    },
    /// A pixel under the mask, or a value of the mask, is NaN or infinite.
    #[error("{slice}[{index}] is {value}; accepted: finite values")]
    NotFinite {
        /// `pixels` or `mask`.
        slice: &'static str,
        /// Where.
        index: usize,
        /// What it held.
        value: f32,
    },
    /// The mask of a source covers no pixel by half.
    #[error("the mask is nowhere 0.5 or more; accepted: at least one such pixel")]
    EmptyMask,
    /// A number of the parameters lies outside its range.
    #[error("{field} is {value}; accepted: {accepted}")]
    Parameter {
        /// The field of [`QuiltParams`](crate::QuiltParams) at fault.
        field: &'static str,
        /// What it held.
        value: f64,
        /// The accepted range.
        accepted: &'static str,
    },
    /// There is nothing to take patches from.
    #[error("sources is empty; accepted: at least one source")]
    NoSource,
    /// No patch lies wholly under the mask of a source.
    #[error("sources[{index}] has no room for a patch of {patch_px} px; accepted: smaller patches or larger sources")]
    SourceTooSmall {
        /// Which source.
        index: usize,
        /// The side of a patch.
        patch_px: usize,
    },
}
