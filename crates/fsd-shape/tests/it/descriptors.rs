//! Tests of Fourier shape descriptors.

use crate::support;
use std::f64::consts::{PI, TAU};

use fsd_shape::{Descriptors, Error, Point, resample, signed_area};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

/// Returns an irregular outline of `count` points around (3, −2).
fn shape(count: usize, seed: u64) -> Vec<Point> {
    let polygon = support::polygon(1.0, &support::CELL, &mut Xoshiro256PlusPlus::seed_from_u64(seed));
    resample(&polygon, count).iter().map(|p| [p[0] + 3.0, p[1] - 2.0]).collect()
}

fn close(a: &[Point], b: &[Point], tolerance: f64) {
    assert_eq!(a.len(), b.len());
    for (p, q) in a.iter().zip(b) {
        assert!((p[0] - q[0]).abs() < tolerance && (p[1] - q[1]).abs() < tolerance, "{p:?} {q:?}");
    }
}

fn same(a: &Descriptors, b: &Descriptors, tolerance: f64) {
    close(a.as_slice(), b.as_slice(), tolerance);
}

#[test]
fn descriptors_match_equation_2() {
    for count in [7, 12, 30] {
        let points = shape(count, 1);
        let descriptors = Descriptors::from_outline(&points).unwrap();
        let half = i32::try_from(count).unwrap() / 2;
        for l in -half..=half {
            let mut sum = [0.0, 0.0];
            for (k, p) in points.iter().enumerate() {
                let (s, c) = libm::sincos(-TAU * f64::from(l) * k as f64 / count as f64);
                sum = [sum[0] + p[0] * c - p[1] * s, sum[1] + p[0] * s + p[1] * c];
            }
            let share = if 2 * l.unsigned_abs() as usize == count { 2.0 } else { 1.0 };
            let u = descriptors.harmonic(l);
            close(&[u], &[sum.map(|v| v / (share * count as f64))], 1e-14);
        }
        assert_eq!(descriptors.harmonic(half + 1), [0.0, 0.0]);
        assert_eq!(descriptors.harmonic(i32::MIN), [0.0, 0.0]);
    }
}

#[test]
fn the_inverse_returns_the_outline() {
    for count in [3, 4, 5, 64, 97, 420] {
        let points = shape(count, 2);
        let descriptors = Descriptors::from_outline(&points).unwrap();
        close(&descriptors.outline(count), &points, 1e-12);
        // A multiple contains the same points, a half every second.
        let finer = descriptors.outline(3 * count);
        close(&finer.iter().step_by(3).copied().collect::<Vec<_>>(), &points, 1e-12);
        if count % 2 == 0 {
            let every_other: Vec<Point> = points.iter().step_by(2).copied().collect();
            close(&descriptors.outline(count / 2), &every_other, 1e-12);
        }
        assert!(descriptors.outline(0).is_empty());
        let centre = descriptors.harmonic(0);
        assert!((descriptors.outline(1)[0][0] - points[0][0]).abs() < 1e-12);
        assert!((centre[0] - 3.0).abs() < 1.0);
    }
}

#[test]
fn a_circle_is_u1_and_an_ellipse_u1_and_u_minus_1() {
    let at = |a: f64, b: f64| -> Vec<Point> {
        (0..64).map(|k| libm::sincos(TAU * f64::from(k) / 64.0)).map(|(s, c)| [a * c, b * s]).collect()
    };
    let circle = Descriptors::from_outline(&at(5.0, 5.0)).unwrap();
    assert!((circle.radius() - 5.0).abs() < 1e-14);
    assert!((circle.area() - 25.0 * PI).abs() < 1e-12);
    for l in (-32..=32).filter(|&l| l != 1) {
        assert!(circle.magnitude(l) < 1e-14);
    }
    let ellipse = Descriptors::from_outline(&at(7.0, 3.0)).unwrap();
    close(&[ellipse.harmonic(1), ellipse.harmonic(-1)], &[[5.0, 0.0], [2.0, 0.0]], 1e-14);
    assert!((ellipse.area() - 21.0 * PI).abs() < 1e-12);
    assert!((ellipse.radius() - 5.0).abs() < 1e-14);
}

#[test]
fn areas_are_exact() {
    let points = shape(81, 3);
    let descriptors = Descriptors::from_outline(&points).unwrap();
    // Area of the polygon through the K points: (K/2) Σ |uₗ|² sin(2πl/K).
    let sum: f64 = (-40..=40)
        .map(|l| descriptors.magnitude(l) * descriptors.magnitude(l) * libm::sin(TAU * f64::from(l) / 81.0))
        .sum();
    assert!((signed_area(&points) - 40.5 * sum).abs() < 1e-12);
    let fine = signed_area(&descriptors.outline(40_000));
    assert!((descriptors.area() - fine).abs() < 1e-5 * fine);
}

