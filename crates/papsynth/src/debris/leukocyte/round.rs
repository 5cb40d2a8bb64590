//! The paper's leukocytes: one perturbed circle.

use super::Leukocyte;
use crate::debris::prelude::*;

/// Cell size of the Perlin noise in a nucleus, relative to its radius.
const NOISE_CELL: f64 = 0.55;
/// Strength of the noise relative to the absorbance.
const NOISE_STRENGTH: f32 = 1.1;
/// Radius of the cell relative to its nucleus.
const CYTOPLASM_RADIUS: f64 = 1.6;
/// Minimum absorbance of a drawn cytoplasm; fainter ones are invisible.
const MIN_CYTOPLASM_ABSORBANCE: f64 = 0.02;
/// Absorbance at the rim relative to the centre.
const RIM: f64 = 0.62;

pub(super) fn make(leukocyte: &Leukocyte, context: &ObjectContext<'_>) -> Phantom {
    let Leukocyte { alpha, beta, absorbance, cytoplasm_absorbance, .. } = *leukocyte;
    let mut rng = context.stream("shape");
    let centre = context.centre;
    let turn = context.rotation_deg.to_radians();
    let radius = context.px(leukocyte.radius_um);
    let place = |shape: Vec<Point>| -> Vec<Point> { shape.iter().map(|p| placed(*p, turn, centre)).collect() };
    let shape = place(perturbed_circle(radius, alpha, beta, &mut rng));
    let body = (cytoplasm_absorbance >= MIN_CYTOPLASM_ABSORBANCE)
        .then(|| place(perturbed_circle(radius * CYTOPLASM_RADIUS, 0.10, 0.10, &mut rng)));
    let mut nucleus = Tile::around(shape.iter().chain(body.iter().flatten()), 2.0);
    let mut coverage = nucleus.blank();
    nucleus.cover(&shape);
    let mut tile = nucleus.clone();
    domed(&mut tile, &shape);
    textured(&mut tile, centre, NOISE_CELL * radius, 2, NOISE_STRENGTH, absorbance, rng.next_u64());
    if let Some(body) = &body {
        coverage.cover(body);
        for (value, cover) in tile.values.iter_mut().zip(&coverage.values) {
            *value += cover * cytoplasm_absorbance as f32;
        }
    }
    for (cover, inside) in coverage.values.iter_mut().zip(&nucleus.values) {
        *cover = cover.max(*inside);
    }
    let area_px = coverage.sum();
    Phantom::whole(tile, coverage, area_px, context.dyes.nucleus)
}

/// Multiplies a nucleus by its thickness profile, which is largest at the centre.
fn domed(tile: &mut Tile, outline: &[Point]) {
    let (centre, square) = (fsd_shape::centroid(outline), area(outline) / core::f64::consts::PI);
    tile.for_each(|p, value| {
        let (dx, dy) = (p[0] - centre[0], p[1] - centre[1]);
        let chord = (1.0 - (dx * dx + dy * dy) / square).max(0.0).sqrt();
        *value *= (RIM + (1.0 - RIM) * chord) as f32;
    });
}
