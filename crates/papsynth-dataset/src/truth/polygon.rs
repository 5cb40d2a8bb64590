//! Masks as polygons whose corners are corners of pixels: pixel (x, y) is the square from (x, y) to (x + 1, y + 1); and as GeoJSON, in which a
//! cell is one feature with its nucleus within (`nucleusGeometry`) and everything else a detection.

use papsynth::truth::{Mask, ObjectTruth, Part};
use serde_json::{Value, json};

use super::frame::category_name;
use crate::bytes::sha256;

/// Corners of a closed line, of which the last is joined to the first; no corner is passed twice. Pixels inside lie to its right.
pub(crate) type Ring = Vec<[u32; 2]>;

/// East, south, west, north: each next is a turn to the right.
const STEPS: [[isize; 2]; 4] = [[1, 0], [0, 1], [-1, 0], [0, -1]];

/// A ring turned at this corner already: two of its pixels touch there.
const PASSED: u8 = 1 << 4;

/// The sides of pixels between mask and outside, by the corner where they begin.
struct Sides {
    /// Of each corner, bit `d` for a side that leaves in direction `d`, and [`PASSED`] once a ring turned there.
    leaving: Vec<u8>,
    /// Corners in a row.
    width: usize,
    /// The upper left corner.
    origin: [u32; 2],
}

impl Sides {
    fn of(mask: &Mask) -> Option<Self> {
        let bounds = mask.bounds()?;
        let origin = [bounds.x, bounds.y];
        let (width, height) = (bounds.width as usize + 1, bounds.height as usize + 1);
        let mut leaving = vec![0_u8; width * height];
        for run in mask.runs() {
            let row = (run.y - origin[1]) as usize * width;
            let [from, to] = [run.x0 - origin[0], run.x1 - origin[0]].map(|x| row + x as usize);
            // What the row above left as its lower sides and this row has as its upper sides is inside.
            for corner in from..to {
                toggle(&mut leaving, [corner, corner + 1], 0);
                toggle(&mut leaving, [corner + width + 1, corner + width], 2);
            }
            leaving[from + width] |= 1 << 3;
            leaving[to] |= 1 << 1;
        }
        Some(Self { leaving, width, origin })
    }

