/// Working memory of the blurs: give the same one to every call and nothing is allocated once it
/// has grown to the largest image.
#[derive(Debug, Clone, Default)]
pub struct Scratch {
    /// The columns that are being blurred, with the rows above and below them.
    pub(crate) strip: Vec<f32>,
    /// One row, with what lies left and right of it.
    pub(crate) line: Vec<f32>,
    /// The image halved 1, 2 … times; the first is the coarsest one, blurred.
    pub(crate) levels: Vec<Vec<f32>>,
}

impl Scratch {
    /// Empty memory.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }
}
