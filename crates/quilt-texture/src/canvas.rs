use crate::source::ROW_PADDING;
use crate::{QuiltParams, Seam, Source};

/// A synthesised texture.
#[derive(Debug, Clone, PartialEq)]
pub struct Texture {
    /// Row-major from the top, in the unit of the sources; 0 outside the target.
    pub pixels: Vec<f32>,
    /// The source pixel of each pixel, or the one of greater weight in a feathered seam; `None` outside the target.
    pub origins: Vec<Option<Origin>>,
    /// Width, px.
    pub width: usize,
}

/// A pixel of a source.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Origin {
    /// Index into the sources of [`Quilter::new`](crate::Quilter::new).
    pub source: usize,
    /// Index into the pixels of [`Source::new`](crate::Source::new).
    pub pixel: usize,
}

/// The texture during synthesis, which consists of complete patches; cropped at the end.
pub(crate) struct Canvas {
    patch: usize,
    overlap: usize,
    /// Number of patches along x and y.
    pub(crate) patches: [usize; 2],
    width: usize,
    pixels: Vec<f32>,
    /// Source pixel of each pixel; `None` where there is no patch yet.
    origins: Vec<Option<Origin>>,
    /// Whether a pixel is inside the target.
    in_target: Vec<bool>,
    scratch: SeamScratch,
}

/// Working memory of one patch.
#[derive(Default)]
struct SeamScratch {
    /// Weight of the new patch for each of its pixels.
    weights: Vec<f32>,
    sharp: Vec<f32>,
    errors: Vec<f32>,
    path: Vec<usize>,
}

impl Canvas {
    pub(crate) fn new(target_mask: &[f32], target_width: usize, params: &QuiltParams) -> Self {
        let (patch, overlap) = (params.patch_px, params.overlap_px);
        let target_height = target_mask.len() / target_width;
        let step = patch - overlap;
        let patches = [target_width, target_height].map(|n| n.saturating_sub(overlap).div_ceil(step).max(1));
        let [width, height] = patches.map(|n| n * step + overlap);
        let mut in_target = vec![false; width * height];
        for (row, mask) in in_target.chunks_mut(width).zip(target_mask.chunks(target_width)) {
            row.iter_mut().zip(mask).for_each(|(in_target, &m)| *in_target = m > 0.0);
        }
        Self {
            patch,
            overlap,
            patches,
            width,
            pixels: vec![0.0; width * height],
            origins: vec![None; width * height],
            in_target,
            scratch: SeamScratch::default(),
        }
    }

    /// Returns column and row of the upper left pixel of a patch.
    pub(crate) fn corner(&self, patch: [usize; 2]) -> [usize; 2] {
        patch.map(|n| n * (self.patch - self.overlap))
    }

    /// Returns whether a patch contains target pixels that are not filled yet.
    pub(crate) fn needs(&self, corner: [usize; 2]) -> bool {
        (0..self.patch).any(|y| {
            let start = self.index(corner, [0, y]);
            let row = start..start + self.patch;
            let unfilled = self.in_target[row.clone()].iter().zip(&self.origins[row]);
            unfilled.into_iter().any(|(&in_target, origin)| in_target && origin.is_none())
        })
    }

    /// Collects the filled target pixels in the overlaps of a patch.
    pub(crate) fn overlaps(&self, corner: [usize; 2], pixels: &mut Vec<([usize; 2], f32)>) {
        pixels.clear();
        for y in 0..self.patch {
            let breadth = if y < self.overlap { self.patch } else { self.overlap };
            for x in 0..breadth {
                let i = self.index(corner, [x, y]);
                if self.in_target[i] && self.origins[i].is_some() {
                    pixels.push(([x, y], self.pixels[i]));
                }
            }
        }
    }

    /// Blends the patch at `place` of a source into the canvas.
    pub(crate) fn paste(&mut self, corner: [usize; 2], number: usize, source: &Source, place: usize, seam: Seam) {
        let mut scratch = core::mem::take(&mut self.scratch);
        self.set_weights(corner, source, place, seam, &mut scratch);
        for (y, weights) in scratch.weights.chunks_exact(self.patch).enumerate() {
            let (start, from) = (self.index(corner, [0, y]), place + y * source.stride());
            // The pixels of a row of a patch are in one row of the source.
            let unpadded = from - from / source.stride() * ROW_PADDING;
            let here = self.pixels[start..].iter_mut().zip(&mut self.origins[start..]);
            for (x, (((pixel, origin), new), weight)) in here.zip(&source.pixels[from..]).zip(weights).enumerate() {
                let weight = if origin.is_some() { *weight } else { 1.0 };
                if weight >= 0.5 {
                    *origin = Some(Origin { source: number, pixel: unpadded + x });
                }
                *pixel = if weight == 1.0 { *new } else { *pixel + weight * (new - *pixel) };
            }
        }
        self.scratch = scratch;
    }

