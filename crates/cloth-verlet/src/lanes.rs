//! Vector operations on a batch of sheets: every array holds one value for each of `L` lanes.
//!
//! Lanes are independent, so that the bits of a sheet do not depend on the others of its batch.

use crate::mesh::Pair;
use std::ops::{Index, IndexMut};

/// One value for each lane. Aligned to a cache line, so that 16 values do not straddle two.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(crate) struct Lane<const L: usize>(pub(crate) [f32; L]);

impl<const L: usize> Lane<L> {
    pub(crate) const ZERO: Self = Lane([0.0; L]);
}

impl<const L: usize> Index<usize> for Lane<L> {
    type Output = f32;
    #[inline(always)]
    fn index(&self, l: usize) -> &f32 {
        &self.0[l]
    }
}

impl<const L: usize> IndexMut<usize> for Lane<L> {
    #[inline(always)]
    fn index_mut(&mut self, l: usize) -> &mut f32 {
        &mut self.0[l]
    }
}

/// x, y and z of one vertex in every lane.
pub(crate) type Node<const L: usize> = [Lane<L>; 3];

/// A closed curve in every lane.
pub(crate) type Curve<const L: usize> = Vec<[Lane<L>; 2]>;

/// Avoids a division by zero; far below the rounding error of a length.
pub(crate) const TINY: f32 = 1e-20;

#[expect(clippy::cast_possible_truncation, reason = "rounding to the lanes' precision is the purpose")]
pub(crate) fn single(value: f64) -> f32 {
    value as f32
}

// These compile to one vector instruction; `f32::max` and `f32::min` also handle NaN.

#[inline(always)]
pub(crate) fn at_least(value: f32, low: f32) -> f32 {
    if value > low { value } else { low }
}

#[inline(always)]
pub(crate) fn at_most(value: f32, high: f32) -> f32 {
    if value < high { value } else { high }
}

/// Eq. 4: xₜ₊Δₜ = 2xₜ − xₜ₋Δₜ + v̇ₜ Δt², with the previous displacement scaled by `keep` = 1 − damping.
#[inline(always)]
pub(crate) fn verlet(now: f32, before: f32, acceleration_dt2: f32, keep: f32) -> f32 {
    // Eq. 4, as 2xₜ − xₜ₋Δₜ = xₜ + (xₜ − xₜ₋Δₜ).
    now + (now - before) * keep + acceleration_dt2
}

/// A distance constraint C = |d| − rest, d = b − a, projected once. Returns s: a moves by w_a s d and b by −w_b s d.
///
/// From extended position-based dynamics (Macklin, Müller and Chentanez 2016, doi:10.1145/2994258.2994272, Eq. 18),
/// Δλ = −(C + α̃λ) / (∑w + α̃) with α̃ = α / Δt²; there is one iteration a step, so λ = 0. `gain` is 1 / (∑w + α̃).
#[inline(always)]
fn correction(d: [f32; 3], rest: f32, gain: f32) -> f32 {
    let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + TINY).sqrt();
    gain - gain * rest / length
}

/// Applies Eq. 4 to the vertices `which`.
///
/// Like pairs, vertices are given by their indices: the compiler would vectorise a loop over a range of vertices, with
/// gathers and scatters, instead of the loop over lanes.
#[inline(always)]
pub(crate) fn advance<const L: usize>(
    now: &mut [Node<L>],
    before: &mut [Node<L>],
    which: &[u32],
    keep: f32,
    gravity_dt2: f32,
) {
    let fall = [0.0, 0.0, gravity_dt2];
    for &v in which {
        let (n, b) = (&mut now[v as usize], &mut before[v as usize]);
        // On copies, which cannot alias, so that the compiler vectorises.
        let (at, mut next) = (*n, *b);
        for axis in 0..3 {
            for l in 0..L {
                next[axis][l] = verlet(at[axis][l], next[axis][l], fall[axis], keep);
            }
        }
        (*n, *b) = (next, at);
    }
}

/// Parameters of a set of distance constraints.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Constraint {
    /// 1 / (∑w + α̃), with the weight w = 1 of a free vertex.
    pub(crate) gain: f32,
    /// Relative compression beyond which the resistance is constant.
    pub(crate) yield_strain: f32,
}

/// Projects the distances of all pairs once. The first vertex of a pair is either `FREE` or fixed, the second is free.
#[inline(always)]
pub(crate) fn project<const FREE: bool, const L: usize>(
    now: &mut [Node<L>],
    pairs: &[Pair],
    lengths: &[Lane<L>],
    constraint: Constraint,
) {
    for (&[a, b], rest) in pairs.iter().zip(lengths) {
        if let Ok([p, q]) = now.get_disjoint_mut([a as usize, b as usize]) {
            project_pair::<FREE, L>(p, q, rest, &constraint);
        }
    }
}

/// Projects one distance in all lanes. Works on copies, which cannot alias, so that the compiler vectorises.
#[inline(always)]
fn project_pair<const FREE: bool, const L: usize>(
    p: &mut Node<L>,
    q: &mut Node<L>,
    rest: &Lane<L>,
    constraint: &Constraint,
) {
    let least = -(constraint.gain * constraint.yield_strain);
    let (mut a, mut b) = (*p, *q);
    for l in 0..L {
        let d = [b[0][l] - a[0][l], b[1][l] - a[1][l], b[2][l] - a[2][l]];
        let s = at_least(correction(d, rest[l], constraint.gain), least);
        for axis in 0..3 {
            let moved = d[axis] * s;
            if FREE {
                a[axis][l] += moved;
            }
            b[axis][l] -= moved;
        }
    }
    if FREE {
        *p = a;
    }
    *q = b;
}

