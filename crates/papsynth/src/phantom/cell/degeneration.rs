//! Degeneration of cytoplasm: dark granular material at the rim and in patches.

use multiversion::multiversion;
use portable_numerics::rounding::round_to_count;

use super::detail::covered;
use super::rim::depth_in_zone;
use crate::phantom::box_sums::for_each_row_of_sums;
use crate::phantom::cell_context::CellContext;
use crate::phantom::noise_fields::{FieldSampler, SIDE, Texels};
use crate::phantom::tile::Tile;

/// Standard deviations of the smoothing of the noise fields of degenerated material, µm: two sizes of grains, clumps of
/// grains, and patches.
const MATERIAL_UM: [f64; 4] = [0.16, 0.35, 0.8, 3.0];

/// Width of the zone at the rim with most of the material, µm.
const MARGIN_UM: f64 = 6.0;

/// Fraction of the area inside the zone at the rim that material covers, for a degeneration of 0. The sum of this and
/// the next three terms is limited to 0 to 1: weakly degenerated cells have material only at the rim and in patches,
/// strongly degenerated ones everywhere.
const COVERED_INSIDE: f32 = -0.4;

/// Increase of the covered fraction per unit of degeneration.
const COVERED_BY_DEGENERATION: f32 = 0.9;

/// Increase of the covered fraction from the inner border of the zone at the rim to the outline.
const COVERED_AT_RIM: f32 = 0.6;

/// Increase of the covered fraction per standard deviation of the patches.
const COVERED_BY_PATCHES: f32 = 0.4;

/// Mean absorbance of the material relative to [`amount`], before negative values become 0.
const MATERIAL: f32 = 0.8;

/// Standard deviation of the absorbance of the material due to the grains of each of the two sizes, relative to
/// [`amount`], where the patches have their mean.
const GRAINS: f32 = 0.42;

/// Standard deviation of the absorbance of the material due to the clumps of grains, relative to [`amount`].
const CLUMPS: f32 = 0.14;

/// Relative change of the standard deviation of the grains per standard deviation of the patches: it is larger where
/// there is more material. Set by eye.
const UNEVEN: f32 = 0.5;

/// Fraction of the material that is left at the outline, where it crumbles. The noise field of the clumps, of standard
/// deviation 1, is added, and the sum is limited to 0 to 1. Set by eye, beside degenerated cells of real fields.
const LEFT_AT_RIM: f32 = -0.5;

/// Increase of this fraction from the outline to the inner border of the zone at the rim. Set by eye, too.
const LEFT_ACROSS_ZONE: f32 = 8.0;

/// Adds the granular material of a degenerated cell: the thickness of cytoplasm that absorbs as much.
pub(super) fn add(thickness: &mut Tile, coverage: &Tile, cell: &CellContext<'_>) {
    let strength = cell.body.detail.degeneration as f32;
    if strength <= 0.0 {
        return;
    }
    let (pixel_um, clouds, rng) = (cell.pixel_um(), cell.noise_fields.clouds(), &mut cell.stream("degeneration"));
    let samplers = MATERIAL_UM.map(|um| FieldSampler::clouds((um / pixel_um).max(0.5), rng));
    let radius = round_to_count(MARGIN_UM / pixel_um).max(1);
    let side = (2 * radius + 1) as f32;
    let width = coverage.width;
    let mut texels: Texels = [0.0; SIDE + 1];
    let mut fields = [(); MATERIAL_UM.len()].map(|()| vec![0.0_f32; width]);
    let mut rows = thickness.values.chunks_exact_mut(width).zip(coverage.values.chunks_exact(width)).enumerate();
    for_each_row_of_sums(coverage, radius, |sums| {
        let Some((y, (row, cover))) = rows.next() else { return };
        let Some((first, end)) = covered(cover) else { return };
        for (field, sampler) in fields.iter_mut().zip(&samplers) {
            clouds.row_into(&mut field[first..end], sampler, [first as f64, y as f64], &mut texels);
        }
        let fields = fields.each_ref().map(|field| &field[first..end]);
        encrust(&mut row[first..end], fields, &sums[first..end], 1.0 / (side * side), strength);
    });
}

