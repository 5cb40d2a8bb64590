//! Delaunay triangulations, of new points and of points that have moved a little.

use crate::refine::index;
use crate::sheet::{OUTSIDE, cross, edges};
use crate::{Error, Point};
use spade::{DelaunayTriangulation, Point2, Triangulation};

/// Returns the triangles of the Delaunay triangulation, counter-clockwise.
pub(crate) fn delaunay(points: &[Point]) -> Result<Vec<[u32; 3]>, Error> {
    let corners = |mesh: DelaunayTriangulation<_>| {
        mesh.inner_faces().map(|face| face.vertices().map(|v| index(v.fix().index()))).collect()
    };
    triangulation(points).map(corners)
}

pub(crate) fn triangulation(points: &[Point]) -> Result<DelaunayTriangulation<Point2<f64>>, Error> {
    let vertices = points.iter().map(|p| Point2::new(p[0], p[1])).collect();
    DelaunayTriangulation::bulk_load_stable(vertices).map_err(|_| Error::Parameter {
        field: "vertices",
        value: f64::NAN,
        accepted: "a number of points that can be triangulated",
    })
}

/// A Delaunay triangulation that follows moving points by edge flips, which takes a small part of the time of a new
/// triangulation.
///
/// Half-edge 3t + i runs from corner i of triangle t to the next corner.
pub(crate) struct FlipMesh {
    triangles: Vec<[u32; 3]>,
    /// The half-edge of the neighbour in the opposite direction, or [`BOUNDARY`].
    twins: Vec<usize>,
}

/// Marks half-edges without a twin.
const BOUNDARY: usize = usize::MAX;

/// Points count as inside a circle if the determinant exceeds this fraction of its terms: well above rounding errors,
/// so that flips end.
const TOLERANCE: f64 = 1e-12;

impl FlipMesh {
    /// Creates the triangulation from counter-clockwise triangles.
    pub(crate) fn new(triangles: Vec<[u32; 3]>, vertices: usize) -> Self {
        let mut twins = vec![BOUNDARY; 3 * triangles.len()];
        for edge in edges(&triangles, vertices).iter().filter(|edge| !edge.sides.contains(&OUTSIDE)) {
            // A triangle is left of an edge if it contains the half-edge that starts at the smaller end.
            let [left, right] = [0, 1].map(|k| {
                let t = edge.sides[k] as usize;
                3 * t + triangles[t].iter().position(|v| *v == edge.ends[k]).unwrap_or(0)
            });
            (twins[left], twins[right]) = (right, left);
        }
        Self { triangles, twins }
    }

    /// Returns the triangles, counter-clockwise.
    pub(crate) fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Flips edges until the triangulation of the moved points is Delaunay's (Lawson 1977). Returns false, and changes
    /// nothing, if a triangle has turned over.
    pub(crate) fn follow(&mut self, points: &[Point]) -> bool {
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| points[v as usize]);
            cross(a, b, c)
        };
        if !self.triangles.iter().all(|t| area(t) > 0.0) {
            return false;
        }
        let mut open: Vec<usize> = (0..self.twins.len()).filter(|&half| half < self.twins[half]).collect();
        while let Some(half) = open.pop() {
            let twin = self.twins[half];
            if twin == BOUNDARY {
                continue;
            }
            // The corners of both triangles: the ends of the edge, and the two apexes.
            let [a, b] = [half, twin].map(|half| [half, next(half), next(next(half))]);
            let starts = self.triangles.as_flattened_mut();
            let corners = [a[0], a[1], a[2], b[2]].map(|half| points[starts[half] as usize]);
            if !is_inside_circle(corners) {
                continue;
            }
            // The new edge runs between the apexes.
            (starts[a[0]], starts[b[0]]) = (starts[b[2]], starts[a[2]]);
            let outer = [self.twins[a[2]], self.twins[b[2]]];
            self.join(b[0], outer[0]);
            self.join(a[0], outer[1]);
            self.join(a[2], b[2]);
            open.extend([a[0], a[1], b[0], b[1]]);
        }
        true
    }

    fn join(&mut self, half: usize, twin: usize) {
        self.twins[half] = twin;
        if twin != BOUNDARY {
            self.twins[twin] = half;
        }
    }
}

/// Returns the next half-edge of the same triangle.
fn next(half: usize) -> usize {
    if half % 3 == 2 { half - 2 } else { half + 1 }
}

/// Returns whether the last point is inside the circle through the others, which are counter-clockwise.
fn is_inside_circle([a, b, c, d]: [Point; 4]) -> bool {
    let square = |p: Point| (p[0] - d[0]) * (p[0] - d[0]) + (p[1] - d[1]) * (p[1] - d[1]);
    let terms = [square(a) * cross(d, b, c), square(b) * cross(d, c, a), square(c) * cross(d, a, b)];
    let [sum, size] = [terms.iter().sum::<f64>(), terms.iter().map(|term| term.abs()).sum()];
    sum > TOLERANCE * size
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::rng;
    use portable_numerics::random::uniform;

    fn sorted(triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
        let mut sorted = triangles.to_vec();
        for t in &mut sorted {
            let first = (0..3).min_by_key(|&i| t[i]).unwrap_or(0);
            t.rotate_left(first);
        }
        sorted.sort_unstable();
        sorted
    }

    #[test]
    fn flips_give_the_triangulation_of_the_moved_points() {
        let mut rng = rng(3);
        let (mut followed, mut flipped) = (0, 0);
        for count in [4, 7, 40, 300] {
            // The corners of a square do not move.
            let mut points = vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
            points.extend((4..count).map(|_| [0.05 + 0.9 * uniform(&mut rng), 0.05 + 0.9 * uniform(&mut rng)]));
            let mut mesh = FlipMesh::new(delaunay(&points).unwrap(), points.len());
            for _ in 0..50 {
                let step = 0.02 / (count as f64).sqrt();
                for p in &mut points[4..] {
                    *p = p.map(|c| (c + step * (uniform(&mut rng) - 0.5)).clamp(0.01, 0.99));
                }
                let before = sorted(mesh.triangles());
                if mesh.follow(&points) {
                    followed += 1;
                    assert_eq!(sorted(mesh.triangles()), sorted(&delaunay(&points).unwrap()));
                    flipped += usize::from(sorted(mesh.triangles()) != before);
                } else {
                    assert_eq!(sorted(mesh.triangles()), before);
                    mesh = FlipMesh::new(delaunay(&points).unwrap(), points.len());
                }
            }
        }
        assert!(followed > 100 && flipped > 50, "{followed} {flipped}");
    }
}
