//! The paper's parametric shape (Eqs. 6, 7), a circle with perturbed points, and its Perlin texture.

use perlin_bg::{Fractal, FractalParams, Window};
use rand_core::Rng;

use super::tile::{Point, Tile, area};
use crate::random;

/// Points of the perturbed circle before it is smoothed (K of Eq. 7).
const CORNERS: usize = 12;

/// Curve points per corner.
const POINTS_PER_CORNER: usize = 6;

/// Draws a closed curve around the origin (Eq. 7):
/// xᵢ = s·\[U(−α, α) + cos(θᵢ + U(−β, β))\], yᵢ = s·\[U(−α, α) + sin(θᵢ + U(−β, β))\], with the points joined by a
/// closed Catmull–Rom curve.
pub(crate) fn perturbed_circle<R: Rng + ?Sized>(radius: f64, alpha: f64, beta: f64, rng: &mut R) -> Vec<Point> {
    let corners: Vec<Point> = (0..CORNERS)
        .map(|i| {
            // Eq. 6: (cos θ, sin θ) is the circle itself.
            let theta = core::f64::consts::TAU * i as f64 / CORNERS as f64;
            let [tx, ty] = [random::between(-beta, beta, rng), random::between(-beta, beta, rng)];
            let [ax, ay] = [random::between(-alpha, alpha, rng), random::between(-alpha, alpha, rng)];
            // Eq. 7: s·[U(−α, α) + cos(θᵢ + U(−β, β))], and the same with the sine.
            [radius * (ax + libm::cos(theta + tx)), radius * (ay + libm::sin(theta + ty))]
        })
        .collect();
    smooth(&corners, POINTS_PER_CORNER)
}

/// Harmonics of an irregular outline.
const HARMONICS: core::ops::RangeInclusive<u32> = 2..=6;

/// Multiplies the distances of the points of an outline from the origin by 1 plus harmonics of random phase, with the
/// same area: slightly lobed and angular. The second harmonic has the standard deviation `strength`, the others less.
pub(crate) fn make_irregular<R: Rng + ?Sized>(outline: &mut [Point], strength: f64, rng: &mut R) {
    let before = area(outline).abs();
    let waves: Vec<[f64; 3]> = HARMONICS
        .map(|harmonic| {
            let amplitude = strength * random::normal(rng) * 2.0 / f64::from(harmonic);
            [f64::from(harmonic), amplitude, random::direction(rng)]
        })
        .collect();
    for [x, y] in outline.iter_mut() {
        let angle = libm::atan2(*y, *x);
        let push: f64 = waves.iter().map(|[h, amplitude, phase]| amplitude * libm::cos(h * angle + phase)).sum();
        let scale = (1.0 + push).clamp(0.6, 1.4);
        (*x, *y) = (*x * scale, *y * scale);
    }
    let scale = (before / area(outline).abs().max(f64::MIN_POSITIVE)).sqrt().clamp(0.5, 2.0);
    for point in outline {
        *point = point.map(|v| v * scale);
    }
}

/// Returns a closed Catmull–Rom curve through the corners, with `points` points per corner.
pub(crate) fn smooth(corners: &[Point], points: usize) -> Vec<Point> {
    let n = corners.len();
    let mut curve = Vec::with_capacity(n * points);
    for i in 0..n {
        let [a, b, c, d] = [corners[(i + n - 1) % n], corners[i], corners[(i + 1) % n], corners[(i + 2) % n]];
        for step in 0..points {
            let t = step as f64 / points as f64;
            let at = |axis: usize| {
                let (a, b, c, d) = (a[axis], b[axis], c[axis], d[axis]);
                b + 0.5 * t * (c - a + t * (2.0 * a - 5.0 * b + 4.0 * c - d + t * (3.0 * (b - c) + d - a)))
            };
            curve.push([at(0), at(1)]);
        }
    }
    curve
}

/// Multiplies a tile by an absorbance modulated by Perlin noise, with cells of `cell_px` pixels, relative to `centre`.
pub(crate) fn textured(
    tile: &mut Tile,
    centre: Point,
    cell_px: f64,
    octaves: usize,
    strength: f32,
    absorbance: f64,
    key: u64,
) {
    let params = FractalParams { octaves, ..FractalParams::default() };
    let noise = Fractal::new(&params, key).expect("a few octaves of noise are valid");
    let step = 1.0 / cell_px;
    let window = Window { origin: [-centre[0] * step, -centre[1] * step], step, first: tile.origin };
    let mut factor = vec![1.0; tile.values.len()];
    noise.add_into(&mut factor, tile.width, &window, strength);
    for (value, factor) in tile.values.iter_mut().zip(&factor) {
        *value *= absorbance as f32 * factor.max(0.0);
    }
}

/// Rotates a point about the origin and translates it by `centre`.
pub(crate) fn placed(point: Point, angle: f64, centre: Point) -> Point {
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    [centre[0] + point[0] * cos - point[1] * sin, centre[1] + point[0] * sin + point[1] * cos]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Key;

    #[test]
    fn perturbations_are_within_their_range() {
        let mut rng = Key { seed: 1, index: 0 }.stream("test", 0, "wobble");
        // Without perturbations the curve is the circle, also between corners.
        for (alpha, beta, step) in [(0.0, 0.0, 1), (0.2, 0.1, POINTS_PER_CORNER)] {
            for _ in 0..200 {
                for [x, y] in perturbed_circle(5.0, alpha, beta, &mut rng).into_iter().step_by(step) {
                    let off = ((x * x + y * y).sqrt() / 5.0 - 1.0).abs();
                    assert!(off <= alpha * 2.0_f64.sqrt() + 1.1 * beta + 0.004, "{off}");
                }
            }
        }
    }

    #[test]
    fn irregular_outlines_keep_their_area_and_are_not_round() {
        let mut rng = Key { seed: 2, index: 0 }.stream("test", 0, "irregular");
        let circle = perturbed_circle(4.0, 0.0, 0.0, &mut rng);
        let mut spread = 0.0;
        for _ in 0..200 {
            let mut outline = circle.clone();
            make_irregular(&mut outline, 0.06, &mut rng);
            assert!((area(&outline) / area(&circle) - 1.0).abs() < 1e-9);
            assert!(!fsd_shape::self_intersects(&outline));
            let radii: Vec<f64> = outline.iter().map(|[x, y]| (x * x + y * y).sqrt() / 4.0).collect();
            let mean = radii.iter().sum::<f64>() / radii.len() as f64;
            spread += (radii.iter().map(|r| (r - mean) * (r - mean)).sum::<f64>() / radii.len() as f64).sqrt() / 200.0;
        }
        assert!((0.04..0.10).contains(&spread), "{spread}");
        let mut same = circle.clone();
        make_irregular(&mut same, 0.0, &mut rng);
        assert!(same.iter().zip(&circle).all(|(a, b)| (a[0] - b[0]).abs() + (a[1] - b[1]).abs() < 1e-9));
    }
}
