//! What is compared, and what is wanted.

/// A work of the table.
pub(crate) struct Row {
    /// The name by which it is asked for.
    pub(crate) name: &'static str,
    /// What is done.
    pub(crate) work: &'static str,
    /// Who else does it.
    pub(crate) peer: &'static str,
    /// Where the figures come from.
    pub(crate) source: Source,
    /// What is wanted at least: our time over the peer's, our memory in MB, an exponent.
    pub(crate) at_most: f64,
    /// What is tried for.
    pub(crate) try_for: Option<f64>,
}

/// Where the figures of a row come from.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Source {
    /// CPU time of a kernel: the peer's name of it, and ours.
    Kernel(&'static str, &'static str),
    /// CPU time of a whole program: `frame` or `stack`.
    Program(&'static str),
    /// Peak memory of the same.
    Memory(&'static str),
    /// Time of a frame while two processes of the peer run, and two threads of ours.
    TwoCores,
    /// Time of a frame while two processes of ours run, and two threads of ours.
    TwoThreads,
    /// How time grows: the exponent, fitted to works of ours.
    Growth(&'static Growth),
}

/// Works that differ in size alone.
#[derive(PartialEq)]
pub(crate) struct Growth {
    /// The first part of their names; the second is the size.
    pub(crate) kind: &'static str,
    /// What the size counts.
    pub(crate) what: &'static str,
    pub(crate) sizes: &'static [u32],
    /// Sizes from this on count; below, fixed costs rule.
    pub(crate) from: u32,
    /// Pixels are the square of a side, cells are cells.
    pub(crate) power: f64,
}

const PIXELS: Growth =
    Growth { kind: "pixels", what: "a side of", sizes: &[64, 256, 1024, 2048, 4096, 8192], from: 1024, power: 2.0 };

const CELLS: Growth =
    Growth { kind: "cells", what: "cells:", sizes: &[10, 30, 100, 300, 1000, 3000, 10_000], from: 30, power: 1.0 };

const fn kernel(name: &'static str, work: &'static str, peer: &'static str, at_most: f64, try_for: f64) -> Row {
    Row { name, work, peer, source: Source::Kernel(name, name), at_most, try_for: Some(try_for) }
}

const NUMBA: &str = "papsim, numba";

/// Every row.
pub(crate) const ROWS: [Row; 19] = [
    Row {
        name: "frame",
        work: "frame of 1376 x 1038, 30 cells, peer's recipe, with truth",
        peer: NUMBA,
        source: Source::Program("frame"),
        at_most: 1.0 / 20.0,
        try_for: Some(1.0 / 35.0),
    },
    Row {
        name: "stack",
        work: "its stack of 21 planes",
        peer: NUMBA,
        source: Source::Program("stack"),
        at_most: 1.0 / 16.0,
        try_for: Some(1.0 / 24.0),
    },
    Row {
        name: "two-cores",
        work: "wall time a frame, two threads against two processes",
        peer: "two of papsim, numba",
        source: Source::TwoCores,
        at_most: 1.0 / 20.0,
        try_for: Some(1.0 / 36.0),
    },
    Row {
        name: "two-threads",
        work: "the same against two processes of ours",
        peer: "two of ours",
        source: Source::TwoThreads,
        at_most: 1.0 / 0.95,
        try_for: None,
    },
    Row {
        name: "default-frame",
        work: "frame of the default recipe, all files written",
        peer: NUMBA,
        source: Source::Kernel("frame", "default-frame"),
        at_most: 1.0 / 2.0,
        try_for: Some(1.0 / 6.0),
    },
    kernel("cloth-538", "sheet of 538 vertices, 60 steps; ours of sixteen at a time", NUMBA, 1.0 / 5.0, 1.0 / 11.0),
    kernel("cloth-10000", "step of a sheet of 10 000; ours of sixteen at a time", NUMBA, 1.0 / 14.0, 1.0 / 35.0),
    kernel("blur-0.9", "Gaussian blur of a frame, sigma 0.9", "OpenCV", 0.9, 0.45),
    kernel("blur-3.6", "Gaussian blur of a frame, sigma 3.6", "OpenCV", 0.8, 0.4),
    kernel("blur-20", "Gaussian blur of a frame, sigma 20", "OpenCV", 0.1, 0.03),
    kernel("noise", "shot and read noise of a frame; exact Poisson both", "NumPy", 1.0 / 9.0, 1.0 / 14.0),
    kernel("nucleus", "texture of a nucleus of 40 x 40, three donors", NUMBA, 1.0 / 15.0, 1.0 / 29.0),
    kernel("cytoskeleton", "cytoskeleton of a cell", "papsim, SciPy", 1.0 / 13.0, 1.0 / 25.0),
    kernel("perlin", "octave of Perlin noise of a frame", "FastNoiseLite", 1.0 / 9.0, 1.0 / 45.0),
    kernel("gibson-lanni", "Gibson-Lanni, 127 x 127 x 21", "psfmodels, scalar", 1.0 / 12.0, 1.0 / 50.0),
    Row {
        name: "memory-frame",
        work: "peak memory, frames",
        peer: NUMBA,
        source: Source::Memory("frame"),
        at_most: 60.0,
        try_for: Some(30.0),
    },
    Row {
        name: "memory-stack",
        work: "peak memory, stacks",
        peer: NUMBA,
        source: Source::Memory("stack"),
        at_most: 90.0,
        try_for: Some(40.0),
    },
    Row {
        name: "growth-pixels",
        work: "exponent of time against pixels, default recipe",
        peer: "-",
        source: Source::Growth(&PIXELS),
        at_most: 1.05,
        try_for: None,
    },
    Row {
        name: "growth-cells",
        work: "exponent of time against cells, peer's recipe",
        peer: "-",
        source: Source::Growth(&CELLS),
        at_most: 1.05,
        try_for: None,
    },
];

impl Source {
    /// Whether the peer takes part.
    pub(crate) fn needs_peer(self) -> bool {
        !matches!(self, Self::TwoThreads | Self::Growth(_))
    }
}
