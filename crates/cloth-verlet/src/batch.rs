//! The state of sheets that are solved side by side, one in each lane.

use crate::kernel::Real;
use crate::lanes::{Curve, Lane, Node};
use crate::mesh::{Disc, Pair};
use crate::outline::distance;
use crate::ring::{Ring, View};
use crate::{Point, Vertex};

/// What all sheets of a mesh share: which vertices are bound, and where each may meet the outline.
#[derive(Debug)]
pub(crate) struct Topology {
    /// Distances within the rim, from the rim inwards, and inside.
    pub(crate) edges: [Vec<Pair>; 3],
    /// Distances across edges, likewise.
    pub(crate) bends: [Vec<Pair>; 3],
    pub(crate) views: Vec<View>,
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
    pub(crate) rest: Vec<Point>,
    pub(crate) heights: Vec<f64>,
    /// The outline before and after.
    pub(crate) outline: [Vec<Point>; 2],
}

/// The state of `L` sheets.
#[derive(Debug)]
pub(crate) struct Batch<T, const L: usize> {
    pub(crate) now: Vec<Node<T, L>>,
    pub(crate) before: Vec<Node<T, L>>,
    pub(crate) ring: Ring<T, L>,
    /// The outline at the start and at the end.
    pub(crate) ways: [Curve<T, L>; 2],
    /// Rest lengths of [`Topology::edges`] and [`Topology::bends`].
    pub(crate) edges: [Vec<Lane<T, L>>; 3],
    pub(crate) bends: [Vec<Lane<T, L>>; 3],
}

impl<T: Real, const L: usize> Batch<T, L> {
    /// # Panics
    ///
    /// If `starts` is empty; lanes beyond its length repeat the first.
    pub(crate) fn new(topology: &Topology, starts: &[&Start]) -> Batch<T, L> {
        let lanes: [&Start; L] = std::array::from_fn(|l| starts.get(l).copied().unwrap_or(starts[0]));
        let row = |value: &dyn Fn(&Start) -> f64| Lane(lanes.map(|s| T::of(value(s))));
        let now: Vec<Node<T, L>> = (0..lanes[0].rest.len())
            .map(|v| [row(&|s| s.rest[v][0]), row(&|s| s.rest[v][1]), row(&|s| s.heights[v])])
            .collect();
        let ways = [0, 1].map(|way| -> Curve<T, L> {
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

    /// The vertices of one lane.
    pub(crate) fn lane(&self, l: usize) -> Vec<Vertex> {
        self.now.iter().map(|n| [n[0][l].to_f64(), n[1][l].to_f64(), n[2][l].to_f64()]).collect()
    }
}
