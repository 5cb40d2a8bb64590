//! Windows, outlines and assertions for the tests.

use crate::outline::Outline;
use crate::{DescentPath, PathEnd, Point, Window};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;
use std::collections::BTreeMap;

pub(crate) fn rng(seed: u64) -> Xoshiro256PlusPlus {
    Xoshiro256PlusPlus::seed_from_u64(0x0073_6b65_6c65_746f ^ seed)
}

pub(crate) fn windows() -> [Window; 5] {
    [
        Window::rectangle([0.0, 0.0], [200.0, 120.0]).unwrap(),
        // Flat and far from the origin.
        Window::rectangle([-1000.5, 3000.0], [-900.0, 3000.25]).unwrap(),
        pentagon(),
        Window::convex(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]).unwrap(),
        // Narrow and diagonal.
        Window::convex(&[[0.0, 0.0], [100.0, 100.0], [99.0, 101.0], [-1.0, 1.0]]).unwrap(),
    ]
}

pub(crate) fn pentagon() -> Window {
    Window::convex(&[[0.0, 0.0], [10.0, -2.0], [14.0, 6.0], [6.0, 12.0], [-1.0, 8.0]]).unwrap()
}

pub(crate) fn draws(window: &Window, count: usize, seed: u64) -> Vec<Point> {
    let mut rng = rng(seed);
    (0..count).map(|_| window.draw(&mut rng)).collect()
}

/// Returns sites on the upper and lower border of a square of size 10.
pub(crate) fn rim() -> Vec<Point> {
    (0..40).map(|i| [f64::from(i % 20) * 0.5, f64::from(i / 20) * 10.0]).collect()
}

/// Returns sites on a square lattice, where four cells meet at every vertex.
pub(crate) fn lattice(columns: u32, rows: u32) -> (Vec<Point>, Window) {
    let place = |i: u32| [f64::from(i % columns) + 0.5, f64::from(i / columns) + 0.5];
    let window = Window::rectangle([0.0, 0.0], [f64::from(columns), f64::from(rows)]).unwrap();
    ((0..columns * rows).map(place).collect(), window)
}

/// Returns an outline with five concavities of relative depth `depth`.
pub(crate) fn cell(depth: f64) -> Vec<Point> {
    (0..420)
        .map(|k| {
            let angle = core::f64::consts::TAU * f64::from(k) / 420.0;
            let radius = 70.0 * (1.0 + depth * libm::cos(5.0 * angle));
            [100.0 + 1.2 * radius * libm::cos(angle), 110.0 + radius * libm::sin(angle)]
        })
        .collect()
}

/// Returns the bits of a point, as a map key.
pub(crate) fn key(point: Point) -> [u64; 2] {
    point.map(f64::to_bits)
}

/// Asserts that paths descend strictly, have the heights of their points, end on the outline or on another tree, and
/// form trees.
pub(crate) fn assert_paths(paths: &[DescentPath], outline: &[Point]) {
    let edge = Outline::new(outline).unwrap();
    // A forest: every edge connects two different trees.
    let mut parts: BTreeMap<[u64; 2], [u64; 2]> = BTreeMap::new();
    let root = |parts: &BTreeMap<[u64; 2], [u64; 2]>, point| {
        std::iter::successors(Some(key(point)), |point| parts.get(point).copied()).last().unwrap()
    };
    for (number, path) in paths.iter().enumerate() {
        let DescentPath { points, heights, end } = path;
        assert!(points.len() == heights.len() && points.len() >= 2 && path.length() > 0.0);
        assert!(heights.windows(2).all(|pair| pair[1] < pair[0]));
        assert!(heights.iter().all(|h| (0.0..=1.0).contains(h)));
        let scale = edge.height(points[0]) / heights[0];
        for (&point, height) in points.iter().zip(heights) {
            assert!((edge.height(point) - height * scale).abs() < 1e-6);
        }
        let last = points[points.len() - 1];
        match end {
            PathEnd::Border => assert!(edge.height(last).abs() < 1e-6),
            PathEnd::Junction => assert!(paths[..number].iter().any(|other| other.points.contains(&last))),
        }
        for pair in points.windows(2) {
            let (a, b) = (root(&parts, pair[0]), root(&parts, pair[1]));
            assert_ne!(a, b);
            parts.insert(b, a);
        }
    }
}
