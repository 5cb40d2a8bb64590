//! From the solver's mesh to the one that is seen: smooth inside, exactly on the outline at its rim.

use crate::mesh::Disc;
use crate::outline::Outline;
use crate::sheet::{edges, rim};
use crate::{Point, Sheet, Smoothing, Vertex};
use std::f64::consts::TAU;
use std::sync::Arc;

/// Part of a side of the rim within which a corner of the outline counts as the side's end.
const SAME: f64 = 1e-9;

/// The finer mesh and how its vertices follow from the coarse ones.
#[derive(Debug)]
pub(crate) struct Refinement {
    /// The disc, flat.
    flat: Sheet,
    stencils: Stencils,
    /// The rim's vertices in order, and the triangle inside each of its sides.
    hem: Vec<(u32, u32)>,
}

impl Refinement {
    pub(crate) fn new(disc: &Disc, smoothing: Smoothing) -> Refinement {
        let (triangles, stencils) = match smoothing {
            Smoothing::None => {
                (disc.triangles.clone(), (0..disc.points.len()).map(|v| vec![(index(v), 1.0)]).collect())
            }
            Smoothing::Loop => subdivided(disc),
        };
        let points: Vec<Point> = mean(&stencils, &disc.points).collect();
        let radius = points.iter().map(|[x, y]| (x * x + y * y).sqrt().min(1.0)).collect();
        let flat = Sheet::new(points.iter().map(|&[x, y]| [x, y, 0.0]).collect(), points, radius, triangles);
        let hem = rim(&flat.edges);
        Refinement { flat, stencils, hem }
    }

    pub(crate) fn apply(&self, vertices: &[Vertex], rest: &[Point]) -> Sheet {
        let (vertices, rest) = (mean(&self.stencils, vertices).collect(), mean(&self.stencils, rest).collect());
        let Sheet { radius, triangles, edges, .. } = &self.flat;
        Sheet { vertices, rest, radius: Arc::clone(radius), triangles: Arc::clone(triangles), edges: Arc::clone(edges) }
    }

    /// Lays the rim on the outline: its vertices at equal arcs, and one more at each corner between them. The rest state is only
    /// divided, so that areas stay what they were.
    pub(crate) fn hem(&self, sheet: &mut Sheet, outline: &Outline, offset: f64) {
        let count = self.hem.len();
        let radius = Arc::make_mut(&mut sheet.radius);
        for (&(v, _), p) in self.hem.iter().zip(outline.resampled(count, offset)) {
            sheet.vertices[v as usize][0] = p[0];
            sheet.vertices[v as usize][1] = p[1];
            radius[v as usize] = 1.0;
        }
        for corners in outline.corners(count, offset).chunk_by(|a, b| a.0 == b.0) {
            self.fan(sheet, corners);
        }
        sheet.pair_up();
    }

    /// Divides the triangle inside the side of the rim that the corners lie on into a fan, one more for each corner.
    fn fan(&self, sheet: &mut Sheet, corners: &[(usize, f64, Point)]) {
        let side = corners[0].0;
        let ((a, triangle), (b, _)) = (self.hem[side], self.hem[(side + 1) % self.hem.len()]);
        let old = sheet.triangles[triangle as usize];
        let Some(&apex) = old.iter().find(|&&v| v != a && v != b) else { return };
        let (ra, rb) = (sheet.rest[a as usize], sheet.rest[b as usize]);
        let (za, zb) = (sheet.vertices[a as usize][2], sheet.vertices[b as usize][2]);
        let mut last = a;
        for &(_, part, [x, y]) in corners.iter().filter(|c| (SAME..=1.0 - SAME).contains(&c.1)) {
            let new = index(sheet.vertices.len());
            sheet.vertices.push([x, y, za + part * (zb - za)]);
            sheet.rest.push([ra[0] + part * (rb[0] - ra[0]), ra[1] + part * (rb[1] - ra[1])]);
            Arc::make_mut(&mut sheet.radius).push(1.0);
            Arc::make_mut(&mut sheet.triangles).push([last, new, apex]);
            last = new;
        }
        Arc::make_mut(&mut sheet.triangles)[triangle as usize] = [last, b, apex];
    }
}

#[expect(clippy::cast_possible_truncation, reason = "counts far below 2^32")]
pub(crate) fn index(value: usize) -> u32 {
    value as u32
}

/// For each vertex of the finer mesh, the coarse ones it is the weighted mean of.
type Stencils = Vec<Vec<(u32, f64)>>;

fn mean<const D: usize>(stencils: &Stencils, values: &[[f64; D]]) -> impl Iterator<Item = [f64; D]> {
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

/// One step of Loop's subdivision inside (Loop 1987), plain halving on the rim. It is linear, so that flat stays flat, and it acts
/// on the rest state as on the pressed one, so that an unstrained sheet stays unstrained.
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
    // The middles of the edges follow the vertices.
    let middle = |i: u32, j: u32| index(neighbours.len() + edges.partition_point(|e| e.ends < [i.min(j), i.max(j)]));
    let quarters = |&[a, b, c]: &[u32; 3]| {
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    };
    (disc.triangles.iter().flat_map(quarters).collect(), stencils)
}
