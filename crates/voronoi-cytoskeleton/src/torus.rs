use crate::diagram::build;
use crate::error::{Error, require};
use crate::geometry::{Point, bounds, dot, length, sub};
use crate::lloyd::{relaxed, relaxed_diagram};
use crate::path::{DEGREE, Graph};
use crate::window::Window;
use portable_numerics::random::uniform;
use rand_core::Rng;
use std::collections::BTreeMap;

/// A periodic relaxed Voronoi diagram of the unit square (a flat torus).
///
/// One torus serves any number of skeletons with [`Skeleton::grow_from`](crate::Skeleton::grow_from), each from a part
/// at a random position and rotation.
#[derive(Debug, Clone)]
pub struct Torus {
    sites: usize,
    /// In the unit square, up to rounding errors.
    vertices: Vec<Point>,
    neighbours: Vec<[u32; DEGREE]>,
    longest: f64,
}

/// Width of the repeated margin around the square, in mean distances between sites. A cell is exact if no circle around
/// one of its corners through its site has a diameter above this; for random sites the probability of a larger one is
/// e^(-π 9).
const MARGIN: f64 = 6.0;

impl Torus {
    /// Creates a torus of 100 to 1 000 000 uniform random sites, after 0 to 10 000 passes of Lloyd's algorithm.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for numbers outside these ranges, [`Error::Sites`] if sites coincide.
    pub fn new<R: Rng + ?Sized>(sites: usize, lloyd_passes: usize, rng: &mut R) -> Result<Self, Error> {
        require("sites", sites as f64, (100..=1_000_000).contains(&sites), "between 100 and 1000000")?;
        require("lloyd_passes", lloyd_passes as f64, lloyd_passes <= 10_000, "at most 10000")?;
        let mut places: Vec<Point> = (0..sites).map(|_| [uniform(rng), uniform(rng)]).collect();
        let margin = MARGIN / (sites as f64).sqrt();
        let window = Window::rectangle([-margin; 2], [1.0 + margin; 2])?;
        for _ in 0..lloyd_passes {
            let (copies, _) = repeated(&places, margin);
            let fast = relaxed(&copies, &window, 1);
            let copies = fast.map_or_else(|| Ok(relaxed_diagram(copies, &window, 1)?.sites), Ok)?;
            places = copies[..sites].iter().map(|place| place.map(|c| c - c.floor())).collect();
        }
        let (copies, originals) = repeated(&places, margin);
        let diagram = build(copies, window)?;

        // The cells at each vertex inside.
        let mut meeting = vec![[usize::MAX; DEGREE]; diagram.inner];
        for cell in 0..originals.len() {
            for &vertex in diagram.cell(cell).iter().filter(|&&vertex| vertex < diagram.inner) {
                if let Some(free) = meeting[vertex].iter_mut().find(|cell| **cell == usize::MAX) {
                    *free = cell;
                }
            }
        }
        // Of the copies of a vertex, use the one at the original of its first site.
        let key = |cells: [usize; DEGREE]| {
            let mut key = cells.map(|cell| originals.get(cell).copied().unwrap_or(usize::MAX));
            key.sort_unstable();
            key
        };
        let mut numbers: BTreeMap<[usize; DEGREE], u32> = BTreeMap::new();
        let mut vertices = Vec::with_capacity(2 * sites);
        for (vertex, &cells) in meeting.iter().enumerate() {
            let key = key(cells);
            if cells.contains(&key[0]) && !numbers.contains_key(&key) {
                numbers.insert(key, u32::try_from(vertices.len()).unwrap_or(u32::MAX));
                vertices.push(diagram.vertices[vertex]);
            }
        }
        let mut joined = vec![Vec::with_capacity(DEGREE); vertices.len()];
        let mut longest = 0.0_f64;
        for edge in &diagram.edges {
            let Some(neighbour) = edge.neighbour else { continue };
            let first = originals[edge.cell].min(originals[neighbour]);
            if edge.cell != first && neighbour != first {
                continue;
            }
            let [from, to] = edge.ends;
            let number = |end: usize| meeting.get(end).and_then(|&cells| numbers.get(&key(cells))).copied();
            let (Some(a), Some(b)) = (number(from), number(to)) else { continue };
            joined[a as usize].push(b);
            joined[b as usize].push(a);
            longest = longest.max(length(sub(diagram.vertices[from], diagram.vertices[to])));
        }
        let closed = joined.iter().map(|neighbours| neighbours[..].try_into().ok()).collect::<Option<Vec<_>>>();
        let neighbours = closed.filter(|neighbours| neighbours.len() == 2 * sites);
        let neighbours = neighbours.ok_or(Error::Sites { given: sites, distinct: vertices.len() / 2 })?;
        Ok(Self { sites, vertices, neighbours, longest })
    }

