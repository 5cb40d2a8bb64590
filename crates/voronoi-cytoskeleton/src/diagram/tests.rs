use super::*;
use crate::geometry::{cross, dot, length, sub};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;
use std::collections::BTreeMap;

const SEED: u64 = 0x0064_6961_6772_616d;

fn windows() -> Vec<Window> {
    vec![
        Window::rectangle([0.0, 0.0], [200.0, 120.0]).unwrap(),
        Window::rectangle([-1000.5, 3000.0], [-900.0, 3000.25]).unwrap(),
        Window::convex(&[[0.0, 0.0], [10.0, -2.0], [14.0, 6.0], [6.0, 12.0], [-1.0, 8.0]]).unwrap(),
        Window::convex(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]).unwrap(),
    ]
}

fn random(window: &Window, count: usize, seed: u64) -> Diagram {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(SEED ^ seed);
    let sites: Vec<Point> = (0..count).map(|_| window.draw(&mut rng)).collect();
    Diagram::new(&sites, window).unwrap()
}

/// Sites on a lattice: every circumcircle passes through four of them, and many edges end in the border at right angles.
fn lattice() -> Diagram {
    let window = Window::rectangle([0.0, 0.0], [9.0, 7.0]).unwrap();
    let sites: Vec<Point> = (0..63).map(|i| [f64::from(i % 9) + 0.5, f64::from(i / 9) + 0.5]).collect();
    Diagram::new(&sites, &window).unwrap()
}

fn diagrams() -> Vec<Diagram> {
    let mut diagrams: Vec<Diagram> = windows()
        .iter()
        .flat_map(|window| [1, 2, 3, 4, 7, 50, 300].map(|count| random(window, count, count as u64)))
        .collect();
    diagrams.push(lattice());
    // Sites on one line, and close to the border.
    let window = Window::rectangle([0.0, 0.0], [10.0, 10.0]).unwrap();
    let line: Vec<Point> = (0..10).map(|i| [f64::from(i) + 0.25, 5.0]).collect();
    diagrams.push(Diagram::new(&line, &window).unwrap());
    let rim: Vec<Point> = (0..40).map(|i| [f64::from(i % 20) * 0.5, f64::from(i / 20) * 10.0]).collect();
    diagrams.push(Diagram::new(&rim, &window).unwrap());
    diagrams
}

#[test]
fn areas_sum_to_the_window() {
    for diagram in diagrams() {
        let sum: f64 = (0..diagram.sites().len()).map(|cell| diagram.area(cell)).sum();
        assert!((sum / diagram.window().area() - 1.0).abs() < 1e-9);
    }
}

#[test]
fn cells_are_convex_and_hold_their_sites() {
    for diagram in diagrams() {
        for (cell, &site) in diagram.sites().iter().enumerate() {
            let corners: Vec<Point> = diagram.corners(cell).collect();
            assert!(corners.len() >= 3);
            for (i, &corner) in corners.iter().enumerate() {
                let side = sub(corners[(i + 1) % corners.len()], corner);
                let scale = diagram.window().area();
                assert!(cross(side, sub(site, corner)) >= -1e-9 * scale);
                for &other in &corners {
                    assert!(cross(side, sub(other, corner)) >= -1e-9 * scale);
                }
            }
        }
    }
}

#[test]
fn vertices_are_nearest_to_the_sites_of_their_cells() {
    // Which is the empty circumcircle: around a vertex, no site lies nearer than those whose cells meet in it.
    for diagram in diagrams() {
        let scale = diagram.window().area().sqrt();
        let distance = |vertex: usize, site: Point| length(sub(diagram.vertices()[vertex], site));
        for (cell, &site) in diagram.sites().iter().enumerate() {
            for &vertex in diagram.cell(cell) {
                let nearest = diagram.sites().iter().map(|&site| distance(vertex, site)).fold(f64::INFINITY, f64::min);
                assert!(distance(vertex, site) - nearest < 1e-8 * scale);
            }
        }
    }
}

#[test]
fn points_lie_in_the_cells_of_their_nearest_sites() {
    for (seed, window) in windows().iter().enumerate() {
        let diagram = random(window, 80, seed as u64);
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(SEED);
        for _ in 0..500 {
            let point = window.draw(&mut rng);
            let square = |&cell: &usize| {
                let way = sub(diagram.sites()[cell], point);
                dot(way, way)
            };
            let nearest = (0..80).min_by(|a, b| square(a).total_cmp(&square(b))).unwrap();
            let corners: Vec<Point> = diagram.corners(nearest).collect();
            for (i, &corner) in corners.iter().enumerate() {
                let side = sub(corners[(i + 1) % corners.len()], corner);
                assert!(cross(side, sub(point, corner)) >= -1e-9 * window.area());
            }
        }
    }
}

#[test]
fn euler() {
    for diagram in diagrams() {
        let (v, e, f) = (diagram.vertices().len(), diagram.edges().len(), diagram.sites().len());
        assert_eq!(v + f, e + 1, "{v} vertices, {e} edges, {f} cells");
    }
}

