//! The triangulated disc of all sheets. All sheets have the same topology, so that they can be solved in vector lanes.

use crate::delaunay::{delaunay, triangulation};
use crate::refine::{Stencils, index};
use crate::sheet::{cross, edges};
use crate::{Error, Point};
use multiversion::multiversion;
use spade::{FloatTriangulation, Point2};
use std::f64::consts::{PI, TAU};

/// The paper's mesh: 75 vertices on the rim of 538.
const RIM_OF_PAPER: (f64, f64) = (75.0, 538.0);
/// Relaxation sweeps; beyond a dozen the edge lengths hardly change.
const RELAXATIONS: usize = 16;
/// The golden angle 2π(1 - 1/φ), which spaces the points of a sunflower evenly.
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;

/// Vertices of a square patch of the mesh. Those of sixteen sheets, with their neighbours, fill half of an L1 cache.
const PATCH: f64 = 100.0;

/// Inner vertices whose harmonic weights are computed and summed together.
const LANES: usize = 8;

/// A number for each of [`LANES`] vertices.
type Lanes = [f64; LANES];

/// A pair of vertices with a distance constraint.
pub(crate) type Pair = [u32; 2];

/// A triangulated unit disc. Vertices `0..rim` are on the circle at equal angles, the others inside.
#[derive(Debug, Clone)]
pub(crate) struct Disc {
    pub(crate) points: Vec<Point>,
    pub(crate) rim: usize,
    /// Counter-clockwise.
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Smaller index first, patch by patch in the order of the solver.
    pub(crate) edges: Vec<Vec<Pair>>,
    /// The two vertices opposite each inner edge, in the same patches.
    pub(crate) bends: Vec<Vec<Pair>>,
    /// Blocks of `rim` elements: the weights of each rim vertex in [`LANES`] inner vertices.
    harmonics: Vec<Lanes>,
}

impl Disc {
    pub(crate) fn new(vertices: usize) -> Result<Disc, Error> {
        let (rim, inner) = split(vertices);
        let mut points = sunflower(rim, inner);
        for _ in 0..RELAXATIONS {
            let triangles = delaunay(&points)?;
            relax(&mut points, rim, &triangles);
        }
        let triangles = delaunay(&points)?;
        let (edges, bends) = pairs(&triangles, points.len());
        let harmonics = harmonics(&points, rim);
        Ok(Disc { rim, triangles, edges: ordered(&edges, &points), bends: ordered(&bends, &points), harmonics, points })
    }

    /// Extends a closed curve of `rim` points to all vertices: each coordinate is the harmonic function with these
    /// values on the circle.
    pub(crate) fn harmonic_map(&self, curve: &[Point]) -> Vec<Point> {
        let mut points = curve.to_vec();
        for weights in self.harmonics.chunks_exact(self.rim) {
            let [xs, ys] = weighted_sums(weights, curve);
            points.extend(xs.into_iter().zip(ys).map(|(x, y)| [x, y]));
        }
        points.truncate(self.points.len());
        points
    }

    /// Returns the weights of linear interpolation from the vertices of this mesh to those of another: along the rim
    /// for vertices on the rim, within a triangle for the others.
    pub(crate) fn interpolation(&self, to: &Disc) -> Result<Stencils, Error> {
        let mesh = triangulation(&self.points)?;
        let triangles = mesh.barycentric();
        let on_rim = |k: usize| {
            let (whole, part) = (k * self.rim / to.rim, (k * self.rim % to.rim) as f64 / to.rim as f64);
            vec![(index(whole), 1.0 - part), (index((whole + 1) % self.rim), part)]
        };
        let mut weights = Vec::new();
        let inside = to.points[to.rim..].iter().map(|p| {
            triangles.get_weights(Point2::new(p[0], p[1]), &mut weights);
            weights.iter().map(|(v, weight)| (index(v.index()), *weight)).collect()
        });
        Ok((0..to.rim).map(on_rim).chain(inside).collect())
    }
}

/// Returns the sums of the points of a curve times their weights, in x and y.
#[multiversion(targets = "simd")]
fn weighted_sums(weights: &[Lanes], curve: &[Point]) -> [Lanes; 2] {
    let [mut xs, mut ys] = [[0.0; LANES]; 2];
    for (weights, &[x, y]) in weights.iter().zip(curve) {
        for l in 0..LANES {
            xs[l] += weights[l] * x;
            ys[l] += weights[l] * y;
        }
    }
    [xs, ys]
}

/// Returns the numbers of vertices on the rim and inside, in the proportion of the paper's mesh.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "counts far below 2^32")]
fn split(vertices: usize) -> (usize, usize) {
    let rim = (RIM_OF_PAPER.0 * (vertices as f64 / RIM_OF_PAPER.1).sqrt()).round() as usize;
    (rim, vertices - rim)
}

