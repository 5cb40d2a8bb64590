use super::*;
use crate::geometry::{length, sub};
use crate::path::PathEnd;
use crate::testing::{assert_paths, cell, key, rng};
use std::collections::BTreeMap;

fn grow(params: SkeletonParams, outline: &[Point], seed: u64) -> Vec<DescentPath> {
    Skeleton::new(&params).unwrap().grow(outline, &mut rng(seed)).unwrap()
}

#[test]
fn default_parameters_are_the_papers() {
    let paper = SkeletonParams { sites: 300, lloyd_passes: 2, paths: 15, branch_probability: 0.2, start_above: 0.5 };
    assert_eq!(SkeletonParams::default(), paper);
}

#[test]
fn paths_are_trees_that_descend_from_high_vertices_to_the_outline() {
    let base = SkeletonParams::default();
    let springs = [0.0, 0.5, 0.9].map(|start_above| SkeletonParams { start_above, branch_probability: 0.0, ..base });
    let many = [0.0, 0.2, 1.0].map(|branch_probability| SkeletonParams { branch_probability, paths: 40, ..base });
    let few = [1, 2, 3, 4, 5].map(|sites| SkeletonParams { sites, ..base });
    for params in [&[base][..], &springs, &many, &few].concat() {
        for outline in [cell(0.0), cell(0.35)] {
            for seed in 0..20 {
                let paths = grow(params, &outline, seed);
                assert_paths(&paths, &outline);
                assert!(paths.len() >= 5 || params.sites < 300 || params.start_above > 0.5);
                if params.branch_probability == 0.0 {
                    assert!(paths.len() <= params.paths);
                    assert!(paths.iter().all(|path| path.heights[0] >= params.start_above));
                }
            }
        }
    }
}

#[test]
fn paths_follow_the_edges_of_steepest_descent() {
    let window = Window::rectangle([0.0, 0.0], [100.0, 80.0]).unwrap();
    let height = |[x, y]: Point| 60.0 - length([x - 50.0, y - 40.0]) - 0.1 * x;
    let params = SkeletonParams { branch_probability: 0.0, ..SkeletonParams::default() };
    let skeleton = Skeleton::new(&params).unwrap();
    let diagram = skeleton.diagram(&window, &mut rng(1)).unwrap();
    let mut ways: BTreeMap<[u64; 2], Vec<Point>> = BTreeMap::new();
    for edge in diagram.edges().iter().filter(|edge| edge.neighbour.is_some()) {
        let [a, b] = edge.ends.map(|vertex| diagram.vertices()[vertex]);
        ways.entry(key(a)).or_default().push(b);
        ways.entry(key(b)).or_default().push(a);
    }
    let paths = skeleton.paths(&diagram, height, &mut rng(2));
    assert!(!paths.is_empty());
    for path in paths {
        for pair in path.points.windows(2) {
            let slope = |&to: &Point| (height(pair[0]) - height(to)) / length(sub(to, pair[0]));
            let steepest = ways[&key(pair[0])].iter().max_by(|a, b| slope(a).total_cmp(&slope(b))).unwrap();
            // Where the height falls below 0, the last point is on the edge before its end.
            let way = sub(*steepest, pair[0]);
            let run = sub(pair[1], pair[0]);
            assert!((way[0] * run[1] - way[1] * run[0]).abs() < 1e-9 * length(way) * length(run));
            assert!(length(run) <= length(way) * (1.0 + 1e-12));
        }
    }
}

#[test]
fn paths_end_on_the_border_where_the_height_is_above_zero() {
    let window = Window::rectangle([0.0, 0.0], [100.0, 80.0]).unwrap();
    let height = |[x, y]: Point| 1000.0 - length([x - 50.0, y - 40.0]);
    let skeleton = Skeleton::new(&SkeletonParams::default()).unwrap();
    let paths = skeleton.grow_on(&window, height, &mut rng(3)).unwrap();
    assert!(paths.len() >= 5);
    for path in paths.iter().filter(|path| path.end == PathEnd::Border) {
        let [x, y] = path.points[path.points.len() - 1];
        let depth = x.min(100.0 - x).min(y).min(80.0 - y);
        assert!(depth.abs() < 1e-9);
    }
}

#[test]
fn branching_increases_the_number_of_paths() {
    let outline = &cell(0.0);
    let count = |branch_probability: f64| {
        let params = SkeletonParams { branch_probability, ..SkeletonParams::default() };
        (0..20).map(|seed| grow(params, outline, seed).len()).sum::<usize>()
    };
    let (none, some, all) = (count(0.0), count(0.2), count(1.0));
    assert!(none <= 20 * 15 && none > 20 * 5);
    assert!(some > none && all > some, "{none} {some} {all}");
}

#[test]
fn no_paths_without_start_vertices() {
    let outline = &cell(0.0);
    let none = SkeletonParams { paths: 0, ..SkeletonParams::default() };
    assert!(grow(none, outline, 0).is_empty());
    let window = Window::rectangle([0.0, 0.0], [10.0, 10.0]).unwrap();
    let skeleton = Skeleton::new(&SkeletonParams::default()).unwrap();
    for flat in [0.0, -3.0, 5.0, f64::NAN] {
        assert!(skeleton.grow_on(&window, |_| flat, &mut rng(0)).unwrap().is_empty());
    }
}

#[test]
fn bits_are_those_recorded() {
    // A change of this hash changes every image for a given seed.
    let paths = grow(SkeletonParams::default(), &cell(0.35), 0);
    let hash = paths
        .iter()
        .flat_map(|path| path.points.iter().flatten().chain(&path.heights))
        .fold(0u64, |hash, value| (hash ^ value.to_bits()).wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(29));
    assert_eq!((paths.len(), hash), (17, 9_528_974_140_830_678_547));
}

#[test]
fn out_of_range_parameters_are_reported() {
    let base = SkeletonParams::default();
    let cases = [
        ("sites = 0", SkeletonParams { sites: 0, ..base }),
        ("sites =", SkeletonParams { sites: usize::MAX, ..base }),
        ("lloyd_passes =", SkeletonParams { lloyd_passes: 10_001, ..base }),
        ("branch_probability = NaN", SkeletonParams { branch_probability: f64::NAN, ..base }),
        ("branch_probability = 1.5", SkeletonParams { branch_probability: 1.5, ..base }),
        ("start_above = -0.1", SkeletonParams { start_above: -0.1, ..base }),
        ("start_above = inf", SkeletonParams { start_above: f64::INFINITY, ..base }),
    ];
    for (start, params) in cases {
        let message = Skeleton::new(&params).unwrap_err().to_string();
        assert!(message.starts_with(start), "{message}");
    }
    let skeleton = Skeleton::new(&base).unwrap();
    assert!(skeleton.grow(&[[0.0, 0.0], [1.0, 1.0]], &mut rng(0)).is_err());
    assert!(skeleton.grow(&[[0.0, f64::NAN]; 5], &mut rng(0)).is_err());
    // Far from the origin a window of 1e-7 contains few different numbers, so that sites coincide.
    let far = Window::rectangle([1e9 - 2e-7, 1e9 - 2e-7], [1e9, 1e9]).unwrap();
    let error = skeleton.grow_on(&far, |_| 1.0, &mut rng(0)).unwrap_err();
    assert!(matches!(error, Error::Sites { given: 300, .. }), "{error}");
}
