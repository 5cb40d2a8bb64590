//! Lloyd's algorithm without a diagram: the centroid of each cell from the sites around it alone.
//!
//! A cell is where v · q ≤ |q|² / 2 for every other site, q from the cell's own, and for the site's mirror image in every
//! side of the window. Polarity turns these lines into the points 2 q / |q|², and the cell's corners into the sides of
//! their convex hull. The hull is found by gift wrapping, of many cells side by side.

use crate::diagram::{Diagram, build};
use crate::error::Error;
use crate::geometry::{Point, bounds, dot, length, sub};
use crate::window::Window;
use multiversion::multiversion;

/// Cells worked on side by side: two of the widest registers, so that one need not wait for the other.
const LANES: usize = 16;

type Lanes = [f64; LANES];

/// A point in each lane.
type Points = [Lanes; 2];

/// Sites in a square of the grid, on average.
const CROWD: f64 = 1.2;

/// Rings of squares around a site's own that are searched first.
const RINGS: usize = 2;

/// Distance from a side, over the side of a square, below which a site counts as this far off.
const BORDER: f64 = 1e-9;

/// Sides that a cell may have; one with more is left to the triangulation.
const SIDES: usize = 64;

/// The diagram of some sites after some passes: without diagrams in between, where that goes.
pub(crate) fn relaxed_diagram(sites: Vec<Point>, window: &Window, passes: usize) -> Result<Diagram, Error> {
    if let Some(Ok(diagram)) = relaxed(&sites, window, passes).map(|sites| build(sites, window.clone())) {
        return Ok(diagram);
    }
    let mut diagram = build(sites, window.clone())?;
    (0..passes).for_each(|_| diagram.relax());
    Ok(diagram)
}

/// The sites after some passes. None if there is a cell that this way cannot settle: one with very many sides.
pub(crate) fn relaxed(sites: &[Point], window: &Window, passes: usize) -> Option<Vec<Point>> {
    let mut sites = sites.to_vec();
    for _ in 0..passes {
        Grid::new(&sites, window).centroids(&mut sites)?;
    }
    Some(sites)
}

/// Sites sorted by squares.
struct Grid<'a> {
    window: &'a Window,
    origin: Point,
    side: f64,
    size: [usize; 2],
    /// Where the sites of each square begin, row by row, and the end.
    starts: Vec<usize>,
    places: Vec<Point>,
    numbers: Vec<usize>,
    /// A corner of the window on each of its sides, and the direction outwards, of length 1.
    sides: Vec<(Point, Point)>,
}

impl<'a> Grid<'a> {
    fn new(sites: &[Point], window: &'a Window) -> Self {
        let [low, high] = bounds(window.corners());
        let extent = sub(high, low);
        // In a narrow window that lies askew most squares are empty; there shall not be too many.
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

    /// Puts the centroid of each cell that holds its own in the place of its site.
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

    /// Gathers the sites in some rings of squares around a site's, and the mirror images that may matter among them.
    fn gather(&self, site: Point, rings: usize, group: &mut Group, lane: usize) {
        let mut blocks = [[0; 2]; 2];
        for axis in 0..2 {
            let place = site[axis] - self.origin[axis];
            let square = floor(place / self.side).min(self.size[axis] - 1);
            let (first, end) = (square.saturating_sub(rings), (square + rings + 1).min(self.size[axis]));
            blocks[axis] = [first, end];
            // Beyond the grid there is nothing to miss.
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
        // A cell that lies in its room reaches no farther than the corner of the block.
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

/// A number that is not negative, rounded down.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a saturating cast is what is meant")]
fn floor(number: f64) -> usize {
    number as usize
}

/// What is gathered for the cells of all lanes.
#[derive(Default)]
struct Group {
    /// Neighbours, from the site: the first and those that fill up a lane are the site itself.
    neighbours: Vec<Points>,
    /// How far left and right, up and down all sites are gathered.
    room: [[Lanes; 2]; 2],
}

impl Group {
    fn clear(&mut self) {
        self.neighbours.clear();
        self.neighbours.push(Points::default());
    }

    /// Puts neighbours into a lane that holds `count`.
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

/// The way from each site to the centroid of its cell; NaN where more must be gathered to know.
#[multiversion(targets = "simd")]
fn wrap(group: &mut Group) -> Points {
    // Polarity. The walk starts at the farthest point, which the nearest neighbour becomes.
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

/// From a point of each hull the next, such that all points lie to the left of the way there.
#[inline(always)]
fn turn(points: &[Points], at: &Points) -> Points {
    let mut way = [each(|lane| -at[0][lane]), each(|lane| -at[1][lane])];
    let mut next = Points::default();
    for point in points {
        let x = each(|lane| point[0][lane] - at[0][lane]);
        let y = each(|lane| point[1][lane] - at[1][lane]);
        // Negative where the point lies to the right; adding zero makes a negative zero positive. Where four cells meet,
        // points lie on one line, and the one behind must not be taken for one ahead.
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

/// What `value` is in each lane. A plain loop, which the compiler reliably inlines and vectorises.
#[inline(always)]
fn each(value: impl Fn(usize) -> f64) -> Lanes {
    let mut lanes = Lanes::default();
    for (lane, slot) in lanes.iter_mut().enumerate() {
        *slot = value(lane);
    }
    lanes
}

/// One or the other by a sign; on bits, which stay in registers where conditions do not.
#[inline(always)]
fn choose(sign: &Lanes, negative: &Lanes, positive: &Lanes) -> Lanes {
    each(|lane| {
        let mask = (sign[lane].to_bits().cast_signed() >> 63).cast_unsigned();
        f64::from_bits(negative[lane].to_bits() & mask | positive[lane].to_bits() & !mask)
    })
}

/// What is known of the cells after some of their corners, seen from their sites.
#[derive(Default)]
struct Cells {
    first: Points,
    last: Points,
    /// Twice the area, and six times its moments.
    area: Lanes,
    moments: Points,
    /// Whether more than half the way round is done, and all of it.
    half: [bool; LANES],
    done: [bool; LANES],
    /// Whether the circle around a corner through the site leaves the room, so that a site in it may have been missed.
    open: [bool; LANES],
}

impl Cells {
    /// The next corner: where the lines meet that are the points `at` and `next`.
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

    /// Adds the triangle between the site, the last corner and the next.
    #[inline(always)]
    fn triangle(&mut self, lane: usize, x: f64, y: f64) {
        let last = [self.last[0][lane], self.last[1][lane]];
        let area = last[0] * y - last[1] * x;
        self.area[lane] += area;
        self.moments[0][lane] += area * (last[0] + x);
        self.moments[1][lane] += area * (last[1] + y);
        (self.last[0][lane], self.last[1][lane]) = (x, y);
    }

    /// Notes which walks have come round, or ended where there is no next line. Whether all have.
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
