//! The arithmetic of one vertex or one constraint, for f32 (the lanes of the solver) and f64 (the laws in the tests).

use std::ops::{Add, Div, Mul, Neg, Sub};

pub(crate) trait Real:
    Copy
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    const ZERO: Self;
    const ONE: Self;
    /// Keeps a length from being zero; far below the rounding of any real one.
    const TINY: Self;
    fn of(value: f64) -> Self;
    fn to_f64(self) -> f64;
    fn sqrt(self) -> Self;

    #[inline(always)]
    fn at_least(self, low: Self) -> Self {
        if self > low { self } else { low }
    }

    #[inline(always)]
    fn at_most(self, high: Self) -> Self {
        if self < high { self } else { high }
    }
}

impl Real for f32 {
    const ZERO: f32 = 0.0;
    const ONE: f32 = 1.0;
    const TINY: f32 = 1e-20;
    #[expect(clippy::cast_possible_truncation, reason = "rounding to the lanes' precision is the purpose")]
    fn of(value: f64) -> f32 {
        value as f32
    }
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
    #[inline(always)]
    fn sqrt(self) -> f32 {
        f32::sqrt(self)
    }
}

impl Real for f64 {
    const ZERO: f64 = 0.0;
    const ONE: f64 = 1.0;
    const TINY: f64 = 1e-40;
    fn of(value: f64) -> f64 {
        value
    }
    fn to_f64(self) -> f64 {
        self
    }
    #[inline(always)]
    fn sqrt(self) -> f64 {
        f64::sqrt(self)
    }
}

/// Eq. 4: xₜ₊Δₜ = 2xₜ − xₜ₋Δₜ + v̇ₜ Δt², with the step before it scaled by `keep` = 1 − damping.
#[inline(always)]
pub(crate) fn verlet<T: Real>(now: T, before: T, acceleration_dt2: T, keep: T) -> T {
    // Eq. 4, as 2xₜ − xₜ₋Δₜ = xₜ + (xₜ − xₜ₋Δₜ).
    now + (now - before) * keep + acceleration_dt2
}

/// A distance constraint C = |d| − rest, d = b − a, projected once: a moves by w_a s d and b by −w_b s d, where s is returned.
///
/// From extended position-based dynamics (Macklin, Müller and Chentanez 2016, doi:10.1145/2994258.2994272, Eq. 18),
/// Δλ = −(C + α̃λ) / (∑w + α̃) with α̃ = α / Δt²; there is one iteration a step, so λ = 0. `gain` is 1 / (∑w + α̃).
#[inline(always)]
pub(crate) fn pull<T: Real>(d: [T; 3], rest: T, gain: T) -> T {
    let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + T::TINY).sqrt();
    gain - gain * rest / length
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An oscillator under Eq. 4: positions after `steps` steps from x₀ = 1 and the exact discrete x₋₁.
    fn oscillate(w_dt: f64, steps: usize) -> (f64, f64) {
        let angle = 2.0 * libm::asin((0.5 * w_dt).min(1.0));
        let (mut before, mut now) = (libm::cos(angle), 1.0);
        for _ in 0..steps {
            (before, now) = (now, verlet(now, before, -w_dt * w_dt * now, 1.0));
        }
        (before, now)
    }

    #[test]
    fn law_22_verlet_oscillates_at_the_discrete_frequency() {
        // sin(ω'Δt/2) = ωΔt/2
        for w_dt in [0.01, 0.3, 1.0, 1.9] {
            let angle = 2.0 * libm::asin(0.5 * w_dt);
            let (_, now) = oscillate(w_dt, 1000);
            assert!((now - libm::cos(1000.0 * angle)).abs() < 1e-5, "{w_dt}: {now}");
        }
    }

    #[test]
    fn law_22_verlet_conserves_its_energy() {
        let w_dt = 0.4;
        let energy = |(x0, x1): (f64, f64)| 0.5 * (x1 - x0) * (x1 - x0) / (w_dt * w_dt) + 0.5 * x0 * x1;
        let (first, last) = (energy(oscillate(w_dt, 1)), energy(oscillate(w_dt, 100_000)));
        assert!((last / first - 1.0).abs() < 1e-10, "{first} {last}");
    }

    #[test]
    fn law_22_verlet_is_stable_below_two_and_not_above() {
        let bounded = (1..2000).map(|n| oscillate(1.999, n).1.abs()).fold(0.0, f64::max);
        let (mut before, mut now) = (1.0_f64, 0.9_f64);
        for _ in 0..2000 {
            (before, now) = (now, verlet(now, before, -2.001 * 2.001 * now, 1.0));
        }
        assert!(bounded < 100.0 && now.abs() > 1e10, "{bounded} {now}");
    }

    #[test]
    fn damping_scales_the_step_before() {
        assert_eq!(verlet(2.0, 1.0, 0.5, 0.5), 3.0);
        assert_eq!(verlet(2.0_f32, 1.0, 0.5, 1.0), 2.0 * 2.0 - 1.0 + 0.5);
    }

    /// A unit mass hanging from a spring of compliance `compliance` and rest length 1 along z, one substep of `h`.
    fn hang(z: &mut f64, before: &mut f64, g: f64, compliance: f64, h: f64, keep: f64) {
        let next = verlet(*z, *before, -g * h * h, keep);
        *before = *z;
        let s = pull([0.0, 0.0, next], 1.0, 1.0 / (1.0 + compliance / (h * h)));
        *z = next - s * next;
    }

    #[test]
    fn law_23_a_weight_stretches_its_spring_by_compliance_times_weight() {
        for h in [1.0 / 60.0, 1.0 / 240.0] {
            let (g, compliance) = (9.81, 1e-3);
            let (mut z, mut before) = (-1.0, -1.0);
            for _ in 0..200_000 {
                hang(&mut z, &mut before, g, compliance, h, 0.99);
            }
            assert!((-z - 1.0 - compliance * g).abs() < 1e-6, "{z}");
        }
    }

    #[test]
    fn law_23_a_spring_decays_like_implicit_euler() {
        let (h, compliance) = (1.0 / 60.0, 1e-3);
        let (mut z, mut before) = (1.01, 1.0);
        let mut ys = vec![0.0];
        for _ in 0..20 {
            hang(&mut z, &mut before, 0.0, compliance, h, 1.0);
            ys.push(z - 1.0);
        }
        // y₁² − y₀ y₂ of a damped oscillation shrinks by the square of the decay, 1 / (1 + (ωh)²) with ω² = 1/α, in each step.
        let size = |n: usize| ys[n] * ys[n] - ys[n - 1] * ys[n + 1];
        for n in 2..19 {
            let decay = (size(n + 1) / size(n)).sqrt();
            assert!((decay - 1.0 / (1.0 + h * h / compliance).sqrt()).abs() < 1e-5, "{decay}");
        }
    }

    #[test]
    fn a_rigid_distance_is_restored_at_once() {
        let d = [3.0_f64, 0.0, 4.0];
        let s = pull(d, 2.0, 0.5);
        let left = d.map(|c| c - 2.0 * s * c);
        assert!((left[0] * left[0] + left[2] * left[2] - 4.0).abs() < 1e-12);
    }
}
