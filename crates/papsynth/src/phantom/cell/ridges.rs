//! Narrow ridges of a crumpled sheet.

use multiversion::multiversion;

use crate::phantom::tile::Tile;

/// Half width of the widest narrow ridge, µm.
const HALF_WIDTH_UM: f64 = 0.7;
/// Limit from which ridges keep their thickness.
const NO_LIMIT: f64 = 100.0;

/// Limits the additional thickness of narrow ridges, which rise where a sheet stands up along its rim or a fold, and
/// along the creases of a fold that is too narrow to be seen. Light microscopes show them as thin, faint lines.
/// `thickness` is relative to the flat sheet; up to 1, it does not change, so that narrow parts of a cell keep theirs.
///
/// The ridges are the difference between the thickness and its grey-scale opening with a square (white top-hat
/// transform; Soille, Morphological Image Analysis, 2004, doi:10.1007/978-3-662-05088-0). A difference x becomes
/// x·L / (x + L), where L is the limit. Wider folds do not change.
pub(super) fn limit_ridges(thickness: &mut Tile, limit: f64, pixel_um: f64) {
    let radius = (HALF_WIDTH_UM / pixel_um).round() as usize;
    if limit >= NO_LIMIT || radius == 0 {
        return;
    }
    let mut opened = thickness.values.clone();
    over_squares(&mut opened, thickness.width, radius, minima);
    over_squares(&mut opened, thickness.width, radius, maxima);
    // A limit of 0 must not divide 0 by 0.
    soften(&mut thickness.values, &opened, (limit as f32).max(1e-6));
}

/// Joins each value with all others in the square of 2·`radius` + 1 pixels around it.
fn over_squares(values: &mut [f32], width: usize, radius: usize, join: fn(&mut [f32], &[f32])) {
    let mut source = vec![0.0; width];
    for row in values.chunks_exact_mut(width) {
        source.copy_from_slice(row);
        for shift in 1..=radius.min(width - 1) {
            join(row, &source[shift..]);
            join(&mut row[shift..], &source);
        }
    }
    let source = values.to_vec();
    let rows: Vec<&[f32]> = source.chunks_exact(width).collect();
    for (y, row) in values.chunks_exact_mut(width).enumerate() {
        let around = y.saturating_sub(radius)..(y + radius + 1).min(rows.len());
        around.filter(|other| *other != y).for_each(|other| join(row, rows[other]));
    }
}

#[multiversion(targets = "simd")]
fn minima(row: &mut [f32], other: &[f32]) {
    row.iter_mut().zip(other).for_each(|(value, other)| *value = if *other < *value { *other } else { *value });
}

#[multiversion(targets = "simd")]
fn maxima(row: &mut [f32], other: &[f32]) {
    row.iter_mut().zip(other).for_each(|(value, other)| *value = if *other > *value { *other } else { *value });
}

#[multiversion(targets = "simd")]
fn soften(values: &mut [f32], opened: &[f32], limit: f32) {
    for (value, opened) in values.iter_mut().zip(opened) {
        let flat = if *value < 1.0 { *value } else { 1.0 };
        let base = if *opened > flat { *opened } else { flat };
        let excess = *value - base;
        *value = base + excess * limit / (excess + limit);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a tile of 20 × 20 pixels from a function of x and y.
    fn tile(value: impl Fn(usize, usize) -> f32) -> Tile {
        let values = (0..400).map(|at| value(at % 20, at / 20)).collect();
        Tile { origin: [0, 0], width: 20, values }
    }

    #[test]
    fn narrow_ridges_are_limited_and_wide_folds_keep_their_thickness() {
        // Pixels of 0.35 µm: ridges of up to four pixels are narrow.
        for (width, height, expected) in [(4, 1.0, 1.0 + 0.2), (1, 3.0, 1.0 + 3.0 / 13.0), (5, 1.0, 2.0)] {
            for across in [true, false] {
                let ridge = |x, y| if (8..8 + width).contains(if across { &x } else { &y }) { height } else { 0.0 };
                let mut thickness = tile(|x, y| 1.0 + ridge(x, y));
                limit_ridges(&mut thickness, 0.25, 0.35);
                let other = tile(|x, y| if ridge(x, y) > 0.0 { expected } else { 1.0 });
                for (value, expected) in thickness.values.iter().zip(other.values) {
                    assert!((value - expected).abs() < 1e-6, "{width} px: {value}, expected {expected}");
                }
            }
        }
    }

    #[test]
    fn narrow_parts_of_a_cell_keep_their_thickness() {
        let protrusion = tile(|x, y| if y > 12 || (8..10).contains(&x) { 0.9 } else { 0.0 });
        let mut limited = protrusion.clone();
        limit_ridges(&mut limited, 0.25, 0.35);
        assert_eq!(limited, protrusion);
    }

    #[test]
    fn no_limit_keeps_every_ridge_and_a_limit_of_0_removes_them() {
        let ridge = tile(|x, y| if x == y { 4.0 } else { 1.0 });
        let mut kept = ridge.clone();
        limit_ridges(&mut kept, 100.0, 0.35);
        assert_eq!(kept, ridge);
        let mut removed = ridge;
        limit_ridges(&mut removed, 0.0, 0.35);
        assert!(removed.values.iter().all(|value| (0.999..1.001).contains(value)));
    }

    #[test]
    fn an_opening_is_the_largest_minimum_of_the_squares_that_contain_a_pixel() {
        let values = tile(|x, y| ((x * 37 + y * 61) % 23) as f32);
        let mut opened = values.values.clone();
        over_squares(&mut opened, 20, 2, minima);
        over_squares(&mut opened, 20, 2, maxima);
        let around = |at: usize| at.saturating_sub(2)..(at + 3).min(20);
        let minimum = |x: usize, y: usize| {
            let square = around(y).flat_map(|v| around(x).map(move |u| (u, v)));
            square.map(|(u, v)| values.values[v * 20 + u]).fold(f32::INFINITY, f32::min)
        };
        for (at, opened) in opened.iter().enumerate() {
            let square = around(at / 20).flat_map(|v| around(at % 20).map(move |u| (u, v)));
            let greatest = square.map(|(u, v)| minimum(u, v)).fold(f32::NEG_INFINITY, f32::max);
            assert_eq!(*opened, greatest, "{at}");
        }
    }
}