#[test]
fn edges_and_cells_tell_the_same() {
    for diagram in diagrams() {
        let mut sides: BTreeMap<[usize; 2], usize> = BTreeMap::new();
        for cell in 0..diagram.sites().len() {
            let vertices = diagram.cell(cell);
            for (i, &vertex) in vertices.iter().enumerate() {
                assert_eq!(sides.insert([vertex, vertices[(i + 1) % vertices.len()]], cell), None);
            }
        }
        let mut uses = 0;
        for edge in diagram.edges() {
            let [a, b] = edge.ends;
            assert_eq!(sides.get(&[a, b]), Some(&edge.cell));
            assert_eq!(sides.get(&[b, a]).copied(), edge.neighbour);
            uses += 1 + usize::from(edge.neighbour.is_some());
        }
        assert_eq!(uses, sides.len());
    }
}

#[test]
fn agrees_with_the_clipping_of_every_bisector() {
    // The ten-line oracle: the window, cut by the bisector against every other site.
    for (seed, window) in windows().iter().enumerate() {
        let diagram = random(window, 60, seed as u64);
        for (cell, &site) in diagram.sites().iter().enumerate() {
            let mut polygon = window.corners().to_vec();
            for &other in diagram.sites().iter().filter(|&&other| other != site) {
                let middle = [(site[0] + other[0]) / 2.0, (site[1] + other[1]) / 2.0];
                let side = |p: Point| dot(sub(p, middle), sub(other, site));
                let mut kept = Vec::new();
                for (i, &b) in polygon.iter().enumerate() {
                    let a = polygon[(i + polygon.len() - 1) % polygon.len()];
                    let (from, to) = (side(a), side(b));
                    if (from > 0.0) != (to > 0.0) {
                        let t = from / (from - to);
                        kept.push([a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]);
                    }
                    if to <= 0.0 {
                        kept.push(b);
                    }
                }
                polygon = kept;
            }
            let expected = Moments::of(polygon.iter().copied(), site);
            let found = diagram.moments(cell);
            let scale = window.area();
            assert!((found.area - expected.area).abs() < 1e-9 * scale);
            assert!((found.second - expected.second).abs() < 1e-9 * scale * scale);
        }
    }
}

#[test]
fn relaxing_never_raises_the_energy_and_evens_the_cells() {
    for (seed, window) in windows().iter().enumerate() {
        let mut diagram = random(window, 200, seed as u64);
        let spread = |diagram: &Diagram| {
            let mean = window.area() / 200.0;
            let squares = (0..200).map(|cell| (diagram.area(cell) / mean - 1.0) * (diagram.area(cell) / mean - 1.0));
            (squares.sum::<f64>() / 200.0).sqrt()
        };
        let (before, mut energy) = (spread(&diagram), diagram.energy());
        for _ in 0..30 {
            diagram.relax();
            let next = diagram.energy();
            assert!(next <= energy * (1.0 + 1e-12), "{next} {energy}");
            energy = next;
            assert!(diagram.sites().iter().all(|&site| window.contains(site)));
        }
        assert!(spread(&diagram) < before / 2.0);
    }
}

#[test]
fn a_centroidal_diagram_stays() {
    let mut diagram = lattice();
    let sites = diagram.sites().to_vec();
    diagram.relax();
    for (before, after) in sites.iter().zip(diagram.sites()) {
        assert!(length(sub(*after, *before)) < 1e-12);
    }
}

#[test]
fn energy_is_the_squared_distance_to_the_nearest_site() {
    let window = Window::rectangle([0.0, 0.0], [1.0, 1.0]).unwrap();
    let single = Diagram::new(&[[0.5, 0.5]], &window).unwrap();
    assert!((single.energy() - 1.0 / 6.0).abs() < 1e-15);
    assert_eq!(single.cell(0).len(), 4);
}

#[test]
fn border_vertices_lie_on_the_border() {
    for diagram in diagrams() {
        let window = diagram.window();
        for (vertex, &point) in diagram.vertices().iter().enumerate() {
            let corners = window.corners();
            let depth = (0..corners.len())
                .map(|i| {
                    let side = sub(corners[(i + 1) % corners.len()], corners[i]);
                    cross(side, sub(point, corners[i])) / length(side)
                })
                .fold(f64::INFINITY, f64::min);
            if diagram.is_on_border(vertex) {
                assert!(depth.abs() < 1e-9 * window.area().sqrt());
            } else {
                assert!(depth >= 0.0);
            }
        }
    }
}

#[test]
fn refused_sites_say_why() {
    let window = Window::rectangle([0.0, 0.0], [10.0, 10.0]).unwrap();
    let message = |sites: &[Point]| Diagram::new(sites, &window).unwrap_err().to_string();
    assert!(message(&[]).starts_with("0 sites"));
    assert!(message(&[[1.0, 1.0], [2.0, 2.0], [1.0, 1.0]]).starts_with("3 sites lie in 2"));
    assert!(message(&[[1.0, 1.0], [f64::NAN, 2.0]]).starts_with("site 1 is [NaN, 2]"));
    assert!(message(&[[1.0, 1.0], [2.0, f64::NEG_INFINITY]]).starts_with("site 1 is"));
    assert!(message(&[[1.0, 1.0], [11.0, 2.0]]).starts_with("site 1 at [11, 2] lies outside"));
    // Too small for the triangulation, and zero for every purpose.
    assert!(Diagram::new(&[[1e-300, 0.0], [2.0, 2.0]], &window).is_ok());
}
