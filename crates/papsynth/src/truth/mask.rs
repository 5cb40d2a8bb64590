//! Exact masks as runs of pixels.

/// A set of pixels of an image, as horizontal runs in raster order.
///
/// Runs of a row are disjoint and sorted; all pixels are inside the image.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Mask {
    runs: Vec<Run>,
}

/// Pixels `x0..x1` of row `y`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Run {
    /// Row, counted from the top.
    pub y: u32,
    /// First column.
    pub x0: u32,
    /// One past the last column.
    pub x1: u32,
}

/// Bounding box of a mask: pixels `x..x+width`, `y..y+height`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Bounds {
    /// Left column.
    pub x: u32,
    /// Top row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Mask {
    /// Returns the pixels of a tile for which `inside` is true, clipped to an image of `width` x `height`.
    ///
    /// The tile has `tile_width` columns; its upper left pixel is pixel `origin` of the image.
    #[must_use]
    pub fn from_tile(
        tile: &[f32],
        tile_width: usize,
        origin: [i64; 2],
        width: usize,
        height: usize,
        inside: impl Fn(f32) -> bool,
    ) -> Self {
        let mut runs = Vec::new();
        for (row, values) in tile.chunks_exact(tile_width.max(1)).enumerate() {
            let y = origin[1] + row as i64;
            if y < 0 || y >= height as i64 {
                continue;
            }
            let first = (-origin[0]).clamp(0, tile_width as i64) as usize;
            let last = (width as i64 - origin[0]).clamp(0, tile_width as i64) as usize;
            let values = &values[..last.max(first)];
            let mut at = first;
            while let Some(from) = next(values, at, &inside) {
                let end = next(values, from, |value| !inside(value)).unwrap_or(values.len());
                runs.push(run(y, origin[0], from, end));
                at = end;
            }
        }
        Self { runs }
    }

    /// Creates a mask from runs, which must be non-empty, disjoint, and sorted by row and column.
    #[must_use]
    pub fn from_runs(runs: Vec<Run>) -> Self {
        debug_assert!(runs.iter().all(|r| r.x0 < r.x1));
        debug_assert!(runs.windows(2).all(|w| w[0].y < w[1].y || (w[0].y == w[1].y && w[0].x1 < w[1].x0)));
        Self { runs }
    }

    /// Returns the union of masks.
    #[must_use]
    pub fn union<'a>(masks: impl IntoIterator<Item = &'a Self>) -> Self {
        let mut all: Vec<Run> = masks.into_iter().flat_map(|mask| &mask.runs).copied().collect();
        all.sort_unstable_by_key(|run| (run.y, run.x0));
        let mut runs: Vec<Run> = Vec::with_capacity(all.len());
        for run in all {
            match runs.last_mut() {
                Some(last) if last.y == run.y && run.x0 <= last.x1 => last.x1 = last.x1.max(run.x1),
                _ => runs.push(run),
            }
        }
        Self { runs }
    }

    /// Returns the runs in raster order.
    #[must_use]
    pub fn runs(&self) -> &[Run] {
        &self.runs
    }

    /// Whether the mask has no pixels.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.runs.is_empty()
    }

    /// Returns the number of pixels.
    #[must_use]
    pub fn area(&self) -> u64 {
        self.runs.iter().map(|r| u64::from(r.x1 - r.x0)).sum()
    }

    /// Returns the bounding box, or `None` for an empty mask.
    #[must_use]
    pub fn bounds(&self) -> Option<Bounds> {
        let (first, last) = (self.runs.first()?, self.runs.last()?);
        let x = self.runs.iter().map(|r| r.x0).min()?;
        let end = self.runs.iter().map(|r| r.x1).max()?;
        Some(Bounds { x, y: first.y, width: end - x, height: last.y + 1 - first.y })
    }

    /// Returns the mean position of the pixel centres, or `None` for an empty mask.
    #[must_use]
    pub fn centroid(&self) -> Option<[f64; 2]> {
        let area = self.area();
        if area == 0 {
            return None;
        }
        let (mut x, mut y) = (0.0, 0.0);
        for run in &self.runs {
            let length = f64::from(run.x1 - run.x0);
            x += length * (f64::from(run.x0) + f64::from(run.x1) - 1.0) / 2.0;
            y += length * f64::from(run.y);
        }
        Some([x / area as f64, y / area as f64])
    }

    /// Returns every pixel as an index into an image of `width` columns.
    pub fn pixels(&self, width: usize) -> impl Iterator<Item = usize> + '_ {
        self.runs.iter().flat_map(move |r| {
            let row = r.y as usize * width;
            row + r.x0 as usize..row + r.x1 as usize
        })
    }
}

/// Returns the first index from `start` for which `is` is true. Tests blocks of values at once.
#[inline(always)]
pub(super) fn next<T: Copy>(values: &[T], start: usize, is: impl Fn(T) -> bool) -> Option<usize> {
    /// Values per block.
    const BLOCK: usize = 16;
    let rest = &values[start..];
    let none = |block: &&[T]| !block.iter().fold(false, |any, &value| any | is(value));
    let skipped = BLOCK * rest.chunks_exact(BLOCK).take_while(none).count();
    rest[skipped..].iter().position(|&value| is(value)).map(|index| start + skipped + index)
}

fn run(y: i64, left: i64, from: usize, to: usize) -> Run {
    let clip = |value: i64| u32::try_from(value).unwrap_or(0);
    Run { y: clip(y), x0: clip(left + from as i64), x1: clip(left + to as i64) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_union_contains_every_pixel_once() {
        let masks = [[0.0, 1.0, 1.0, 0.0, 1.0, 0.0], [1.0, 0.0, 0.0, 0.0, 1.0, 1.0], [0.0, 0.0, 1.0, 1.0, 0.0, 0.0]]
            .map(|tile| Mask::from_tile(&tile, 3, [0, 0], 9, 9, |v| v > 0.5));
        let union = Mask::union(&masks);
        let pixels: std::collections::BTreeSet<usize> = masks.iter().flat_map(|mask| mask.pixels(9)).collect();
        assert_eq!(union.pixels(9).collect::<Vec<_>>(), pixels.into_iter().collect::<Vec<_>>());
        assert_eq!(union, Mask::from_runs(union.runs().to_vec()), "its runs do not touch");
    }

    #[test]
    fn area_bounds_and_centroid_of_a_clipped_tile_match_hand_computed_values() {
        let tile = [0.0, 1.0, 1.0, 0.0, 1.0, 0.0, 1.0, 1.0];
        let mask = Mask::from_tile(&tile, 4, [1, 2], 10, 10, |v| v >= 0.5);
        assert_eq!(mask.area(), 5);
        assert_eq!(mask.bounds(), Some(Bounds { x: 1, y: 2, width: 4, height: 2 }));
        assert_eq!(mask.centroid(), Some([(2.0 + 3.0 + 1.0 + 3.0 + 4.0) / 5.0, (2.0 * 2.0 + 3.0 * 3.0) / 5.0]));
        let clipped = Mask::from_tile(&tile, 4, [-2, -1], 10, 10, |v| v >= 0.5);
        assert_eq!(clipped.runs(), &[Run { y: 0, x0: 0, x1: 2 }]);
        let outside = Mask::from_tile(&tile, 4, [-20, 0], 10, 10, |v| v >= 0.5);
        assert!(outside.is_empty() && outside.bounds().is_none() && outside.centroid().is_none());
        assert_eq!(mask.pixels(10).collect::<Vec<_>>(), [22, 23, 31, 33, 34]);
    }
}
