//! Outlines and random numbers for the tests.

use crate::Point;
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;
use std::f64::consts::TAU;

pub(crate) fn rng(stream: u64) -> Xoshiro256PlusPlus {
    Xoshiro256PlusPlus::seed_from_u64(0x63_6c6f_7468 + stream)
}

/// Returns the closed curve r = 100 (1 + depth cos(waves θ + 1)) of 200 points, off the origin.
pub(crate) fn wavy(waves: f64, depth: f64) -> Vec<Point> {
    (0..200)
        .map(|k| TAU * f64::from(k) / 200.0)
        .map(|angle| (100.0 * (1.0 + depth * libm::cos(waves * angle + 1.0)), angle))
        .map(|(r, angle)| [30.0 + r * libm::cos(angle), -20.0 + r * libm::sin(angle)])
        .collect()
}

/// An L, in the orientation opposite to that of [`wavy`].
pub(crate) fn angular() -> Vec<Point> {
    vec![[0.0, 0.0], [0.0, 9.0], [4.0, 9.0], [4.0, 4.5], [8.0, 4.5], [8.0, 0.0]]
}
