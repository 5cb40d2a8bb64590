//! Sums over the squares around all pixels of a tile.

use multiversion::multiversion;

use super::tile::Tile;

/// Calls `visit` with each row of the sums over squares of 2·`radius` + 1 pixels, from the top. Pixels outside are 0.
pub(crate) fn for_each_row_of_sums(tile: &Tile, radius: usize, mut visit: impl FnMut(&[f32])) {
    let (width, side) = (tile.width, 2 * radius + 1);
    let row = |y: usize| tile.values.get(y * width..(y + 1) * width);
    // Sums of columns, with margins of zeros.
    let mut sums = vec![0.0; width + 2 * radius];
    let mut blocks = [sums.clone(), sums.clone()];
    let mut squares = vec![0.0; width];
    let add = |sums: &mut [f32], y: Option<usize>, sign: f32| {
        y.and_then(row).into_iter().for_each(|row| add_row(&mut sums[radius..], row, sign));
    };
    (0..radius).for_each(|y| add(&mut sums, Some(y), 1.0));
    for y in 0..tile.height() {
        add(&mut sums, Some(y + radius), 1.0);
        sum_windows(&mut squares, &sums, &mut blocks, side);
        visit(&squares);
        add(&mut sums, y.checked_sub(radius), -1.0);
    }
}

/// Returns the mean over squares of 2·radius + 1 pixels.
pub(crate) fn averaged(tile: &Tile, radius: usize) -> Tile {
    let side = (2 * radius + 1) as f32;
    let weight = 1.0 / (side * side);
    let mut values = Vec::with_capacity(tile.values.len());
    for_each_row_of_sums(tile, radius, |sums| {
        values.extend(sums.iter().map(|sum| (weight * sum).clamp(0.0, 1.0)));
    });
    Tile { values, ..*tile }
}

/// Sums each window of `side` consecutive values, of which there are `side` − 1 more than sums. `blocks` are buffers.
fn sum_windows(sums: &mut [f32], values: &[f32], blocks: &mut [Vec<f32>; 2], side: usize) {
    let [blocks, doubled] = blocks;
    blocks.copy_from_slice(values);
    sums.fill(0.0);
    // A window consists of blocks, whose lengths are powers of two.
    let (mut start, mut length) = (0, 1);
    loop {
        if side & length != 0 {
            add_row(sums, &blocks[start..], 1.0);
            start += length;
        }
        if start == side {
            break;
        }
        add_rows(doubled, blocks, &blocks[length..]);
        core::mem::swap(blocks, doubled);
        length *= 2;
    }
}

#[multiversion(targets = "simd")]
fn add_rows(sums: &mut [f32], row: &[f32], other: &[f32]) {
    for ((sum, a), b) in sums.iter_mut().zip(row).zip(other) {
        *sum = a + b;
    }
}

/// Adds `factor` times a row to sums.
#[multiversion(targets = "simd")]
pub(crate) fn add_row(sums: &mut [f32], row: &[f32], factor: f32) {
    for (sum, value) in sums.iter_mut().zip(row) {
        *sum += factor * value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_of_windows_match_direct_sums() {
        for side in [1, 3, 5, 7, 13, 16, 31] {
            let values: Vec<f32> = (0..40 + side - 1).map(|i| ((i * 37) % 101) as f32).collect();
            let mut sums = vec![7.0; 40];
            sum_windows(&mut sums, &values, &mut [values.clone(), values.clone()], side);
            let direct: Vec<f32> = values.windows(side).map(|window| window.iter().sum()).collect();
            assert_eq!(sums, direct, "{side}");
        }
    }

    #[test]
    fn averages_match_sums_over_squares() {
        let values = (0..13 * 9).map(|i| f32::from(u8::from(i * 7 % 5 < 3))).collect();
        let tile = Tile { origin: [2, -3], width: 13, values };
        for radius in [1_usize, 3, 8, 20] {
            let mean = averaged(&tile, radius);
            for (i, found) in mean.values.iter().enumerate() {
                let near = |a: usize, b: usize| a.abs_diff(b) <= radius;
                let square =
                    tile.values.iter().enumerate().filter(|(j, _)| near(j % 13, i % 13) && near(j / 13, i / 13));
                let wanted = square.map(|(_, value)| value).sum::<f32>() / ((2 * radius + 1) * (2 * radius + 1)) as f32;
                assert!((found - wanted).abs() < 1e-5, "{radius} {i}: {found} {wanted}");
            }
        }
    }
}
