//! The target outline of a sheet.

use crate::{Error, Point};
use std::f64::consts::PI;

/// A valid outline in units of its equivalent radius, with its centroid at the origin and positive area.
#[derive(Debug, Clone)]
pub(crate) struct Outline {
    pub(crate) points: Vec<Point>,
    pub(crate) centre: Point,
    /// Equivalent radius √(area / π) in the unit of the caller.
    pub(crate) radius: f64,
}

impl Outline {
    pub(crate) fn new(points: &[Point]) -> Result<Outline, Error> {
        if points.len() < 3 {
            return Err(Error::TooFewPoints { points: points.len() });
        }
        if let Some((index, &[x, y])) = points.iter().enumerate().find(|(_, p)| !(p[0].is_finite() && p[1].is_finite()))
        {
            return Err(Error::NotFinite { index, x, y });
        }
        let [x0, y0] = points[0];
        let local: Vec<Point> = points.iter().map(|p| [p[0] - x0, p[1] - y0]).collect();
        let (area, centre) = moments(&local);
        let span = local.iter().fold(0.0_f64, |s, p| s.max(p[0].abs()).max(p[1].abs()));
        // A smaller area is a rounding error: the points are collinear.
        if !(area.abs() > f64::EPSILON * span * span * 64.0 && area.is_finite()) {
            return Err(Error::NoArea { area });
        }
        let radius = (area.abs() / PI).sqrt();
        let mut points: Vec<Point> =
            local.iter().map(|p| [(p[0] - centre[0]) / radius, (p[1] - centre[1]) / radius]).collect();
        if area < 0.0 {
            points.reverse();
        }
        Ok(Outline { points, centre: [x0 + centre[0], y0 + centre[1]], radius })
    }

    /// Returns `count` points at equal arc lengths, the first at the fraction `offset` of the perimeter, 0 to 1.
    pub(crate) fn resampled(&self, count: usize, offset: f64) -> Vec<Point> {
        let sides = || sides(&self.points);
        let perimeter: f64 = sides().map(|(a, b)| distance(a, b)).sum();
        let mut walked = 0.0;
        let mut ring = Vec::with_capacity(count);
        // Two rounds, because the first arc starts at `offset`.
        for (a, b) in sides().chain(sides()) {
            let length = distance(a, b);
            while ring.len() < count {
                let due = perimeter * (offset + ring.len() as f64 / count as f64) - walked;
                if due > length {
                    break;
                }
                let t = if length > 0.0 { due / length } else { 0.0 };
                ring.push([a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]);
            }
            walked += length;
        }
        ring.resize(count, self.points[0]);
        ring
    }

    /// Returns the corners of the outline in order from `offset`: the index of the equal arc, of `count`, that contains
    /// it, the position along that arc, 0 to 1, and the point.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "arc numbers below count")]
    pub(crate) fn corners(&self, count: usize, offset: f64) -> Vec<(usize, f64, Point)> {
        let perimeter: f64 = sides(&self.points).map(|(a, b)| distance(a, b)).sum();
        let mut walked = 0.0;
        let mut corners = Vec::with_capacity(self.points.len());
        for (a, b) in sides(&self.points) {
            let way = walked / perimeter - offset;
            let arc = (if way < 0.0 { way + 1.0 } else { way }) * count as f64;
            corners.push((((arc as usize).min(count - 1)), arc, a));
            walked += distance(a, b);
        }
        corners.sort_by(|p, q| p.1.total_cmp(&q.1));
        for c in &mut corners {
            c.1 -= c.0 as f64;
        }
        corners
    }
}

pub(crate) fn sides(points: &[Point]) -> impl Iterator<Item = (Point, Point)> {
    points.iter().copied().zip(points.iter().copied().cycle().skip(1))
}

/// Returns the signed area (positive if oriented from +x to +y) and the centroid of a polygon.
pub(crate) fn moments(points: &[Point]) -> (f64, Point) {
    let (mut twice, mut sx, mut sy) = (0.0, 0.0, 0.0);
    for (a, b) in sides(points) {
        let w = a[0] * b[1] - b[0] * a[1];
        twice += w;
        sx += w * (a[0] + b[0]);
        sy += w * (a[1] + b[1]);
    }
    (twice / 2.0, [sx / (3.0 * twice), sy / (3.0 * twice)])
}

