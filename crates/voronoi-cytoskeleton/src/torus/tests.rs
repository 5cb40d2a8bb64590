use super::*;
use crate::testing::{assert_rivers, cell, rng};
use crate::{River, Skeleton, SkeletonParams};

/// The shortest way between two points of the torus.
fn way(a: Point, b: Point) -> Point {
    sub(b, a).map(|c| c - (c + 0.5).floor())
}

#[test]
fn three_edges_meet_in_each_of_twice_as_many_vertices_as_sites() {
    for (sites, passes) in [(100, 0), (100, 2), (173, 1), (1200, 2)] {
        for seed in 0..5 {
            let torus = Torus::new(sites, passes, &mut rng(seed)).unwrap();
            // Euler on a torus: vertices − edges + cells = 0.
            assert_eq!(torus.vertices.len(), 2 * sites);
            for (vertex, ways) in torus.ways.iter().enumerate() {
                for &other in ways {
                    assert_ne!(other as usize, vertex);
                    assert!(torus.ways[other as usize].contains(&u32::try_from(vertex).unwrap()));
                    let edge = way(torus.vertices[vertex], torus.vertices[other as usize]);
                    assert!(length(edge) <= torus.longest * (1.0 + 1e-12));
                    assert!(torus.longest < 8.0 / (sites as f64).sqrt());
                }
            }
        }
    }
}

#[test]
fn every_vertex_inside_has_all_its_neighbours_in_their_places() {
    let torus = Torus::new(900, 2, &mut rng(3)).unwrap();
    let window = Window::rectangle([0.0, 0.0], [130.0, 90.0]).unwrap();
    let period = (window.area() * 3.0).sqrt();
    let mut rng = rng(4);
    for _ in 0..50 {
        let net = torus.place(&window, 300, &mut rng).unwrap();
        for (vertex, ways) in net.ways.iter().enumerate() {
            assert_eq!(window.contains(net.vertices[vertex]), vertex < net.inner);
            for &to in ways.iter().flatten() {
                let edge = length(sub(net.vertices[vertex], net.vertices[to as usize]));
                assert!(edge <= torus.longest * period * (1.0 + 1e-9));
            }
            assert_eq!(ways.iter().flatten().count(), if vertex < net.inner { DEGREE } else { 0 });
        }
    }
}

#[test]
fn rivers_on_a_torus_keep_the_laws_of_rivers() {
    let outline = cell(0.15);
    let skeleton = Skeleton::new(&SkeletonParams::default()).unwrap();
    let torus = Torus::new(1200, 2, &mut rng(8)).unwrap();
    let mut rng = rng(9);
    for _ in 0..40 {
        let rivers = skeleton.grow_from(&torus, &outline, &mut rng).unwrap();
        assert!(rivers.len() >= 5);
        assert_rivers(&rivers, &outline);
    }
}

#[test]
fn rivers_are_as_many_and_as_long_as_on_diagrams_of_their_own() {
    let outline = cell(0.15);
    let skeleton = Skeleton::new(&SkeletonParams::default()).unwrap();
    let tori = [10, 11, 12, 13].map(|seed| Torus::new(1200, 2, &mut rng(seed)).unwrap());
    let mut rng = rng(14);
    let mut sums = |own: bool| {
        let mut sums = [0.0; 3];
        for number in 0..400 {
            let rivers = match own {
                true => skeleton.grow(&outline, &mut rng).unwrap(),
                false => skeleton.grow_from(&tori[number % 4], &outline, &mut rng).unwrap(),
            };
            sums[0] += rivers.len() as f64;
            sums[1] += rivers.iter().map(River::length).sum::<f64>();
            sums[2] += rivers.iter().map(|river| river.points.len()).sum::<usize>() as f64;
        }
        sums
    };
    for (found, expected) in sums(false).into_iter().zip(sums(true)) {
        assert!((found / expected - 1.0).abs() < 0.04, "{found} {expected}");
    }
}

#[test]
fn long_windows_are_refused_and_grow_a_diagram_of_their_own() {
    let torus = Torus::new(900, 2, &mut rng(5)).unwrap();
    let long = [[0.0, 0.0], [400.0, 0.0], [400.0, 20.0], [0.0, 20.0]];
    assert!(torus.place(&Window::around(&long).unwrap(), 300, &mut rng(6)).is_none());
    let skeleton = Skeleton::new(&SkeletonParams::default()).unwrap();
    let found = skeleton.grow_from(&torus, &long, &mut rng(7)).unwrap();
    assert_eq!(found, skeleton.grow(&long, &mut rng(7)).unwrap());
}

#[test]
fn numbers_out_of_range_are_named() {
    for (sites, passes, start) in [(99, 2, "sites is 99"), (1_000_001, 2, "sites is"), (300, 10_001, "lloyd_passes is")]
    {
        assert!(Torus::new(sites, passes, &mut rng(0)).unwrap_err().to_string().starts_with(start));
    }
}
