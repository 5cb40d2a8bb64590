//! White blood cells ("White blood cells", Eqs. 6, 7, Fig. 9).

use rand_core::Rng;

use super::Phantom;
use super::tile::{Point, Tile, area};
use super::wobble::{placed, textured, wobbled_circle};
use crate::random;
use crate::scene::{Body, Object, Scene};

/// Size of the cells of the Perlin noise inside a nucleus, relative to its radius.
const NOISE_CELL: f64 = 0.55;
/// Strength of that noise relative to the absorbance.
const NOISE_STRENGTH: f32 = 1.1;
/// Radius of a lobe relative to a round nucleus of the same cell.
const LOBE: f64 = 0.66;
/// Radius of the cell relative to its nucleus.
const HALO: f64 = 1.6;
/// A cytoplasm fainter than this cannot be told from the background.
const FAINTEST_HALO: f64 = 0.02;

pub(super) fn make(scene: &Scene, object: &Object) -> Phantom {
    let Body::Leukocyte { radius_um, lobes, alpha, beta, absorbance, halo } = object.body else {
        return Phantom { pieces: Vec::new(), traits: Vec::new() };
    };
    let mut rng = scene.key.stream("leukocyte", object.number, "shape");
    let centre = scene.grid().to_px(object.centre_um);
    let turn = object.rotation_deg.to_radians();
    let radius = radius_um / scene.grid().pixel_um;
    let place = |shape: Vec<Point>, at: Point| -> Vec<Point> {
        shape.iter().map(|p| placed([p[0] + at[0], p[1] + at[1]], turn, centre)).collect()
    };
    let shapes: Vec<Vec<Point>> = if lobes <= 1 {
        vec![place(wobbled_circle(radius, alpha, beta, &mut rng), [0.0, 0.0])]
    } else {
        // Lobes lie along an arc, so near to each other that they touch.
        let spread = random::between(0.7, 1.1, &mut rng);
        let bend = random::between(0.6, 1.4, &mut rng);
        (0..lobes)
            .map(|lobe| {
                let along = (lobe as f64 - (lobes - 1) as f64 / 2.0) * spread;
                let size = radius * LOBE * random::between(0.8, 1.15, &mut rng);
                let at = [radius * LOBE * along, radius * LOBE * bend * (0.35 * along * along - 0.3)];
                place(wobbled_circle(size, alpha, beta, &mut rng), at)
            })
            .collect()
    };
    let body = (halo >= FAINTEST_HALO).then(|| place(wobbled_circle(radius * HALO, 0.10, 0.10, &mut rng), [0.0, 0.0]));
    let mut nucleus = Tile::around(shapes.iter().chain(&body).flatten(), 2.0);
    let mut coverage = nucleus.blank();
    for shape in &shapes {
        nucleus.cover(shape);
    }
    let mut tile = nucleus.clone();
    domed(&mut tile, &shapes);
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
    Phantom::whole(tile, coverage, whole, scene.dyes.nucleus)
}

/// Absorbance of a lobe at its rim, relative to its middle: a lobe is a ball that dries flat.
const RIM: f64 = 0.62;

/// Makes lobes thicker in their middle.
fn domed(tile: &mut Tile, lobes: &[Vec<Point>]) {
    let balls: Vec<(Point, f64)> =
        lobes.iter().map(|lobe| (fsd_shape::centroid(lobe), area(lobe) / core::f64::consts::PI)).collect();
    tile.for_each(|p, value| {
        let chord = |(centre, square): &(Point, f64)| {
            let (dx, dy) = (p[0] - centre[0], p[1] - centre[1]);
            (1.0 - (dx * dx + dy * dy) / square).max(0.0).sqrt()
        };
        let thickest = balls.iter().map(chord).fold(0.0, f64::max);
        *value *= (RIM + (1.0 - RIM) * thickest) as f32;
    });
}
