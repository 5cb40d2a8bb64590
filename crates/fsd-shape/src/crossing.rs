//! Does a closed outline cross itself? A uniform grid over the edges, so that only neighbours are compared.

use core::ops::Range;

use crate::outline::{Point, count_as_f64, cross, distance, edges, sub};

/// Cells of the grid per edge, at most (about): finer grids cost more to clear than they spare in comparisons.
const CELLS_PER_EDGE: f64 = 6.0;

/// Whether the closed outline touches or crosses itself.
///
/// True if two edges that are not neighbours share a point, or if two neighbours fold back onto each other. Repeated points
/// are taken as one; fewer than three different points, or a coordinate that is not finite, make no simple outline and give true.
/// Takes about linear time on outlines of even spacing.
///
/// ```
/// use fsd_shape::self_intersects;
/// assert!(!self_intersects(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]));
/// assert!(self_intersects(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]));
/// ```
pub fn self_intersects(outline: &[Point]) -> bool {
    let mut points: Vec<Point> = Vec::with_capacity(outline.len());
    for &p in outline {
        if points.last() != Some(&p) {
            points.push(p);
        }
    }
    while points.len() > 1 && points.first() == points.last() {
        points.pop();
    }
    let finite = points.iter().flatten().all(|v| v.is_finite());
    if points.len() < 3 || !finite {
        return true;
    }
    let count = points.len();
    let folds = (0..count).any(|i| {
        let (p, q, r) = (points[i], points[(i + 1) % count], points[(i + 2) % count]);
        folds_back(p, q, r)
    });
    folds || Grid::new(&points).finds_crossing(&points)
}

/// Whether the edge q–r runs back over the edge p–q.
fn folds_back(p: Point, q: Point, r: Point) -> bool {
    let (a, b) = (sub(q, p), sub(r, q));
    cross(a, b) == 0.0 && a[0] * b[0] + a[1] * b[1] < 0.0
}

/// Whether two closed segments share a point.
fn meet(a: Point, b: Point, c: Point, d: Point) -> bool {
    let boxes_meet = (0..2).all(|k| a[k].min(b[k]) <= c[k].max(d[k]) && c[k].min(d[k]) <= a[k].max(b[k]));
    if !boxes_meet {
        return false;
    }
    let side = |p: Point, q: Point, r: Point| cross(sub(q, p), sub(r, p));
    let parts = |p: Point, q: Point, r: Point, s: Point| {
        let (one, other) = (side(p, q, r), side(p, q, s));
        (one > 0.0 && other > 0.0) || (one < 0.0 && other < 0.0)
    };
    // On one line the sides are all 0 and the boxes decide.
    !parts(a, b, c, d) && !parts(c, d, a, b)
}

/// Edges by the square cells their bounding boxes touch: the edges of cell `k` are `entries[starts[k]..starts[k + 1]]`.
struct Grid {
    starts: Vec<u32>,
    entries: Vec<u32>,
}

impl Grid {
    fn new(points: &[Point]) -> Self {
        let mut low = points[0];
        let mut high = points[0];
        let mut length = 0.0;
        for (p, q) in edges(points) {
            low = [low[0].min(p[0]), low[1].min(p[1])];
            high = [high[0].max(p[0]), high[1].max(p[1])];
            length += distance(p, q);
        }
        let extent = sub(high, low);
        let count = count_as_f64(points.len());
        let fair = (extent[0] * extent[1] / (CELLS_PER_EDGE * count)).sqrt();
        // At least a mean edge, so that an edge touches few cells; the perimeter is at least twice the extent, so this bounds the cells in a row too.
        let side = fair.max(length / count);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a finite, non-negative number of cells, at most a few times the number of edges"
        )]
        let cell = |offset: f64| (offset / side) as usize;
        let columns = cell(extent[0]) + 1;
        let rows = cell(extent[1]) + 1;
        let range = |p: Point, q: Point, axis: usize| {
            let (a, b) = (p[axis] - low[axis], q[axis] - low[axis]);
            cell(a.min(b))..cell(a.max(b)) + 1
        };
        let touched: Vec<(Range<usize>, Range<usize>)> =
            edges(points).map(|(p, q)| (range(p, q, 0), range(p, q, 1))).collect();

        let mut starts = vec![0_u32; columns * rows + 1];
        for (across, down) in &touched {
            for row in down.clone() {
                for start in &mut starts[row * columns + 1..][across.clone()] {
                    *start += 1;
                }
            }
        }
        for k in 1..starts.len() {
            starts[k] += starts[k - 1];
        }
        let mut next = starts.clone();
        let mut entries = vec![0_u32; starts[columns * rows] as usize];
        for (edge, (across, down)) in (0_u32..).zip(&touched) {
            for row in down.clone() {
                for place in &mut next[row * columns..][across.clone()] {
                    entries[*place as usize] = edge;
                    *place += 1;
                }
            }
        }
        Self { starts, entries }
    }

    fn finds_crossing(&self, points: &[Point]) -> bool {
        let segments: Vec<(Point, Point)> = edges(points).collect();
        let last = segments.len() - 1;
        self.starts.windows(2).any(|bounds| {
            let here = &self.entries[bounds[0] as usize..bounds[1] as usize];
            here.iter().enumerate().any(|(n, &i)| {
                let i = i as usize;
                let (a, b) = segments[i];
                here[n + 1..].iter().any(|&j| {
                    let j = j as usize;
                    let neighbours = j == i + 1 || (i == 0 && j == last);
                    let (c, d) = segments[j];
                    !neighbours && meet(a, b, c, d)
                })
            })
        })
    }
}
