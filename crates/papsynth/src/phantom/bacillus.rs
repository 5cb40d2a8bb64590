//! Rod-shaped bacteria ("Bacilli"): short bent lines of even width with round ends.

use super::Phantom;
use super::tile::{Point, Tile};
use super::wobble::placed;
use crate::scene::{Body, Object, Scene};

/// Straight parts of a bent rod.
const PARTS: usize = 6;

pub(super) fn make(scene: &Scene, object: &Object) -> Phantom {
    let Body::Bacillus { length_um, width_um, bend_deg, absorbance, phase_rad } = object.body else {
        return Phantom { pieces: Vec::new(), traits: Vec::new() };
    };
    let pixel = scene.grid().pixel_um;
    let half_width = 0.5 * width_um / pixel;
    let spine = spine((length_um - width_um).max(0.0) / pixel, bend_deg.to_radians());
    let centre = scene.grid().to_px(object.centre_um);
    let spine: Vec<Point> = spine.iter().map(|p| placed(*p, object.rotation_deg.to_radians(), centre)).collect();
    let mut coverage = Tile::around(&spine, half_width + 2.0);
    coverage.for_each(|p, value| {
        // A pixel is covered as far as the rod's edge reaches into it.
        let distance = spine.windows(2).fold(f64::INFINITY, |least, s| least.min(distance(p, s[0], s[1])));
        *value = (half_width - distance + 0.5).clamp(0.0, (2.0 * half_width).min(1.0)) as f32;
    });
    let mut tile = coverage.clone();
    for value in &mut tile.values {
        *value *= absorbance.max(super::LEAST_ABSORBANCE) as f32;
    }
    let area = (length_um - width_um).max(0.0) * width_um + core::f64::consts::FRAC_PI_4 * width_um * width_um;
    Phantom::whole(tile, coverage, area / (pixel * pixel), scene.dyes.bacillus).refracting(phase_rad, absorbance)
}

/// The middle line of a rod: an arc of a circle about the origin.
fn spine(length: f64, bend: f64) -> Vec<Point> {
    let mut points = vec![[0.0, 0.0]];
    let step = length / PARTS as f64;
    let (mut x, mut y) = (0.0, 0.0);
    for part in 0..PARTS {
        let angle = bend * ((part as f64 + 0.5) / PARTS as f64 - 0.5);
        x += step * libm::cos(angle);
        y += step * libm::sin(angle);
        points.push([x, y]);
    }
    for point in &mut points {
        point[0] -= 0.5 * x;
        point[1] -= 0.5 * y;
    }
    points
}

/// Distance from a point to a straight part.
fn distance(p: Point, a: Point, b: Point) -> f64 {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let length = dx * dx + dy * dy;
    let t = if length > 0.0 { (((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / length).clamp(0.0, 1.0) } else { 0.0 };
    let (ex, ey) = (p[0] - a[0] - t * dx, p[1] - a[1] - t * dy);
    (ex * ex + ey * ey).sqrt()
}
