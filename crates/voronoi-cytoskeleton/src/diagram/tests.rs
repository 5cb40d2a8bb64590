use super::*;
use crate::geometry::{bounds, cross, dot, length, sub};
use crate::testing::{draws, lattice, rim, windows};
use portable_numerics::statistics::deviation;
use std::collections::BTreeMap;

fn random(window: &Window, count: usize, seed: u64) -> Diagram {
    Diagram::new(&draws(window, count, seed), window).unwrap()
}

fn diagrams() -> Vec<Diagram> {
    let mut diagrams: Vec<Diagram> = windows()
        .iter()
        .flat_map(|window| [1, 2, 3, 4, 7, 50, 300].map(|count| random(window, count, count as u64)))
        .collect();
    // Every circumcircle contains four sites, and many edges are perpendicular to the border.
    let (sites, window) = lattice(9, 7);
    diagrams.push(Diagram::new(&sites, &window).unwrap());
    // Collinear sites, and sites on the border.
    let window = Window::rectangle([0.0, 0.0], [10.0, 10.0]).unwrap();
    let line: Vec<Point> = (0..10).map(|i| [f64::from(i) + 0.25, 5.0]).collect();
    diagrams.extend([line, rim()].map(|sites| Diagram::new(&sites, &window).unwrap()));
    diagrams
}

#[test]
fn edges_and_cells_are_consistent() {
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
        // Euler's formula.
        let (v, e, f) = (diagram.vertices().len(), diagram.edges().len(), diagram.sites().len());
        assert_eq!(v + f, e + 1, "{v} vertices, {e} edges, {f} cells");
    }
}

#[test]
fn cells_agree_with_clipping_by_every_bisector() {
    // Reference implementation: the window clipped by the bisectors with all other sites.
    for diagram in diagrams() {
        for (cell, &site) in diagram.sites().iter().enumerate() {
            let mut polygon = diagram.window().corners().to_vec();
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
            let [low, high] = bounds(diagram.window().corners());
            let (scale, size) = (1e-9 * diagram.window().area(), length(sub(high, low)));
            assert!((found.area - expected.area).abs() < scale);
            assert!((0..2).all(|axis| (found.first[axis] - expected.first[axis]).abs() < scale * size));
            assert!((found.second - expected.second).abs() < scale * size * size);
        }
    }
}

#[test]
fn relaxation_reduces_the_energy_and_the_variation_of_areas() {
    for (seed, window) in windows().iter().enumerate() {
        let mut diagram = random(window, 200, seed as u64);
        let spread = |diagram: &Diagram| deviation(&(0..200).map(|cell| diagram.area(cell)).collect::<Vec<_>>());
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
fn a_centroidal_diagram_does_not_change() {
    let (sites, window) = lattice(9, 7);
    let mut diagram = Diagram::new(&sites, &window).unwrap();
    diagram.relax();
    assert!(sites.iter().zip(diagram.sites()).all(|(&before, &after)| length(sub(after, before)) < 1e-12));
}

#[test]
fn energy_is_the_integral_of_the_squared_distance() {
    let window = Window::rectangle([0.0, 0.0], [1.0, 1.0]).unwrap();
    let single = Diagram::new(&[[0.5, 0.5]], &window).unwrap();
    assert!((single.energy() - 1.0 / 6.0).abs() < 1e-15);
    assert_eq!(single.cell(0).len(), 4);
}

#[test]
fn border_vertices_are_on_the_border() {
    for diagram in diagrams() {
        let window = diagram.window();
        for (vertex, &point) in diagram.vertices().iter().enumerate() {
            let depths = window.sides().map(|(corner, side)| cross(side, sub(point, corner)) / length(side));
            let depth = depths.fold(f64::INFINITY, f64::min);
            if diagram.is_on_border(vertex) {
                assert!(depth.abs() < 1e-9 * window.area().sqrt());
            } else {
                assert!(depth >= 0.0);
            }
        }
    }
}

#[test]
fn invalid_sites_are_reported() {
    let window = Window::rectangle([0.0, 0.0], [10.0, 10.0]).unwrap();
    let message = |sites: &[Point]| Diagram::new(sites, &window).unwrap_err().to_string();
    assert!(message(&[]).starts_with("sites: 0"));
    assert!(message(&[[1.0, 1.0], [2.0, 2.0], [1.0, 1.0]]).starts_with("sites: 3, different positions: 2"));
    assert!(message(&[[1.0, 1.0], [f64::NAN, 2.0]]).starts_with("site 1 = [NaN, 2]"));
    assert!(message(&[[1.0, 1.0], [2.0, f64::NEG_INFINITY]]).starts_with("site 1 ="));
    assert!(message(&[[1.0, 1.0], [11.0, 2.0]]).starts_with("site 1 at [11, 2] is outside"));
    // Replaced by 0, because it is too small for the triangulation.
    assert!(Diagram::new(&[[1e-300, 0.0], [2.0, 2.0]], &window).is_ok());
}