    /// Returns the texture, cropped to the target.
    pub(crate) fn finish(self, target_width: usize, target_height: usize) -> Texture {
        let mut texture = Texture {
            pixels: Vec::with_capacity(target_width * target_height),
            origins: Vec::with_capacity(target_width * target_height),
            width: target_width,
        };
        for y in 0..target_height {
            let row = y * self.width..y * self.width + target_width;
            let in_target = &self.in_target[row.clone()];
            let pixels = self.pixels[row.clone()].iter().zip(in_target);
            texture.pixels.extend(pixels.map(|(&v, &in_target)| if in_target { v } else { 0.0 }));
            let origins = self.origins[row].iter().zip(in_target);
            texture.origins.extend(origins.map(|(origin, &in_target)| origin.filter(|_| in_target)));
        }
        texture
    }

    fn index(&self, corner: [usize; 2], [x, y]: [usize; 2]) -> usize {
        (corner[1] + y) * self.width + corner[0] + x
    }

    /// Sets the weights of the new patch in its overlaps.
    fn set_weights(&self, corner: [usize; 2], source: &Source, place: usize, seam: Seam, scratch: &mut SeamScratch) {
        let (patch, overlap) = (self.patch, self.overlap);
        let old = |x, y| self.origins[self.index(corner, [x, y])].is_some();
        let rows = |mut columns: core::ops::Range<usize>, y| columns.any(|x| old(x, y));
        let left = (overlap..patch).any(|y| rows(0..overlap, y));
        let above = (0..overlap).any(|y| rows(if left { overlap } else { 0 }..patch, y));
        let weights = &mut scratch.weights;
        weights.clear();
        weights.resize(patch * patch, 1.0);
        match seam {
            Seam::Feather => {
                for (y, row) in weights.chunks_exact_mut(patch).enumerate() {
                    let down = if above { feather(y, overlap) } else { 1.0 };
                    for (x, weight) in row.iter_mut().enumerate() {
                        let across = if left { feather(x, overlap) } else { 1.0 };
                        *weight = across.min(down);
                    }
                }
            }
            Seam::MinCut { feather_px } => {
                scratch.path.resize(patch, 0);
                // A cut through pixels outside the target, or without an old pixel, has no error.
                let error = |x, y| {
                    let i = self.index(corner, [x, y]);
                    let d = self.pixels[i] - source.pixels[place + y * source.stride() + x];
                    if self.in_target[i] && self.origins[i].is_some() { d * d } else { 0.0 }
                };
                for (_, transposed) in [(left, false), (above, true)].into_iter().filter(|(meets, _)| *meets) {
                    let place = |along, across| if transposed { (along, across) } else { (across, along) };
                    let strip = (0..patch).flat_map(|along| (0..overlap).map(move |across| place(along, across)));
                    scratch.errors.clear();
                    scratch.errors.extend(strip.map(|(x, y)| error(x, y)));
                    min_cut(&mut scratch.errors, overlap, &mut scratch.path);
                    for (along, &cut) in scratch.path.iter().enumerate() {
                        for (x, y) in (0..cut).map(|across| place(along, across)) {
                            weights[y * patch + x] = 0.0;
                        }
                    }
                }
                if feather_px > 0 {
                    for (i, weight) in weights.iter_mut().enumerate() {
                        if !old(i % patch, i / patch) {
                            *weight = 1.0;
                        }
                    }
                    scratch.sharp.clone_from(weights);
                    for y in 0..patch {
                        let breadth = if y < overlap { patch } else { overlap };
                        for x in 0..breadth {
                            weights[y * patch + x] = blurred(&scratch.sharp, patch, [x, y], feather_px, [left, above]);
                        }
                    }
                }
            }
        }
    }
}

