/// A synthesised texture.
#[derive(Debug, Clone, PartialEq)]
pub struct Texture {
    /// Row by row from the top, in units of the sources; 0 outside the target.
    pub pixels: Vec<f32>,
    /// Where each pixel came from, or most of it where a seam is feathered; `None` outside the
    /// target.
    pub origins: Vec<Option<Origin>>,
    /// Width, px.
    pub width: usize,
}

/// A pixel of a source.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Origin {
    /// Which of the sources given to [`Quilter::new`](crate::Quilter::new).
    pub source: usize,
    /// Index into the pixels given to [`Source::new`](crate::Source::new).
    pub pixel: usize,
}
