//! Degeneration of cytoplasm: dark granular material at the rim and in patches.

use multiversion::multiversion;

use super::detail::covered;
use crate::phantom::box_sums::for_each_row_of_sums;
use crate::phantom::cell_context::CellContext;
use crate::phantom::noise_fields::{FieldSampler, SIDE, Texels};
use crate::phantom::tile::Tile;
use crate::random;

/// Standard deviations of the smoothing of the noise fields of degenerated material, µm: two sizes of grains, clumps of
/// grains, and patches.
const MATERIAL_UM: [f64; 4] = [0.16, 0.35, 0.8, 3.0];

/// Width of the zone at the rim with most of the material, µm.
const MARGIN_UM: f64 = 6.0;

/// The fraction of a place that is covered with material: inside, at the rim in addition, and by patches. Strongly
/// degenerated cells are covered everywhere.
const INSIDE: [f32; 2] = [-0.4, 0.9];
const AT_RIM: f32 = 0.6;
const OF_PATCHES: f32 = 0.4;

/// Absorbance of the material relative to its amount, negative values apart: mean, and standard deviation of the
/// grains of each size, where patches have their mean, and of the clumps.
const MATERIAL: f32 = 0.8;
const GRAINS: f32 = 0.42;
const CLUMPS: f32 = 0.14;

/// Change of the standard deviation of the grains, relative to it, per standard deviation of the patches: it is larger
/// where there is more material. Set by eye.
const UNEVEN: f32 = 0.5;

/// Material crumbles at the rim: the fraction that is left is the first number at the rim, rises by the second one over
/// the width of the zone, and varies between clumps. Set by eye, beside degenerated cells of real fields.
const WHOLE: f32 = -0.5;
const CRUMBLING: f32 = 8.0;

/// Adds the granular material of a degenerated cell.
pub(super) fn add(absorbance: &mut Tile, coverage: &Tile, cell: &CellContext<'_>) {
    let strength = cell.body.detail.degeneration as f32;
    if strength <= 0.0 {
        return;
    }
    let (pixel_um, clouds, rng) = (cell.pixel_um(), cell.noise_fields.clouds(), &mut cell.stream("degeneration"));
    let samplers = MATERIAL_UM.map(|um| FieldSampler::clouds((um / pixel_um).max(0.5), rng));
    let radius = random::count(MARGIN_UM / pixel_um).max(1);
    let side = (2 * radius + 1) as f32;
    let width = coverage.width;
    let mut texels: Texels = [0.0; SIDE + 1];
    let mut fields = [(); MATERIAL_UM.len()].map(|()| vec![0.0_f32; width]);
    let mut rows = absorbance.values.chunks_exact_mut(width).zip(coverage.values.chunks_exact(width)).enumerate();
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

/// Adds material to a row.
#[multiversion(targets = "simd")]
fn encrust(row: &mut [f32], fields: [&[f32]; 4], sums: &[f32], weight: f32, strength: f32) {
    let [fine, coarse, clumps, patches] = fields;
    let inside = INSIDE[0] + INSIDE[1] * strength;
    let amount = amount(strength);
    let grains = fine.iter().zip(coarse).zip(clumps).zip(patches);
    for ((value, (((fine, coarse), clumps), patches)), sum) in row.iter_mut().zip(grains).zip(sums) {
        let margin = 1.0 - (2.0 * weight * sum - 1.0).clamp(0.0, 1.0);
        let covered = (inside + AT_RIM * margin + OF_PATCHES * patches).clamp(0.0, 1.0);
        let whole = (WHOLE + (1.0 - margin) * CRUMBLING + clumps).clamp(0.0, 1.0);
        let uneven = (1.0 + UNEVEN * patches).max(0.0);
        let grain = whole * (MATERIAL + GRAINS * uneven * (fine + coarse) + CLUMPS * clumps);
        *value += amount * covered * if grain > 0.0 { grain } else { 0.0 };
    }
}

/// Returns the absorbance of the material relative to the cytoplasm. It approaches 1: stronger degeneration covers more
/// of a cell, but grains become no darker.
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
