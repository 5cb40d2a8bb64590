//! The state of a batch of sheets, one in each vector lane, and both solvers.

use crate::lanes::{Constraint, Curve, Lane, Node, advance, confine, project, single, verlet};
use crate::mesh::{Disc, Pair};
use crate::outline::{Outline, distance};
use crate::refine::index;
use crate::ring::{MovingOutline, SearchWindow};
use crate::{Point, VerletParams, Vertex, XpbdParams};

/// Data shared by all sheets of a mesh: the constrained pairs of vertices, and the sides of the outline that each
/// vertex may touch.
#[derive(Debug)]
pub(crate) struct Topology {
    /// Edges with two, one and no vertex on the rim.
    pub(crate) edges: [Vec<Pair>; 3],
    /// Pairs of vertices opposite an edge, sorted likewise.
    pub(crate) bends: [Vec<Pair>; 3],
    windows: Vec<SearchWindow>,
    pub(crate) rim: usize,
    /// The indices of all vertices.
    vertices: Vec<u32>,
}

impl Topology {
    /// `sides` is the number of sides of the outline.
    pub(crate) fn new(disc: &Disc, sides: usize) -> Topology {
        // Pairs hold the smaller index first, and the rim comes before all others.
        let on_rim = |p: &Pair| p.iter().filter(|&&v| (v as usize) < disc.rim).count();
        let sorted =
            |pairs: &[Pair]| [2, 1, 0].map(|count| pairs.iter().copied().filter(|p| on_rim(p) == count).collect());
        Topology {
            edges: sorted(&disc.edges),
            bends: sorted(&disc.bends),
            windows: disc.points.iter().map(|&p| SearchWindow::from(p, sides)).collect(),
            rim: disc.rim,
            vertices: (0..disc.points.len()).map(index).collect(),
        }
    }
}

/// One sheet before it is crumpled, in units of the equivalent radius of its outline.
#[derive(Debug, Clone)]
pub(crate) struct Start {
    /// The target outline, and the position of the first rim vertex on it, as a fraction of the perimeter.
    pub(crate) shape: Outline,
    pub(crate) offset: f64,
    pub(crate) rest: Vec<Point>,
    pub(crate) heights: Vec<f64>,
    /// The outline at the start and at the end.
    pub(crate) outline: [Vec<Point>; 2],
}

#[derive(Debug)]
pub(crate) struct Batch<const L: usize> {
    now: Vec<Node<L>>,
    before: Vec<Node<L>>,
    ring: MovingOutline<L>,
    /// The outline at the start and at the end.
    outlines: [Curve<L>; 2],
    /// Rest lengths of [`Topology::edges`] and [`Topology::bends`].
    edges: [Vec<Lane<L>>; 3],
    bends: [Vec<Lane<L>>; 3],
}

impl<const L: usize> Batch<L> {
    /// # Panics
    ///
    /// If `starts` is empty. Lanes beyond its length repeat the first.
    pub(crate) fn new(topology: &Topology, starts: &[&Start]) -> Self {
        let lanes: [&Start; L] = std::array::from_fn(|l| starts.get(l).copied().unwrap_or(starts[0]));
        let row = |value: &dyn Fn(&Start) -> f64| Lane(lanes.map(|s| single(value(s))));
        let now: Vec<Node<L>> = (0..lanes[0].rest.len())
            .map(|v| [row(&|s| s.rest[v][0]), row(&|s| s.rest[v][1]), row(&|s| s.heights[v])])
            .collect();
        let outlines = [0, 1].map(|which| -> Curve<L> {
            (0..lanes[0].outline[which].len()).map(|k| [0, 1].map(|axis| row(&|s| s.outline[which][k][axis]))).collect()
        });
        let lengths = |pairs: &Vec<Pair>| {
            pairs.iter().map(|&[a, b]| row(&|s| distance(s.rest[a as usize], s.rest[b as usize]))).collect()
        };
        Batch {
            before: now.clone(),
            ring: MovingOutline::new(outlines[0].clone(), now.len()),
            now,
            outlines,
            edges: topology.edges.each_ref().map(lengths),
            bends: topology.bends.each_ref().map(lengths),
        }
    }

