use super::*;
use crate::testing::{draws, lattice, rim, windows};

/// Asserts that the fast pass agrees with the diagram, relative to the size of a cell.
fn agree(sites: &[Point], window: &Window, tolerance: f64) {
    let mut slow = Diagram::new(sites, window).unwrap();
    slow.relax();
    let fast = relaxed(sites, window, 1).unwrap();
    let size = (window.area() / sites.len() as f64).sqrt();
    for (found, &expected) in fast.iter().zip(slow.sites()) {
        assert!(window.contains(*found));
        let error = length(sub(*found, expected)) / size;
        assert!(error < tolerance, "{found:?} {expected:?}: {error:e}, tolerance {tolerance:e}");
    }
}

#[test]
fn relaxed_sites_agree_with_the_diagram() {
    for window in windows() {
        for count in [1, 2, 3, 7, 40, 300, 1000] {
            for seed in 0..20 {
                agree(&draws(&window, count, seed), &window, 1e-7);
            }
        }
    }
}

#[test]
fn a_lattice_does_not_change() {
    let (sites, window) = lattice(20, 15);
    for (before, after) in sites.iter().zip(relaxed(&sites, &window, 3).unwrap()) {
        assert!(length(sub(after, *before)) < 1e-12);
    }
}

#[test]
fn sites_on_the_border_and_nearly_coincident_sites() {
    let window = Window::rectangle([0.0, 0.0], [10.0, 10.0]).unwrap();
    agree(&rim(), &window, 1e-7);
    for (seed, apart) in [1e-3, 1e-6, 1e-9].into_iter().enumerate() {
        let mut sites = draws(&window, 60, seed as u64);
        sites.extend((0..30).map(|i| [sites[i][0], (sites[i][1] - apart).abs()]).collect::<Vec<_>>());
        agree(&sites, &window, 1e-5);
    }
    for (seed, apart) in [0.0, 1e-15, 1e-13, 1e-11].into_iter().enumerate() {
        for window in windows() {
            let mut sites = draws(&window, 60, seed as u64);
            sites.extend(sites.clone().iter().map(|site| [site[0] + apart, site[1]]));
            sites.extend(window.corners());
            sites.retain(|&site| window.contains(site));
            let relaxed = relaxed(&sites, &window, 3).unwrap_or_default();
            assert!(relaxed.iter().all(|&site| window.contains(site)));
        }
    }
}

#[test]
fn cells_of_many_sides_need_the_triangulation() {
    let corner = |k: u32| core::f64::consts::TAU * f64::from(k) / 100.0;
    let corners: Vec<Point> = (0..100).map(|k| [libm::cos(corner(k)), libm::sin(corner(k))]).collect();
    let window = Window::convex(&corners).unwrap();
    assert_eq!(relaxed(&[[0.5, 0.25]], &window, 1), None);
    agree(&[[0.5, 0.25], [-0.5, 0.0], [0.0, 0.5], [0.0, -0.5], [0.1, 0.1]], &window, 1e-7);
}
