//! The final mesh of a sheet: optionally subdivided, with its rim exactly on the outline.

use crate::mesh::Disc;
use crate::outline::Outline;
use crate::sheet::{Edge, OUTSIDE, edges, rim};
use crate::{Point, Sheet, Smoothing, Vertex};
use std::f64::consts::TAU;
use std::sync::Arc;

/// Distance from the end of a rim side, as a fraction of its length, within which a corner of the outline is merged
/// with it.
const MERGE_DISTANCE: f64 = 1e-9;

/// The final mesh, and its vertices as weighted means of the solver's vertices.
#[derive(Debug)]
pub(crate) struct Refinement {
    /// The flat disc.
    flat: Sheet,
    /// `None` if the vertices are those of the solver.
    stencils: Option<Stencils>,
    /// The sides of the rim in order.
    rim: Vec<RimSide>,
}

/// A side of the rim.
#[derive(Debug)]
struct RimSide {
    /// The vertex where it starts.
    start: u32,
    triangle: u32,
    /// Index of the edge.
    edge: usize,
    /// Index of the edge from `start` to the third corner of the triangle.
    spoke: usize,
}

impl Refinement {
    pub(crate) fn new(disc: &Disc, smoothing: Smoothing) -> Refinement {
        let (triangles, stencils) = match smoothing {
            Smoothing::None => (disc.triangles.clone(), None),
            Smoothing::Loop => {
                let (triangles, stencils) = subdivided(disc);
                (triangles, Some(stencils))
            }
        };
        let points = refined(stencils.as_ref(), &disc.points);
        let radius = points.iter().map(|[x, y]| (x * x + y * y).sqrt().min(1.0)).collect();
        let flat = Sheet::new(points.iter().map(|&[x, y]| [x, y, 0.0]).collect(), points, radius, triangles);
        let rim = rim_sides(&flat);
        Refinement { flat, stencils, rim }
    }

    pub(crate) fn apply(&self, vertices: &[Vertex], rest: &[Point]) -> Sheet {
        let stencils = self.stencils.as_ref();
        let (vertices, rest) = (refined(stencils, vertices), refined(stencils, rest));
        let Sheet { radius, triangles, edges, .. } = &self.flat;
        Sheet { vertices, rest, radius: Arc::clone(radius), triangles: Arc::clone(triangles), edges: Arc::clone(edges) }
    }

    /// Moves the rim onto the outline: its vertices to equal arc lengths, and inserts a vertex at each corner between
    /// them. The rest state is only divided, so that its area does not change.
    pub(crate) fn snap_rim(&self, sheet: &mut Sheet, outline: &Outline, offset: f64) {
        let count = self.rim.len();
        let corners = outline.corners(count, offset);
        sheet.reserve(corners.len());
        let radius = Arc::make_mut(&mut sheet.radius);
        for (side, [x, y]) in self.rim.iter().zip(outline.resampled(count, offset)) {
            let v = side.start as usize;
            [sheet.vertices[v][0], sheet.vertices[v][1], radius[v]] = [x, y, 1.0];
        }
        for corners in corners.chunk_by(|a, b| a.0 == b.0) {
            self.fan(sheet, corners);
        }
    }

    /// Divides the triangle at the rim side with these corners into a fan, with one more triangle for each corner.
    fn fan(&self, sheet: &mut Sheet, corners: &[(usize, f64, Point)]) {
        let number = corners[0].0;
        let RimSide { start: a, triangle, edge, spoke } = self.rim[number];
        let b = self.rim[(number + 1) % self.rim.len()].start;
        let triangles = Arc::make_mut(&mut sheet.triangles);
        let edges = Arc::make_mut(&mut sheet.edges);
        let radius = Arc::make_mut(&mut sheet.radius);
        let Some(&apex) = triangles[triangle as usize].iter().find(|&&v| v != a && v != b) else { return };
        let (ra, rb) = (sheet.rest[a as usize], sheet.rest[b as usize]);
        let (za, zb) = (sheet.vertices[a as usize][2], sheet.vertices[b as usize][2]);
        // The edge from `last` to `apex`.
        let (mut last, mut open) = (a, spoke);
        for &(_, part, [x, y]) in corners.iter().filter(|c| (MERGE_DISTANCE..=1.0 - MERGE_DISTANCE).contains(&c.1)) {
            let (vertex, new) = (index(sheet.vertices.len()), index(triangles.len()));
            sheet.vertices.push([x, y, za + part * (zb - za)]);
            sheet.rest.push([ra[0] + part * (rb[0] - ra[0]), ra[1] + part * (rb[1] - ra[1])]);
            radius.push(1.0);
            triangles.push([last, vertex, apex]);
            for side in edges[open].sides.iter_mut().filter(|side| **side == triangle) {
                *side = new;
            }
            open = edges.len() + 1;
            edges.extend([Edge::new([last, vertex], [new, OUTSIDE]), Edge::new([vertex, apex], [new, triangle])]);
            last = vertex;
        }
        triangles[triangle as usize] = [last, b, apex];
        edges[edge] = Edge::new([last, b], [triangle, OUTSIDE]);
    }
}

