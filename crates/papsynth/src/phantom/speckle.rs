//! Specks of dust and stain ("Speckles"): a pixel, extended by one in a random direction, then dilated.

use super::Phantom;
use super::tile::Tile;
use crate::random;
use crate::scene::{Body, Object, Scene};

pub(super) fn make(scene: &Scene, object: &Object) -> Phantom {
    let Body::Speckle { dilations, absorbance } = object.body else {
        return Phantom { pieces: Vec::new(), traits: Vec::new() };
    };
    let mut rng = scene.key.stream("speckle", object.number, "shape");
    let [x, y] = scene.view.to_px(object.centre_um).map(libm::round);
    let [dx, dy] = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]][random::below(4, &mut rng)];
    let seeds = [[x, y], [x + dx, y + dy]];
    let reach = dilations as f64;
    let mut coverage = Tile::around(&seeds, reach + 2.0);
    coverage.for_each(|p, value| {
        // Dilation by a cross, so often, is everything within that many steps along rows and columns.
        let inside = seeds.iter().any(|s| (p[0] - s[0]).abs() + (p[1] - s[1]).abs() <= reach);
        *value = if inside { 1.0 } else { 0.0 };
    });
    let area = coverage.values.iter().map(|v| f64::from(*v)).sum();
    let mut tile = coverage.clone();
    for value in &mut tile.values {
        *value *= absorbance as f32;
    }
    Phantom::whole(tile, coverage, area)
}
