use super::*;
use crate::testing::{assert_paths, cell, rng};
use crate::{DescentPath, Skeleton, SkeletonParams};

/// Returns the shortest vector between two points of the torus.
fn way(a: Point, b: Point) -> Point {
    sub(b, a).map(|c| c - (c + 0.5).floor())
}

#[test]
fn each_site_has_two_vertices_of_three_edges() {
    for (sites, passes) in [(100, 0), (100, 2), (173, 1), (1200, 2)] {
        for seed in 0..5 {
            let torus = Torus::new(sites, passes, &mut rng(seed)).unwrap();
            // Euler on a torus: vertices − edges + cells = 0.
            assert_eq!(torus.vertices.len(), 2 * sites);
            for (vertex, neighbours) in torus.neighbours.iter().enumerate() {
                for &other in neighbours {
                    assert_ne!(other as usize, vertex);
                    assert!(torus.neighbours[other as usize].contains(&u32::try_from(vertex).unwrap()));
                    let edge = way(torus.vertices[vertex], torus.vertices[other as usize]);
                    assert!(length(edge) <= torus.longest * (1.0 + 1e-12));
                    assert!(torus.longest < 8.0 / (sites as f64).sqrt());
                }
            }
        }
    }
}

#[test]
fn vertices_inside_have_all_their_neighbours() {
    let torus = Torus::new(900, 2, &mut rng(3)).unwrap();
    let window = Window::rectangle([0.0, 0.0], [130.0, 90.0]).unwrap();
    let period = (window.area() * 3.0).sqrt();
    let mut rng = rng(4);
    for _ in 0..50 {
        let graph = torus.place(&window, 300, &mut rng).unwrap();
        for (vertex, neighbours) in graph.neighbours.iter().enumerate() {
            assert_eq!(window.contains(graph.vertices[vertex]), vertex < graph.inner);
            for &to in neighbours.iter().flatten() {
                let edge = length(sub(graph.vertices[vertex], graph.vertices[to as usize]));
                assert!(edge <= torus.longest * period * (1.0 + 1e-9));
            }
            assert_eq!(neighbours.iter().flatten().count(), if vertex < graph.inner { DEGREE } else { 0 });
        }
    }
}

#[test]
fn paths_on_a_torus_are_descending_trees() {
    let outline = cell(0.15);
    let skeleton = Skeleton::new(&SkeletonParams::default()).unwrap();
    let torus = Torus::new(1200, 2, &mut rng(8)).unwrap();
    let mut rng = rng(9);
    for _ in 0..40 {
        let paths = skeleton.grow_from(&torus, &outline, &mut rng).unwrap();
        assert!(paths.len() >= 5);
        assert_paths(&paths, &outline);
    }
}

#[test]
fn paths_on_a_torus_have_the_number_and_length_of_those_on_diagrams() {
    let outline = cell(0.15);
    let skeleton = Skeleton::new(&SkeletonParams::default()).unwrap();
    let tori = [10, 11, 12, 13].map(|seed| Torus::new(1200, 2, &mut rng(seed)).unwrap());
    let mut rng = rng(14);
    let mut sums = |own: bool| {
        let mut sums = [0.0; 3];
        for number in 0..400 {
            let paths = match own {
                true => skeleton.grow(&outline, &mut rng).unwrap(),
                false => skeleton.grow_from(&tori[number % 4], &outline, &mut rng).unwrap(),
            };
            sums[0] += paths.len() as f64;
            sums[1] += paths.iter().map(DescentPath::length).sum::<f64>();
            sums[2] += paths.iter().map(|path| path.points.len()).sum::<usize>() as f64;
        }
        sums
    };
    for (found, expected) in sums(false).into_iter().zip(sums(true)) {
        assert!((found / expected - 1.0).abs() < 0.04, "{found} {expected}");
    }
}

#[test]
fn long_windows_use_a_new_diagram() {
    let torus = Torus::new(900, 2, &mut rng(5)).unwrap();
    let long = [[0.0, 0.0], [400.0, 0.0], [400.0, 20.0], [0.0, 20.0]];
    assert!(torus.place(&Window::around(&long).unwrap(), 300, &mut rng(6)).is_none());
    let skeleton = Skeleton::new(&SkeletonParams::default()).unwrap();
    let found = skeleton.grow_from(&torus, &long, &mut rng(7)).unwrap();
    assert_eq!(found, skeleton.grow(&long, &mut rng(7)).unwrap());
}

#[test]
fn out_of_range_numbers_are_reported() {
    for (sites, passes, start) in [(99, 2, "sites = 99"), (1_000_001, 2, "sites ="), (300, 10_001, "lloyd_passes =")] {
        assert!(Torus::new(sites, passes, &mut rng(0)).unwrap_err().to_string().starts_with(start));
    }
}
