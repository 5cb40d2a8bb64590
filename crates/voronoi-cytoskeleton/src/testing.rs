//! Windows, outlines and laws that several tests share.

use crate::outline::Outline;
use crate::{Mouth, Point, River, Window};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;
use std::collections::BTreeMap;

pub(crate) fn rng(seed: u64) -> Xoshiro256PlusPlus {
    Xoshiro256PlusPlus::seed_from_u64(0x0073_6b65_6c65_746f ^ seed)
}

pub(crate) fn windows() -> [Window; 5] {
    [
        Window::rectangle([0.0, 0.0], [200.0, 120.0]).unwrap(),
        // Flat and far out.
        Window::rectangle([-1000.5, 3000.0], [-900.0, 3000.25]).unwrap(),
        pentagon(),
        Window::convex(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]).unwrap(),
        // Narrow and askew.
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

/// Sites close to the upper and the lower border of a square of 10.
pub(crate) fn rim() -> Vec<Point> {
    (0..40).map(|i| [f64::from(i % 20) * 0.5, f64::from(i / 20) * 10.0]).collect()
}

/// Sites in the squares of a chessboard: four cells meet in every vertex.
pub(crate) fn lattice(columns: u32, rows: u32) -> (Vec<Point>, Window) {
    let place = |i: u32| [f64::from(i % columns) + 0.5, f64::from(i / columns) + 0.5];
    let window = Window::rectangle([0.0, 0.0], [f64::from(columns), f64::from(rows)]).unwrap();
    ((0..columns * rows).map(place).collect(), window)
}

/// An outline about as large as a cell, with five bays of some depth.
pub(crate) fn cell(depth: f64) -> Vec<Point> {
    (0..420)
        .map(|k| {
            let angle = core::f64::consts::TAU * f64::from(k) / 420.0;
            let radius = 70.0 * (1.0 + depth * libm::cos(5.0 * angle));
            [100.0 + 1.2 * radius * libm::cos(angle), 110.0 + radius * libm::sin(angle)]
        })
        .collect()
}

/// A point as a key.
pub(crate) fn key(point: Point) -> [u64; 2] {
    point.map(f64::to_bits)
}

/// Rivers descend strictly, have the heights of their points, end on the outline or in another tree, and form trees.
pub(crate) fn assert_rivers(rivers: &[River], outline: &[Point]) {
    let edge = Outline::new(outline).unwrap();
    // A forest: edges that join two parts, never one that joins a part to itself.
    let mut parts: BTreeMap<[u64; 2], [u64; 2]> = BTreeMap::new();
    let root = |parts: &BTreeMap<[u64; 2], [u64; 2]>, point| {
        std::iter::successors(Some(key(point)), |point| parts.get(point).copied()).last().unwrap()
    };
    for (number, river) in rivers.iter().enumerate() {
        let River { points, heights, mouth } = river;
        assert!(points.len() == heights.len() && points.len() >= 2 && river.length() > 0.0);
        assert!(heights.windows(2).all(|pair| pair[1] < pair[0]));
        assert!(heights.iter().all(|h| (0.0..=1.0).contains(h)));
        let scale = edge.height(points[0]) / heights[0];
        for (&point, height) in points.iter().zip(heights) {
            assert!((edge.height(point) - height * scale).abs() < 1e-6);
        }
        let last = points[points.len() - 1];
        match mouth {
            Mouth::Border => assert!(edge.height(last).abs() < 1e-6),
            Mouth::Confluence => assert!(rivers[..number].iter().any(|other| other.points.contains(&last))),
        }
        for pair in points.windows(2) {
            let (a, b) = (root(&parts, pair[0]), root(&parts, pair[1]));
            assert_ne!(a, b);
            parts.insert(b, a);
        }
    }
}
