//! Detects self-intersections of an outline: none if it surrounds its centroid once, else by a sweep over its edges.

use crate::outline::{Point, centroid, cross, edges, sub};

/// Returns whether the closed outline touches or intersects itself.
///
/// Returns true if two edges that are not neighbours share a point, or if two neighbours overlap. Repeated points count
/// as one. Fewer than three different points, or a coordinate that is not finite, give true. The time is O(n log n) for
/// typical outlines, and O(n²) if many edges overlap along the longer side of the bounding box.
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
    if is_star(&points) {
        return false;
    }
    let count = points.len();
    let overlaps = |i: usize| edges_overlap(points[i], points[(i + 1) % count], points[(i + 2) % count]);
    (0..count).any(overlaps) || finds_crossing(&points)
}

/// Returns whether the outline surrounds its centroid once and every ray from the centroid crosses it once. Such an
/// outline does not intersect itself. Returns false for angles within rounding errors.
fn is_star(points: &[Point]) -> bool {
    const ROUNDING: f64 = 1e-12;
    let centre = centroid(points);
    let size = points.iter().flatten().fold(0.0_f64, |size, v| size.max(v.abs()));
    let turns =
        |sign: f64| edges(points).all(|(p, q)| sign * cross(sub(p, centre), sub(q, centre)) > ROUNDING * size * size);
    let upwards = edges(points).filter(|(p, q)| p[1] < centre[1] && q[1] >= centre[1]).count();
    upwards == 1 && (turns(1.0) || turns(-1.0))
}

/// Returns whether the edge q–r overlaps the edge p–q.
fn edges_overlap(p: Point, q: Point, r: Point) -> bool {
    let (a, b) = (sub(q, p), sub(r, q));
    cross(a, b) == 0.0 && a[0] * b[0] + a[1] * b[1] < 0.0
}

/// Returns whether two closed segments share a point.
fn segments_intersect(a: Point, b: Point, c: Point, d: Point) -> bool {
    let boxes_overlap = (0..2).all(|k| a[k].min(b[k]) <= c[k].max(d[k]) && c[k].min(d[k]) <= a[k].max(b[k]));
    if !boxes_overlap {
        return false;
    }
    let side = |p: Point, q: Point, r: Point| cross(sub(q, p), sub(r, p));
    let separates = |p: Point, q: Point, r: Point, s: Point| {
        let (one, other) = (side(p, q, r), side(p, q, s));
        (one > 0.0 && other > 0.0) || (one < 0.0 && other < 0.0)
    };
    // For collinear segments all sides are 0, and the bounding boxes decide.
    !separates(a, b, c, d) && !separates(c, d, a, b)
}

/// Returns whether two edges that are not neighbours share a point.
fn finds_crossing(points: &[Point]) -> bool {
    let extent = |axis: usize| {
        let bounds = |(low, high): (f64, f64), p: &Point| (low.min(p[axis]), high.max(p[axis]));
        let (low, high) = points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), bounds);
        high - low
    };
    let axis = usize::from(extent(1) > extent(0));
    let from = |(p, q): (Point, Point)| p[axis].min(q[axis]);
    // Edges in the order of the sweep. An outline has few monotone runs, which a stable sort merges quickly.
    let mut sorted: Vec<(usize, (Point, Point))> = edges(points).enumerate().collect();
    sorted.sort_by(|a, b| from(a.1).total_cmp(&from(b.1)));
    sorted.iter().enumerate().any(|(n, &(i, (a, b)))| {
        let end = a[axis].max(b[axis]);
        sorted[n + 1..].iter().take_while(|other| from(other.1) <= end).any(|&(j, (c, d))| {
            let distance = i.abs_diff(j);
            distance != 1 && distance != points.len() - 1 && segments_intersect(a, b, c, d)
        })
    })
}
