/// Working memory of blurs. With reuse, calls allocate only until it fits the largest image.
#[derive(Debug, Clone, Default)]
pub struct Scratch {
    /// Columns of the current strip, including rows above and below.
    pub(crate) strip: Vec<f32>,
    /// One row, including pixels at its left and right.
    pub(crate) line: Vec<f32>,
    /// Downsampled images; the first is the coarsest one, blurred.
    pub(crate) levels: Vec<Vec<f32>>,
}

impl Scratch {
    /// Creates empty memory.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }
}
