use super::*;
use crate::testing::{draws, pentagon};

#[test]
fn both_orientations_give_the_same_window() {
    let square = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
    let mut reversed = square;
    reversed.reverse();
    for corners in [square, reversed] {
        let window = Window::convex(&corners).unwrap();
        assert_eq!(window.area(), 4.0);
        assert!(window.contains([1.0, 0.0]) && window.contains([1.9, 1.9]));
        assert!(!window.contains([2.1, 1.0]) && !window.contains([1.0, -1e-9]));
    }
    assert_eq!(Window::rectangle([2.0, 0.0], [0.0, 2.0]).unwrap().area(), 4.0);
}

#[test]
fn repeated_and_collinear_corners_are_accepted() {
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0], [0.0, 0.0]];
    let window = Window::convex(&corners).unwrap();
    assert_eq!((window.corners().len(), window.area()), (5, 2.0));
    let around = Window::around(&corners).unwrap();
    assert!(around.area() == 2.0 && corners.iter().all(|&point| around.contains(point)));
}

#[test]
fn draws_are_uniform() {
    let window = pentagon();
    let count = 40_000;
    let points = draws(&window, count, 0);
    assert!(points.iter().all(|&point| window.contains(point)));
    let moments = Moments::of(window.corners().iter().copied(), [0.0, 0.0]);
    for axis in 0..2 {
        let mean = points.iter().map(|point| point[axis]).sum::<f64>() / count as f64;
        let expected = moments.first[axis] / moments.area;
        // Standard deviation about 3.5, standard error 0.018; bound 4 standard errors.
        assert!((mean - expected).abs() < 0.07, "{mean} {expected}");
    }
}

#[test]
fn clip_returns_the_part_inside() {
    let window = pentagon();
    for i in 0..200 {
        let angle = f64::from(i) * 0.1;
        let direction = [libm::cos(angle), libm::sin(angle)];
        let origin = [f64::from(i % 17) - 0.63, f64::from(i % 13) + 0.21];
        let inside = |t: f64| window.contains(along(origin, direction, t));
        match window.clip(origin, direction, [f64::NEG_INFINITY, f64::INFINITY]) {
            Some([from, to]) => {
                assert!(inside((from + to) / 2.0));
                assert!(!inside(from - 1e-6) && !inside(to + 1e-6));
            }
            None => assert!((-400..400).all(|t| !inside(f64::from(t) * 0.1))),
        }
    }
}

#[test]
fn arc_length_increases_along_the_border() {
    let window = pentagon();
    let mut last = -1.0;
    for side in 0..5 {
        for step in 0..10 {
            let (from, to) = (window.corners[side], window.corners[(side + 1) % 5]);
            let point = along(from, sub(to, from), (f64::from(step) + 0.5) / 10.0);
            let arc_length = window.arc_length_of(point);
            assert!(arc_length > last && arc_length < window.arc_length[5]);
            last = arc_length;
        }
    }
}

#[test]
fn invalid_windows_are_reported() {
    let message = |corners: &[Point]| Window::convex(corners).unwrap_err().to_string();
    assert!(message(&[[0.0, 0.0], [1.0, f64::NAN], [1.0, 1.0]]).starts_with("window corner 1"));
    assert!(message(&[[0.0, 0.0], [1e10, 0.0], [1.0, 1.0]]).starts_with("window corner 1"));
    assert!(message(&[]).starts_with("the window of 0 points"));
    assert!(message(&[[0.0, 0.0], [1.0, 1.0]]).starts_with("the window of 2 points"));
    assert!(message(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]).starts_with("the window of 3 points"));
    let notched = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0, 1.0], [0.0, 4.0]];
    assert!(message(&notched).contains("not convex"));
    let star: Vec<Point> = (0..5)
        .map(|k| {
            let angle = f64::from(2 * k) * core::f64::consts::TAU / 5.0;
            [libm::cos(angle), libm::sin(angle)]
        })
        .collect();
    assert!(message(&star).contains("not convex"));
    assert!(Window::around(&[]).is_err());
    assert!(Window::around(&[[1.0, 1.0], [1.0, 5.0]]).is_err());
    assert!(Window::rectangle([0.0, 0.0], [f64::INFINITY, 1.0]).is_err());
}
