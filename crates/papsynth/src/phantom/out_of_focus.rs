//! Objects far outside the depth of the slide ("Out of focus objects"): shaped and textured like leukocytes.

use rand_core::Rng;

use super::Phantom;
use super::tile::{Point, Tile, area};
use super::wobble::{placed, textured, wobbled_circle};
use crate::scene::{Body, Object, Scene};

/// Size of the cells of the Perlin noise inside, relative to the radius.
const NOISE_CELL: f64 = 0.7;
/// Strength of that noise relative to the absorbance.
const NOISE_STRENGTH: f32 = 0.6;

pub(super) fn make(scene: &Scene, object: &Object) -> Phantom {
    let Body::OutOfFocus { radius_um, alpha, beta, absorbance } = object.body else {
        return Phantom { pieces: Vec::new(), traits: Vec::new() };
    };
    let mut rng = scene.key.stream("out-of-focus", object.number, "shape");
    let centre = scene.grid().to_px(object.centre_um);
    let radius = radius_um / scene.grid().pixel_um;
    let turn = object.rotation_deg.to_radians();
    let shape: Vec<Point> =
        wobbled_circle(radius, alpha, beta, &mut rng).iter().map(|p| placed(*p, turn, centre)).collect();
    let mut coverage = Tile::around(&shape, 2.0);
    coverage.cover(&shape);
    let mut tile = coverage.clone();
    textured(&mut tile, centre, NOISE_CELL * radius, 3, NOISE_STRENGTH, absorbance, rng.next_u64());
    Phantom::whole(tile, coverage, area(&shape), scene.dyes.nucleus)
}
