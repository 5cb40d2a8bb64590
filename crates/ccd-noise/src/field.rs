use crate::hash::{Part, RowWords, Stream};
use crate::poisson::poisson;

/// A noise field: a pure function of a key and of the pixel position. Rows, tiles and threads in any order give the
/// same values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct NoiseField {
    key: u64,
}

impl NoiseField {
    /// Creates the field of a key. Fields of different keys are independent.
    #[must_use]
    pub fn new(key: u64) -> Self {
        Self { key }
    }

    pub(crate) fn row(&self, y: u32) -> RowWords {
        RowWords::new(self.key, y)
    }

    /// Writes standard normal deviates to `out`, a window in rows of `width` pixels. `origin` [x, y] is the position of
    /// its first pixel in the frame.
    ///
    /// Box–Muller pairs with 32 bits of radius and 32 bits of angle; the largest absolute value is 6.76.
    ///
    /// # Panics
    ///
    /// If the length of `out` is not a multiple of `width`.
    pub fn normal_into(&self, width: usize, origin: [u32; 2], out: &mut [f32]) {
        assert_rows(out.len(), width);
        for (y, out) in rows(origin).zip(out.chunks_exact_mut(width)) {
            normal_row(&self.row(y), origin[0], out);
        }
    }

    /// Writes Poisson deviates of `means` to `out`, a window in rows of `width` pixels. `origin` [x, y] is the position
    /// of its first pixel in the frame.
    ///
    /// The distribution is exact for means up to 2²⁴. Larger means count as 2²⁴; negative means and NaN count as 0.
    ///
    /// # Panics
    ///
    /// If the length of `means` is not a multiple of `width`, or differs from the length of `out`.
    pub fn poisson_into(&self, means: &[f32], width: usize, origin: [u32; 2], out: &mut [f32]) {
        assert_rows(means.len(), width);
        assert_eq!(out.len(), means.len(), "`out` and `means` must have the same length");
        let both = means.chunks_exact(width).zip(out.chunks_exact_mut(width));
        for (y, (means, out)) in rows(origin).zip(both) {
            poisson_row(&self.row(y), origin[0], means, out);
        }
    }
}

/// Iterates over the rows of the frame from `origin` on.
pub(crate) fn rows(origin: [u32; 2]) -> impl Iterator<Item = u32> {
    (0..).map(move |i| origin[1].wrapping_add(i))
}

pub(crate) fn assert_rows(len: usize, width: usize) {
    assert!(width > 0 && len.is_multiple_of(width), "{len} pixels are not a multiple of the width, {width}",);
}

#[multiversion::multiversion(targets = "simd")]
fn normal_row(row: &RowWords, x: u32, out: &mut [f32]) {
    for part in Part::of_row(x, out.len()) {
        let normals = row.block(part.x).normals(Stream::Read);
        out[part.pixels.clone()].copy_from_slice(part.within(&normals));
    }
}

#[multiversion::multiversion(targets = "simd")]
fn poisson_row(row: &RowWords, x: u32, means: &[f32], out: &mut [f32]) {
    for part in Part::of_row(x, out.len()) {
        let counts = poisson(&part.of(means), &row.block(part.x));
        out[part.pixels.clone()].copy_from_slice(part.within(&counts));
    }
}
