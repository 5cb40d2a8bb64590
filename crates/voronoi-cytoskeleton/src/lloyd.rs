//! Lloyd's algorithm without a diagram: computes the centroid of each cell from the neighbouring sites.
//!
//! A cell is the set of points v, relative to its site, with v · q ≤ |q|² / 2 for every other site q and for the mirror
//! image of the site in every side of the window. Polar duality maps these lines to the points 2 q / |q|², and the
//! corners of the cell to the sides of their convex hull, which gift wrapping finds for many cells at once.

use crate::diagram::{Diagram, build};
use crate::error::Error;
use crate::geometry::{Point, bounds, dot, length, sub};
use crate::window::Window;
use multiversion::multiversion;

/// Cells processed at once: two of the widest registers, to hide latency.
const LANES: usize = 16;

type Lanes = [f64; LANES];

/// A point in each lane.
type Points = [Lanes; 2];

/// Mean number of sites in a square of the grid.
const CROWD: f64 = 1.2;

/// Rings of squares around that of a site in the first search.
const RINGS: usize = 2;

/// Minimum distance from a side of the window, in units of the grid squares; sites closer to it count as at this
/// distance.
const BORDER: f64 = 1e-9;

/// Maximum number of sides of a cell; the triangulation handles cells with more.
const SIDES: usize = 64;

/// Returns the diagram of sites after Lloyd passes, without intermediate diagrams if possible.
pub(crate) fn relaxed_diagram(sites: Vec<Point>, window: &Window, passes: usize) -> Result<Diagram, Error> {
    if let Some(Ok(diagram)) = relaxed(&sites, window, passes).map(|sites| build(sites, window.clone())) {
        return Ok(diagram);
    }
    let mut diagram = build(sites, window.clone())?;
    (0..passes).for_each(|_| diagram.relax());
    Ok(diagram)
}

/// Returns the sites after Lloyd passes; none if a cell has too many sides.
pub(crate) fn relaxed(sites: &[Point], window: &Window, passes: usize) -> Option<Vec<Point>> {
    let mut sites = sites.to_vec();
    for _ in 0..passes {
        Grid::new(&sites, window).centroids(&mut sites)?;
    }
    Some(sites)
}

/// Sites sorted by grid squares.
struct Grid<'a> {
    window: &'a Window,
    origin: Point,
    side: f64,
    size: [usize; 2],
    /// Index of the first site of each square, row by row, and the end.
    starts: Vec<usize>,
    places: Vec<Point>,
    numbers: Vec<usize>,
    /// A corner on each side of the window, and its outward unit normal.
    sides: Vec<(Point, Point)>,
}

impl<'a> Grid<'a> {
    fn new(sites: &[Point], window: &'a Window) -> Self {
        let [low, high] = bounds(window.corners());
        let extent = sub(high, low);
        // Limits the number of empty squares for a narrow diagonal window.
        let area = window.area().max(extent[0] * extent[1] / 8.0);
        let side = (area * CROWD / sites.len() as f64).sqrt();
        let size = extent.map(|extent| floor(extent / side) + 1);
        let square = |site: Point| {
            let [column, row] = [0, 1].map(|axis| floor((site[axis] - low[axis]) / side).min(size[axis] - 1));
            row * size[0] + column
        };
        let mut starts = vec![0; size[0] * size[1] + 1];
        for &site in sites {
            starts[square(site)] += 1;
        }
        let mut end = 0;
        for start in &mut starts {
            end += *start;
            *start = end;
        }
        let (mut places, mut numbers) = (vec![[0.0; 2]; sites.len()], vec![0; sites.len()]);
        for (number, &site) in sites.iter().enumerate() {
            let start = &mut starts[square(site)];
            *start -= 1;
            (places[*start], numbers[*start]) = (site, number);
        }
        let outwards = |side: Point| [side[1] / length(side), -side[0] / length(side)];
        let sides = window.sides().map(|(corner, side)| (corner, outwards(side))).collect();
        Self { window, origin: low, side, size, starts, places, numbers, sides }
    }

    /// Replaces each site by the centroid of its cell, if that is inside the window.
    fn centroids(&self, sites: &mut [Point]) -> Option<()> {
        let mut open: Vec<usize> = (0..self.places.len()).collect();
        let mut group = Group::default();
        let mut rings = RINGS;
        while !open.is_empty() {
            let mut left = Vec::new();
            for cells in open.chunks(LANES) {
                group.clear();
                for (lane, &cell) in cells.iter().enumerate() {
                    self.gather(self.places[cell], rings, &mut group, lane);
                }
                let ways = wrap(&mut group);
                for (lane, &cell) in cells.iter().enumerate() {
                    let [x, y] = ways.map(|way| way[lane]);
                    if x.is_nan() {
                        left.push(cell);
                        continue;
                    }
                    let site = self.places[cell];
                    let centroid = [site[0] + x, site[1] + y];
                    if self.window.contains(centroid) {
                        sites[self.numbers[cell]] = centroid;
                    }
                }
            }
            if rings > self.size[0].max(self.size[1]) && !left.is_empty() {
                return None;
            }
            open = left;
            rings += rings / 2;
        }
        Some(())
    }

