//! Masks as polygons along pixel edges: pixel (x, y) is the square from (x, y) to (x + 1, y + 1). Also masks as
//! GeoJSON: a cell is one feature with its nucleus (`nucleusGeometry`), everything else is a detection.

use papsynth::truth::{Mask, ObjectTruth, Part};
use serde::Serialize;
use serde_json::{Value, json};

use super::frame::category_name;
use crate::bytes::sha256;

/// Corners of a closed line without duplicates; the last is joined to the first. The inside is to the right.
pub(crate) type Ring = Vec<[u32; 2]>;

/// East, south, west, north: clockwise.
const STEPS: [[isize; 2]; 4] = [[1, 0], [0, 1], [-1, 0], [0, -1]];

/// Marks a corner where a ring turned before: two of its pixels touch there.
const PASSED: u8 = 1 << 4;

/// The pixel edges on the border of a mask, by their start corner.
struct Edges {
    /// For each corner, bit `d` for an edge that leaves in direction `d`, and [`PASSED`] after a ring turned there.
    leaving: Vec<u8>,
    /// Number of corners in a row.
    width: usize,
    /// The upper left corner.
    origin: [u32; 2],
}

impl Edges {
    fn of(mask: &Mask) -> Option<Self> {
        let bounds = mask.bounds()?;
        let origin = [bounds.x, bounds.y];
        let (width, height) = (bounds.width as usize + 1, bounds.height as usize + 1);
        let mut leaving = vec![0_u8; width * height];
        for run in mask.runs() {
            let row = (run.y - origin[1]) as usize * width;
            let [from, to] = [run.x0 - origin[0], run.x1 - origin[0]].map(|x| row + x as usize);
            // A lower edge of the row above and an upper edge of this row cancel: they are inside.
            for corner in from..to {
                toggle(&mut leaving, [corner, corner + 1], 0);
                toggle(&mut leaving, [corner + width + 1, corner + width], 2);
            }
            leaving[from + width] |= 1 << 3;
            leaving[to] |= 1 << 1;
        }
        Some(Self { leaving, width, origin })
    }

    /// Removes and returns the next edge at a corner: the sharpest turn to the right, so that pixels that touch only at
    /// a corner are separate.
    fn take(&mut self, corner: usize, arrived: usize) -> Option<usize> {
        let direction = [1, 0, 3].into_iter().map(|turn| (arrived + turn) % 4);
        let direction = direction.into_iter().find(|d| self.leaving[corner] >> d & 1 == 1)?;
        self.leaving[corner] &= !(1 << direction);
        Some(direction)
    }

    fn step(&self, corner: usize, direction: usize) -> usize {
        let [dx, dy] = STEPS[direction];
        corner.wrapping_add_signed(dx + dy * self.width.cast_signed())
    }

    fn place(&self, corner: usize) -> [u32; 2] {
        let [x, y] = [corner % self.width, corner / self.width].map(|v| u32::try_from(v).unwrap_or(u32::MAX));
        [x + self.origin[0], y + self.origin[1]]
    }
}

/// Adds an edge, or removes the opposite edge from end to start.
fn toggle(leaving: &mut [u8], [start, end]: [usize; 2], direction: usize) {
    let opposite = 1 << ((direction + 2) % 4);
    if leaving[end] & opposite != 0 {
        leaving[end] &= !opposite;
    } else {
        leaving[start] |= 1 << direction;
    }
}

/// Returns the outlines of all parts of a mask and of their holes, sorted by their first corner from top to bottom and
/// left to right. The first edge runs east. An outline that touches itself at a corner is split, so that each one is
/// simple, as GeoJSON and OGC Simple Features require.
pub(crate) fn outlines(mask: &Mask) -> Vec<Ring> {
    let Some(mut edges) = Edges::of(mask) else { return Vec::new() };
    let mut rings = Vec::new();
    for start in 0..edges.leaving.len() {
        while edges.leaving[start] & 1 == 1 {
            edges.leaving[start] &= !1;
            edges.leaving[start] |= PASSED;
            let (mut ring, mut corner, mut direction) = (vec![edges.place(start)], edges.step(start, 0), 0);
            while corner != start {
                // Each corner has as many edges that leave as edges that arrive.
                let Some(next) = edges.take(corner, direction) else { break };
                if next != direction {
                    let place = edges.place(corner);
                    if edges.leaving[corner] & PASSED != 0 {
                        // The corners since the first visit are a separate ring.
                        if let Some(first) = ring.iter().position(|&other| other == place) {
                            rings.push(from_the_top(ring.split_off(first)));
                        }
                    }
                    edges.leaving[corner] |= PASSED;
                    ring.push(place);
                }
                (corner, direction) = (edges.step(corner, next), next);
            }
            rings.push(ring);
        }
    }
    rings.sort_unstable_by_key(|ring| [ring[0][1], ring[0][0]]);
    rings
}

