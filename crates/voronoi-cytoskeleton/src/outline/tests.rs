use super::*;
use crate::Window;
use crate::testing::draws;

/// Returns a concave star.
fn star(count: u32) -> Vec<Point> {
    (0..count)
        .map(|k| {
            let angle = core::f64::consts::TAU * f64::from(k) / f64::from(count);
            let radius = 50.0 + 15.0 * libm::cos(5.0 * angle);
            [100.0 + radius * libm::cos(angle), 80.0 + radius * libm::sin(angle)]
        })
        .collect()
}

fn oracle(points: &[Point], p: Point) -> f64 {
    let (mut nearest, mut inside) = (f64::INFINITY, false);
    for (i, &a) in points.iter().enumerate() {
        let b = points[(i + 1) % points.len()];
        let d = sub(b, a);
        let t = (dot(sub(p, a), d) / dot(d, d).max(1e-300)).clamp(0.0, 1.0);
        nearest = nearest.min(length([p[0] - a[0] - t * d[0], p[1] - a[1] - t * d[1]]));
        if (a[1] <= p[1]) != (b[1] <= p[1]) && p[0] < a[0] + (p[1] - a[1]) * d[0] / d[1] {
            inside = !inside;
        }
    }
    if inside { nearest } else { -nearest }
}

#[test]
fn heights_agree_with_brute_force() {
    let square = vec![[40.0, 40.0], [140.0, 40.0], [140.0, 40.0], [140.0, 120.0], [40.0, 120.0]];
    let outlines = [star(3), star(7), star(8), star(9), star(64), star(65), star(421), square];
    let around = Window::rectangle([0.0, 0.0], [200.0, 160.0]).unwrap();
    for points in outlines {
        let outline = Outline::new(&points).unwrap();
        let random = draws(&around, 500, points.len() as u64);
        // Random points, and points at the same y as corners.
        let level: Vec<Point> = points.iter().map(|p| [p[0] - 7.25, p[1]]).collect();
        for point in random.into_iter().chain(level) {
            let (found, expected) = (outline.height(point), oracle(&points, point));
            assert!((found - expected).abs() < 1e-9, "{point:?}: {found} {expected}");
        }
    }
}

#[test]
fn invalid_outlines_are_reported() {
    let message = |points: &[Point]| Outline::new(points).unwrap_err().to_string();
    assert!(message(&[]).starts_with("the outline of 0 points"));
    assert!(message(&[[0.0, 0.0], [1.0, 0.0]]).starts_with("the outline of 2 points"));
    assert!(message(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]).starts_with("the outline of 3 points"));
    assert!(message(&[[0.0, 0.0], [1.0, f64::NAN], [2.0, 2.0]]).starts_with("outline point 1"));
}