    /// Gathers the sites in `rings` rings of squares around a site, and the mirror images within that range.
    fn gather(&self, site: Point, rings: usize, group: &mut Group, lane: usize) {
        let mut blocks = [[0; 2]; 2];
        for axis in 0..2 {
            let place = site[axis] - self.origin[axis];
            let square = floor(place / self.side).min(self.size[axis] - 1);
            let (first, end) = (square.saturating_sub(rings), (square + rings + 1).min(self.size[axis]));
            blocks[axis] = [first, end];
            // There are no sites beyond the grid.
            group.room[axis][0][lane] = if first == 0 { f64::INFINITY } else { place - first as f64 * self.side };
            group.room[axis][1][lane] =
                if end == self.size[axis] { f64::INFINITY } else { end as f64 * self.side - place };
        }
        let [columns, rows] = blocks;
        let mut count = 1;
        for row in rows[0]..rows[1] {
            let [from, to] = columns.map(|column| self.starts[row * self.size[0] + column]);
            group.put(&mut count, lane, self.places[from..to].iter().map(|&place| sub(place, site)));
        }
        // A cell that is complete within its range does not extend beyond the corner of the block.
        let reach = core::f64::consts::SQRT_2 * (rings + 1) as f64 * self.side;
        for &(corner, outwards) in &self.sides {
            let depth = dot(outwards, sub(corner, site));
            if depth <= reach {
                let depth = 2.0 * depth.max(BORDER * self.side);
                group.put(&mut count, lane, core::iter::once([outwards[0] * depth, outwards[1] * depth]));
            }
        }
    }
}

/// Rounds a non-negative number down.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the cast saturates")]
fn floor(number: f64) -> usize {
    number as usize
}

/// The gathered neighbours of the cells of all lanes.
#[derive(Default)]
struct Group {
    /// Neighbours relative to the site; the first entry, and the padding of a lane, are the site itself.
    neighbours: Vec<Points>,
    /// Range of the gathered sites to the left and right, up and down.
    room: [[Lanes; 2]; 2],
}

impl Group {
    fn clear(&mut self) {
        self.neighbours.clear();
        self.neighbours.push(Points::default());
    }

    /// Appends neighbours to a lane that contains `count`.
    #[inline(always)]
    fn put(&mut self, count: &mut usize, lane: usize, neighbours: impl ExactSizeIterator<Item = Point>) {
        let end = *count + neighbours.len();
        if end > self.neighbours.len() {
            self.neighbours.resize(end, Points::default());
        }
        for (points, [x, y]) in self.neighbours[*count..end].iter_mut().zip(neighbours) {
            (points[0][lane], points[1][lane]) = (x, y);
        }
        *count = end;
    }
}

/// Returns the vector from each site to the centroid of its cell; NaN if more sites must be gathered.
#[multiversion(targets = "simd")]
fn wrap(group: &mut Group) -> Points {
    // Polar duality. The walk starts at the farthest point, the dual of the nearest neighbour.
    let mut start = Points::default();
    let mut farthest = Lanes::default();
    for points in &mut group.neighbours {
        let scale = each(|lane| {
            let square = points[0][lane] * points[0][lane] + points[1][lane] * points[1][lane];
            if square > 0.0 { 2.0 / square } else { 0.0 }
        });
        *points = [each(|lane| points[0][lane] * scale[lane]), each(|lane| points[1][lane] * scale[lane])];
        let farther = each(|lane| farthest[lane] - scale[lane]);
        farthest = choose(&farther, &scale, &farthest);
        start = [choose(&farther, &points[0], &start[0]), choose(&farther, &points[1], &start[1])];
    }
    let mut cells = Cells::default();
    let mut at = start;
    for step in 0..SIDES {
        let next = turn(&group.neighbours, &at);
        cells.add(step, &at, &next, &group.room);
        at = next;
        if cells.pass(&start, &at) {
            break;
        }
    }
    cells.centroids()
}

