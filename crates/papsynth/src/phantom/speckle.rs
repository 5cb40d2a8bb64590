//! Specks of dust and stain ("Speckles"): a pixel, extended by one in a random direction, then dilated.

use super::tile::Tile;
use super::{LEAST_ABSORBANCE, Phantom};
use crate::random;
use crate::recipe::SpeckForm;
use crate::scene::{Body, Object, Scene};

pub(super) fn make(scene: &Scene, object: &Object) -> Phantom {
    let Body::Speckle { form, dilations, absorbance, phase_rad } = object.body else {
        return Phantom { pieces: Vec::new(), traits: Vec::new() };
    };
    let mut rng = scene.key.stream("speckle", object.number, "shape");
    let pixel = scene.oversampling() as f64;
    // Its pixels are those of the image, whatever grid it is drawn on.
    let [x, y] = scene.view.to_px(object.centre_um).map(libm::round);
    let [dx, dy] = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]][random::below(4, &mut rng)];
    let seeds = [[x, y], [x + dx, y + dy]];
    let to_grid = |p: [f64; 2]| p.map(|v| (v + 0.5) * pixel - 0.5);
    let reach = dilations as f64;
    let mut coverage = Tile::around(&seeds.map(to_grid), (reach + 2.0) * pixel);
    coverage.for_each(|p, value| {
        let p = p.map(|v| (v + 0.5) / pixel - 0.5);
        *value = match form {
            // Dilation by a cross, so often, is everything within that many steps along rows and columns.
            SpeckForm::Dilated => {
                let p = p.map(libm::round);
                let inside = seeds.iter().any(|s| (p[0] - s[0]).abs() + (p[1] - s[1]).abs() <= reach);
                if inside { 1.0 } else { 0.0 }
            }
            // By a disc: everything nearer to the way between the two than the radius, its edge as far as it is covered.
            SpeckForm::Round => {
                let along = ((p[0] - x) * dx + (p[1] - y) * dy).clamp(0.0, 1.0);
                let (ex, ey) = (p[0] - x - along * dx, p[1] - y - along * dy);
                ((reach + 0.5 - (ex * ex + ey * ey).sqrt()) * pixel + 0.5).clamp(0.0, 1.0) as f32
            }
        };
    });
    let area = coverage.values.iter().map(|v| f64::from(*v)).sum();
    let mut tile = coverage.clone();
    for value in &mut tile.values {
        *value *= absorbance.max(LEAST_ABSORBANCE) as f32;
    }
    Phantom::whole(tile, coverage, area, scene.dyes.speckle).refracting(phase_rad, absorbance)
}