fn rim_sides(flat: &Sheet) -> Vec<RimSide> {
    let rim = rim(&flat.edges);
    let ends = rim.iter().cycle().skip(1).map(|side| side.0);
    let find = |a: u32, b: u32| flat.edges.iter().position(|e| e.ends == [a.min(b), a.max(b)]).unwrap_or_default();
    let side = |(&(start, triangle), end): (&(u32, u32), u32)| {
        let third = flat.triangles[triangle as usize].iter().copied().find(|&v| v != start && v != end);
        RimSide { start, triangle, edge: find(start, end), spoke: find(start, third.unwrap_or_default()) }
    };
    rim.iter().zip(ends).map(side).collect()
}

#[expect(clippy::cast_possible_truncation, reason = "counts far below 2^32")]
pub(crate) fn index(value: usize) -> u32 {
    value as u32
}

/// For each vertex of one mesh, vertices of another and their weights.
pub(crate) type Stencils = Vec<Vec<(u32, f64)>>;

pub(crate) fn mean<const D: usize>(stencils: &Stencils, values: &[[f64; D]]) -> impl Iterator<Item = [f64; D]> {
    stencils.iter().map(|stencil| {
        let mut sum = [0.0; D];
        for &(v, weight) in stencil {
            for (s, value) in sum.iter_mut().zip(values[v as usize]) {
                *s += weight * value;
            }
        }
        sum
    })
}

fn refined<const D: usize>(stencils: Option<&Stencils>, values: &[[f64; D]]) -> Vec<[f64; D]> {
    stencils.map_or_else(|| values.to_vec(), |stencils| mean(stencils, values).collect())
}

/// Applies one step of Loop's subdivision inside (Loop 1987), and halves the sides of the rim. It is linear, so that a
/// flat sheet stays flat. It also applies to the rest state, so that an unstrained sheet stays unstrained.
fn subdivided(disc: &Disc) -> (Vec<[u32; 3]>, Stencils) {
    let mut edges = edges(&disc.triangles, disc.points.len());
    edges.sort_unstable_by_key(|e| e.ends);
    let mut neighbours = vec![Vec::new(); disc.points.len()];
    for [a, b] in edges.iter().map(|e| e.ends) {
        neighbours[a as usize].push(b);
        neighbours[b as usize].push(a);
    }
    let mut stencils: Stencils = Vec::new();
    for (v, around) in neighbours.iter().enumerate() {
        if v < disc.rim {
            stencils.push(vec![(index(v), 1.0)]);
        } else {
            let valence = around.len() as f64;
            let c = 0.375 + 0.25 * libm::cos(TAU / valence);
            let weight = (0.625 - c * c) / valence;
            let own = std::iter::once((index(v), 1.0 - valence * weight));
            stencils.push(own.chain(around.iter().map(|&u| (u, weight))).collect());
        }
    }
    stencils.extend(edges.iter().map(|e| match (e.ends, &e.opposite(&disc.triangles)[..]) {
        ([a, b], &[c, d]) => vec![(a, 0.375), (b, 0.375), (c, 0.125), (d, 0.125)],
        ([a, b], _) => vec![(a, 0.5), (b, 0.5)],
    }));
    // Edge midpoints come after the vertices.
    let middle = |i: u32, j: u32| index(neighbours.len() + edges.partition_point(|e| e.ends < [i.min(j), i.max(j)]));
    let quarters = |&[a, b, c]: &[u32; 3]| {
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    };
    (disc.triangles.iter().flat_map(quarters).collect(), stencils)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{angular, rng, wavy};
    use crate::{Cloth, ClothParams};

    #[test]
    fn edges_of_the_snapped_rim_are_those_of_its_triangles() {
        // In the small mesh, some triangles have two sides on the rim.
        for (vertices, smoothing) in [(32, Smoothing::None), (300, Smoothing::None), (32, Smoothing::Loop)] {
            let cloth = Cloth::new(&ClothParams { vertices, smoothing, ..ClothParams::default() }).unwrap();
            for outline in [wavy(3.0, 0.2), angular()] {
                let sheet = cloth.crumple(&outline, &mut rng(1)).unwrap();
                let sorted = |mut edges: Vec<Edge>| {
                    edges.sort_unstable_by_key(|e| e.ends);
                    edges
                };
                assert_eq!(sorted(sheet.edges.to_vec()), sorted(edges(&sheet.triangles, sheet.vertices.len())));
            }
        }
    }
}