/// Returns the next point of each hull, such that all points are to the left.
#[inline(always)]
fn turn(points: &[Points], at: &Points) -> Points {
    let mut way = [each(|lane| -at[0][lane]), each(|lane| -at[1][lane])];
    let mut next = Points::default();
    for point in points {
        let x = each(|lane| point[0][lane] - at[0][lane]);
        let y = each(|lane| point[1][lane] - at[1][lane]);
        // Negative if the point is to the right; adding 0 changes -0 to +0. Where four cells meet, points are
        // collinear, and a point behind must not count as one ahead.
        let side = each(|lane| {
            let right = way[0][lane] * y[lane] - way[1][lane] * x[lane] + 0.0;
            let ahead = at[1][lane] * point[0][lane] - at[0][lane] * point[1][lane];
            f64::from_bits(right.to_bits() & ahead.to_bits())
        });
        way = [choose(&side, &x, &way[0]), choose(&side, &y, &way[1])];
        next = [choose(&side, &point[0], &next[0]), choose(&side, &point[1], &next[1])];
    }
    next
}

/// Returns `value` for each lane. A plain loop, which the compiler reliably inlines and vectorises.
#[inline(always)]
fn each(value: impl Fn(usize) -> f64) -> Lanes {
    let mut lanes = Lanes::default();
    for (lane, slot) in lanes.iter_mut().enumerate() {
        *slot = value(lane);
    }
    lanes
}

/// Selects by a sign, with bit operations, which stay in registers.
#[inline(always)]
fn choose(sign: &Lanes, negative: &Lanes, positive: &Lanes) -> Lanes {
    each(|lane| {
        let mask = (sign[lane].to_bits().cast_signed() >> 63).cast_unsigned();
        f64::from_bits(negative[lane].to_bits() & mask | positive[lane].to_bits() & !mask)
    })
}

/// Partial moments of the cells, relative to their sites.
#[derive(Default)]
struct Cells {
    first: Points,
    last: Points,
    /// Twice the area, and six times the first moments.
    area: Lanes,
    moments: Points,
    /// Whether more than half of the walk is done, and all of it.
    half: [bool; LANES],
    done: [bool; LANES],
    /// Whether the circle around a corner through the site exceeds the gathered range, so that a site may be missing.
    open: [bool; LANES],
}

impl Cells {
    /// Adds the next corner, the intersection of the lines dual to the points `at` and `next`.
    #[inline(always)]
    fn add(&mut self, step: usize, at: &Points, next: &Points, room: &[[Lanes; 2]; 2]) {
        for lane in 0..LANES {
            let turn = at[0][lane] * next[1][lane] - at[1][lane] * next[0][lane];
            let (x, y) = ((next[1][lane] - at[1][lane]) / turn, (at[0][lane] - next[0][lane]) / turn);
            let radius = (x * x + y * y).sqrt();
            let within = (radius - x <= room[0][0][lane])
                & (radius + x <= room[0][1][lane])
                & (radius - y <= room[1][0][lane])
                & (radius + y <= room[1][1][lane]);
            let done = self.done[lane];
            self.open[lane] |= !done & !(within & (turn > 0.0));
            if step == 0 {
                (self.first[0][lane], self.first[1][lane]) = (x, y);
                (self.last[0][lane], self.last[1][lane]) = (x, y);
            }
            let (x, y) = if done { (self.last[0][lane], self.last[1][lane]) } else { (x, y) };
            self.triangle(lane, x, y);
        }
    }

    /// Adds the triangle of the site, the last corner and the next.
    #[inline(always)]
    fn triangle(&mut self, lane: usize, x: f64, y: f64) {
        let last = [self.last[0][lane], self.last[1][lane]];
        let area = last[0] * y - last[1] * x;
        self.area[lane] += area;
        self.moments[0][lane] += area * (last[0] + x);
        self.moments[1][lane] += area * (last[1] + y);
        (self.last[0][lane], self.last[1][lane]) = (x, y);
    }

    /// Marks the walks that are complete, or have no next line. Returns whether all are done.
    #[inline(always)]
    fn pass(&mut self, start: &Points, at: &Points) -> bool {
        let mut all = true;
        for lane in 0..LANES {
            let side = start[0][lane] * at[1][lane] - start[1][lane] * at[0][lane];
            let round = self.half[lane] & (side >= 0.0);
            let lost = (at[0][lane] == 0.0) & (at[1][lane] == 0.0);
            self.half[lane] |= side < 0.0;
            self.done[lane] |= round | lost;
            all &= self.done[lane];
        }
        all
    }

    #[inline(always)]
    fn centroids(mut self) -> Points {
        let mut centroids = [[f64::NAN; LANES]; 2];
        for lane in 0..LANES {
            self.triangle(lane, self.first[0][lane], self.first[1][lane]);
            if self.done[lane] & !self.open[lane] {
                for (centroid, moment) in centroids.iter_mut().zip(&self.moments) {
                    centroid[lane] = moment[lane] / (3.0 * self.area[lane]);
                }
            }
        }
        centroids
    }
}

#[cfg(test)]
mod tests;