/// Adds material to a row. `sums` are those of the coverage over boxes, `weight` is 1 / the number of pixels of a box.
#[multiversion(targets = "simd")]
fn encrust(row: &mut [f32], fields: [&[f32]; 4], sums: &[f32], weight: f32, strength: f32) {
    let [fine, coarse, clumps, patches] = fields;
    let inside = COVERED_INSIDE + COVERED_BY_DEGENERATION * strength;
    let amount = amount(strength);
    let grains = fine.iter().zip(coarse).zip(clumps).zip(patches);
    for ((value, (((fine, coarse), clumps), patches)), sum) in row.iter_mut().zip(grains).zip(sums) {
        let near_rim = 1.0 - depth_in_zone(*sum, weight);
        let covered = (inside + COVERED_AT_RIM * near_rim + COVERED_BY_PATCHES * patches).clamp(0.0, 1.0);
        let left = (LEFT_AT_RIM + (1.0 - near_rim) * LEFT_ACROSS_ZONE + clumps).clamp(0.0, 1.0);
        let uneven = (1.0 + UNEVEN * patches).max(0.0);
        let grain = left * (MATERIAL + GRAINS * uneven * (fine + coarse) + CLUMPS * clumps);
        *value += amount * covered * if grain > 0.0 { grain } else { 0.0 };
    }
}

/// Returns the scale of the absorbance of the material, relative to the flat sheet. It approaches 1: stronger
/// degeneration covers more of a cell, but grains become no darker.
fn amount(strength: f32) -> f32 {
    strength / (1.0 + strength)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grains_are_stronger_in_patches_of_more_material() {
        let (half, none) = ([0.5_f32; 3], [0.0_f32; 3]);
        let mut row = [0.0; 3];
        // Twice the strength, so that all of the inside is covered.
        encrust(&mut row, [&half, &half, &none, &[-1.0, 0.0, 1.0]], &[1.0; 3], 1.0, 2.0);
        let expected = [-1.0, 0.0, 1.0].map(|patch| (2.0 / 3.0) * (MATERIAL + GRAINS * (1.0 + UNEVEN * patch)));
        row.iter().zip(expected).for_each(|(found, expected)| assert!((found - expected).abs() < 1e-5, "{row:?}"));
    }

    #[test]
    fn degenerated_material_lies_at_the_rim_and_in_patches() {
        let grains = [0.5_f32; 4];
        // The mean coverage around: at three places of the margin, and twice inside. Patches at the last place.
        let [sums, patches] = [[0.5, 0.6, 0.75, 1.0, 1.0], [0.0, 0.0, 0.0, 0.0, 2.0]];
        let mut row = [0.2_f32; 5];
        let fields: [&[f32]; 4] = [&[0.5; 5], &[0.5; 5], &[0.5; 5], &patches];
        encrust(&mut row, fields, &sums, 1.0, 0.3);
        // Material crumbles at the rim.
        assert!(row[0] == 0.2 && row[1] > row[2] && row[2] > row[3] && row[3] == 0.2 && row[4] > 0.2, "{row:?}");
        let patches = [0.0, 0.0, 0.0, 2.0];
        let sums = [0.6, 0.75, 1.0, 1.0];
        let mut row = [0.2_f32; 4];
        encrust(&mut row, [&[-2.0; 4], &[-2.0; 4], &[-2.0; 4], &patches], &sums, 1.0, 0.3);
        assert_eq!(row, [0.2; 4]);
        // A strongly degenerated cell is covered everywhere.
        encrust(&mut row, [&grains, &grains, &grains, &[0.0; 4]], &sums, 1.0, 1.0);
        assert!(row.iter().all(|value| *value > 0.2), "{row:?}");
    }
}
