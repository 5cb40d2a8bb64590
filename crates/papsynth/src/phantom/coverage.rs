//! Exact coverage of pixels by polygons.

use std::borrow::Cow;
use std::cell::Cell;

use multiversion::multiversion;

use super::box_sums::add_row;
use super::tile::{Point, Tile};

impl Tile {
    /// Raises every pixel to the fraction of its area inside a simple polygon. Parts outside the tile are ignored.
    pub(crate) fn cover(&mut self, polygon: &[Point]) {
        let mut edges = Edges::new(self);
        edges.add(polygon);
        edges.for_each_row(self, raise);
    }

    /// Adds `weight` times the coverage of simple polygons, which must have the same orientation.
    pub(crate) fn add_covers(&mut self, polygons: impl IntoIterator<Item = Vec<Point>>, weight: f32) {
        let mut edges = Edges::new(self);
        polygons.into_iter().for_each(|polygon| edges.add(&polygon));
        edges.for_each_row(self, |row, coverage| add_row(row, coverage, weight));
    }
}

#[multiversion(targets = "simd")]
fn raise(row: &mut [f32], coverage: &[f32]) {
    for (value, &coverage) in row.iter_mut().zip(coverage) {
        let coverage = if coverage < 1.0 { coverage } else { 1.0 };
        *value = if coverage > *value { coverage } else { *value };
    }
}

/// Pixels of a block.
const BLOCK: usize = 16;

/// Coverage below which a pixel is outside: rounding errors.
const NEGLIGIBLE: f32 = 1e-5;

thread_local! {
    /// The memory of the last [`Edges`] of a thread, with all steps 0 again: most blocks of a tile are not crossed, so
    /// clearing the crossed ones is faster than allocating.
    static SPARE: Cell<(Vec<[f32; BLOCK]>, Vec<bool>)> = Cell::default();
}

/// The edges of polygons on the pixels of a tile.
///
/// The coverage of a pixel is the sum of the steps in its row up to that pixel: an edge adds the covered fraction of
/// the pixels that it crosses, and makes the rest of the row covered or not.
struct Edges {
    /// Position of the corner of the tile.
    corner: Point,
    /// Width and height of the tile.
    size: [usize; 2],
    /// Rows of blocks of steps. The vectors may be longer than the tile needs.
    steps: Vec<[f32; BLOCK]>,
    /// Whether any step of a block may be other than 0.
    crossed: Vec<bool>,
    /// Blocks of a row.
    stride: usize,
}

impl Edges {
    fn new(tile: &Tile) -> Self {
        let size = [tile.width, tile.height()];
        // An edge at the right border of the tile adds to the two pixels beyond.
        let stride = (size[0] + 2).div_ceil(BLOCK);
        let (mut steps, mut crossed) = SPARE.take();
        let blocks = steps.len().max(stride * size[1]);
        steps.resize(blocks, [0.0; BLOCK]);
        crossed.resize(blocks, false);
        Self { corner: tile.origin.map(|at| at as f64 - 0.5), size, steps, crossed, stride }
    }

    /// Adds the edges of a polygon.
    fn add(&mut self, polygon: &[Point]) {
        let high = [0, 1].map(|axis| self.corner[axis] + self.size[axis] as f64);
        add_edges(self, &clipped(polygon, self.corner, high));
    }

    /// Adds the edge from `from` down to `to`, in pixels from the corner.
    #[inline(always)]
    fn add_edge(&mut self, from: Point, to: Point, sign: f64) {
        let slope = (to[0] - from[0]) / (to[1] - from[1]);
        let (mut column, mut row) = (from[0] as usize, from[1] as usize);
        let (mut at, mut border) = (from, (row + 1) as f64);
        while border < to[1] {
            let next = [from[0] + (border - from[1]) * slope, border];
            column = self.add_piece([column, row], at, next, sign);
            (at, border) = (next, border + 1.0);
            row += 1;
        }
        self.add_piece([column, row], at, to, sign);
    }

