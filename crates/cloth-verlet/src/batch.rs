//! The state of sheets that are solved side by side, one in each lane, and both solvers.

use crate::lanes::{Binding, Curve, Lane, Node, advance, confine, project, single, verlet};
use crate::mesh::{Disc, Pair};
use crate::outline::{Outline, distance};
use crate::ring::{Ring, View};
use crate::{Point, VerletParams, Vertex, XpbdParams};

/// What all sheets of a mesh share: which vertices are bound, and where each may meet the outline.
#[derive(Debug)]
pub(crate) struct Topology {
    /// Distances within the rim, from the rim inwards, and inside.
    pub(crate) edges: [Vec<Pair>; 3],
    /// Distances across edges, likewise.
    pub(crate) bends: [Vec<Pair>; 3],
    views: Vec<View>,
    pub(crate) rim: usize,
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
            views: disc.points.iter().map(|&p| View::from(p, sides)).collect(),
            rim: disc.rim,
        }
    }
}

/// One sheet before it is pressed, in units of its outline's equivalent radius.
#[derive(Debug, Clone)]
pub(crate) struct Start {
    /// What it is pressed into, and where round that its first rim vertex stands.
    pub(crate) shape: Outline,
    pub(crate) offset: f64,
    pub(crate) rest: Vec<Point>,
    pub(crate) heights: Vec<f64>,
    /// The outline before and after.
    pub(crate) outline: [Vec<Point>; 2],
}

#[derive(Debug)]
pub(crate) struct Batch<const L: usize> {
    now: Vec<Node<L>>,
    before: Vec<Node<L>>,
    ring: Ring<L>,
    /// The outline at the start and at the end.
    ways: [Curve<L>; 2],
    /// Rest lengths of [`Topology::edges`] and [`Topology::bends`].
    edges: [Vec<Lane<L>>; 3],
    bends: [Vec<Lane<L>>; 3],
}

impl<const L: usize> Batch<L> {
    /// # Panics
    ///
    /// If `starts` is empty; lanes beyond its length repeat the first.
    pub(crate) fn new(topology: &Topology, starts: &[&Start]) -> Self {
        let lanes: [&Start; L] = std::array::from_fn(|l| starts.get(l).copied().unwrap_or(starts[0]));
        let row = |value: &dyn Fn(&Start) -> f64| Lane(lanes.map(|s| single(value(s))));
        let now: Vec<Node<L>> = (0..lanes[0].rest.len())
            .map(|v| [row(&|s| s.rest[v][0]), row(&|s| s.rest[v][1]), row(&|s| s.heights[v])])
            .collect();
        let ways = [0, 1].map(|way| -> Curve<L> {
            (0..lanes[0].outline[way].len()).map(|k| [0, 1].map(|axis| row(&|s| s.outline[way][k][axis]))).collect()
        });
        let lengths = |pairs: &Vec<Pair>| {
            pairs.iter().map(|&[a, b]| row(&|s| distance(s.rest[a as usize], s.rest[b as usize]))).collect()
        };
        Batch {
            before: now.clone(),
            ring: Ring::new(ways[0].clone(), now.len()),
            now,
            ways,
            edges: topology.edges.each_ref().map(lengths),
            bends: topology.bends.each_ref().map(lengths),
        }
    }

    pub(crate) fn lane(&self, l: usize) -> Vec<Vertex> {
        self.now.iter().map(|n| n.map(|lane| f64::from(lane[l]))).collect()
    }

    /// The paper's way: Eq. 4 on every vertex and on the outline, distances restored by projection, a ground plane.
    #[inline(always)]
    pub(crate) fn verlet(&mut self, topology: &Topology, steps: usize, params: &VerletParams) {
        let keep = single(1.0 - params.damping);
        let gravity = single(-params.gravity * params.dt_squared);
        let attraction = single(params.attraction * params.dt_squared);
        let rigid = Binding { weights: [1.0; 2], gain: 0.5, gives_way: f32::MAX };
        for step in 1..=steps {
            for _ in 0..params.passes {
                for (pairs, lengths) in topology.edges.iter().zip(&self.edges) {
                    project(&mut self.now, pairs, lengths, rigid);
                }
            }
            let ring = self.ring.points.iter_mut().zip(&mut self.ring.before);
            for ((point, before), target) in ring.zip(&self.ways[1]) {
                for axis in 0..2 {
                    for l in 0..L {
                        let now = point[axis][l];
                        point[axis][l] = verlet(now, before[axis][l], (target[axis][l] - now) * attraction, keep);
                        before[axis][l] = now;
                    }
                }
            }
            advance(&mut self.now, &mut self.before, keep, gravity);
            self.ring.press(&mut self.now, &topology.views, 0, step);
            confine(&mut self.now, f32::MAX);
        }
    }

    /// Small steps of extended position-based dynamics, the rim tied to an outline that eases from start to end.
    #[inline(always)]
    pub(crate) fn xpbd(&mut self, topology: &Topology, steps: usize, params: &XpbdParams) {
        let (all, small) = ((steps * params.substeps) as f64, params.substeps as f64);
        let keep = single(libm::pow(1.0 - params.damping, 1.0 / small));
        let gravity = single(-params.gravity / (small * small));
        // Of pairs with one end held on the rim, and of free ones. α̃ = α / Δt², with Δt in steps.
        let bindings = |compliance: f64, gives_way: f32| {
            [[0.0, 1.0], [1.0, 1.0]].map(|weights: [f64; 2]| Binding {
                weights: weights.map(single),
                gain: single(1.0 / (weights[0] + weights[1] + compliance * small * small)),
                gives_way,
            })
        };
        let stretch = bindings(params.stretch_compliance, f32::MAX);
        let bend = bindings(params.bend_compliance, single(params.bend_yield));
        for substep in 1..=steps * params.substeps {
            let s = substep as f64 / all;
            self.tie(topology.rim, single(s * s * (3.0 - 2.0 * s)));
            advance(&mut self.now[topology.rim..], &mut self.before[topology.rim..], keep, gravity);
            // The first set holds the edges of the rim, whose positions are prescribed.
            for set in 1..3 {
                project(&mut self.now, &topology.edges[set], &self.edges[set], stretch[set - 1]);
            }
            for set in 1..3 {
                project(&mut self.now, &topology.bends[set], &self.bends[set], bend[set - 1]);
            }
            confine(&mut self.now, single(params.ceiling));
            if substep.is_multiple_of(params.substeps) {
                self.ring.press(&mut self.now, &topology.views, topology.rim, substep / params.substeps);
            }
        }
    }

    /// Moves the outline, and the rim with it, to the place `moved` of the way from start to end.
    #[inline(always)]
    fn tie(&mut self, rim: usize, moved: f32) {
        let [from, to] = &self.ways;
        for (((point, node), a), b) in self.ring.points.iter_mut().zip(&mut self.now[..rim]).zip(from).zip(to) {
            for axis in 0..2 {
                for l in 0..L {
                    point[axis][l] = a[axis][l] + (b[axis][l] - a[axis][l]) * moved;
                    node[axis][l] = point[axis][l];
                }
            }
        }
    }
}
