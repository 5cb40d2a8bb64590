/// Buffers of blurs, for reuse. They grow to the size of the largest image.
#[derive(Debug, Clone, Default)]
pub struct Scratch {
    /// The current strip of columns, with the rows beyond its upper and lower border.
    pub(crate) strip: Vec<f32>,
    /// One row, with the pixels beyond its left and right border.
    pub(crate) line: Vec<f32>,
    /// Downsampled images; the first is the coarsest one, blurred.
    pub(crate) levels: Vec<Vec<f32>>,
}

impl Scratch {
    /// Creates empty buffers.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }
}