/// Returns the distance of two vertices in the plane.
pub(crate) fn flat_distance<const L: usize>(a: &Node<L>, b: &Node<L>) -> Lane<L> {
    let mut distance = Lane::ZERO;
    for l in 0..L {
        let (x, y) = (b[0][l] - a[0][l], b[1][l] - a[1][l]);
        distance[l] = (x * x + y * y).sqrt();
    }
    distance
}

/// Clamps the heights of the vertices `which` between ground and ceiling.
#[inline(always)]
pub(crate) fn confine<const L: usize>(now: &mut [Node<L>], which: &[u32], ceiling: f32) {
    for &v in which {
        let v = v as usize;
        let mut z = now[v][2];
        for l in 0..L {
            z[l] = at_most(at_least(z[l], 0.0), ceiling);
        }
        now[v][2] = z;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::rng;
    use portable_numerics::random::uniform;

    /// Returns the last two positions of an oscillator under Eq. 4 after `steps` steps, from x₀ = 1 and the exact
    /// discrete x₋₁.
    fn oscillate(w_dt: f32, steps: usize) -> (f32, f32) {
        let angle = 2.0 * libm::asinf((0.5 * w_dt).min(1.0));
        (0..steps)
            .fold((libm::cosf(angle), 1.0), |(before, now), _| (now, verlet(now, before, -w_dt * w_dt * now, 1.0)))
    }

    #[test]
    fn verlet_oscillates_at_the_discrete_frequency() {
        // sin(ω'Δt/2) = ωΔt/2
        for w_dt in [0.1, 0.3, 1.0, 1.9] {
            let angle = 2.0 * libm::asinf(0.5 * w_dt);
            let (_, now) = oscillate(w_dt, 200);
            assert!((now - libm::cosf(200.0 * angle)).abs() < 1e-3, "{w_dt}: {now}");
        }
    }

    #[test]
    fn verlet_conserves_energy() {
        let w_dt = 0.4;
        let energy = |(x0, x1): (f32, f32)| 0.5 * (x1 - x0) * (x1 - x0) / (w_dt * w_dt) + 0.5 * x0 * x1;
        let (first, last) = (energy(oscillate(w_dt, 1)), energy(oscillate(w_dt, 100_000)));
        assert!((last / first - 1.0).abs() < 1e-3, "{first} {last}");
    }

    #[test]
    fn verlet_is_stable_below_two_and_unstable_above() {
        let farthest = |w_dt: f32| (1..600).map(|n| oscillate(w_dt, n).1.abs()).fold(0.0, f32::max);
        assert!(farthest(1.999) < 100.0 && farthest(2.001) > 1e10, "{} {}", farthest(1.999), farthest(2.001));
    }

    /// Advances a unit mass on a spring of rest length 1 along z by one substep of `h`.
    fn hang(z: &mut f32, before: &mut f32, g: f32, compliance: f32, h: f32, keep: f32) {
        let next = verlet(*z, *before, -g * h * h, keep);
        *before = *z;
        let s = correction([0.0, 0.0, next], 1.0, 1.0 / (1.0 + compliance / (h * h)));
        *z = next - s * next;
    }

    #[test]
    fn a_weight_extends_its_spring_by_compliance_times_weight() {
        for h in [1.0 / 60.0, 1.0 / 240.0] {
            let (g, compliance) = (9.81, 1e-2);
            let (mut z, mut before) = (-1.0, -1.0);
            for _ in 0..20_000 {
                hang(&mut z, &mut before, g, compliance, h, 0.99);
            }
            assert!((-z - 1.0 - compliance * g).abs() < 1e-4, "{z}");
        }
    }

    #[test]
    fn a_spring_decays_like_implicit_euler() {
        let (h, compliance) = (1.0 / 60.0, 1e-3);
        let (mut z, mut before) = (1.5, 1.0);
        let mut ys = vec![0.0];
        for _ in 0..20 {
            hang(&mut z, &mut before, 0.0, compliance, h, 1.0);
            ys.push(z - 1.0);
        }
        // y₁² − y₀ y₂ of a damped oscillation shrinks by the square of the decay, 1 / (1 + (ωh)²) with ω² = 1/α, in
        // each step.
        let size = |n: usize| ys[n] * ys[n] - ys[n - 1] * ys[n + 1];
        for n in 2..19 {
            let decay = (size(n + 1) / size(n)).sqrt();
            assert!((decay - 1.0 / (1.0 + h * h / compliance).sqrt()).abs() < 1e-3, "{decay}");
        }
    }

    #[test]
    fn distance_constraints_conserve_momentum() {
        let mut rng = rng(1);
        let mut now: Vec<Node<1>> = (0..30).map(|_| [0; 3].map(|_| Lane([single(uniform(&mut rng))]))).collect();
        let sum = |now: &[Node<1>]| [0, 1, 2].map(|axis| now.iter().map(|n| n[axis][0]).sum::<f32>());
        let before = sum(&now);
        let pairs: Vec<Pair> = (0..29).map(|k| [k, k + 1]).collect();
        for _ in 0..20 {
            let constraint = Constraint { gain: 0.4, yield_strain: 0.2 };
            project::<true, 1>(&mut now, &pairs, &[Lane([0.3]); 29], constraint);
        }
        assert!(before.iter().zip(sum(&now)).all(|(a, b)| (a - b).abs() < 1e-4));
    }
}
