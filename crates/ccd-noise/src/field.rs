use crate::hash::{BLOCK, BLOCK_STEP, RowWords};
use crate::poisson::poisson;

/// Noise that is a pure function of a key and of the position in the frame: the pixels of a
/// frame may be asked for in any order, by rows, tiles or threads, and are always the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct NoiseField {
    key: u64,
}

impl NoiseField {
    /// The field of this key. Fields of different keys are independent.
    #[must_use]
    pub fn new(key: u64) -> Self {
        Self { key }
    }

    pub(crate) fn row(&self, y: u32) -> RowWords {
        RowWords::new(self.key, y)
    }

    /// Standard normal deviates for the window of rows of `width` pixels whose first pixel lies
    /// at `origin` [x, y] of the frame.
    ///
    /// They reach 6.76 standard deviations, in steps of 32 bits of the radius and the angle of pairs of them.
    ///
    /// # Panics
    ///
    /// If `out` is not whole rows of `width`.
    pub fn normal_into(&self, width: usize, origin: [u32; 2], out: &mut [f32]) {
        whole_rows(out.len(), width);
        for (y, out) in rows(origin).zip(out.chunks_exact_mut(width)) {
            normal_row(&self.row(y), origin[0], out);
        }
    }

    /// Poisson deviates of the given `means`, >= 0, for the window of rows of `width` pixels whose
    /// first pixel lies at `origin` [x, y] of the frame.
    ///
    /// They are exact at every mean up to 2²⁴; larger means count as that, and what is not above 0
    /// as 0.
    ///
    /// # Panics
    ///
    /// If `means` is not whole rows of `width`, or `out` not as long as it.
    pub fn poisson_into(&self, means: &[f32], width: usize, origin: [u32; 2], out: &mut [f32]) {
        whole_rows(means.len(), width);
        assert_eq!(out.len(), means.len(), "out has the wrong number of pixels");
        let both = means.chunks_exact(width).zip(out.chunks_exact_mut(width));
        for (y, (means, out)) in rows(origin).zip(both) {
            poisson_row(&self.row(y), origin[0], means, out);
        }
    }
}

/// The rows of the frame from that of `origin` on.
pub(crate) fn rows(origin: [u32; 2]) -> impl Iterator<Item = u32> {
    (0..).map(move |i| origin[1].wrapping_add(i))
}

pub(crate) fn whole_rows(len: usize, width: usize) {
    assert!(width > 0 && len.is_multiple_of(width), "{len} pixels are not whole rows of {width}",);
}

/// The positions of the blocks of a row that starts at `x`.
pub(crate) fn blocks(x: u32) -> impl Iterator<Item = u32> {
    (0..).map(move |i: u32| x.wrapping_add(i.wrapping_mul(BLOCK_STEP)))
}

#[multiversion::multiversion(targets = "simd")]
fn normal_row(row: &RowWords, x: u32, out: &mut [f32]) {
    for (x, out) in blocks(x).zip(out.chunks_mut(BLOCK)) {
        let block = row.block(x);
        let [_, read] = block.normal_pairs();
        out.copy_from_slice(&read[..out.len()]);
    }
}

#[multiversion::multiversion(targets = "simd")]
fn poisson_row(row: &RowWords, x: u32, means: &[f32], out: &mut [f32]) {
    for (x, (means, out)) in blocks(x).zip(means.chunks(BLOCK).zip(out.chunks_mut(BLOCK))) {
        let block = row.block(x);
        let [shot, _] = block.normal_pairs();
        out.copy_from_slice(&poisson(&padded(means), &shot, &block)[..means.len()]);
    }
}

/// The end of a row, made up to a whole block.
#[inline(always)]
pub(crate) fn padded(values: &[f32]) -> [f32; BLOCK] {
    let mut block = [0.0; BLOCK];
    block[..values.len()].copy_from_slice(values);
    block
}