    /// Takes the next side from a corner: the sharpest turn to the right there is, so that pixels that touch at a corner alone are
    /// apart.
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

/// Adds a side, or takes away its opposite, which runs from end to start.
fn toggle(leaving: &mut [u8], [start, end]: [usize; 2], direction: usize) {
    let opposite = 1 << ((direction + 2) % 4);
    if leaving[end] & opposite != 0 {
        leaving[end] &= !opposite;
    } else {
        leaving[start] |= 1 << direction;
    }
}

/// Every outline of a mask, of its parts and of their holes, from top to bottom and left to right by their first corner, from which they
/// run east. Where an outline touches itself in a corner it is cut into two, so that each is simple, as GeoJSON and OGC Simple Features
/// want it.
pub(crate) fn outlines(mask: &Mask) -> Vec<Ring> {
    let Some(mut sides) = Sides::of(mask) else { return Vec::new() };
    let mut rings = Vec::new();
    for start in 0..sides.leaving.len() {
        while sides.leaving[start] & 1 == 1 {
            sides.leaving[start] &= !1;
            sides.leaving[start] |= PASSED;
            let (mut ring, mut corner, mut direction) = (vec![sides.place(start)], sides.step(start, 0), 0);
            while corner != start {
                // Every corner that is entered is left.
                let Some(next) = sides.take(corner, direction) else { break };
                if next != direction {
                    let place = sides.place(corner);
                    if sides.leaving[corner] & PASSED != 0 {
                        // The loop since the first time is a ring of its own.
                        if let Some(first) = ring.iter().position(|&other| other == place) {
                            rings.push(from_the_top(ring.split_off(first)));
                        }
                    }
                    sides.leaving[corner] |= PASSED;
                    ring.push(place);
                }
                (corner, direction) = (sides.step(corner, next), next);
            }
            rings.push(ring);
        }
    }
    rings.sort_unstable_by_key(|ring| [ring[0][1], ring[0][0]]);
    rings
}

/// The ring from its first corner, row by row, that it leaves to the east.
fn from_the_top(mut ring: Ring) -> Ring {
    let east = |&i: &usize| ring[(i + 1) % ring.len()][0] > ring[i][0];
    let first = (0..ring.len()).filter(east).min_by_key(|&i| [ring[i][1], ring[i][0]]);
    ring.rotate_left(first.unwrap_or_default());
    ring
}

/// The parts of a mask: of each its outline, then those of its holes.
fn polygons(mask: &Mask) -> Vec<Vec<Ring>> {
    let (outer, holes): (Vec<_>, Vec<_>) = outlines(mask).into_iter().partition(|ring| twice_area(ring) > 0);
    let mut parts: Vec<Vec<Ring>> = outer.into_iter().map(|ring| vec![ring]).collect();
    for hole in holes {
        // The pixel below the first side is inside.
        let around = parts.iter_mut().filter(|part| contains(&part[0], hole[0])).min_by_key(|p| twice_area(&p[0]));
        if let Some(part) = around {
            part.push(hole);
        }
    }
    parts
}

/// Twice the area, positive where the inside lies to the right.
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

/// The features of these objects. `name` gives each a name that no other has, `measure` what is measured of it and of the nucleus of a cell.
pub(crate) fn collection(
    objects: &[&ObjectTruth],
    name: impl Fn(&ObjectTruth) -> String,
    measure: impl Fn(&ObjectTruth, Option<&ObjectTruth>) -> Value,
) -> Value {
    let find = |id: u32, part: Part| objects.iter().copied().find(|o| o.id == id && o.part == part);
    // A nucleus goes with its cell, if that is there.
    let own = objects.iter().filter(|o| o.part != Part::Nucleus || find(o.id, Part::Cytoplasm).is_none());
    let features = own.map(|object| {
        let is_cell = object.part == Part::Cytoplasm;
        let nucleus = find(object.id, Part::Nucleus).filter(|_| is_cell);
        let class = if is_cell { object.class.clone() } else { category_name(&object.class, object.part) };
        let mut feature = json!({
            "type": "Feature",
            "id": uuid(&name(object)),
            "geometry": shape(&object.amodal),
            "properties": {
                "objectType": if is_cell { "cell" } else { "detection" },
                "name": object.id.to_string(),
                "classification": { "name": class },
                "measurements": measure(object, nucleus),
            },
        });
        if let (Some(nucleus), Some(feature)) = (nucleus, feature.as_object_mut()) {
            feature.insert("nucleusGeometry".to_owned(), shape(&nucleus.amodal));
        }
        feature
    });
    json!({ "type": "FeatureCollection", "features": features.collect::<Vec<_>>() })
}

/// A polygon, or several where the mask falls apart.
fn shape(mask: &Mask) -> Value {
    let mut parts = polygons(mask);
    // A ring ends where it begins.
    for ring in parts.iter_mut().flatten() {
        ring.extend(ring.first().copied());
    }
    match parts.as_slice() {
        [one] => json!({ "type": "Polygon", "coordinates": one }),
        _ => json!({ "type": "MultiPolygon", "coordinates": parts }),
    }
}

/// The UUID of a name, the same whenever it is made.
fn uuid(name: &str) -> String {
    let hex = sha256(name.as_bytes());
    // Version 8: made as the maker likes; variant 8: RFC 9562.
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
    fn a_ring_with_an_island_and_a_touching_corner_falls_into_its_parts() {
        let parts = polygons(&mask(&["#####.", "#...#.", "#.#.#.", "#...#.", "#####.", ".....#"]));
        let areas: Vec<Vec<i64>> = parts.iter().map(|part| part.iter().map(|r| twice_area(r) / 2).collect()).collect();
        assert_eq!(areas, [vec![25, -9], vec![1], vec![1]]);
        assert_eq!(parts[1][0], [[2, 2], [3, 2], [3, 3], [2, 3]]);
        assert_eq!(parts[2][0], [[5, 5], [6, 5], [6, 6], [5, 6]]);
        assert!(polygons(&Mask::default()).is_empty());
        // Pixels that touch in a corner and are joined elsewhere enclose a hole that reaches to that corner.
        let parts = polygons(&mask(&["###", "#.#", "##."]));
        let areas: Vec<Vec<i64>> = parts.iter().map(|part| part.iter().map(|r| twice_area(r) / 2).collect()).collect();
        assert_eq!(areas, [vec![8, -1]]);
        assert!(parts[0].iter().all(|ring| ring.contains(&[2, 2])));
    }

    proptest! {
        #[test]
        fn filled_by_the_even_odd_rule_the_outlines_are_the_mask(
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
                prop_assert!(ring[1][0] > ring[0][0] && ring[1][1] == ring[0][1], "the first side runs east");
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
