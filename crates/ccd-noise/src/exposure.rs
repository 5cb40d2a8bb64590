/// Pixels side by side that are saturated: full, or their converter at its highest level.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct SaturatedRun {
    /// The row of the frame.
    pub y: u32,
    /// The first of them.
    pub x0: u32,
    /// The first after them.
    pub x1: u32,
}

/// What became of a whole frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Exposure {
    /// Saturated pixels: full, or their converter at its highest level.
    pub saturated: usize,
    /// Electrons that the anti-blooming drains took. 0 where blooming is off: what is clipped then is not counted.
    pub drained_e: u64,
    /// Electrons that bloomed over the border of the frame.
    pub escaped_e: u64,
}
