//! The state of a batch of sheets, one in each vector lane, and both solvers.

use crate::lanes::{Constraint, Curve, Lane, Node, advance, confine, flat_distance, project, single, verlet};
use crate::mesh::{Disc, Pair};
use crate::outline::Outline;
use crate::refine::Stencils;
use crate::refine::index;
use crate::ring::{MovingOutline, SearchWindow};
use crate::{Point, Solver, VerletParams, Vertex, XpbdParams};
use std::ops::Range;

/// Data shared by all sheets of a mesh: the constrained pairs of vertices, and the sides of the outline that each
/// vertex may touch.
#[derive(Debug)]
pub(crate) struct Topology {
    /// The constraints in the order of the solver.
    pub(crate) groups: Vec<Group>,
    windows: Vec<SearchWindow>,
    pub(crate) rim: usize,
    /// The indices of all vertices.
    vertices: Vec<u32>,
}

/// Distance constraints of one kind.
#[derive(Debug)]
pub(crate) struct Group {
    pub(crate) kind: Kind,
    /// Whether the first vertex of each pair is fixed on the rim.
    pub(crate) fixed: bool,
    pub(crate) pairs: Vec<Pair>,
}

/// Kind of a distance constraint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Between the ends of an edge.
    Stretch,
    /// Between the vertices opposite an edge.
    Bend,
}

impl Topology {
    /// `sides` is the number of sides of the outline.
    pub(crate) fn new(disc: &Disc, sides: usize, solver: &Solver) -> Topology {
        // Pairs hold the smaller index first, and the rim comes before all others.
        let with = |patch: &[Pair], on_rim: usize| -> Vec<Pair> {
            let count = |p: &Pair| p.iter().filter(|&&v| (v as usize) < disc.rim).count();
            patch.iter().copied().filter(|p| count(p) == on_rim).collect()
        };
        let groups = match solver {
            Solver::Verlet(_) => {
                let all = disc.edges.concat();
                let group = |on_rim| Group { kind: Kind::Stretch, fixed: false, pairs: with(&all, on_rim) };
                [2, 1, 0].map(group).into()
            }
            // The positions of the rim are prescribed. All constraints of a patch follow each other, so that its
            // vertices are loaded once.
            Solver::Xpbd(_) => {
                let kinds = |(edges, bends)| [(Kind::Stretch, edges), (Kind::Bend, bends)];
                let groups = |(kind, patch): (Kind, &Vec<Pair>)| {
                    [true, false].map(|fixed| Group { kind, fixed, pairs: with(patch, usize::from(fixed)) })
                };
                disc.edges.iter().zip(&disc.bends).flat_map(kinds).flat_map(groups).collect()
            }
        };
        Topology {
            groups,
            windows: disc.points.iter().map(|&p| SearchWindow::from(p, sides)).collect(),
            rim: disc.rim,
            vertices: (0..disc.points.len()).map(index).collect(),
        }
    }
}

/// One sheet before it is crumpled.
#[derive(Debug, Clone)]
pub(crate) struct Start {
    /// The target outline, and the position of the first rim vertex on it, as a fraction of the perimeter.
    pub(crate) shape: Outline,
    pub(crate) offset: f64,
    pub(crate) flat: Flat,
}

/// A flat sheet on the ground, in units of the equivalent radius of its outline.
#[derive(Debug, Clone)]
pub(crate) struct Flat {
    pub(crate) rest: Vec<Point>,
    pub(crate) heights: Vec<f64>,
    /// The outline at the start and at the end.
    pub(crate) outline: [Vec<Point>; 2],
}

/// Consecutive steps of a simulation.
#[derive(Debug, Clone)]
pub(crate) struct Phase {
    /// The steps, counted from 0.
    pub(crate) steps: Range<usize>,
    /// Number of steps of the complete simulation.
    pub(crate) all: usize,
    /// Substeps in each step.
    pub(crate) substeps: usize,
}

#[derive(Debug)]
pub(crate) struct Batch<const L: usize> {
    pub(crate) now: Vec<Node<L>>,
    before: Vec<Node<L>>,
    ring: MovingOutline<L>,
    /// The outline at the start and at the end.
    outlines: [Curve<L>; 2],
    /// Rest lengths of [`Topology::groups`].
    lengths: Vec<Vec<Lane<L>>>,
}

impl<const L: usize> Batch<L> {
    /// # Panics
    ///
    /// If `flats` is empty. Lanes beyond its length repeat the first.
    pub(crate) fn new(topology: &Topology, flats: &[&Flat]) -> Self {
        let lanes: [&Flat; L] = std::array::from_fn(|l| flats.get(l).copied().unwrap_or(flats[0]));
        let mut now: Vec<Node<L>> = vec![[Lane::ZERO; 3]; flats[0].rest.len()];
        let mut outlines: [Curve<L>; 2] = flats[0].outline.each_ref().map(|curve| vec![[Lane::ZERO; 2]; curve.len()]);
        for (l, flat) in lanes.iter().enumerate() {
            for ((node, &[x, y]), &z) in now.iter_mut().zip(&flat.rest).zip(&flat.heights) {
                [node[0][l], node[1][l], node[2][l]] = [x, y, z].map(single);
            }
            for (point, &[x, y]) in outlines.iter_mut().flatten().zip(flat.outline.iter().flatten()) {
                [point[0][l], point[1][l]] = [x, y].map(single);
            }
        }
        let distance = |&[a, b]: &Pair| flat_distance(&now[a as usize], &now[b as usize]);
        Batch {
            lengths: topology.groups.iter().map(|group| group.pairs.iter().map(distance).collect()).collect(),
            before: now.clone(),
            ring: MovingOutline::new(outlines[0].clone(), now.len()),
            now,
            outlines,
        }
    }

