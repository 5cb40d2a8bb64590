//! Objects far outside the depth of the slide ("Out of focus objects"): shaped and textured like leukocytes.

use perlin_bg::{Fractal, FractalParams};
use rand_core::Rng;

use super::Phantom;
use super::tile::{Point, Tile, area};
use super::wobble::{placed, wobbled_circle};
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
    let centre = scene.view.to_px(object.centre_um);
    let radius = radius_um / scene.view.pixel_um;
    let turn = object.rotation_deg.to_radians();
    let shape: Vec<Point> =
        wobbled_circle(radius, alpha, beta, &mut rng).iter().map(|p| placed(*p, turn, centre)).collect();
    let mut coverage = Tile::around(&shape, 2.0);
    coverage.cover(&shape);
    let noise = Fractal::new(&FractalParams { octaves: 3, ..FractalParams::default() }, rng.next_u64()).ok();
    let cell = NOISE_CELL * radius;
    let mut tile = coverage.clone();
    tile.for_each(|p, value| {
        if *value > 0.0 {
            let n = noise.as_ref().map_or(0.0, |n| n.at((p[0] - centre[0]) / cell, (p[1] - centre[1]) / cell));
            *value *= absorbance as f32 * (1.0 + NOISE_STRENGTH * n).max(0.0);
        }
    });
    Phantom::whole(tile, coverage, area(&shape))
}
