//! The default solver.

use crate::XpbdParams;
use crate::batch::{Batch, Topology};
use crate::kernel::Real;
use crate::lanes::{Binding, advance, confine, project};

impl<T: Real, const L: usize> Batch<T, L> {
    /// Small steps of extended position-based dynamics, the rim tied to an outline that eases from start to end.
    #[inline(always)]
    pub(crate) fn xpbd(&mut self, topology: &Topology, steps: usize, params: &XpbdParams) {
        #[expect(clippy::cast_precision_loss, reason = "counts far below 2^52")]
        let (all, small) = ((steps * params.substeps) as f64, params.substeps as f64);
        let keep = T::of(libm::pow(1.0 - params.damping, 1.0 / small));
        let gravity = T::of(-params.gravity / (small * small));
        let no_limit = T::of(f64::from(f32::MAX));
        // α̃ = α / Δt², with Δt in steps.
        let binding = |compliance: f64, weights: [f64; 2], gives_way: T| Binding {
            weights: weights.map(T::of),
            gain: T::of(1.0 / (weights[0] + weights[1] + compliance * small * small)),
            gives_way,
        };
        let (held, free) = ([0.0, 1.0], [1.0, 1.0]);
        let yields = T::of(params.bend_yield);
        let stretch = [held, free].map(|weights| binding(params.stretch_compliance, weights, no_limit));
        let bend = [held, free].map(|weights| binding(params.bend_compliance, weights, yields));
        for substep in 1..=steps * params.substeps {
            #[expect(clippy::cast_precision_loss, reason = "counts far below 2^52")]
            let s = substep as f64 / all;
            self.tie(topology.rim, T::of(s * s * (3.0 - 2.0 * s)));
            advance(&mut self.now[topology.rim..], &mut self.before[topology.rim..], keep, gravity);
            // The first set of pairs lies within the rim, which moves as it is told.
            for set in 1..3 {
                project(&mut self.now, &topology.edges[set], &self.edges[set], stretch[set - 1]);
            }
            for set in 1..3 {
                project(&mut self.now, &topology.bends[set], &self.bends[set], bend[set - 1]);
            }
            confine(&mut self.now, T::of(params.ceiling));
            if substep.is_multiple_of(params.substeps) {
                self.ring.press(&mut self.now, &topology.views, topology.rim, substep / params.substeps);
            }
        }
    }

    /// Moves the outline, and the rim with it, to the place `moved` of the way from start to end.
    #[inline(always)]
    fn tie(&mut self, rim: usize, moved: T) {
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
