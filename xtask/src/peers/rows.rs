//! The rows of the table, with their targets.

use Source::{Kernel, Memory, Program, TwoCores, TwoThreads};

/// A row of the table.
pub(super) struct Row {
    /// Name of the row.
    pub(super) name: &'static str,
    /// The work.
    pub(super) work: &'static str,
    /// The other program.
    pub(super) peer: &'static str,
    /// Source of the figures.
    pub(super) source: Source,
    /// Required: our time relative to the peer's, our memory in MB, or an exponent.
    pub(super) at_most: f64,
    /// Desired.
    pub(super) try_for: Option<f64>,
}

/// Source of the figures of a row.
#[derive(Clone, Copy)]
pub(super) enum Source {
    /// CPU time of a kernel: its names in the peer's program and in ours.
    Kernel(&'static str, &'static str),
    /// CPU time of a complete program: `frame` or `stack`.
    Program(&'static str),
    /// Peak memory of a complete program.
    Memory(&'static str),
    /// Time per frame of two processes of the peer, and of two of our threads.
    TwoCores,
    /// Time per frame of two of our processes, and of two of our threads.
    TwoThreads,
    /// Exponent of our time as a function of size.
    Growth(&'static Growth),
}

/// Kernels of different sizes.
pub(super) struct Growth {
    /// First part of the names; the second is the size.
    pub(super) kind: &'static str,
    /// Meaning of the size, for the note.
    pub(super) what: &'static str,
    pub(super) sizes: &'static [u32],
    /// Smallest size of the fit; below, fixed costs dominate.
    pub(super) from: u32,
    /// Power of the size: 2 for the width of a field, 1 for a number of cells.
    pub(super) power: f64,
}

const PIXELS: Growth =
    Growth { kind: "pixels", what: "a width of", sizes: &[64, 256, 1024, 2048, 4096, 8192], from: 1024, power: 2.0 };

const CELLS: Growth =
    Growth { kind: "cells", what: "cells:", sizes: &[10, 30, 100, 300, 1000, 3000, 10_000], from: 30, power: 1.0 };

const NUMBA: &str = "papsim, numba";

const fn row(name: &'static str, work: &'static str, source: Source, at_most: f64, try_for: f64) -> Row {
    Row { name, work, peer: NUMBA, source, at_most, try_for: Some(try_for) }
}

const fn kernel(name: &'static str, work: &'static str, peer: &'static str, at_most: f64, try_for: f64) -> Row {
    Row { peer, ..row(name, work, Kernel(name, name), at_most, try_for) }
}

const fn growth(name: &'static str, work: &'static str, growth: &'static Growth) -> Row {
    Row { name, work, peer: "-", source: Source::Growth(growth), at_most: 1.05, try_for: None }
}

/// All rows.
pub(super) const ROWS: [Row; 19] = [
    row(
        "frame",
        "frame of 1376 x 1038, 30 cells, peer's recipe, with ground truth",
        Program("frame"),
        1.0 / 20.0,
        1.0 / 35.0,
    ),
    row("stack", "stack of 21 planes of the same", Program("stack"), 1.0 / 16.0, 1.0 / 24.0),
    Row {
        peer: "two of papsim, numba",
        ..row("two-cores", "wall time per frame, two threads, two processes", TwoCores, 1.0 / 20.0, 1.0 / 36.0)
    },
    Row {
        name: "two-threads",
        work: "wall time per frame, two threads, two of our processes",
        peer: "two of ours",
        source: TwoThreads,
        at_most: 1.0 / 0.95,
        try_for: None,
    },
    row(
        "default-frame",
        "frame of the default recipe, all files written",
        Kernel("frame", "default-frame"),
        1.0 / 3.0,
        0.25,
    ),
    kernel("cloth-538", "sheet of 538 vertices, 60 steps; ours in batches of 16", NUMBA, 1.0 / 5.0, 1.0 / 11.0),
    kernel("cloth-10000", "step of a sheet of 10 000; ours in batches of 16", NUMBA, 1.0 / 14.0, 1.0 / 35.0),
    kernel("blur-0.9", "Gaussian blur of a frame, sigma 0.9", "OpenCV", 0.9, 0.45),
    kernel("blur-3.6", "Gaussian blur of a frame, sigma 3.6", "OpenCV", 0.8, 0.4),
    kernel("blur-20", "Gaussian blur of a frame, sigma 20", "OpenCV", 0.1, 0.03),
    kernel("noise", "photon and read noise of a frame, exact Poisson", "NumPy", 1.0 / 9.0, 1.0 / 14.0),
    kernel("nucleus", "texture of a nucleus of 40 x 40, three sources", NUMBA, 1.0 / 15.0, 1.0 / 29.0),
    kernel("cytoskeleton", "cytoskeleton of a cell", "papsim, SciPy", 1.0 / 13.0, 1.0 / 25.0),
    kernel("perlin", "octave of Perlin noise of a frame", "FastNoiseLite", 1.0 / 9.0, 1.0 / 45.0),
    kernel("gibson-lanni", "Gibson-Lanni, 127 x 127 x 21", "psfmodels, scalar", 1.0 / 12.0, 1.0 / 50.0),
    row("memory-frame", "peak memory, frames", Memory("frame"), 60.0, 30.0),
    row("memory-stack", "peak memory, stacks", Memory("stack"), 90.0, 40.0),
    growth("growth-pixels", "exponent of time over pixels, default recipe", &PIXELS),
    growth("growth-cells", "exponent of time over cells, peer's recipe", &CELLS),
];
