//! The rim of a cell: how the thickness of the cytoplasm increases from its outline.

use multiversion::multiversion;
use portable_numerics::rounding::round_to_count;

use super::coarse_tile::CoarseTile;
use crate::phantom::box_sums::for_each_row_of_sums;
use crate::phantom::cell_context::CellContext;
use crate::phantom::noise_fields::FieldSampler;
use crate::phantom::tile::{Point, Tile};

/// Thins the marginal zone, of width `zone_px`, along the outline of a cell; the factor is 1 farther inside. The
/// remaining increase of the thickness, [`beyond_zone`], depends on the relative radius.
pub(super) fn thin_rim(thickness: &mut Tile, coverage: &Tile, zone_px: f64) {
    let radius = round_to_count(zone_px);
    if radius == 0 {
        return;
    }
    let (width, side) = (coverage.width, 2 * radius + 1);
    let weight = 1.0 / (side as f32 * side as f32);
    let mut rows = thickness.values.chunks_exact_mut(width);
    for_each_row_of_sums(coverage, radius, |sums| {
        if let Some(values) = rows.next() {
            thin(values, sums, weight);
        }
    });
}

/// Standard deviation of the Gaussian that smooths the inside of a cell for [`slope_rim`], µm.
const SLOPE_UM: f64 = 4.0;

/// Largest relative decrease of the thickness at the rim. Set by eye, with single cells of Cervix93 as guide
/// (docs/decisions.md, "Sloping rims").
const SLOPE: f32 = 0.7;

/// Standard deviation of the smoothing of the noise that makes some parts of the rim slope and others not, µm.
const SLOPE_CHANGES_UM: f64 = 5.0;

/// Thins a broad zone along parts of the rim, whose thickness increases gradually.
pub(super) fn slope_rim(thickness: &mut Tile, outline: &[Point], cell: &CellContext<'_>) {
    if cell.body.detail.rim_um <= 0.0 {
        return;
    }
    let (pixel_um, mut rng) = (cell.pixel_um(), cell.stream("slope"));
    let mut zone = CoarseTile::smoothed(thickness, outline, SLOPE_UM / pixel_um);
    let sampler = FieldSampler::clouds(SLOPE_CHANGES_UM / pixel_um, &mut rng);
    let mut noise = CoarseTile::noise(thickness, cell.noise_fields.clouds(), &sampler);
    let [mut smoothed, mut slopes] = [(); 2].map(|()| vec![0.0; thickness.width]);
    for (y, row) in thickness.values.chunks_exact_mut(smoothed.len()).enumerate() {
        zone.row_into(&mut smoothed, y);
        noise.row_into(&mut slopes, y);
        slope_row(row, &smoothed, &slopes);
    }
}

/// Thins a row where `smoothed`, the smoothed inside of the cell, is below 1, in proportion to a slope between 0 and 1
/// from noise.
#[multiversion(targets = "simd")]
fn slope_row(row: &mut [f32], smoothed: &[f32], noise: &[f32]) {
    for ((value, smoothed), noise) in row.iter_mut().zip(smoothed).zip(noise) {
        // 1 at the outline, 0 inside.
        let near_rim = (2.0 - 2.0 * smoothed).clamp(0.0, 1.0);
        *value *= 1.0 - SLOPE * near_rim * (0.5 + 0.5 * noise).clamp(0.0, 1.0);
    }
}

/// Returns the thickness of a sheet relative to the rest, at a distance from its rim in widths of the marginal zone.
///
/// At the rim of single cells of Cervix93, the absorbance increases as 1 − exp(−t/λ) with the distance t, where λ is
/// 1.6 to 2.2 µm.
pub(super) fn thinning(distance: f64) -> f64 {
    1.0 - libm::exp(-2.0 * distance.max(0.0))
}

/// Returns the part of [`thinning`] that changes only beyond the marginal zone.
pub(super) fn beyond_zone(distance: f64) -> f64 {
    thinning(distance.max(1.0))
}