pub(crate) fn distance(a: Point, b: Point) -> f64 {
    square(a, b).sqrt()
}

/// Consecutive sides that are skipped together if their bounding box is too far away.
const GROUP: usize = 16;

/// Point-in-polygon and nearest-point queries. Sides are sorted into bands of y and grouped into bounding boxes.
#[derive(Debug)]
pub(crate) struct Inside {
    sides: Vec<(Point, Point)>,
    low: f64,
    bands_per_unit: f64,
    /// The numbers of the sides in each band, one band after the other, and where each begins.
    in_bands: Vec<u32>,
    band_starts: Vec<u32>,
    /// Bounding box of each [`GROUP`] of sides.
    boxes: Vec<[Point; 2]>,
    /// Square of the radius of a circle around the origin inside the polygon, or 0.
    inner_square: f64,
}

impl Inside {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "band numbers below count")]
    pub(crate) fn new(points: &[Point]) -> Inside {
        let sides: Vec<(Point, Point)> = sides(points).collect();
        let boxes: Vec<[Point; 2]> = sides.chunks(GROUP).map(bounds).collect();
        let low = boxes.iter().fold(f64::INFINITY, |m, b| m.min(b[0][1]));
        let high = boxes.iter().fold(f64::NEG_INFINITY, |m, b| m.max(b[1][1]));
        let count = points.len();
        let bands_per_unit = count as f64 / (high - low);
        let bands = |(a, b): &(Point, Point)| {
            let band = |y: f64| (((y - low) * bands_per_unit) as usize).min(count);
            band(a[1].min(b[1]))..=band(a[1].max(b[1]))
        };
        // Ends of the bands, which become their starts as sides are filled in from the last.
        let mut band_starts = vec![0_u32; count + 2];
        for band in sides.iter().flat_map(bands) {
            band_starts[band] += 1;
        }
        let mut end = 0;
        for start in &mut band_starts {
            end += *start;
            *start = end;
        }
        let mut in_bands = vec![0; end as usize];
        for (side, ends) in sides.iter().enumerate().rev() {
            for band in bands(ends) {
                band_starts[band] -= 1;
                in_bands[band_starts[band] as usize] = side as u32;
            }
        }
        let mut inside = Inside { sides, low, bands_per_unit, in_bands, band_starts, boxes, inner_square: 0.0 };
        if inside.contains([0.0, 0.0]) {
            inside.inner_square = square([0.0, 0.0], inside.foot([0.0, 0.0]));
        }
        inside
    }

    /// Returns whether a point is inside, by the even-odd rule.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a band number, checked by get")]
    pub(crate) fn contains(&self, p: Point) -> bool {
        let band = (p[1] - self.low) * self.bands_per_unit;
        let Some(&[start, end]) = self.band_starts.get(band as usize..).and_then(|b| b.first_chunk()) else {
            return false;
        };
        if band < 0.0 {
            return false;
        }
        let list = &self.in_bands[start as usize..end as usize];
        let crossed = |&&side: &&u32| {
            let (a, b) = self.sides[side as usize];
            (a[1] > p[1]) != (b[1] > p[1]) && p[0] < a[0] + (p[1] - a[1]) * (b[0] - a[0]) / (b[1] - a[1])
        };
        list.iter().filter(crossed).count() % 2 == 1
    }

    /// Returns `p` if it is inside, otherwise the nearest point of the boundary.
    pub(crate) fn nearest(&self, p: Point) -> Point {
        if p[0] * p[0] + p[1] * p[1] < self.inner_square || self.contains(p) { p } else { self.foot(p) }
    }

    /// Returns the nearest point of the boundary.
    fn foot(&self, p: Point) -> Point {
        let mut best = (f64::INFINITY, p);
        for (group, [low, high]) in self.sides.chunks(GROUP).zip(&self.boxes) {
            let corner = [p[0].clamp(low[0], high[0]), p[1].clamp(low[1], high[1])];
            if square(p, corner) >= best.0 {
                continue;
            }
            for &(a, b) in group {
                let (ux, uy) = (b[0] - a[0], b[1] - a[1]);
                let length = ux * ux + uy * uy;
                let t = if length > 0.0 {
                    (((p[0] - a[0]) * ux + (p[1] - a[1]) * uy) / length).clamp(0.0, 1.0)
                } else {
                    0.0
                };
                let q = [a[0] + t * ux, a[1] + t * uy];
                if square(p, q) < best.0 {
                    best = (square(p, q), q);
                }
            }
        }
        best.1
    }
}

