use crate::Error;

/// Candidates compared at once: two vectors of AVX-512, four of AVX, eight of NEON.
pub(crate) const LANES: usize = 32;

/// Padding at the end of each row, so that a block of candidates can be read beyond it.
pub(crate) const ROW_PADDING: usize = LANES;

/// Smallest coverage of a pixel inside the mask.
pub(crate) const COVERED: f32 = 0.5;

/// A masked texture, from which patches are taken.
///
/// The sources of a [`Quilter`](crate::Quilter) should have a common mean and standard deviation, because patches keep
/// their grey levels.
#[derive(Debug, Clone)]
pub struct Source {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Rows of `stride` pixels; 0 outside the mask and in the padding.
    pub(crate) pixels: Vec<f32>,
    /// Relative distance from the edge of the mask, in the same layout.
    pub(crate) centrality: Vec<f32>,
    /// Whether a pixel is inside the mask, in rows of `width`.
    pub(crate) known: Vec<bool>,
    /// Number of pixels inside the mask, and the sum of their squared deviations from the mean.
    pub(crate) count: usize,
    pub(crate) squares: f64,
}

impl Source {
    /// Creates a source from a texture of `width` pixels a row. Only pixels with a `mask` (coverage, 0 to 1) of 0.5 or
    /// more are used.
    ///
    /// # Errors
    ///
    /// If pixels, mask and width are inconsistent, the mask is empty, or a used value is not finite.
    pub fn new(pixels: &[f32], mask: &[f32], width: usize) -> Result<Self, Error> {
        if width == 0 || pixels.len() != mask.len() || !pixels.len().is_multiple_of(width) {
            return Err(Error::Shape { pixels: pixels.len(), mask: mask.len(), width });
        }
        finite("mask", mask.iter().enumerate())?;
        let known: Vec<bool> = mask.iter().map(|&m| m >= COVERED).collect();
        let used = || pixels.iter().enumerate().filter(|&(i, _)| known[i]);
        finite("pixels", used())?;
        let count = used().count();
        if count == 0 {
            return Err(Error::EmptyMask);
        }
        #[expect(clippy::cast_precision_loss, reason = "far below 2^53 pixels")]
        let mean = used().map(|(_, &v)| f64::from(v)).sum::<f64>() / count as f64;
        let squares = used().map(|(_, &v)| f64::from(v) - mean).map(|d| d * d).sum();

        let height = pixels.len() / width;
        let stride = width + ROW_PADDING;
        let mut padded = vec![0.0; stride * height + ROW_PADDING];
        let mut depth = padded.clone();
        let distances = centrality(&known, width);
        for y in 0..height {
            for x in 0..width {
                let i = y * width + x;
                if known[i] {
                    padded[y * stride + x] = pixels[i];
                    depth[y * stride + x] = distances[i];
                }
            }
        }
        Ok(Self { width, height, pixels: padded, centrality: depth, known, count, squares })
    }

    /// Returns the width, px.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Returns the height, px.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// Returns the distance of rows in the padded layout.
    pub(crate) fn stride(&self) -> usize {
        self.width + ROW_PADDING
    }
}

fn finite<'a>(slice: &'static str, values: impl Iterator<Item = (usize, &'a f32)>) -> Result<(), Error> {
    for (index, &value) in values {
        if !value.is_finite() {
            return Err(Error::NotFinite { slice, index, value });
        }
    }
    Ok(())
}

/// Returns the distance of each pixel inside a mask from the nearest pixel outside, relative to the largest: 0 outside,
/// 1 at the pixel farthest from the edge. Pixels beyond the image count as outside.
///
/// Exact distance transform, by lower envelopes of parabolas (Felzenszwalb and Huttenlocher,
/// doi:10.4086/toc.2012.v008a019).
pub(crate) fn centrality(inside: &[bool], width: usize) -> Vec<f32> {
    let height = inside.len() / width;
    // Squared vertical distance to the outside.
    let mut vertical = vec![0_u32; inside.len()];
    for x in 0..width {
        let mut run = 0;
        for y in 0..height {
            run = if inside[y * width + x] { run + 1 } else { 0 };
            vertical[y * width + x] = run;
        }
        run = 0;
        for y in (0..height).rev() {
            let v = &mut vertical[y * width + x];
            run = if *v > 0 { run + 1 } else { 0 };
            *v = run.min(*v) * run.min(*v);
        }
    }
    let mut squared = vec![0_u32; inside.len()];
    let mut envelope = Envelope::default();
    for (row, out) in vertical.chunks(width).zip(squared.chunks_mut(width)) {
        envelope.transform(row, out);
    }
    let largest = squared.iter().copied().max().unwrap_or(0).max(1);
    #[expect(clippy::cast_precision_loss, reason = "rounded to single precision")]
    let root = |square: u32| (square as f32 / largest as f32).sqrt();
    squared.into_iter().map(root).collect()
}

