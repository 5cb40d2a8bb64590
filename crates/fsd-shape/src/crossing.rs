//! Does a closed outline cross itself? A sweep over the edges, so that only those side by side are compared.

use crate::outline::{Point, cross, edges, sub};

/// Whether the closed outline touches or crosses itself.
///
/// True if two edges that are not neighbours share a point, or if two neighbours fold back onto each other. Repeated points
/// are taken as one; fewer than three different points, or a coordinate that is not finite, make no simple outline and give true.
/// Takes about n log n time, and up to n² where many edges span the same stretch of the longer side.
///
/// ```
/// use fsd_shape::self_intersects;
/// assert!(!self_intersects(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]));
/// assert!(self_intersects(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]));
/// ```
pub fn self_intersects(outline: &[Point]) -> bool {
    let mut points = outline.to_vec();
    points.dedup();
    while points.len() > 1 && points.first() == points.last() {
        points.pop();
    }
    let finite = points.iter().flatten().all(|v| v.is_finite());
    if points.len() < 3 || !finite {
        return true;
    }
    let count = points.len();
    let folds = |i: usize| folds_back(points[i], points[(i + 1) % count], points[(i + 2) % count]);
    (0..count).any(folds) || finds_crossing(&points)
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

/// Whether two edges that are not neighbours share a point.
fn finds_crossing(points: &[Point]) -> bool {
    let extent = |axis: usize| {
        let bounds = |(low, high): (f64, f64), p: &Point| (low.min(p[axis]), high.max(p[axis]));
        let (low, high) = points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), bounds);
        high - low
    };
    let axis = usize::from(extent(1) > extent(0));
    let from = |(p, q): (Point, Point)| p[axis].min(q[axis]);
    // Edges in the order in which the sweep meets them; an outline has few runs, which a stable sort only merges.
    let mut met: Vec<(usize, (Point, Point))> = edges(points).enumerate().collect();
    met.sort_by(|a, b| from(a.1).total_cmp(&from(b.1)));
    met.iter().enumerate().any(|(n, &(i, (a, b)))| {
        let end = a[axis].max(b[axis]);
        met[n + 1..].iter().take_while(|other| from(other.1) <= end).any(|&(j, (c, d))| {
            let apart = i.abs_diff(j);
            apart != 1 && apart != points.len() - 1 && meet(a, b, c, d)
        })
    })
}