    pub(crate) fn lane(&self, l: usize) -> Vec<Vertex> {
        self.now.iter().map(|n| n.map(|lane| f64::from(lane[l]))).collect()
    }

    /// Runs the paper's method: Eq. 4 on every vertex and on the outline, distances restored by projection, a ground
    /// plane.
    #[inline(always)]
    pub(crate) fn verlet(&mut self, topology: &Topology, steps: usize, params: &VerletParams) {
        let keep = single(1.0 - params.damping);
        let gravity = single(-params.gravity * params.dt_squared);
        let attraction = single(params.attraction * params.dt_squared);
        let rigid = Constraint { weights: [1.0; 2], gain: 0.5, yield_strain: f32::MAX };
        for step in 1..=steps {
            for _ in 0..params.passes {
                for (pairs, lengths) in topology.edges.iter().zip(&self.edges) {
                    project(&mut self.now, pairs, lengths, rigid);
                }
            }
            let ring = self.ring.points.iter_mut().zip(&mut self.ring.before);
            for ((point, before), target) in ring.zip(&self.outlines[1]) {
                for axis in 0..2 {
                    for l in 0..L {
                        let now = point[axis][l];
                        point[axis][l] = verlet(now, before[axis][l], (target[axis][l] - now) * attraction, keep);
                        before[axis][l] = now;
                    }
                }
            }
            advance(&mut self.now, &mut self.before, &topology.vertices, keep, gravity);
            self.ring.push_inside(&mut self.now, &topology.windows, 0, step);
            confine(&mut self.now, &topology.vertices, f32::MAX);
        }
    }

    /// Runs extended position-based dynamics in small steps. The rim follows an outline that eases from start to end.
    #[inline(always)]
    pub(crate) fn xpbd(&mut self, topology: &Topology, steps: usize, params: &XpbdParams) {
        let (all, small) = ((steps * params.substeps) as f64, params.substeps as f64);
        let keep = single(libm::pow(1.0 - params.damping, 1.0 / small));
        let gravity = single(-params.gravity / (small * small));
        // For pairs with one end fixed on the rim, and for free pairs. α̃ = α / Δt², with Δt in steps.
        let constraints = |compliance: f64, yield_strain: f32| {
            [[0.0, 1.0], [1.0, 1.0]].map(|weights: [f64; 2]| Constraint {
                weights: weights.map(single),
                gain: single(1.0 / (weights[0] + weights[1] + compliance * small * small)),
                yield_strain,
            })
        };
        let stretch = constraints(params.stretch_compliance, f32::MAX);
        let bend = constraints(params.bend_compliance, single(params.bend_yield));
        for substep in 1..=steps * params.substeps {
            let s = substep as f64 / all;
            self.move_rim(&topology.vertices[..topology.rim], single(s * s * (3.0 - 2.0 * s)));
            advance(&mut self.now, &mut self.before, &topology.vertices[topology.rim..], keep, gravity);
            // Set 0 holds the edges of the rim, whose positions are prescribed.
            for set in 1..3 {
                project(&mut self.now, &topology.edges[set], &self.edges[set], stretch[set - 1]);
            }
            for set in 1..3 {
                project(&mut self.now, &topology.bends[set], &self.bends[set], bend[set - 1]);
            }
            confine(&mut self.now, &topology.vertices[topology.rim..], single(params.ceiling));
            if substep.is_multiple_of(params.substeps) {
                self.ring.push_inside(&mut self.now, &topology.windows, topology.rim, substep / params.substeps);
            }
        }
    }

    /// Moves the outline and the rim to the fraction `moved` of their which from start to end.
    #[inline(always)]
    fn move_rim(&mut self, rim: &[u32], moved: f32) {
        let [from, to] = &self.outlines;
        for &v in rim {
            let v = v as usize;
            let (a, b) = (from[v], to[v]);
            let mut point = a;
            for axis in 0..2 {
                for l in 0..L {
                    point[axis][l] = a[axis][l] + (b[axis][l] - a[axis][l]) * moved;
                }
            }
            self.ring.points[v] = point;
            let node = &mut self.now[v];
            [node[0], node[1]] = point;
        }
    }
}
