//! The paper's white blood cells: one perturbed circle.

use super::Leukocyte;
use crate::debris::prelude::*;

/// Size of the cells of the Perlin noise inside a nucleus, relative to its radius.
const NOISE_CELL: f64 = 0.55;
/// Strength of that noise relative to the absorbance.
const NOISE_STRENGTH: f32 = 1.1;
/// Radius of the cell relative to its nucleus.
const HALO: f64 = 1.6;
/// A cytoplasm fainter than this cannot be told from the background.
const FAINTEST_HALO: f64 = 0.02;
/// Absorbance at the rim, relative to the middle: a nucleus is a ball that dries flat.
const RIM: f64 = 0.62;

pub(super) fn make(leukocyte: &Leukocyte, site: &Site<'_>) -> Phantom {
    let Leukocyte { alpha, beta, absorbance, halo, .. } = *leukocyte;
    let mut rng = site.stream("shape");
    let centre = site.centre;
    let turn = site.rotation_deg.to_radians();
    let radius = site.px(leukocyte.radius_um);
    let place = |shape: Vec<Point>| -> Vec<Point> { shape.iter().map(|p| placed(*p, turn, centre)).collect() };
    let shape = place(perturbed_circle(radius, alpha, beta, &mut rng));
    let body = (halo >= FAINTEST_HALO).then(|| place(perturbed_circle(radius * HALO, 0.10, 0.10, &mut rng)));
    let mut nucleus = Tile::around(shape.iter().chain(body.iter().flatten()), 2.0);
    let mut coverage = nucleus.blank();
    nucleus.cover(&shape);
    let mut tile = nucleus.clone();
    domed(&mut tile, &shape);
    textured(&mut tile, centre, NOISE_CELL * radius, 2, NOISE_STRENGTH, absorbance, rng.next_u64());
    if let Some(body) = &body {
        coverage.cover(body);
        for (value, cover) in tile.values.iter_mut().zip(&coverage.values) {
            *value += cover * halo as f32;
        }
    }
    for (cover, inside) in coverage.values.iter_mut().zip(&nucleus.values) {
        *cover = cover.max(*inside);
    }
    let whole = coverage.values.iter().map(|share| f64::from(*share)).sum();
    Phantom::whole(tile, coverage, whole, site.dyes.nucleus)
}

/// Makes a nucleus thicker in its middle.
fn domed(tile: &mut Tile, outline: &[Point]) {
    let (centre, square) = (fsd_shape::centroid(outline), area(outline) / core::f64::consts::PI);
    tile.for_each(|p, value| {
        let (dx, dy) = (p[0] - centre[0], p[1] - centre[1]);
        let chord = (1.0 - (dx * dx + dy * dy) / square).max(0.0).sqrt();
        *value *= (RIM + (1.0 - RIM) * chord) as f32;
    });
}
