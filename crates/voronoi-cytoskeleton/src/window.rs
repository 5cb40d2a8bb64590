use crate::error::{Error, require_coordinates};
use crate::geometry::{Moments, Point, along, bounds, cross, dot, length, sub};
use portable_numerics::random::uniform;
use rand_core::Rng;

/// The convex polygon of a diagram.
#[derive(Debug, Clone, PartialEq)]
pub struct Window {
    /// In the order of positive area, from x towards y.
    corners: Vec<Point>,
    /// Vectors from each corner to the next.
    sides: Vec<Point>,
    /// Arc length of the border up to each corner, and the perimeter.
    pub(crate) arc_length: Vec<f64>,
    area: f64,
}

impl Window {
    /// Creates the rectangle between two opposite corners.
    ///
    /// # Errors
    /// [`Error::Coordinate`] or [`Error::Flat`].
    pub fn rectangle(a: Point, b: Point) -> Result<Self, Error> {
        Self::convex(&[a, [b[0], a[1]], b, [a[0], b[1]]])
    }

    /// Creates the bounding box of points.
    ///
    /// # Errors
    /// [`Error::Coordinate`], or [`Error::Flat`] if all points are on one vertical or horizontal line.
    pub fn around(points: &[Point]) -> Result<Self, Error> {
        require_coordinates("outline point", points)?;
        if points.is_empty() {
            return Err(Error::Flat { what: "outline", count: 0, area: 0.0 });
        }
        let [low, high] = bounds(points);
        Self::rectangle(low, high)
    }

    /// Creates a convex polygon from its corners, in either orientation.
    ///
    /// # Errors
    /// [`Error::Coordinate`], [`Error::Flat`] or [`Error::NotConvex`].
    pub fn convex(corners: &[Point]) -> Result<Self, Error> {
        require_coordinates("window corner", corners)?;
        let mut corners = corners.to_vec();
        corners.dedup();
        while corners.len() > 1 && corners.first() == corners.last() {
            corners.pop();
        }
        let about = corners.first().copied().unwrap_or_default();
        let mut area = Moments::of(corners.iter().copied(), about).area;
        if area < 0.0 {
            corners.reverse();
            area = -area;
        }
        if corners.len() < 3 || area == 0.0 {
            return Err(Error::Flat { what: "window", count: corners.len(), area });
        }
        // Tolerance for the rounding errors of collinear corners.
        let slack = area * 1e-12;
        let count = corners.len();
        let sides: Vec<Point> = (0..count).map(|side| sub(corners[(side + 1) % count], corners[side])).collect();
        for side in 0..count {
            for (corner, &point) in corners.iter().enumerate() {
                if cross(sides[side], sub(point, corners[side])) < -slack {
                    return Err(Error::NotConvex { corner, side });
                }
            }
        }
        let mut arc_length = vec![0.0];
        for &side in &sides {
            arc_length.push(arc_length[arc_length.len() - 1] + length(side));
        }
        Ok(Self { corners, sides, arc_length, area })
    }

    /// Returns the corners, in the order of positive area with x right and y down.
    pub fn corners(&self) -> &[Point] {
        &self.corners
    }

    /// Returns the area.
    pub fn area(&self) -> f64 {
        self.area
    }

    /// Returns whether a point is in the window or on its border.
    pub fn contains(&self, point: Point) -> bool {
        self.sides().all(|(from, side)| cross(side, sub(point, from)) >= 0.0)
    }

    /// Draws a uniform random point.
    pub fn draw<R: Rng + ?Sized>(&self, rng: &mut R) -> Point {
        let apex = self.corners[0];
        // A triangle of the fan around the first corner, with probability proportional to area, then a point in it.
        let mut rest = uniform(rng) * self.area;
        let fan = self.corners[1..].windows(2);
        let mut triangle = [apex; 2];
        for pair in fan {
            triangle = [sub(pair[0], apex), sub(pair[1], apex)];
            rest -= cross(triangle[0], triangle[1]) / 2.0;
            if rest < 0.0 {
                break;
            }
        }
        let (mut u, mut v) = (uniform(rng), uniform(rng));
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        along(along(apex, triangle[0], u), triangle[1], v)
    }

    /// Returns the part of the line `origin + t · direction` inside the window, within a range of t.
    pub(crate) fn clip(&self, origin: Point, direction: Point, range: [f64; 2]) -> Option<[f64; 2]> {
        let [mut from, mut to] = range;
        for (corner, side) in self.sides() {
            let inside = cross(side, sub(origin, corner));
            let growth = cross(side, direction);
            if growth > 0.0 {
                from = from.max(-inside / growth);
            } else if growth < 0.0 {
                to = to.min(-inside / growth);
            } else if inside < 0.0 {
                return None;
            }
        }
        (from < to).then_some([from, to])
    }

    /// Returns the arc length of a point on the border.
    pub(crate) fn arc_length_of(&self, point: Point) -> f64 {
        let distance = |&(_, (corner, side)): &(usize, (Point, Point))| {
            let way = sub(point, corner);
            let beside = cross(side, way) * cross(side, way) / dot(side, side);
            // Beyond an end of the side, the distance to that end.
            let beyond = (dot(side, way) - dot(side, side)).max(-dot(side, way)).max(0.0);
            beside + beyond * beyond / dot(side, side)
        };
        self.sides()
            .enumerate()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
            .map_or(0.0, |(number, (corner, side))| {
                self.arc_length[number] + dot(sub(point, corner), side) / length(side)
            })
    }

    /// Returns the first corner and the vector of each side.
    pub(crate) fn sides(&self) -> impl Iterator<Item = (Point, Point)> {
        self.corners.iter().copied().zip(self.sides.iter().copied())
    }
}

#[cfg(test)]
mod tests;
