//! The paper's solver.

use crate::VerletParams;
use crate::batch::{Batch, Topology};
use crate::kernel::{Real, verlet};
use crate::lanes::{Binding, advance, confine, project};

impl<T: Real, const L: usize> Batch<T, L> {
    /// The paper's way: Eq. 4 on every vertex and on the outline, distances restored by projection, a ground plane.
    #[inline(always)]
    pub(crate) fn verlet(&mut self, topology: &Topology, steps: usize, params: &VerletParams) {
        let keep = T::of(1.0 - params.damping);
        let gravity = T::of(-params.gravity * params.dt_squared);
        let attraction = T::of(params.attraction * params.dt_squared);
        let no_limit = T::of(f64::from(f32::MAX));
        let rigid = Binding { weights: [T::ONE; 2], gain: T::of(0.5), gives_way: no_limit };
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
            confine(&mut self.now, no_limit);
        }
    }
}
