//! Pyramids of 8-bit images.

use super::grid::{Grid, Region};

/// An 8-bit image at all levels.
#[derive(Debug)]
pub(crate) struct Levels {
    grid: Grid,
    channels: usize,
    /// The bytes of each level, row-major, channels interleaved.
    levels: Vec<Vec<u8>>,
}

impl Levels {
    pub(crate) fn new(grid: Grid, channels: usize, values: &[u16], white: u16) -> Self {
        let mut levels = vec![eight_bits(values, white)];
        let mut width = grid.width;
        for _ in 1..grid.levels {
            let half = levels.last().map(|below| halved(below, width, channels));
            levels.extend(half);
            width = width.div_ceil(2);
        }
        Self { grid, channels, levels }
    }

    /// Returns the bytes of a region of a level.
    pub(crate) fn part(&self, level: usize, region: &Region) -> Vec<u8> {
        let row = self.grid.width.div_ceil(1 << level) * self.channels;
        let columns = region.columns.start * self.channels..region.columns.end * self.channels;
        let rows = self.levels[level].chunks_exact(row).skip(region.rows.start).take(region.rows.len());
        rows.flat_map(|row| &row[columns.clone()]).copied().collect()
    }
}

/// Scales grey levels from 0 to `white` to 0 to 255, rounding half up.
pub(crate) fn eight_bits(values: &[u16], white: u16) -> Vec<u8> {
    let white = u32::from(white.max(1));
    let scaled = |value: &u16| u8::try_from((u32::from(*value) * 255 + white / 2) / white).unwrap_or(u8::MAX);
    values.iter().map(scaled).collect()
}

/// Returns the means of 2 × 2 pixels, rounded half up; an odd last row or column counts twice.
fn halved(bytes: &[u8], width: usize, channels: usize) -> Vec<u8> {
    let rows: Vec<&[u8]> = bytes.chunks_exact(width * channels).collect();
    let mut half = Vec::with_capacity(width.div_ceil(2) * channels * rows.len().div_ceil(2));
    for pair in rows.chunks(2) {
        let (upper, lower) = (pair[0], pair[pair.len() - 1]);
        for (above, below) in upper.chunks(2 * channels).zip(lower.chunks(2 * channels)) {
            let right = above.len() - channels;
            for at in 0..channels {
                let sum =
                    [above[at], above[right + at], below[at], below[right + at]].map(u16::from).iter().sum::<u16>();
                half.push(u8::try_from((sum + 2) / 4).unwrap_or(u8::MAX));
            }
        }
    }
    half
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn black_stays_black_and_white_becomes_white() {
        for bits in 1..=16 {
            let white = u16::MAX >> (16 - bits);
            assert_eq!(eight_bits(&[0, white, white / 2], white)[..2], [0, 255], "{bits}");
        }
        assert_eq!(eight_bits(&[0, 1, 128, 255], 255), [0, 1, 128, 255]);
        // Grey levels above white occur in damaged files only.
        assert_eq!(eight_bits(&[u16::MAX], 4095), [255]);
    }

    proptest! {
        /// Compares with the mean of the existing pixels of each 2 × 2 block.
        #[test]
        fn every_level_is_half_of_the_one_below(width in 1_usize..40, height in 1_usize..40, colour: bool, seed in 0_usize..999) {
            let channels = if colour { 3 } else { 1 };
            let values: Vec<u16> = (0..width * height * channels).map(|i| u16::try_from((i * 7919 + seed) % 256).unwrap()).collect();
            let grid = Grid::new(width, height, 4);
            let levels = Levels::new(grid, channels, &values, 255);
            let whole = |level: usize| {
                let [columns, rows] = grid.size(level).unwrap();
                levels.part(level, &Region { rows: 0..rows, columns: 0..columns })
            };
            prop_assert!(whole(0).iter().map(|&byte| u16::from(byte)).eq(values));
            for level in 1..grid.levels {
                let ([columns, rows], below) = (grid.size(level - 1).unwrap(), whole(level - 1));
                for (i, &found) in whole(level).iter().enumerate() {
                    let (pixel, channel) = (i / channels, i % channels);
                    let wide = columns.div_ceil(2);
                    let (x, y) = (pixel % wide * 2, pixel / wide * 2);
                    let four = [[x, y], [x + 1, y], [x, y + 1], [x + 1, y + 1]];
                    let there: Vec<u32> = four
                        .into_iter()
                        .filter(|&[x, y]| x < columns && y < rows)
                        .map(|[x, y]| u32::from(below[(y * columns + x) * channels + channel]))
                        .collect();
                    let count = u32::try_from(there.len()).unwrap();
                    prop_assert_eq!(u32::from(found), (2 * there.iter().sum::<u32>() + count) / (2 * count));
                }
            }
        }
    }
}
