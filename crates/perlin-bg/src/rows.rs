use crate::kernel::{add_points, lattice_line};
use crate::perlin::Perlin;

/// The part of the plane that an image covers: pixel (column, row) is at `origin + step · (first + [column, row])`.
///
/// Positions are computed from integer pixel numbers. Two windows that differ only in `first` agree bit for bit where
/// they overlap, such as tiles of a slide of any size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    /// Position of pixel (0, 0), in lattice cells. Default: [0, 0].
    pub origin: [f64; 2],
    /// Distance between pixels, in lattice cells: 1 / (cell size in pixels). Default: 1.
    pub step: f64,
    /// Number (column, row) of the image's first pixel. Default: [0, 0].
    pub first: [i64; 2],
}

impl Default for Window {
    fn default() -> Self {
        Self { origin: [0.0, 0.0], step: 1.0, first: [0, 0] }
    }
}

impl Window {
    /// Creates a window with lattice cells of `cell_px` pixels and pixel (0, 0) at position zero.
    pub fn with_cell_px(cell_px: f64) -> Self {
        Self { step: 1.0 / cell_px, ..Self::default() }
    }

    /// Returns the window of a tile whose first pixel is number `first`.
    pub fn tile(self, first: [i64; 2]) -> Self {
        Self { first, ..self }
    }

    /// Returns the position of a column, in lattice cells.
    pub fn x(&self, column: usize) -> f64 {
        self.along(0, column)
    }

    /// Returns the position of a row, in lattice cells.
    pub fn y(&self, row: usize) -> f64 {
        self.along(1, row)
    }

    fn along(&self, axis: usize, pixel: usize) -> f64 {
        let number = self.first[axis].wrapping_add_unsigned(pixel as u64);
        self.origin[axis] + self.step * number as f64
    }
}

impl Perlin {
    /// Adds `amplitude` times the noise to every pixel of `image`. The added value equals `amplitude * self.at(x, y)`
    /// at the pixel positions of `window`.
    ///
    /// # Panics
    /// If `width` is zero or does not divide the length of `image`.
    pub fn add_into(&self, image: &mut [f32], width: usize, window: &Window, amplitude: f32) {
        let mut rows = Rows::new(self, (0..width).map(|c| window.x(c)), amplitude);
        for_each_row(image, width, |r, row| rows.add_row(row, window.y(r)));
    }
}

/// Calls `visit` with the number and the pixels of each row.
///
/// # Panics
/// If `width` is zero or does not divide the length of `image`.
pub(crate) fn for_each_row(image: &mut [f32], width: usize, mut visit: impl FnMut(usize, &mut [f32])) {
    assert!(
        width > 0 && image.len().is_multiple_of(width),
        "the image's {} pixels are not a multiple of the width, {width}",
        image.len()
    );
    for (r, row) in image.chunks_exact_mut(width).enumerate() {
        visit(r, row);
    }
}

/// Samples noise row by row.
///
/// Terms of a column are computed once. Terms of a lattice line are computed once per line, as a value and a slope per
/// column. A row between two lines then costs six multiply-adds per pixel for any cell size, without gradients or
/// hashes.
#[derive(Debug)]
pub(crate) struct Rows<'a> {
    noise: &'a Perlin,
    amplitude: f32,
    offsets: Vec<f32>,
    fades: Vec<f32>,
    runs: Vec<Run>,
    above: Line,
    below: Line,
}

/// Adjacent columns in one lattice cell.
#[derive(Debug)]
struct Run {
    cell: i64,
    end: usize,
}

/// A lattice line sampled at every column.
#[derive(Debug)]
struct Line {
    number: Option<i64>,
    values: Vec<f32>,
    slopes: Vec<f32>,
}

impl Line {
    fn new(width: usize) -> Self {
        Self { number: None, values: vec![0.0; width], slopes: vec![0.0; width] }
    }
}

impl<'a> Rows<'a> {
    pub(crate) fn new(noise: &'a Perlin, positions: impl ExactSizeIterator<Item = f64>, amplitude: f32) -> Self {
        let width = positions.len();
        let mut offsets = Vec::with_capacity(width);
        let mut fades = Vec::with_capacity(width);
        let mut runs: Vec<Run> = Vec::new();
        for (column, position) in positions.enumerate() {
            let profile = noise.profile(position);
            offsets.push(profile.offset);
            fades.push(profile.fade);
            match runs.last_mut() {
                Some(run) if run.cell == profile.cell => run.end = column + 1,
                _ => runs.push(Run { cell: profile.cell, end: column + 1 }),
            }
        }
        Self { noise, amplitude, offsets, fades, runs, above: Line::new(width), below: Line::new(width) }
    }

    /// Adds the noise at `y` to a row.
    pub(crate) fn add_row(&mut self, row: &mut [f32], y: f64) {
        let profile = self.noise.profile(y);
        self.prepare(profile.cell);
        add_points(
            row,
            (&self.above.values, &self.above.slopes),
            (&self.below.values, &self.below.slopes),
            profile,
            self.amplitude,
        );
    }

    /// Prepares the lattice line `number` in `above` and the next one in `below`. Downward steps reuse one of them.
    fn prepare(&mut self, number: i64) {
        let next = number.wrapping_add(1);
        if self.below.number == Some(number) {
            core::mem::swap(&mut self.above, &mut self.below);
        }
        if self.above.number != Some(number) {
            Self::sample(self.noise, &self.offsets, &self.fades, &self.runs, &mut self.above, number);
        }
        if self.below.number != Some(next) {
            Self::sample(self.noise, &self.offsets, &self.fades, &self.runs, &mut self.below, next);
        }
    }

    fn sample(noise: &Perlin, offsets: &[f32], fades: &[f32], runs: &[Run], line: &mut Line, number: i64) {
        line.number = Some(number);
        let mut start = 0;
        for run in runs {
            let left = noise.gradient([run.cell, number]);
            let right = noise.gradient([run.cell.wrapping_add(1), number]);
            for i in start..run.end {
                [line.values[i], line.slopes[i]] = lattice_line(offsets[i], fades[i], left, right);
            }
            start = run.end;
        }
    }
}