    /// Returns the number of sites.
    pub fn sites(&self) -> usize {
        self.sites
    }

    /// Returns the part under a window, which contains `sites` sites on average; none if it would overlap itself.
    pub(crate) fn place<R: Rng + ?Sized>(&self, window: &Window, sites: usize, rng: &mut R) -> Option<Graph> {
        let period = (window.area() * self.sites as f64 / sites as f64).sqrt();
        let [low, high] = bounds(window.corners());
        let half = [0, 1].map(|axis| (high[axis] - low[axis]) / 2.0);
        if length(half) + self.longest * period > period / 2.0 {
            return None;
        }
        let origin = [uniform(rng), uniform(rng)];
        let [x, y] = direction(rng).map(|c| c * period);
        let hand = if rng.next_u64() >> 63 == 0 { 1.0 } else { -1.0 };
        // Relative to the centre of the window.
        let places: Vec<Point> = self
            .vertices
            .iter()
            .map(|&vertex| {
                let [u, v] = sub(vertex, origin).map(shortest);
                [u * x - v * y, hand * (u * y + v * x)]
            })
            .collect();

        // There are two vertices for each site.
        let next = |chosen: &[usize]| u32::try_from(chosen.len()).ok();
        let mut numbers = vec![None; places.len()];
        let mut chosen = Vec::with_capacity(3 * sites);
        for (vertex, &[x, y]) in places.iter().enumerate() {
            if x.abs() < half[0] && y.abs() < half[1] {
                numbers[vertex] = next(&chosen);
                chosen.push(vertex);
            }
        }
        let inner = chosen.len();
        let mut neighbours = Vec::with_capacity(chosen.capacity());
        for number in 0..inner {
            neighbours.push(self.neighbours[chosen[number]].map(|way| {
                let way = way as usize;
                if numbers[way].is_none() {
                    numbers[way] = next(&chosen);
                    chosen.push(way);
                }
                numbers[way]
            }));
        }
        neighbours.resize(chosen.len(), [None; DEGREE]);
        let middle = [low[0] + half[0], low[1] + half[1]];
        let vertices = chosen.iter().map(|&vertex| [middle[0] + places[vertex][0], middle[1] + places[vertex][1]]);
        Some(Graph { vertices: vertices.collect(), inner, neighbours })
    }
}

/// Returns the shortest difference of two coordinates on the torus.
fn shortest(way: f64) -> f64 {
    let back = if way > 0.5 { 1.0 } else { 0.0 };
    let forth = if way < -0.5 { 1.0 } else { 0.0 };
    way - back + forth
}

/// Returns the sites and their copies within a margin around the unit square, and the index of the original of each.
fn repeated(sites: &[Point], margin: f64) -> (Vec<Point>, Vec<usize>) {
    let (mut copies, mut originals) = (sites.to_vec(), (0..sites.len()).collect::<Vec<_>>());
    let within = |c: f64| c >= -margin && c <= 1.0 + margin;
    for shift in (0..9).filter(|&shift| shift != 4).map(|shift| [f64::from(shift % 3 - 1), f64::from(shift / 3 - 1)]) {
        for (number, site) in sites.iter().enumerate() {
            let copy = [site[0] + shift[0], site[1] + shift[1]];
            if copy.into_iter().all(within) {
                copies.push(copy);
                originals.push(number);
            }
        }
    }
    (copies, originals)
}

/// Draws a uniform random direction, by rejection of points outside the unit disc.
fn direction<R: Rng + ?Sized>(rng: &mut R) -> Point {
    loop {
        let [x, y] = [0; 2].map(|_| 2.0 * uniform(rng) - 1.0);
        let square = dot([x, y], [x, y]);
        if square > 1e-6 && square <= 1.0 {
            return [x / square.sqrt(), y / square.sqrt()];
        }
    }
}

#[cfg(test)]
mod tests;
