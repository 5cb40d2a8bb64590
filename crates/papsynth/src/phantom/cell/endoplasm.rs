//! The endoplasm: the inner part of the cytoplasm.

use multiversion::multiversion;

use super::coarse_tile::CoarseTile;
use crate::phantom::cell_context::CellContext;
use crate::phantom::parametric_shape::{make_irregular, perturbed_circle};
use crate::phantom::tile::{Point, Tile, scaled_about};
use crate::random;

/// Radius of the region where the nucleus lifts the sheet, relative to the nucleus radius.
const LIFTED: f64 = 2.4;

/// Increase of thickness at the nucleus, relative to the density of the endoplasm. Single normal cells of Cervix93
/// hardly become thicker towards the nucleus within the endoplasm.
const LIFT: f32 = 0.3;

/// Steps of a radial ramp.
const STEPS: usize = 6;

/// Returns a ramp: 1 inside a polygon scaled by `inner` about `centre`, 0 outside the polygon scaled by `outer`, with
/// equal steps between.
pub(super) fn ramp(like: &Tile, polygon: &[Point], centre: Point, inner: f64, outer: f64) -> Tile {
    let scaled = |step: usize| {
        let factor = inner + (outer - inner) * (step as f64 + 0.5) / STEPS as f64;
        scaled_about(polygon, centre, factor)
    };
    let mut ramp = like.blank();
    ramp.add_covers((0..STEPS).map(scaled), 1.0 / STEPS as f32);
    ramp
}

/// Adds the endoplasm: the inner part of the cytoplasm, denser than the outer part. Returns its zone: 1 inside, 0
/// outside.
pub(super) fn add_endoplasm(
    thickness: &mut Tile,
    outline: &[Point],
    nucleus: Point,
    cell: &CellContext<'_>,
) -> Option<CoarseTile> {
    let body = cell.body;
    if body.detail.endoplasm <= 0.0 {
        return None;
    }
    let (pixel_um, rng) = (cell.pixel_um(), &mut cell.stream("endoplasm"));
    let size = random::between(INNER_SIZE[0], INNER_SIZE[1], rng);
    let sigma_px = random::between(INNER_SOFTNESS[0], INNER_SOFTNESS[1], rng) * body.radius_um / pixel_um;
    // The zone is smooth, so that every second point is sufficient.
    let around = outline.iter().step_by(2).map(|p| [0, 1].map(|axis| size * (p[axis] - nucleus[axis])));
    let mut zone: Vec<Point> = around.collect();
    make_irregular(&mut zone, INNER_IRREGULARITY, rng);
    let zone: Vec<Point> = zone.iter().map(|p| [p[0] + nucleus[0], p[1] + nucleus[1]]).collect();
    let mut inner = CoarseTile::smoothed(thickness, &zone, sigma_px);
    // Densest where the nucleus lifts the sheet.
    let radius = body.nucleus.radius_um / pixel_um;
    let round = perturbed_circle(radius, 0.15, 0.15, rng);
    let round: Vec<Point> = round.iter().map(|p| [p[0] + nucleus[0], p[1] + nucleus[1]]).collect();
    let near = Tile::around(&scaled_about(&round, nucleus, LIFTED), 1.0);
    let lifted = ramp(&near, &round, nucleus, 1.0, LIFTED);
    let lift = LIFT * body.detail.endoplasm as f32;
    thickness.blend(&lifted, |values, ramp| {
        values.iter_mut().zip(ramp).for_each(|(value, ramp)| *value *= 1.0 + lift * ramp);
    });
    let density = body.detail.endoplasm as f32;
    let mut inside = vec![0.0_f32; thickness.width];
    for (y, row) in thickness.values.chunks_exact_mut(inside.len()).enumerate() {
        inner.row_into(&mut inside, y);
        thicken(row, &inside, INNER * density);
    }
    Some(inner)
}

/// Size of the zone of the endoplasm relative to the cell: minimum, maximum. This and the next two were set by eye.
const INNER_SIZE: [f64; 2] = [0.45, 0.75];

/// Standard deviation of the Gaussian that smooths the zone, relative to the radius of the cell: minimum, maximum.
const INNER_SOFTNESS: [f64; 2] = [0.1, 0.3];

/// Irregularity of the outline of the zone: see [`make_irregular`].
const INNER_IRREGULARITY: f64 = 0.12;

/// Increase of thickness in the endoplasm relative to its density. In fields with the endoplasm of version 31, matched
/// to normal fields of Cervix93, the absorbance of single cells relative to its median, which includes the endoplasm,
/// rises from 0.95 at a fifth of the way from the rim to the centre to 1.2 or 1.3 in the inner half. In 26 real cells,
/// it rises from 0.9 to 1.2 or 1.3.
const INNER: f32 = 1.4;

/// Thickens a row by the density of the endoplasm where it is inside.
#[multiversion(targets = "simd")]
fn thicken(row: &mut [f32], inside: &[f32], density: f32) {
    for (value, inside) in row.iter_mut().zip(inside) {
        *value *= 1.0 + inside * density;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantom::tile::tests::disc;

    #[test]
    fn a_ramp_is_the_mean_of_scaled_coverages() {
        let like = Tile { origin: [-20, -20], width: 41, values: vec![0.0; 41 * 41] };
        let (polygon, centre) = (disc([1.0, 0.5], 12.0), [0.0, 0.0]);
        let ramp = ramp(&like, &polygon, centre, 0.6, 1.4);
        let mut mean = like.blank();
        for step in 0..STEPS {
            let mut cover = like.blank();
            cover.cover(&scaled_about(&polygon, centre, 0.6 + 0.8 * (step as f64 + 0.5) / STEPS as f64));
            mean.values.iter_mut().zip(&cover.values).for_each(|(mean, share)| *mean += share / STEPS as f32);
        }
        for (a, b) in ramp.values.iter().zip(&mean.values) {
            assert!((a - b).abs() < 1e-5, "{a} {b}");
        }
        assert!((ramp.values[20 * 41 + 20] - 1.0).abs() < 1e-5);
    }
}