    /// Adds a piece of an edge within a row, and returns the column of its lower end.
    #[inline(always)]
    fn add_piece(&mut self, [mut column, row]: [usize; 2], [mut x, y]: Point, to: Point, sign: f64) -> usize {
        let mut height = sign * (to[1] - y);
        let mut side = column as f64;
        if !(to[0] >= side && to[0] <= side + 1.0) {
            let slope = height / (to[0] - x);
            while to[0] > side + 1.0 {
                let part = slope * (side + 1.0 - x);
                self.add_part([column, row], part, side + 1.0 - 0.5 * (x + side + 1.0));
                (x, height, column, side) = (side + 1.0, height - part, column + 1, side + 1.0);
            }
            while to[0] < side && column > 0 {
                let part = slope * (side - x);
                self.add_part([column, row], part, side + 1.0 - 0.5 * (x + side));
                (x, height, column, side) = (side, height - part, column - 1, side - 1.0);
            }
        }
        self.add_part([column, row], height, side + 1.0 - 0.5 * (x + to[0]));
        column
    }

    /// Adds the part of an edge within a pixel: `height`, of which the fraction `beyond` of the pixel is on the right.
    #[inline(always)]
    fn add_part(&mut self, [column, row]: [usize; 2], height: f64, beyond: f64) {
        let block = row * self.stride + column / BLOCK;
        let covered = height * beyond;
        if let Some([here, next]) = self.steps.as_flattened_mut()[block * BLOCK + column % BLOCK..].first_chunk_mut() {
            *here += covered as f32;
            *next += (height - covered) as f32;
        }
        self.crossed[block] = true;
        self.crossed[row * self.stride + (column + 1) / BLOCK] = true;
    }

    /// Calls `visit` with each row of the tile and the total coverage of its pixels, without rows that are not covered.
    fn for_each_row(mut self, tile: &mut Tile, visit: impl Fn(&mut [f32], &[f32])) {
        let mut line = vec![[0.0; BLOCK]; self.stride];
        let rows = self.steps.chunks_exact_mut(self.stride).zip(self.crossed.chunks_exact_mut(self.stride));
        for (row, (steps, crossed)) in tile.values.chunks_exact_mut(tile.width).zip(rows) {
            if crossed.contains(&true) {
                sum_steps(&mut line, steps, crossed);
                visit(row, line.as_flattened());
            }
        }
        SPARE.set((self.steps, self.crossed));
    }
}

#[multiversion(targets = "simd")]
fn add_edges(edges: &mut Edges, polygon: &[Point]) {
    let place = |p: &Point| [p[0] - edges.corner[0], p[1] - edges.corner[1]];
    let Some(mut from) = polygon.last().map(place) else { return };
    for to in polygon {
        let to = [to[0] - edges.corner[0], to[1] - edges.corner[1]];
        if from[1] < to[1] {
            edges.add_edge(from, to, 1.0);
        } else if from[1] > to[1] {
            edges.add_edge(to, from, -1.0);
        }
        from = to;
    }
}

/// Sums the steps of a row from left to right and clears them; negative sums count as positive.
#[multiversion(targets = "simd")]
fn sum_steps(line: &mut [[f32; BLOCK]], steps: &mut [[f32; BLOCK]], crossed: &mut [bool]) {
    let mut level = 0.0_f32;
    for ((out, steps), crossed) in line.iter_mut().zip(steps).zip(crossed) {
        *out = [level; BLOCK];
        if *crossed {
            for (out, step) in out.iter_mut().zip(&*steps) {
                level += step;
                *out = level;
            }
            (*steps, *crossed) = ([0.0; BLOCK], false);
        }
        for out in out {
            *out = if out.abs() > NEGLIGIBLE { out.abs() } else { 0.0 };
        }
    }
}