/// Rotates a ring to start at its first corner in row-major order with an edge to the east.
fn from_the_top(mut ring: Ring) -> Ring {
    let east = |&i: &usize| ring[(i + 1) % ring.len()][0] > ring[i][0];
    let first = (0..ring.len()).filter(east).min_by_key(|&i| [ring[i][1], ring[i][0]]);
    ring.rotate_left(first.unwrap_or_default());
    ring
}

/// Returns the parts of a mask: for each the outline, then those of its holes.
fn polygons(mask: &Mask) -> Vec<Vec<Ring>> {
    let (outer, holes): (Vec<_>, Vec<_>) = outlines(mask).into_iter().partition(|ring| twice_area(ring) > 0);
    let mut parts: Vec<Vec<Ring>> = outer.into_iter().map(|ring| vec![ring]).collect();
    for hole in holes {
        // The pixel below the first edge is inside the part.
        let around = parts.iter_mut().filter(|part| contains(&part[0], hole[0])).min_by_key(|p| twice_area(&p[0]));
        if let Some(part) = around {
            part.push(hole);
        }
    }
    parts
}

/// Returns twice the area, positive if the inside is to the right.
fn twice_area(ring: &Ring) -> i64 {
    let next = ring.iter().cycle().skip(1);
    ring.iter().zip(next).map(|(a, b)| i64::from(a[0]) * i64::from(b[1]) - i64::from(b[0]) * i64::from(a[1])).sum()
}

fn contains(ring: &Ring, [x, y]: [u32; 2]) -> bool {
    let next = ring.iter().cycle().skip(1);
    let crossed =
        ring.iter().zip(next).filter(|(a, b)| a[0] == b[0] && a[0] <= x && y >= a[1].min(b[1]) && y < a[1].max(b[1]));
    crossed.count() % 2 == 1
}

/// Features of objects as GeoJSON.
#[derive(Debug, Serialize)]
#[serde(tag = "type", rename = "FeatureCollection")]
pub(crate) struct Collection {
    features: Vec<Feature>,
}

#[derive(Debug, Serialize)]
#[serde(tag = "type")]
struct Feature {
    id: String,
    geometry: Shape,
    properties: Value,
    #[serde(rename = "nucleusGeometry", skip_serializing_if = "Option::is_none")]
    nucleus: Option<Shape>,
}

/// The geometry of a mask.
#[derive(Debug, Serialize)]
#[serde(tag = "type", content = "coordinates")]
enum Shape {
    Polygon(Vec<Ring>),
    MultiPolygon(Vec<Vec<Ring>>),
}

/// Returns the features of these objects. `name` returns a unique name, `measure` the measurements of an object and of
/// its nucleus.
pub(crate) fn collection(
    objects: &[&ObjectTruth],
    name: impl Fn(&ObjectTruth) -> String,
    measure: impl Fn(&ObjectTruth, Option<&ObjectTruth>) -> Value,
) -> Collection {
    let find = |id: u32, part: Part| objects.iter().copied().find(|o| o.id == id && o.part == part);
    // A nucleus is part of its cell, if the image shows the cell.
    let own = objects.iter().filter(|o| o.part != Part::Nucleus || find(o.id, Part::Cytoplasm).is_none());
    let features = own.map(|object| {
        let is_cell = object.part == Part::Cytoplasm;
        let nucleus = find(object.id, Part::Nucleus).filter(|_| is_cell);
        let class = if is_cell { object.class.clone() } else { category_name(&object.class, object.part) };
        Feature {
            id: uuid(&name(object)),
            geometry: shape(&object.amodal),
            properties: json!({
                "objectType": if is_cell { "cell" } else { "detection" },
                "name": object.id.to_string(),
                "classification": { "name": class },
                "measurements": measure(object, nucleus),
            }),
            nucleus: nucleus.map(|nucleus| shape(&nucleus.amodal)),
        }
    });
    Collection { features: features.collect() }
}