fn square(a: Point, b: Point) -> f64 {
    (b[0] - a[0]) * (b[0] - a[0]) + (b[1] - a[1]) * (b[1] - a[1])
}

fn bounds(sides: &[(Point, Point)]) -> [Point; 2] {
    let ends = || sides.iter().flat_map(|&(a, b)| [a, b]);
    [
        ends().fold([f64::INFINITY; 2], |m, p| [m[0].min(p[0]), m[1].min(p[1])]),
        ends().fold([f64::NEG_INFINITY; 2], |m, p| [m[0].max(p[0]), m[1].max(p[1])]),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{angular, rng, wavy};
    use portable_numerics::random::uniform;

    #[test]
    fn an_outline_is_centred_scaled_and_oriented() {
        let outline = Outline::new(&angular()).unwrap();
        let (area, centre) = moments(&outline.points);
        assert!((area - PI).abs() < 1e-12 && centre[0].abs() < 1e-12 && centre[1].abs() < 1e-12);
        assert!((outline.radius * outline.radius * PI - 54.0).abs() < 1e-9);
    }

    #[test]
    fn invalid_outlines_are_rejected() {
        let error = |points: &[Point]| Outline::new(points).unwrap_err();
        assert_eq!(error(&[[0.0, 0.0], [1.0, 0.0]]), Error::TooFewPoints { points: 2 });
        assert!(matches!(error(&[[0.0, 0.0], [f64::NAN, 0.0], [1.0, 1.0]]), Error::NotFinite { index: 1, .. }));
        assert!(matches!(error(&[[0.0, 0.0], [1.0, f64::INFINITY], [1.0, 1.0]]), Error::NotFinite { .. }));
        assert!(matches!(error(&[[0.0, 0.0], [1.0, 1.0], [3.0, 3.0]]), Error::NoArea { .. }));
        assert!(matches!(error(&[[5.0, 5.0]; 4]), Error::NoArea { .. }));
    }

    #[test]
    fn arcs_are_equal_and_contain_their_corners() {
        let outline = Outline::new(&angular()).unwrap();
        let (count, offset) = (40, 0.37);
        let ring = outline.resampled(count, offset);
        let perimeter: f64 = sides(&outline.points).map(|(a, b)| distance(a, b)).sum();
        let corners = outline.corners(count, offset);
        assert_eq!(corners.len(), 6);
        for k in 0..count {
            let mut way = vec![ring[k]];
            way.extend(corners.iter().filter(|c| c.0 == k).map(|c| c.2));
            way.push(ring[(k + 1) % count]);
            let length: f64 = way.windows(2).map(|w| distance(w[0], w[1])).sum();
            assert!((length - perimeter / 40.0).abs() < 1e-9, "{k}: {length}");
        }
    }

    #[test]
    fn nearest_agrees_with_brute_force() {
        let points = Outline::new(&wavy(5.0, 0.3)).unwrap().points;
        let inside = Inside::new(&points);
        let mut rng = rng(2);
        let mut value = || 3.6 * (uniform(&mut rng) - 0.5);
        let mut outside = 0;
        for _ in 0..2000 {
            let p = [value(), value()];
            let crossings = sides(&points)
                .filter(|(a, b)| {
                    (a[1] > p[1]) != (b[1] > p[1]) && p[0] < a[0] + (p[1] - a[1]) * (b[0] - a[0]) / (b[1] - a[1])
                })
                .count();
            let wanted = if crossings % 2 == 1 {
                p
            } else {
                outside += 1;
                let feet = sides(&points).map(|(a, b)| {
                    let u = [b[0] - a[0], b[1] - a[1]];
                    let t =
                        (((p[0] - a[0]) * u[0] + (p[1] - a[1]) * u[1]) / (u[0] * u[0] + u[1] * u[1])).clamp(0.0, 1.0);
                    [a[0] + t * u[0], a[1] + t * u[1]]
                });
                feet.min_by(|a, b| distance(p, *a).total_cmp(&distance(p, *b))).unwrap()
            };
            assert_eq!(inside.nearest(p), wanted);
        }
        assert!(outside > 500);
    }
}