    /// Adds the displacements of another mesh from its `start`, interpolated with `stencils`, and its velocities,
    /// scaled by `ratio`.
    pub(crate) fn displace(&mut self, from: &Self, start: &[Node<L>], stencils: &Stencils, ratio: f64) {
        let ratio = single(ratio);
        for ((now, before), stencil) in self.now.iter_mut().zip(&mut self.before).zip(stencils) {
            let mut velocity: Node<L> = [Lane::ZERO; 3];
            for &(v, weight) in stencil {
                let (v, weight) = (v as usize, single(weight));
                let (to, last, first) = (&from.now[v], &from.before[v], &start[v]);
                for axis in 0..3 {
                    for l in 0..L {
                        now[axis][l] += weight * (to[axis][l] - first[axis][l]);
                        velocity[axis][l] += weight * (to[axis][l] - last[axis][l]);
                    }
                }
            }
            for axis in 0..3 {
                for l in 0..L {
                    before[axis][l] = now[axis][l] - ratio * velocity[axis][l];
                }
            }
        }
    }

    pub(crate) fn lane(&self, l: usize) -> Vec<Vertex> {
        self.now.iter().map(|n| [0, 1, 2].map(|axis| f64::from(n[axis][l]))).collect()
    }

    /// Runs the paper's method: Eq. 4 on every vertex and on the outline, distances restored by projection, a ground
    /// plane.
    #[inline(always)]
    pub(crate) fn verlet(&mut self, topology: &Topology, steps: usize, params: &VerletParams) {
        let keep = single(1.0 - params.damping);
        let gravity = single(-params.gravity * params.dt_squared);
        let attraction = single(params.attraction * params.dt_squared);
        let rigid = Constraint { gain: 0.5, yield_strain: f32::MAX };
        for step in 1..=steps {
            for _ in 0..params.passes {
                for (group, lengths) in topology.groups.iter().zip(&self.lengths) {
                    project::<true, L>(&mut self.now, &group.pairs, lengths, rigid);
                }
            }
            let ring = self.ring.points.iter_mut().zip(&mut self.ring.before);
            for ((point, before), target) in ring.zip(&self.outlines[1]) {
                // On copies, which cannot alias, so that the compiler vectorises the loop over lanes.
                let (at, target, mut next) = (*point, *target, *before);
                for axis in 0..2 {
                    for l in 0..L {
                        let pull = (target[axis][l] - at[axis][l]) * attraction;
                        next[axis][l] = verlet(at[axis][l], next[axis][l], pull, keep);
                    }
                }
                (*point, *before) = (next, at);
            }
            advance(&mut self.now, &mut self.before, &topology.vertices, keep, gravity);
            self.ring.push_inside(&mut self.now, &topology.windows, 0, step);
            confine(&mut self.now, &topology.vertices, f32::MAX);
        }
    }

    /// Runs extended position-based dynamics in small steps. The rim follows an outline that eases from start to end.
    #[inline(always)]
    pub(crate) fn xpbd(&mut self, topology: &Topology, phase: &Phase, params: &XpbdParams) {
        let Phase { steps, substeps, .. } = phase;
        let (all, small) = ((phase.all * substeps) as f64, *substeps as f64);
        let keep = single(libm::pow(1.0 - params.damping, 1.0 / small));
        let gravity = single(-params.gravity / (small * small));
        // α̃ = α / Δt², with Δt in steps. ∑w is 1 for pairs with one end fixed on the rim, and 2 for free pairs.
        let constraints = |compliance: f64, yield_strain: f32| {
            [1.0, 2.0]
                .map(|weights| Constraint { gain: single(1.0 / (weights + compliance * small * small)), yield_strain })
        };
        let stretch = constraints(params.stretch_compliance, f32::MAX);
        let bend = constraints(params.bend_compliance, single(params.bend_yield));
        for substep in steps.start * substeps + 1..=steps.end * substeps {
            let s = substep as f64 / all;
            self.move_rim(&topology.vertices[..topology.rim], single(s * s * (3.0 - 2.0 * s)));
            advance(&mut self.now, &mut self.before, &topology.vertices[topology.rim..], keep, gravity);
            for (Group { kind, fixed, pairs }, lengths) in topology.groups.iter().zip(&self.lengths) {
                let [held, free] = if *kind == Kind::Stretch { stretch } else { bend };
                if *fixed {
                    project::<false, L>(&mut self.now, pairs, lengths, held);
                } else {
                    project::<true, L>(&mut self.now, pairs, lengths, free);
                }
            }
            confine(&mut self.now, &topology.vertices[topology.rim..], single(params.ceiling));
            if substep.is_multiple_of(*substeps) {
                self.ring.push_inside(&mut self.now, &topology.windows, topology.rim, substep / substeps);
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