/// Returns a polygon, or several if the mask has several parts.
fn shape(mask: &Mask) -> Shape {
    let mut parts = polygons(mask);
    // GeoJSON repeats the first corner.
    for ring in parts.iter_mut().flatten() {
        ring.extend(ring.first().copied());
    }
    match parts.len() {
        1 => Shape::Polygon(parts.remove(0)),
        _ => Shape::MultiPolygon(parts),
    }
}

/// Returns a UUID derived from a name.
fn uuid(name: &str) -> String {
    let hex = sha256(name.as_bytes());
    // Version 8 (custom) and variant 8 of RFC 9562.
    format!("{}-{}-8{}-8{}-{}", &hex[..8], &hex[8..12], &hex[13..16], &hex[17..20], &hex[20..32])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn mask(rows: &[&str]) -> Mask {
        let tile: Vec<f32> = rows.iter().flat_map(|r| r.bytes().map(|b| f32::from(u8::from(b == b'#')))).collect();
        Mask::from_tile(&tile, rows[0].len(), [0, 0], rows[0].len(), rows.len(), |v| v > 0.5)
    }

    #[test]
    fn rings_islands_and_touching_corners_are_separate_parts() {
        let parts = polygons(&mask(&["#####.", "#...#.", "#.#.#.", "#...#.", "#####.", ".....#"]));
        let areas: Vec<Vec<i64>> = parts.iter().map(|part| part.iter().map(|r| twice_area(r) / 2).collect()).collect();
        assert_eq!(areas, [vec![25, -9], vec![1], vec![1]]);
        assert_eq!(parts[1][0], [[2, 2], [3, 2], [3, 3], [2, 3]]);
        assert_eq!(parts[2][0], [[5, 5], [6, 5], [6, 6], [5, 6]]);
        assert!(polygons(&Mask::default()).is_empty());
        // Pixels that touch at a corner and are joined elsewhere enclose a hole up to that corner.
        let parts = polygons(&mask(&["###", "#.#", "##."]));
        let areas: Vec<Vec<i64>> = parts.iter().map(|part| part.iter().map(|r| twice_area(r) / 2).collect()).collect();
        assert_eq!(areas, [vec![8, -1]]);
        assert!(parts[0].iter().all(|ring| ring.contains(&[2, 2])));
    }

    proptest! {
        #[test]
        fn outlines_filled_by_the_even_odd_rule_equal_the_mask(
            width in 1_usize..14,
            height in 1_usize..12,
            pixels in proptest::collection::vec(proptest::bool::weighted(0.6), 14 * 12),
        ) {
            let tile: Vec<f32> = pixels[..width * height].iter().map(|&p| f32::from(u8::from(p))).collect();
            let mask = Mask::from_tile(&tile, width, [0, 0], width, height, |v| v > 0.5);
            let rings = outlines(&mask);
            for (pixel, &value) in tile.iter().enumerate() {
                let at = [pixel % width, pixel / width].map(|v| u32::try_from(v).unwrap());
                let inside = rings.iter().filter(|ring| contains(ring, at)).count() % 2 == 1;
                prop_assert_eq!(inside, value > 0.5, "{:?}", at);
            }
            let parts = polygons(&mask);
            prop_assert_eq!(parts.iter().flatten().count(), rings.len());
            let area: i64 = parts.iter().flatten().map(twice_area).sum();
            prop_assert_eq!(area, 2 * mask.area() as i64);
            prop_assert!(rings.is_sorted_by_key(|ring| [ring[0][1], ring[0][0]]));
            for ring in &rings {
                prop_assert!(ring[1][0] > ring[0][0] && ring[1][1] == ring[0][1], "the first edge runs east");
                let corners: std::collections::BTreeSet<_> = ring.iter().collect();
                prop_assert_eq!(corners.len(), ring.len(), "no corner twice");
                let turns = ring.iter().zip(ring.iter().cycle().skip(1));
                prop_assert!(turns.clone().all(|(a, b)| (a[0] == b[0]) != (a[1] == b[1])), "along rows and columns");
                let before = ring.iter().cycle().skip(ring.len() - 1);
                prop_assert!(before.zip(turns).all(|(a, (b, c))| (a[0] == b[0]) != (b[0] == c[0])), "corners turn");
            }
        }
    }
}
