//! Sheets solved side by side: every array holds one value for each of `L` lanes, and all lanes do the same.
//!
//! A lane never looks at another, so that a sheet's bits do not depend on its company.

use crate::kernel::{Real, pull, verlet};
use crate::mesh::Pair;
use std::ops::{Index, IndexMut};

/// One value for each lane. The alignment is that of a cache line: a row of 16 f32 must not straddle two.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(crate) struct Lane<T, const L: usize>(pub(crate) [T; L]);

impl<T, const L: usize> Index<usize> for Lane<T, L> {
    type Output = T;
    #[inline(always)]
    fn index(&self, l: usize) -> &T {
        &self.0[l]
    }
}

impl<T, const L: usize> IndexMut<usize> for Lane<T, L> {
    #[inline(always)]
    fn index_mut(&mut self, l: usize) -> &mut T {
        &mut self.0[l]
    }
}

/// x, y and z of one vertex in every lane.
pub(crate) type Node<T, const L: usize> = [Lane<T, L>; 3];

/// A closed curve in every lane.
pub(crate) type Curve<T, const L: usize> = Vec<[Lane<T, L>; 2]>;

/// Eq. 4 on every vertex.
#[inline(always)]
pub(crate) fn advance<T: Real, const L: usize>(
    now: &mut [Node<T, L>],
    before: &mut [Node<T, L>],
    keep: T,
    gravity_dt2: T,
) {
    let fall = [T::ZERO, T::ZERO, gravity_dt2];
    for (n, b) in now.iter_mut().zip(before) {
        // On copies, so that the compiler knows them apart and takes all lanes at once.
        let (at, mut next) = (*n, *b);
        for axis in 0..3 {
            for l in 0..L {
                next[axis][l] = verlet(at[axis][l], next[axis][l], fall[axis], keep);
            }
        }
        (*n, *b) = (next, at);
    }
}

/// How a set of distances is restored.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Binding<T> {
    /// Inverse masses of a pair's ends.
    pub(crate) weights: [T; 2],
    /// 1 / (∑w + α̃).
    pub(crate) gain: T,
    /// Relative shortening beyond which the resistance no longer grows.
    pub(crate) gives_way: T,
}

/// One pass over the distances of `pairs`.
#[inline(always)]
pub(crate) fn project<T: Real, const L: usize>(
    now: &mut [Node<T, L>],
    pairs: &[Pair],
    lengths: &[Lane<T, L>],
    binding: Binding<T>,
) {
    for (&[a, b], rest) in pairs.iter().zip(lengths) {
        if let Ok([p, q]) = now.get_disjoint_mut([a as usize, b as usize]) {
            bind(p, q, rest, &binding);
        }
    }
}

/// One distance, in all lanes: on copies, so that the compiler knows them apart and takes all lanes at once.
#[inline(always)]
fn bind<T: Real, const L: usize>(p: &mut Node<T, L>, q: &mut Node<T, L>, rest: &Lane<T, L>, binding: &Binding<T>) {
    let least = -(binding.gain * binding.gives_way);
    let (mut a, mut b) = (*p, *q);
    for l in 0..L {
        let d = [b[0][l] - a[0][l], b[1][l] - a[1][l], b[2][l] - a[2][l]];
        let s = pull(d, rest[l], binding.gain).at_least(least);
        for axis in 0..3 {
            a[axis][l] = a[axis][l] + d[axis] * (s * binding.weights[0]);
            b[axis][l] = b[axis][l] - d[axis] * (s * binding.weights[1]);
        }
    }
    (*p, *q) = (a, b);
}

/// Ground and ceiling.
#[inline(always)]
pub(crate) fn confine<T: Real, const L: usize>(now: &mut [Node<T, L>], ceiling: T) {
    for n in now {
        for z in &mut n[2].0 {
            *z = z.at_least(T::ZERO).at_most(ceiling);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::rng;
    use rand_core::Rng;

    fn nodes(count: usize) -> Vec<Node<f64, 1>> {
        let mut rng = rng(1);
        let mut value = || Lane([f64::from(rng.next_u32()) / f64::from(u32::MAX)]);
        (0..count).map(|_| [value(), value(), value()]).collect()
    }

    #[test]
    fn law_23_distances_conserve_momentum() {
        let mut now = nodes(30);
        let sum = |now: &[Node<f64, 1>]| [0, 1, 2].map(|axis| now.iter().map(|n| n[axis][0]).sum::<f64>());
        let before = sum(&now);
        let pairs: Vec<Pair> = (0..29).map(|k| [k, k + 1]).collect();
        let lengths = vec![Lane([0.3]); 29];
        for _ in 0..20 {
            project(&mut now, &pairs, &lengths, Binding { weights: [1.0; 2], gain: 0.4, gives_way: 0.2 });
        }
        for (a, b) in before.iter().zip(sum(&now)) {
            assert!((a - b).abs() < 1e-12);
        }
    }

    #[test]
    fn law_23_what_falls_follows_a_parabola() {
        let mut now = nodes(3);
        let start = now.clone();
        let mut before = now.clone();
        for _ in 0..100 {
            advance(&mut now, &mut before, 1.0, -0.01);
        }
        for (n, s) in now.iter().zip(&start) {
            // ∑ 1..=100 of the constant acceleration.
            assert!((n[2][0] - s[2][0] + 0.01 * 5050.0).abs() < 1e-10);
            assert!((n[0][0] - s[0][0]).abs() < 1e-12);
        }
    }

    #[test]
    fn a_crease_gives_way() {
        let pull_by = |gives_way: f64| {
            let mut now = vec![[Lane([0.0]); 3], [Lane([0.5]), Lane([0.0]), Lane([0.0])]];
            project(&mut now, &[[0, 1]], &[Lane([1.0])], Binding { weights: [1.0; 2], gain: 0.5, gives_way });
            now[1][0][0] - now[0][0][0]
        };
        assert!((pull_by(f64::MAX) - 1.0).abs() < 1e-12);
        assert!((pull_by(0.1) - 0.55).abs() < 1e-12);
    }

    #[test]
    fn ground_and_ceiling_hold() {
        let mut now = vec![[Lane([-1.0, 0.5, 2.0]); 3]];
        confine(&mut now, 1.0);
        assert_eq!(now[0][2].0, [0.0, 0.5, 1.0]);
        assert_eq!(now[0][0].0, [-1.0, 0.5, 2.0]);
    }
}