/// Returns the mean weight in a box around a pixel of a patch. Beyond edges with a neighbour the old texture continues,
/// with weight 0; other edges end the box.
fn blurred(weights: &[f32], patch: usize, at: [usize; 2], radius: usize, meets: [bool; 2]) -> f32 {
    let [(x0, x1, wide), (y0, y1, high)] = [0, 1].map(|axis| {
        let first = at[axis].saturating_sub(radius);
        let end = (at[axis] + radius + 1).min(patch);
        let beyond = if meets[axis] { radius.saturating_sub(at[axis]) } else { 0 };
        (first, end, end - first + beyond)
    });
    let sum: f32 = (y0..y1).map(|y| weights[y * patch + x0..y * patch + x1].iter().sum::<f32>()).sum();
    #[expect(clippy::cast_precision_loss, reason = "at most 513 squared")]
    {
        sum / (wide * high) as f32
    }
}

/// Computes the path of least total error through a strip, with at most one step sideways from row to row (Efros and
/// Freeman, doi:10.1145/383259.383296).
///
/// `errors` has rows of `breadth` and is overwritten; `path` receives the column of the cut of each row. Of equal paths
/// it is the leftmost.
fn min_cut(errors: &mut [f32], breadth: usize, path: &mut [usize]) {
    // E(y, x) = e(y, x) + min(E(y - 1, x - 1), E(y - 1, x), E(y - 1, x + 1)).
    for y in 1..path.len() {
        for x in 0..breadth {
            let best = least_near(&errors[(y - 1) * breadth..][..breadth], x);
            errors[y * breadth + x] += errors[(y - 1) * breadth + best];
        }
    }
    let mut x = None;
    for y in (0..path.len()).rev() {
        let row = &errors[y * breadth..][..breadth];
        let best = match x {
            None => (1..breadth).fold(0, |best, x| if row[x] < row[best] { x } else { best }),
            Some(below) => least_near(row, below),
        };
        path[y] = best;
        x = Some(best);
    }
}

/// Returns the column of the least value among the neighbours of `x`, the leftmost of equal values.
fn least_near(row: &[f32], x: usize) -> usize {
    let mut best = x.saturating_sub(1);
    for candidate in best + 1..(x + 2).min(row.len()) {
        if row[candidate] < row[best] {
            best = candidate;
        }
    }
    best
}

/// Returns the weight of a new patch `i` pixels from its edge, which increases over the overlap. The weight of the old
/// pixel is 1 minus that.
fn feather(i: usize, overlap: usize) -> f32 {
    #[expect(clippy::cast_precision_loss, reason = "at most 128")]
    if i < overlap { (i + 1) as f32 / (overlap + 1) as f32 } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::Rng;
    use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

    const SEED: u64 = 0x5ea3;

    /// Returns the least error of all paths through a strip, by depth-first search.
    fn least(errors: &[f32], breadth: usize, y: usize, from: Option<usize>) -> f32 {
        if y * breadth == errors.len() {
            return 0.0;
        }
        (0..breadth)
            .filter(|&x| from.is_none_or(|f| f.abs_diff(x) <= 1))
            .map(|x| errors[y * breadth + x] + least(errors, breadth, y + 1, Some(x)))
            .fold(f32::INFINITY, f32::min)
    }

    #[test]
    fn cut_equals_exhaustive_search() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(SEED);
        for (length, breadth) in [(1, 1), (7, 5), (7, 2), (5, 1), (6, 3), (2, 5)] {
            for _ in 0..50 {
                // Integers, so that sums are exact and ties occur.
                let errors: Vec<_> = (0..length * breadth).map(|_| (rng.next_u32() % 10) as f32).collect();
                let mut path = vec![0; length];
                min_cut(&mut errors.clone(), breadth, &mut path);
                assert!(path.windows(2).all(|w| w[0].abs_diff(w[1]) <= 1));
                let total: f32 = path.iter().enumerate().map(|(y, x)| errors[y * breadth + x]).sum();
                assert_eq!(total, least(&errors, breadth, 0, None));
            }
        }
    }

    #[test]
    fn feather_weights_sum_to_one() {
        for overlap in 1..9 {
            for i in 0..overlap {
                let (new, old) = (feather(i, overlap), feather(overlap - 1 - i, overlap));
                assert!((new + old - 1.0).abs() < 1e-6);
            }
            assert_eq!(feather(overlap, overlap), 1.0);
        }
    }
}
