//! The grouping of cells of a class: single cells, aggregates, honeycombs and palisades.

use rand_core::Rng;

use crate::key::Stream;
use crate::random;
use crate::recipe::{Group, GroupForm};

/// Standard deviation of the place of a cell in a honeycomb or a palisade, relative to the distance of neighbours.
const JITTER: f64 = 0.08;

/// Largest bend of a palisade over its length, radians.
const BEND: f64 = 0.9;

/// Standard deviation of the direction of the cells of a palisade, degrees.
const LEAN_DEG: f64 = 7.0;

/// Minimum distance of the cells of an aggregate, relative to that of neighbours, and the number of tries to get it.
const APART: f64 = 0.8;
const TRIES: usize = 12;

/// The place of a cell.
pub(super) struct Place {
    pub(super) centre_um: [f64; 2],
    /// Direction of the long axis, degrees.
    pub(super) rotation_deg: f64,
    /// Group, from 1; 0 for single cells.
    pub(super) group: u32,
}

/// Places the cells of one class, group by group.
pub(super) struct Groups<'a> {
    group: &'a Group,
    /// Number of groups begun in this field, of all classes.
    begun: u32,
    now: Option<Started>,
}

/// The group that is being filled.
struct Started {
    /// The place of its first cell, µm.
    origin_um: [f64; 2],
    /// Direction of its rows, radians.
    direction: f64,
    /// Bend of the row from cell to cell, radians.
    bend: f64,
    /// Distance between the centres of neighbours, µm.
    distance_um: f64,
    size: usize,
    cells: Vec<[f64; 2]>,
}

impl<'a> Groups<'a> {
    /// Starts the groups of a class, after so many groups of other classes.
    pub(super) fn new(group: &'a Group, begun: u32) -> Self {
        Self { group, begun, now: None }
    }

    /// Returns the number of groups begun in this field.
    pub(super) fn begun(&self) -> u32 {
        self.begun
    }

    /// Returns whether the next cell begins a group.
    pub(super) fn is_full(&self) -> bool {
        self.now.as_ref().is_none_or(|group| group.cells.len() >= group.size)
    }

    /// Returns the place of the next cell. `free` returns the place of a cell that begins a group; a group is drawn
    /// from the stream of its first cell.
    pub(super) fn next<E>(
        &mut self,
        radius_um: f64,
        mut free: impl FnMut(&mut Stream) -> Result<[f64; 2], E>,
        rng: &mut Stream,
    ) -> Result<Place, E> {
        if self.group.form == GroupForm::Single {
            return Ok(Place { centre_um: free(rng)?, rotation_deg: f64::NAN, group: 0 });
        }
        let group = match self.now.take().filter(|group| group.cells.len() < group.size) {
            Some(group) => self.now.insert(group),
            None => {
                let origin_um = free(rng)?;
                let size = self.group.size.draw_count(rng).max(1);
                let direction = random::direction(rng);
                self.begun += 1;
                self.now.insert(Started {
                    origin_um,
                    direction,
                    bend: random::between(-BEND, BEND, rng) / size as f64,
                    distance_um: 2.0 * radius_um * self.group.distance.draw(rng),
                    size,
                    cells: Vec::new(),
                })
            }
        };
        let (centre_um, rotation_deg) = match self.group.form {
            GroupForm::Palisade => group.in_a_row(rng),
            GroupForm::Honeycomb => (group.in_a_layer(rng), random::between(0.0, 360.0, rng)),
            GroupForm::Aggregate | GroupForm::Single => (group.in_an_aggregate(rng), random::between(0.0, 360.0, rng)),
        };
        group.cells.push(centre_um);
        Ok(Place { centre_um, rotation_deg, group: self.begun })
    }
}

impl Started {
    /// Returns a place next to the last cell, on a row that bends; cells are perpendicular to it.
    fn in_a_row<R: Rng + ?Sized>(&self, rng: &mut R) -> ([f64; 2], f64) {
        let number = self.cells.len() as f64;
        let heading = self.direction + self.bend * number;
        let before = self.cells.last().copied().unwrap_or(self.origin_um);
        let step = if self.cells.is_empty() { 0.0 } else { self.distance_um * random::between(0.85, 1.15, rng) };
        let aside = JITTER * self.distance_um * random::normal(rng);
        let place = [
            before[0] + step * libm::cos(heading) - aside * libm::sin(heading),
            before[1] + step * libm::sin(heading) + aside * libm::cos(heading),
        ];
        (place, heading.to_degrees() + 90.0 + LEAN_DEG * random::normal(rng))
    }

    /// Returns a place on a hexagonal lattice, in rings around the first cell.
    fn in_a_layer<R: Rng + ?Sized>(&self, rng: &mut R) -> [f64; 2] {
        let [u, v] = hexagon(self.cells.len());
        let (x, y) = (u + 0.5 * v, v * 0.75_f64.sqrt());
        let (cos, sin) = (libm::cos(self.direction), libm::sin(self.direction));
        let mut off = || JITTER * self.distance_um * random::normal(rng);
        [
            self.origin_um[0] + self.distance_um * (x * cos - y * sin) + off(),
            self.origin_um[1] + self.distance_um * (x * sin + y * cos) + off(),
        ]
    }

    /// Returns a place next to a random cell of the aggregate, as far as possible from the others.
    fn in_an_aggregate<R: Rng + ?Sized>(&self, rng: &mut R) -> [f64; 2] {
        let mut best = (0.0, self.origin_um);
        for _ in 0..TRIES {
            let Some(beside) = self.cells.get(random::below(self.cells.len(), rng)) else { break };
            let angle = random::direction(rng);
            let distance = self.distance_um * random::between(0.9, 1.15, rng);
            let place = [beside[0] + distance * libm::cos(angle), beside[1] + distance * libm::sin(angle)];
            let room = self
                .cells
                .iter()
                .map(|cell| libm::hypot(cell[0] - place[0], cell[1] - place[1]))
                .fold(f64::INFINITY, f64::min);
            if room > best.0 {
                best = (room, place);
            }
            if room >= APART * self.distance_um {
                break;
            }
        }
        best.1
    }
}

/// Returns the axial coordinates of the n-th place of a hexagonal lattice, ring by ring.
fn hexagon(number: usize) -> [f64; 2] {
    const STEPS: [[f64; 2]; 6] = [[-1.0, 1.0], [-1.0, 0.0], [0.0, -1.0], [1.0, -1.0], [1.0, 0.0], [0.0, 1.0]];
    let mut ring = 0;
    let mut left = number;
    while left >= (6 * ring).max(1) {
        left -= (6 * ring).max(1);
        ring += 1;
    }
    let mut at = [ring as f64, 0.0];
    for step in 0..left {
        let [du, dv] = STEPS[step / ring.max(1)];
        at = [at[0] + du, at[1] + dv];
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hexagonal_lattice_fills_ring_by_ring_without_gaps() {
        let places: Vec<[f64; 2]> = (0..37).map(hexagon).collect();
        let distance = |a: &[f64; 2], b: &[f64; 2]| {
            let (u, v) = (a[0] - b[0], a[1] - b[1]);
            (u * u + u * v + v * v).sqrt()
        };
        for (i, a) in places.iter().enumerate() {
            let nearest = places.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, b)| distance(a, b));
            assert!((nearest.fold(f64::INFINITY, f64::min) - 1.0).abs() < 1e-12, "{i}: {a:?}");
            // 37 places are the centre and three rings.
            assert!(distance(a, &[0.0, 0.0]) <= 3.0 + 1e-12, "{i}: {a:?}");
        }
    }
}