#[test]
fn operations_on_descriptors_are_operations_on_points() {
    for count in [60, 61] {
        let points = shape(count, 4);
        let of = |points: &[Point]| Descriptors::from_outline(points).unwrap();
        let descriptors = of(&points);
        let (sin, cos) = libm::sincos(0.7);
        let turned: Vec<Point> = points.iter().map(|p| [cos * p[0] - sin * p[1], sin * p[0] + cos * p[1]]).collect();
        same(&descriptors.rotated(0.7), &of(&turned), 1e-12);
        let scaled: Vec<Point> = points.iter().map(|p| [2.5 * p[0], 2.5 * p[1]]).collect();
        same(&descriptors.scaled(2.5), &of(&scaled), 1e-12);
        let moved: Vec<Point> = points.iter().map(|p| [p[0] + 9.0, p[1] - 4.0]).collect();
        same(&descriptors.translated([9.0, -4.0]), &of(&moved), 1e-12);
        let mut started = points.clone();
        started.rotate_left(13);
        same(&descriptors.shifted(13.0 / count as f64), &of(&started), 1e-12);
        let mut backwards = points.clone();
        backwards[1..].reverse();
        same(&descriptors.reversed(), &of(&backwards), 1e-12);
        assert!(descriptors.reversed().area() < 0.0);
        let mirrored: Vec<Point> = points.iter().map(|p| [p[0], -p[1]]).collect();
        same(&descriptors.reflected(), &of(&mirrored), 1e-12);
        same(&descriptors.reflected().reflected(), &descriptors, 1e-15);
    }
}

#[test]
fn equation_3_removes_position_and_size() {
    let descriptors = Descriptors::from_outline(&shape(50, 5)).unwrap();
    let normalised = descriptors.normalised();
    assert!((normalised.radius() - 1.0).abs() < 1e-15);
    assert_eq!(normalised.harmonic(0), [0.0, 0.0]);
    same(&descriptors.translated([5.0, 5.0]).scaled(3.0).normalised(), &normalised, 1e-13);
    // Without a first harmonic the scale does not change.
    let flat = Descriptors::from_harmonics(vec![[1.0, 0.0], [2.0, 0.0], [0.0, 0.0]]).unwrap();
    assert_eq!(flat.normalised().as_slice(), [[1.0, 0.0], [0.0, 0.0], [0.0, 0.0]]);
}

#[test]
fn alignment_removes_rotation_and_start_point() {
    for seed in 10..30 {
        let descriptors = Descriptors::from_outline(&shape(120, seed)).unwrap();
        let aligned = descriptors.aligned();
        for l in [1, -1] {
            assert_eq!(aligned.harmonic(l), [descriptors.magnitude(l), 0.0]);
        }
        assert!(aligned.harmonic(2)[0] >= 0.0);
        same(&aligned.aligned(), &aligned, 1e-12);
        assert!((aligned.area() - descriptors.area()).abs() < 1e-12);
        for (turn, start) in [(0.3, 0.2), (3.0, -0.4), (-2.0, 0.75), (PI, 0.5)] {
            same(&descriptors.rotated(turn).shifted(start).aligned(), &aligned, 1e-9);
        }
    }
}

#[test]
fn truncation_removes_only_the_highest_terms() {
    let descriptors = Descriptors::from_outline(&shape(101, 6)).unwrap();
    assert_eq!(descriptors.harmonics(), 50);
    let smooth = descriptors.truncated(7);
    assert_eq!(smooth.harmonics(), 7);
    for l in -7..=7 {
        assert_eq!(smooth.harmonic(l), descriptors.harmonic(l));
    }
    assert_eq!(descriptors.truncated(50), descriptors);
    assert_eq!(descriptors.truncated(500), descriptors);
    assert_eq!(descriptors.truncated(0).harmonics(), 1);
}

#[test]
fn invalid_outlines_are_rejected() {
    let of = |points: &[Point]| Descriptors::from_outline(points);
    assert_eq!(of(&[[0.0, 0.0], [1.0, 1.0]]), Err(Error::TooFewPoints { count: 2, needed: 3 }));
    assert_eq!(of(&[[0.0, 0.0], [1.0, f64::NAN], [2.0, 1.0]]), Err(Error::PointValue { index: 1 }));
    assert_eq!(of(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]), Err(Error::NoArea));
    for terms in [vec![], vec![[1.0, 0.0]], vec![[1.0, 0.0]; 4]] {
        assert!(matches!(Descriptors::from_harmonics(terms), Err(Error::Parameter { .. })));
    }
    assert!(Descriptors::from_harmonics(vec![[f64::INFINITY, 0.0]; 3]).is_err());
}

#[cfg(feature = "serde")]
#[test]
fn descriptors_round_trip_through_json() {
    let descriptors = Descriptors::from_outline(&shape(9, 7)).unwrap();
    let text = serde_json::to_string(&descriptors).unwrap();
    assert_eq!(serde_json::from_str::<Descriptors>(&text).unwrap(), descriptors);
    assert!(serde_json::from_str::<Descriptors>("[[1.0,0.0],[1.0,0.0]]").is_err());
}
