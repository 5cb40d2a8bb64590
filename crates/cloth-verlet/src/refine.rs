//! From the solver's mesh to the one that is seen: smooth inside, exactly on the outline at its rim.

use crate::mesh::Disc;
use crate::outline::Outline;
use crate::sheet::{Edge, Parts, edges};
use crate::{Point, Smoothing, Vertex};
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Part of a side of the rim within which a corner of the outline counts as the side's end.
const SAME: f64 = 1e-9;

/// The finer mesh and how its vertices follow from the coarse ones.
#[derive(Debug)]
pub(crate) struct Refinement {
    triangles: Arc<Vec<[u32; 3]>>,
    edges: Arc<Vec<Edge>>,
    /// For each fine vertex the coarse ones it is the weighted mean of: `taps[starts[v]..starts[v + 1]]`.
    starts: Vec<u32>,
    taps: Vec<(u32, f64)>,
    /// Distance of each fine vertex from the centre of the disc.
    radius: Arc<Vec<f64>>,
    /// The rim's vertices in order, and the triangle inside each of its sides.
    hem: Vec<(u32, u32)>,
}

fn sorted(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

impl Refinement {
    pub(crate) fn new(disc: &Disc, smoothing: Smoothing) -> Refinement {
        let (triangles, stencils) = match smoothing {
            Smoothing::None => {
                (disc.triangles.clone(), (0..disc.points.len()).map(|v| vec![(index(v), 1.0)]).collect())
            }
            Smoothing::Loop => subdivided(disc),
        };
        let mut starts = vec![0];
        let mut taps = Vec::new();
        for stencil in stencils {
            taps.extend(stencil);
            starts.push(index(taps.len()));
        }
        let edges = Arc::new(edges(&triangles, starts.len() - 1));
        let hem = hem(&triangles);
        let mut refinement =
            Refinement { triangles: Arc::new(triangles), edges, starts, taps, radius: Arc::default(), hem };
        let radius = refinement.mean(&disc.points).map(|[x, y]| (x * x + y * y).sqrt().min(1.0)).collect();
        refinement.radius = Arc::new(radius);
        refinement
    }

    fn mean<const D: usize>(&self, values: &[[f64; D]]) -> impl Iterator<Item = [f64; D]> {
        self.starts.windows(2).map(|range| {
            let mut sum = [0.0; D];
            for &(v, weight) in &self.taps[range[0] as usize..range[1] as usize] {
                for (s, value) in sum.iter_mut().zip(values[v as usize]) {
                    *s += weight * value;
                }
            }
            sum
        })
    }

    pub(crate) fn apply(&self, vertices: &[Vertex], rest: &[Point]) -> Parts {
        Parts {
            vertices: self.mean(vertices).collect(),
            rest: self.mean(rest).collect(),
            radius: Arc::clone(&self.radius),
            triangles: Arc::clone(&self.triangles),
        }
    }

    /// The edges of a sheet that has been given no hem.
    pub(crate) fn edges(&self) -> Arc<Vec<Edge>> {
        Arc::clone(&self.edges)
    }

    /// Lays the rim on the outline: its vertices at equal arcs, and one more at each corner between them. The rest state is only
    /// divided, so that areas stay what they were.
    pub(crate) fn hem(&self, parts: &mut Parts, outline: &Outline, offset: f64) {
        let count = self.hem.len();
        let radius = Arc::make_mut(&mut parts.radius);
        for (&(v, _), p) in self.hem.iter().zip(outline.resampled(count, offset)) {
            parts.vertices[v as usize][0] = p[0];
            parts.vertices[v as usize][1] = p[1];
            radius[v as usize] = 1.0;
        }
        let corners = outline.corners(count, offset);
        let mut rest = &corners[..];
        while let Some(&(side, ..)) = rest.first() {
            let (these, others) = rest.split_at(rest.iter().take_while(|c| c.0 == side).count());
            self.fan(parts, side, these);
            rest = others;
        }
    }

    /// Divides the triangle inside side `side` of the rim into a fan, one more for each corner.
    fn fan(&self, parts: &mut Parts, side: usize, corners: &[(usize, f64, Point)]) {
        let ((a, triangle), (b, _)) = (self.hem[side], self.hem[(side + 1) % self.hem.len()]);
        let old = parts.triangles[triangle as usize];
        let apex = if let Some(&apex) = old.iter().find(|&&v| v != a && v != b) {
            apex
        } else {
            return;
        };
        let (ra, rb) = (parts.rest[a as usize], parts.rest[b as usize]);
        let (za, zb) = (parts.vertices[a as usize][2], parts.vertices[b as usize][2]);
        let mut last = a;
        for &(_, part, [x, y]) in corners {
            if !(SAME..=1.0 - SAME).contains(&part) {
                continue;
            }
            let new = index(parts.vertices.len());
            parts.vertices.push([x, y, za + part * (zb - za)]);
            parts.rest.push([ra[0] + part * (rb[0] - ra[0]), ra[1] + part * (rb[1] - ra[1])]);
            Arc::make_mut(&mut parts.radius).push(1.0);
            Arc::make_mut(&mut parts.triangles).push([last, new, apex]);
            last = new;
        }
        Arc::make_mut(&mut parts.triangles)[triangle as usize] = [last, b, apex];
    }
}

fn index(value: usize) -> u32 {
    #[expect(clippy::cast_possible_truncation, reason = "counts far below 2^32")]
    let small = value as u32;
    small
}

/// For each vertex of the finer mesh, the coarse ones it is the weighted mean of.
type Stencils = Vec<Vec<(u32, f64)>>;

/// One step of Loop's subdivision inside (Loop 1987), plain halving on the rim. It is linear, so that flat stays flat, and it acts
/// on the rest state as on the pressed one, so that an unstrained sheet stays unstrained.
fn subdivided(disc: &Disc) -> (Vec<[u32; 3]>, Stencils) {
    let mut opposite: BTreeMap<[u32; 2], Vec<u32>> = BTreeMap::new();
    let mut neighbours = vec![Vec::new(); disc.points.len()];
    for &[a, b, c] in &disc.triangles {
        for (i, j, k) in [(a, b, c), (b, c, a), (c, a, b)] {
            opposite.entry(sorted(i, j)).or_default().push(k);
        }
    }
    for &[a, b] in opposite.keys() {
        neighbours[a as usize].push(b);
        neighbours[b as usize].push(a);
    }
    let mut stencils: Stencils = Vec::new();
    for (v, around) in neighbours.iter().enumerate() {
        if v < disc.rim {
            stencils.push(vec![(index(v), 1.0)]);
        } else {
            #[expect(clippy::cast_precision_loss, reason = "a handful of neighbours")]
            let valence = around.len() as f64;
            let c = 0.375 + 0.25 * libm::cos(TAU / valence);
            let weight = (0.625 - c * c) / valence;
            let own = std::iter::once((index(v), 1.0 - valence * weight));
            stencils.push(own.chain(around.iter().map(|&u| (u, weight))).collect());
        }
    }
    let mut middle = BTreeMap::new();
    for (&[a, b], across) in &opposite {
        middle.insert([a, b], index(stencils.len()));
        stencils.push(match across[..] {
            [c, d] => vec![(a, 0.375), (b, 0.375), (c, 0.125), (d, 0.125)],
            _ => vec![(a, 0.5), (b, 0.5)],
        });
    }
    let middle = |i: u32, j: u32| middle[&sorted(i, j)];
    let quarters = |&[a, b, c]: &[u32; 3]| {
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    };
    (disc.triangles.iter().flat_map(quarters).collect(), stencils)
}

/// The rim from vertex 0 on: each vertex with the triangle inside the side that starts there.
fn hem(triangles: &[[u32; 3]]) -> Vec<(u32, u32)> {
    let mut sides = BTreeMap::new();
    for (t, &[a, b, c]) in triangles.iter().enumerate() {
        for (i, j) in [(a, b), (b, c), (c, a)] {
            // A side seen from both of its triangles lies inside.
            if sides.remove(&(j, i)).is_none() {
                sides.insert((i, j), index(t));
            }
        }
    }
    let next: BTreeMap<u32, (u32, u32)> = sides.into_iter().map(|((i, j), t)| (i, (j, t))).collect();
    let mut hem = Vec::with_capacity(next.len());
    let mut at = 0;
    while hem.len() < next.len() {
        let Some(&(j, t)) = next.get(&at) else { break };
        hem.push((at, t));
        at = j;
    }
    hem
}