/// Clips a polygon to a rectangle (Sutherland and Hodgman, doi:10.1145/360767.360802).
fn clipped(polygon: &[Point], low: Point, high: Point) -> Cow<'_, [Point]> {
    let inside = |p: &Point| (0..2).all(|axis| (low[axis]..=high[axis]).contains(&p[axis]));
    if polygon.iter().all(inside) {
        return Cow::Borrowed(polygon);
    }
    let mut left = polygon.to_vec();
    for (axis, bound, sign) in [(0, low[0], 1.0), (0, high[0], -1.0), (1, low[1], 1.0), (1, high[1], -1.0)] {
        let whole = core::mem::take(&mut left);
        let beyond = |p: Point| sign * (p[axis] - bound);
        for (index, &to) in whole.iter().enumerate() {
            let from = whole[(index + whole.len() - 1) % whole.len()];
            let (before, after) = (beyond(from), beyond(to));
            if (before < 0.0) != (after < 0.0) {
                let t = before / (before - after);
                let mut cut = [from[0] + t * (to[0] - from[0]), from[1] + t * (to[1] - from[1])];
                cut[axis] = bound;
                left.push(cut);
            }
            if after >= 0.0 {
                left.push(to);
            }
        }
    }
    // Rounding at a corner may leave a point slightly outside.
    for point in &mut left {
        for axis in 0..2 {
            point[axis] = point[axis].clamp(low[axis], high[axis]);
        }
    }
    Cow::Owned(left)
}

#[cfg(test)]
mod tests {
    use super::super::tile::area;
    use super::super::tile::tests::{at, disc, tile};
    use super::*;

    #[test]
    fn coverage_equals_the_area_and_covering_twice_changes_nothing() {
        let polygon = disc([-3.3, 17.8], 6.4);
        let mut tile = Tile::around(&polygon, 2.0);
        tile.cover(&polygon);
        let sum: f64 = tile.values.iter().map(|v| f64::from(*v)).sum();
        assert!((sum - area(&polygon)).abs() < 1e-3, "{sum} {}", area(&polygon));
        let (mut x, mut y) = (0.0, 0.0);
        tile.for_each(|p, v| {
            x += p[0] * f64::from(*v);
            y += p[1] * f64::from(*v);
        });
        // Partly covered pixels count at their centres: accurate to 0.01 px, while a shifted grid would err by 0.5 px.
        assert!((x / sum + 3.3).abs() < 1e-2 && (y / sum - 17.8).abs() < 1e-2, "pixel centres are at integers");
        let once = tile.clone();
        tile.cover(&polygon);
        assert_eq!(once, tile);
    }

    #[test]
    fn parts_outside_a_tile_are_ignored() {
        let polygon = disc([4.0, 6.0], 9.0);
        let mut whole = Tile::around(&polygon, 2.0);
        whole.cover(&polygon);
        for (origin, width, height) in
            [([0, 0], 7, 30), ([-20, 3], 60, 4), ([2, -9], 3, 40), ([10, 12], 9, 9), ([30, 0], 4, 4)]
        {
            let mut part = tile(origin, width, height).blank();
            part.cover(&polygon);
            part.for_each(|p, value| {
                let expected = at(&whole, p.map(|c| c as i64));
                assert!((*value - expected).abs() < 1e-4, "{origin:?} {p:?}: {value} {expected}");
            });
        }
    }

    #[test]
    fn coverage_matches_many_points_in_each_pixel() {
        // A star with long and short edges in all directions, partly outside the tile.
        let star: Vec<Point> = (0..14)
            .map(|i| {
                let (angle, radius) = (f64::from(i) * 0.4487, if i % 2 == 0 { 19.3 } else { 6.1 });
                [12.2 + radius * libm::cos(angle), 9.7 + radius * libm::sin(angle)]
            })
            .collect();
        let inside = |x: f64, y: f64| {
            let sides = star.iter().zip(star.iter().cycle().skip(1));
            sides
                .filter(|(a, b)| (a[1] <= y) != (b[1] <= y) && x < a[0] + (y - a[1]) * (b[0] - a[0]) / (b[1] - a[1]))
                .count()
                % 2
                == 1
        };
        let mut tile = Tile { origin: [-3, 1], width: 33, values: vec![0.0; 33 * 21] };
        tile.cover(&star);
        let side = 20;
        tile.for_each(|p, value| {
            let at = |i: i32| (f64::from(i) + 0.5) / f64::from(side) - 0.5;
            let points = (0..side * side).filter(|i| inside(p[0] + at(i % side), p[1] + at(i / side))).count();
            let expected = points as f64 / f64::from(side * side);
            assert!((f64::from(*value) - expected).abs() < 0.03, "{p:?}: {value} {expected}");
            assert!(expected > 0.0 || *value < 0.01, "{p:?}: {value}");
        });
        assert!(tile.values.iter().filter(|value| **value == 0.0).count() > 100);
    }
}
