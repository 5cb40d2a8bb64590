//! How a picture is cut into tiles, at every size.

use std::ops::Range;

use crate::server::Reply;

/// A picture cut into squares. Level 0 is the whole picture, each further one is half of that before, rounded up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Grid {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Side of a tile; those at the right and lower border are smaller.
    pub(crate) tile: usize,
    pub(crate) levels: usize,
}

/// Rows and columns of a level.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Cut {
    pub(crate) rows: Range<usize>,
    pub(crate) columns: Range<usize>,
}

impl Grid {
    /// With as many levels as it takes until one tile is enough.
    pub(crate) fn new(width: usize, height: usize, tile: usize) -> Self {
        let fits = |level: &usize| width.max(height).div_ceil(1 << level) <= tile;
        let levels = (0..usize::BITS as usize - 1).find(fits).map_or(1, |last| last + 1);
        Self { width, height, tile, levels }
    }

    pub(crate) fn size(&self, level: usize) -> Result<[usize; 2], Reply> {
        if level >= self.levels {
            return Err(Reply::refusal(
                404,
                &format!("there is no level {level}; the last of all is {}", self.levels - 1),
            ));
        }
        Ok([self.width, self.height].map(|side| side.div_ceil(1 << level)))
    }

    /// What a tile holds of its level.
    pub(crate) fn cut(&self, level: usize, row: usize, column: usize) -> Result<Cut, Reply> {
        let [width, height] = self.size(level)?;
        let along = |number: usize, side: usize| {
            let start = number.checked_mul(self.tile).filter(|start| *start < side);
            start.map(|start| start..(start + self.tile).min(side))
        };
        let (rows, columns) = (along(row, height), along(column, width));
        let cut = rows.zip(columns).map(|(rows, columns)| Cut { rows, columns });
        cut.ok_or_else(|| Reply::refusal(404, &format!("there is no tile {row}-{column} in level {level}")))
    }
}

impl Cut {
    /// With a pixel more on every side where there is one.
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
                    let cut = grid.cut(level, row, column).unwrap();
                    prop_assert_eq!((cut.rows.start, cut.columns.start), (row * tile, column * tile));
                    prop_assert!(cut.rows.len() <= tile && cut.width() <= tile);
                    pixels += cut.rows.len() * cut.width();
                }
                prop_assert_eq!(pixels, sides[0] * sides[1]);
                prop_assert!(grid.cut(level, rows, 0).is_err() && grid.cut(level, 0, columns).is_err());
                // One tile is enough for the last level and for no other.
                prop_assert_eq!(rows * columns == 1, level + 1 == grid.levels);
                sides = sides.map(|side| side.div_ceil(2));
            }
            prop_assert!(grid.size(grid.levels).is_err() && grid.cut(grid.levels, 0, 0).is_err());
        }
    }

    #[test]
    fn numbers_that_are_too_large_are_no_tile() {
        let grid = Grid::new(1000, 700, 256);
        for [level, row, column] in [[usize::MAX, 0, 0], [64, 0, 0], [0, usize::MAX, 0], [1, 0, usize::MAX / 2]] {
            assert_eq!(grid.cut(level, row, column).unwrap_err().status, 404);
        }
    }
}
