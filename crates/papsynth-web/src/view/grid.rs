//! The tile grid of an image at every level.

use std::ops::Range;

use crate::server::Reply;

/// A tile grid. Level 0 has full resolution; each further level has half the size of the one before, rounded up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Grid {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Size of a tile, px; tiles at the right and lower border are smaller.
    pub(crate) tile: usize,
    pub(crate) levels: usize,
}

/// A range of rows and columns of a level.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Region {
    pub(crate) rows: Range<usize>,
    pub(crate) columns: Range<usize>,
}

impl Grid {
    /// Creates a grid whose last level is a single tile.
    pub(crate) fn new(width: usize, height: usize, tile: usize) -> Self {
        let fits = |level: &usize| width.max(height).div_ceil(1 << level) <= tile;
        let levels = (0..usize::BITS as usize - 1).find(fits).map_or(1, |last| last + 1);
        Self { width, height, tile, levels }
    }

    pub(crate) fn size(&self, level: usize) -> Result<[usize; 2], Reply> {
        if level >= self.levels {
            return Err(Reply::error(404, &format!("no level {level}: expected 0 to {}", self.levels - 1)));
        }
        Ok([self.width, self.height].map(|side| side.div_ceil(1 << level)))
    }

    /// Returns the region of a tile.
    pub(crate) fn region(&self, level: usize, row: usize, column: usize) -> Result<Region, Reply> {
        let [width, height] = self.size(level)?;
        let along = |number: usize, side: usize| {
            let start = number.checked_mul(self.tile).filter(|start| *start < side);
            start.map(|start| start..(start + self.tile).min(side))
        };
        let (rows, columns) = (along(row, height), along(column, width));
        let region = rows.zip(columns).map(|(rows, columns)| Region { rows, columns });
        region.ok_or_else(|| Reply::error(404, &format!("no tile {row}-{column} in level {level}")))
    }
}

impl Region {
    /// Returns the region with a margin of one pixel, within the level.
    pub(crate) fn wider(&self, [width, height]: [usize; 2]) -> Self {
        let wider = |range: &Range<usize>, side: usize| range.start.saturating_sub(1)..(range.end + 1).min(side);
        Self { rows: wider(&self.rows, height), columns: wider(&self.columns, width) }
    }

    pub(crate) fn width(&self) -> usize {
        self.columns.len()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn tiles_cover_every_pixel_of_every_level_once(width in 1_usize..900, height in 1_usize..900, tile in 1_usize..300) {
            let grid = Grid::new(width, height, tile);
            let mut sides = [width, height];
            for level in 0..grid.levels {
                prop_assert_eq!(grid.size(level).unwrap(), sides);
                let (columns, rows) = (sides[0].div_ceil(tile), sides[1].div_ceil(tile));
                let mut pixels = 0;
                for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
                    let region = grid.region(level, row, column).unwrap();
                    prop_assert_eq!((region.rows.start, region.columns.start), (row * tile, column * tile));
                    prop_assert!(region.rows.len() <= tile && region.width() <= tile);
                    pixels += region.rows.len() * region.width();
                }
                prop_assert_eq!(pixels, sides[0] * sides[1]);
                prop_assert!(grid.region(level, rows, 0).is_err() && grid.region(level, 0, columns).is_err());
                // One tile is enough for the last level and for no other.
                prop_assert_eq!(rows * columns == 1, level + 1 == grid.levels);
                sides = sides.map(|side| side.div_ceil(2));
            }
            prop_assert!(grid.size(grid.levels).is_err() && grid.region(grid.levels, 0, 0).is_err());
        }
    }

    #[test]
    fn tiles_out_of_range_are_rejected() {
        let grid = Grid::new(1000, 700, 256);
        for [level, row, column] in [[usize::MAX, 0, 0], [64, 0, 0], [0, usize::MAX, 0], [1, 0, usize::MAX / 2]] {
            assert_eq!(grid.region(level, row, column).unwrap_err().status, 404);
        }
    }
}