fn sunflower(rim: usize, inner: usize) -> Vec<Point> {
    let reach = 1.0 - PI / rim as f64;
    let on_rim = (0..rim).map(|k| (1.0, TAU * k as f64 / rim as f64));
    let inside = (0..inner).map(|i| (reach * ((i as f64 + 0.5) / inner as f64).sqrt(), GOLDEN_ANGLE * i as f64));
    on_rim.chain(inside).map(|(r, angle)| [r * libm::cos(angle), r * libm::sin(angle)]).collect()
}

/// Moves each inner vertex to the centre of mass of the triangles around it.
fn relax(points: &mut [Point], rim: usize, triangles: &[[u32; 3]]) {
    let mut sums = vec![[0.0; 3]; points.len()];
    for t in triangles {
        let [a, b, c] = t.map(|v| points[v as usize]);
        let area = cross(a, b, c);
        for v in t {
            let s = &mut sums[*v as usize];
            s[0] += area * (a[0] + b[0] + c[0]) / 3.0;
            s[1] += area * (a[1] + b[1] + c[1]) / 3.0;
            s[2] += area;
        }
    }
    for (p, s) in points.iter_mut().zip(&sums).skip(rim) {
        *p = [s[0] / s[2], s[1] / s[2]];
    }
}

/// Returns the edges, and the two vertices opposite each inner edge.
fn pairs(triangles: &[[u32; 3]], vertices: usize) -> (Vec<Pair>, Vec<Pair>) {
    let mut edges = edges(triangles, vertices);
    edges.sort_unstable_by_key(|e| e.ends);
    let bends = edges.iter().filter_map(|e| match e.opposite(triangles)[..] {
        [a, b] => Some([a.min(b), a.max(b)]),
        _ => None,
    });
    (edges.iter().map(|e| e.ends).collect(), bends.collect())
}

/// Orders pairs for the solver: patch by patch, so that a patch stays in the L1 cache. The order of patches is
/// scattered over the disc, so that no direction is preferred. Within a patch, consecutive pairs share no vertex, so
/// that they do not wait for each other.
fn ordered(pairs: &[Pair], points: &[Point]) -> Vec<Vec<Pair>> {
    patches(pairs, points).iter().map(|patch| independent_sets(patch, points.len())).collect()
}

/// Groups pairs by the grid square that contains their midpoint.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "patch numbers, far below 2^32")]
fn patches(pairs: &[Pair], points: &[Point]) -> Vec<Vec<Pair>> {
    let side = (points.len() as f64 / PATCH).sqrt().ceil() as usize;
    let mut patches = vec![Vec::new(); side * side];
    for &pair in pairs {
        let [a, b] = pair.map(|v| points[v as usize]);
        let place =
            |axis: usize| ((0.25 * (a[axis] + b[axis]) + 0.5) * side as f64).clamp(0.0, side as f64 - 1.0) as usize;
        patches[place(1) * side + place(0)].push(pair);
    }
    // Multiples of the golden angle are evenly spaced: this scatters the patches.
    let turn = |patch: usize| (patch as f64 * GOLDEN_ANGLE / TAU).fract();
    let mut order: Vec<usize> = (0..patches.len()).collect();
    order.sort_by(|&a, &b| turn(a).total_cmp(&turn(b)));
    order.into_iter().map(|patch| std::mem::take(&mut patches[patch])).collect()
}

/// Sorts pairs into sets without a common vertex, by greedy colouring.
fn independent_sets(pairs: &[Pair], vertices: usize) -> Vec<Pair> {
    let mut taken = vec![0_u64; vertices];
    let mut sets: Vec<Vec<Pair>> = Vec::new();
    for &[a, b] in pairs {
        let colour = (!(taken[a as usize] | taken[b as usize])).trailing_zeros() as usize;
        taken[a as usize] |= 1 << colour;
        taken[b as usize] |= 1 << colour;
        sets.resize(sets.len().max(colour + 1), Vec::new());
        sets[colour].push([a, b]);
    }
    sets.concat()
}

/// Returns the weights of the trigonometric polynomial through the rim, continued inwards:
/// w = (1/K) ∑_l r^|l| cos l(θ - θ_k), |l| ≤ K/2. The last block is filled up with points at the centre.
fn harmonics(points: &[Point], rim: usize) -> Vec<Lanes> {
    let (rim, inner) = points.split_at(rim);
    let mut weights = Vec::with_capacity(rim.len() * inner.len().div_ceil(LANES));
    for block in inner.chunks(LANES) {
        let mut places = [[0.0; LANES]; 2];
        for (l, point) in block.iter().enumerate() {
            (places[0][l], places[1][l]) = (point[0], point[1]);
        }
        weights.extend(rim.iter().map(|&at| harmonics_of(places, at, rim.len())));
    }
    weights
}