/// The lower envelope of the parabolas (x - at)² + height of one row.
#[derive(Default)]
struct Envelope {
    /// Position and height of the apexes of the parabolas on the envelope, from left to right.
    apexes: Vec<(i64, i64)>,
    /// The first x at which each of them is the lowest.
    from: Vec<i64>,
}

impl Envelope {
    fn transform(&mut self, row: &[u32], out: &mut [u32]) {
        self.apexes.clear();
        self.from.clear();
        self.push(-1, 0);
        let mut end = 0;
        for &height in row {
            self.push(end, i64::from(height));
            end += 1;
        }
        self.push(end, 0);
        let mut lowest = 0;
        for (x, out) in (0..).zip(out) {
            while self.from.get(lowest + 1).is_some_and(|&from| from <= x) {
                lowest += 1;
            }
            let (at, height) = self.apexes[lowest];
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "at most the height in the row"
            )]
            {
                *out = ((x - at) * (x - at) + height) as u32;
            }
        }
    }

    fn push(&mut self, at: i64, height: i64) {
        while let Some(&(before, its_height)) = self.apexes.last() {
            // First integer x at which the new parabola is not higher than the last one.
            let rise = height + at * at - its_height - before * before;
            let run = 2 * (at - before);
            let crossing = rise.div_euclid(run) + i64::from(rise.rem_euclid(run) > 0);
            if crossing > self.from[self.from.len() - 1] {
                self.from.push(crossing);
                self.apexes.push((at, height));
                return;
            }
            self.apexes.pop();
            self.from.pop();
        }
        self.from.push(-1);
        self.apexes.push((at, height));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::Rng;
    use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

    #[test]
    fn inconsistent_sizes_are_rejected() {
        let shape =
            |pixels: usize, mask: usize, width| Source::new(&vec![0.0; pixels], &vec![1.0; mask], width).unwrap_err();
        for bad in [shape(6, 6, 0), shape(6, 5, 3), shape(7, 7, 3)] {
            assert!(matches!(bad, Error::Shape { .. }));
        }
        assert!(matches!(Source::new(&[1.0; 4], &[0.4; 4], 2), Err(Error::EmptyMask)));
        assert!(matches!(Source::new(&[], &[], 3), Err(Error::EmptyMask)));
        let nan = Source::new(&[1.0, f32::NAN], &[1.0, 1.0], 2).unwrap_err();
        assert_eq!(nan.to_string(), "pixels[1] = NaN: expected a finite number");
        assert!(Source::new(&[1.0, 2.0], &[1.0, f32::NAN], 2).is_err());
    }

    #[test]
    fn pixels_outside_the_mask_are_ignored() {
        let source = Source::new(&[3.0, f32::NAN, 5.0], &[0.5, 0.49, 1.0], 3).unwrap();
        assert_eq!(source.count, 2);
        assert!((source.squares - 2.0).abs() < 1e-12);
        assert!(source.pixels.iter().all(|v| v.is_finite()));
    }

    const SEED: u64 = 0xd157;

    /// Reference implementation: the nearest of all outside pixels, with a frame of outside pixels around the image.
    fn reference(inside: &[bool], width: usize) -> Vec<f32> {
        let height = inside.len() / width;
        let framed = |x: usize, y: usize| {
            let within = (1..=width).contains(&x) && (1..=height).contains(&y);
            within && inside[(y - 1) * width + x - 1]
        };
        let outside: Vec<_> = (0..(width + 2) * (height + 2))
            .map(|i| (i % (width + 2), i / (width + 2)))
            .filter(|&(x, y)| !framed(x, y))
            .collect();
        let nearest = |i: usize| {
            let (x, y) = (i % width + 1, i / width + 1);
            let squared = |&(u, v): &(usize, usize)| x.abs_diff(u).pow(2) + y.abs_diff(v).pow(2);
            outside.iter().map(squared).min().unwrap()
        };
        let squared: Vec<_> = (0..inside.len()).map(nearest).collect();
        let largest = *squared.iter().max().unwrap().max(&1) as f32;
        squared.iter().map(|&d| (d as f32 / largest).sqrt()).collect()
    }

    #[test]
    fn centrality_equals_brute_force() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(SEED);
        for (width, height, holes) in [(1, 1, 2), (7, 5, 3), (23, 17, 40), (12, 30, 9), (16, 9, 1)] {
            for _ in 0..20 {
                let mask: Vec<_> = (0..width * height).map(|_| !rng.next_u32().is_multiple_of(holes)).collect();
                assert_eq!(centrality(&mask, width), reference(&mask, width));
            }
        }
        let full = vec![true; 63];
        assert_eq!(centrality(&full, 9), reference(&full, 9));
        assert_eq!(centrality(&[false; 12], 4), [0.0; 12]);
    }
}
