/// A horizontal run of saturated pixels: pixels at full-well capacity or at the highest grey level.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct SaturatedRun {
    /// Row in the frame.
    pub y: u32,
    /// Column of the first pixel.
    pub x0: u32,
    /// Column after the last pixel.
    pub x1: u32,
}

/// Charge statistics of an exposed frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Exposure {
    /// Number of saturated pixels: pixels at full-well capacity or at the highest grey level.
    pub saturated: usize,
    /// Electrons removed by anti-blooming drains. 0 without blooming: excess charge is then not counted.
    pub drained_e: u64,
    /// Electrons that bloomed across the border of the frame.
    pub escaped_e: u64,
}