/// Returns the weights of one of `count` rim vertices in inner vertices.
#[multiversion(targets = "simd")]
fn harmonics_of([xs, ys]: [Lanes; 2], [cos_k, sin_k]: Point, count: usize) -> Lanes {
    // z = r e^{i(θ - θ_k)}; its powers are the terms of the sum.
    let [mut re, mut im] = [[0.0; LANES]; 2];
    for l in 0..LANES {
        re[l] = xs[l] * cos_k + ys[l] * sin_k;
        im[l] = ys[l] * cos_k - xs[l] * sin_k;
    }
    let [mut power_re, mut power_im] = [re, im];
    let mut sums = [1.0; LANES];
    for _ in 1..count.div_ceil(2) {
        for l in 0..LANES {
            sums[l] += 2.0 * power_re[l];
            let next = power_re[l] * re[l] - power_im[l] * im[l];
            power_im[l] = power_re[l] * im[l] + power_im[l] * re[l];
            power_re[l] = next;
        }
    }
    for l in 0..LANES {
        if count.is_multiple_of(2) {
            sums[l] += power_re[l];
        }
        sums[l] /= count as f64;
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::refine::mean;
    use std::collections::BTreeSet;

    #[test]
    fn the_mesh_covers_the_disc() {
        let disc = Disc::new(538).unwrap();
        assert_eq!((disc.points.len(), disc.rim), (538, 75));
        // Euler: V − E + F = 1, and the rim is the boundary.
        let [edges, bends] = [disc.edges.concat(), disc.bends.concat()];
        assert_eq!(538 + disc.triangles.len(), edges.len() + 1);
        assert_eq!(edges.len() - bends.len(), 75);
        let area: f64 = disc
            .triangles
            .iter()
            .map(|t| t.map(|v| disc.points[v as usize]))
            .map(|[a, b, c]| cross(a, b, c) / 2.0)
            .sum();
        assert!((area - 37.5 * libm::sin(TAU / 75.0)).abs() < 1e-9);
        let lengths: Vec<f64> = edges
            .iter()
            .map(|&[a, b]| crate::outline::distance(disc.points[a as usize], disc.points[b as usize]))
            .collect();
        let (least, most) = lengths.iter().fold((f64::MAX, 0.0_f64), |(l, m), &d| (l.min(d), m.max(d)));
        assert!(most < 3.0 * least, "{least} {most}");
    }

    #[test]
    fn sets_of_pairs_share_no_vertex() {
        let disc = Disc::new(200).unwrap();
        for pairs in [disc.edges.concat(), disc.bends.concat()] {
            let mut taken = BTreeSet::new();
            let mut sets = 1;
            for [a, b] in independent_sets(&pairs, 200) {
                assert!(a < b);
                if !taken.insert(a) | !taken.insert(b) {
                    sets += 1;
                    taken = BTreeSet::from([a, b]);
                }
            }
            assert!(sets < 20, "{sets}");
        }
    }

    #[test]
    fn patches_are_small_and_contain_every_pair_once() {
        let disc = Disc::new(2000).unwrap();
        let (mut edges, bends) = pairs(&disc.triangles, 2000);
        for (found, all) in [(&disc.edges, &edges), (&disc.bends, &bends)] {
            let sorted = |pairs: &[Pair]| BTreeSet::from_iter(pairs.to_vec());
            let found = found.concat();
            assert_eq!((found.len(), sorted(&found)), (all.len(), sorted(all)));
        }
        edges.reverse();
        for patch in patches(&edges, &disc.points) {
            let vertices: BTreeSet<u32> = patch.iter().flatten().copied().collect();
            assert!(vertices.len() < 200, "{}", vertices.len());
        }
    }

    #[test]
    fn interpolation_reproduces_linear_functions() {
        for (from, to) in [(16, 32), (32, 16), (300, 600), (600, 300), (65, 100)] {
            let [from, to] = [from, to].map(|vertices| Disc::new(vertices).unwrap());
            let stencils = from.interpolation(&to).unwrap();
            let found: Vec<Point> = mean(&stencils, &from.points).collect();
            for (v, (found, wanted)) in found.iter().zip(&to.points).enumerate() {
                // A vertex on the circle is interpolated on a chord.
                let most = if v < to.rim { 1.0 - libm::cos(PI / from.rim as f64) } else { 0.0 };
                assert!(crate::outline::distance(*found, *wanted) < most + 1e-9, "{v}: {found:?} {wanted:?}");
            }
            for stencil in &stencils {
                let sum: f64 = stencil.iter().map(|(_, weight)| weight).sum();
                assert!((sum - 1.0).abs() < 1e-12 && stencil.iter().all(|(_, weight)| *weight >= -1e-12));
            }
        }
    }

    #[test]
    fn harmonic_functions_are_reproduced() {
        let disc = Disc::new(400).unwrap();
        // Re z³ and Im z² are harmonic.
        let field = |&[x, y]: &Point| [x * x * x - 3.0 * x * y * y, 2.0 * x * y];
        let rim: Vec<Point> = disc.points[..disc.rim].iter().map(field).collect();
        for (found, p) in disc.harmonic_map(&rim).iter().zip(&disc.points) {
            let wanted = field(p);
            assert!((found[0] - wanted[0]).abs() < 1e-9 && (found[1] - wanted[1]).abs() < 1e-9);
        }
    }
}