/// Coefficients of the polynomial u(a + bu + cu²), which differs from [`thinning`] in the marginal zone, relative to
/// its inner border, by 0.01 at most.
const ZONE: [f32; 3] = [2.262_7, -1.94, 0.677_3];

/// Returns the depth of a pixel in the zone along the outline of a cell: 0 at the outline, 1 at half the side of a box
/// from it and farther inside. `sum` is the sum of the coverage over the box around the pixel, `weight` is 1 / the
/// number of pixels of the box.
///
/// At a straight outline, the mean coverage of a box is 0.5; half a side farther inside, it is 1. Inlined, so that it
/// is compiled for the caller's instruction set.
#[inline(always)]
pub(super) fn depth_in_zone(sum: f32, weight: f32) -> f32 {
    (2.0 * weight * sum - 1.0).clamp(0.0, 1.0)
}

/// Multiplies values by a factor that increases from 0 at the rim to 1 at one radius inside: [`ZONE`].
#[multiversion(targets = "simd")]
fn thin(values: &mut [f32], sums: &[f32], weight: f32) {
    for (value, sum) in values.iter_mut().zip(sums) {
        let inside = depth_in_zone(*sum, weight);
        *value *= inside * (ZONE[0] + inside * (ZONE[1] + inside * ZONE[2]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantom::tile::tests::{at, disc};

    #[test]
    fn thin_rim_matches_the_local_mean_of_the_coverage() {
        let mut cover = Tile { origin: [3, -7], width: 31, values: vec![0.0; 31 * 27] };
        cover.cover(&disc([17.0, 5.0], 11.0));
        let radius = 4_i64;
        let mut thin = Tile { values: vec![1.0; 31 * 27], ..cover.clone() };
        thin_rim(&mut thin, &cover, 4.0);
        thin.for_each(|p, found| {
            let [x, y] = p.map(|at| at as i64);
            let around = (y - radius..=y + radius).flat_map(|y| (x - radius..=x + radius).map(move |x| [x, y]));
            let sum: f64 = around.map(|p| f64::from(at(&cover, p))).sum();
            let inside = (2.0 * sum / 81.0 - 1.0).clamp(0.0, 1.0);
            let [a, b, c] = ZONE.map(f64::from);
            let expected = inside * (a + inside * (b + inside * c));
            assert!((f64::from(*found) - expected).abs() < 1e-5, "{x} {y}: {found}");
        });
    }

    #[test]
    fn folded_and_other_cells_become_thin_over_the_same_distance() {
        let (radius, edge) = (6, 20.0);
        let mut cover = Tile { origin: [0, 0], width: 60, values: vec![0.0; 60 * 41] };
        cover.cover(&[[edge, -1.0], [70.0, -1.0], [70.0, 50.0], [edge, 50.0]]);
        let mut thin = Tile { values: vec![1.0; 60 * 41], ..cover.clone() };
        thin_rim(&mut thin, &cover, f64::from(radius));
        for x in 20..40 {
            let found = f64::from(at(&thin, [x, 20]));
            let distance = (x as f64 - edge) / (f64::from(radius) + 0.5);
            let found = found * beyond_zone(distance);
            assert!((found - thinning(distance)).abs() < 0.01, "{x}: {found} {}", thinning(distance));
        }
        assert!(thinning(0.0) == 0.0 && (thinning(5.0) - 1.0).abs() < 1e-4);
    }

    #[test]
    fn a_sloping_rim_is_thin_at_the_outline_and_unchanged_inside() {
        // Smoothed, the inside is 0.5 at a straight outline.
        let smoothed = [0.5, 0.75, 1.0, 1.0, 0.5];
        let mut row = [1.0; 5];
        slope_row(&mut row, &smoothed, &[1.0, 1.0, 1.0, -1.0, -1.0]);
        assert_eq!(row, [1.0 - SLOPE, 1.0 - 0.5 * SLOPE, 1.0, 1.0, 1.0]);
    }
}
