//! The moving outline, and its collisions with vertices.

use crate::Point;
use crate::lanes::{Curve, Lane, Node, TINY, at_least, at_most};
use std::f64::consts::TAU;

/// Half of the search window of a vertex on the rim, as a fraction of the perimeter.
const HALF_WINDOW: f64 = 0.125;
/// Distance from the centre of the disc below which the search window is the complete outline.
const FULL_WINDOW_RADIUS: f64 = 0.25;
/// Binary logarithm of the longest interval between two checks of a vertex, in steps.
const MAX_INTERVAL_LOG2: u32 = 4;
/// Assumed approach of a vertex and the outline in a step: a multiple of the displacement of the outline's fastest
/// point, plus a constant in equivalent radii.
const APPROACH: (f32, f32) = (2.0, 1e-3);

/// Consecutive sides that are skipped together if all lanes have found a nearer one.
const GROUP: usize = 4;
/// Margin of the bounding circle of a group, in equivalent radii: a hundred times the rounding error of f32.
const CIRCLE_MARGIN: f32 = 1e-5;

/// The sides of the outline that a vertex may touch: `count` groups, alternating to both sides of the group `own`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SearchWindow {
    own: u32,
    count: u32,
}

impl SearchWindow {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "side numbers, reduced to 0..sides")]
    pub(crate) fn from([x, y]: Point, sides: usize) -> SearchWindow {
        let count = sides as f64;
        let half = (count * HALF_WINDOW / (x * x + y * y).sqrt().max(FULL_WINDOW_RADIUS)).ceil() as usize;
        let own = ((libm::atan2(y, x) / TAU + 1.0) * count) as usize % sides;
        let groups = (2 * half.div_ceil(GROUP) + 1).min(sides.div_ceil(GROUP));
        SearchWindow { own: (own / GROUP) as u32, count: groups as u32 }
    }

    /// Returns the indices of the groups, of `all`. The order is fixed for each vertex: of sides at the same distance,
    /// every lane takes the first, whichever groups are skipped.
    #[inline(always)]
    fn groups(&self, all: usize) -> impl Iterator<Item = usize> {
        let (own, count) = (self.own as usize, self.count as usize);
        (0..count).map(move |k| {
            let apart = k.div_ceil(2);
            let group = if k % 2 == 1 { own + apart } else { own + all - apart };
            if group < all { group } else { group - all }
        })
    }
}

/// A corner of the outline and the side that starts there.
#[derive(Debug, Clone, Copy)]
struct Corner<const L: usize> {
    at: [Lane<L>; 2],
    /// Outward normal, of any length. Interpolated along a side, its sign distinguishes inside and outside even at a
    /// corner.
    normal: [Lane<L>; 2],
    /// 1 / length² of the side.
    inverse: Lane<L>,
}

#[derive(Debug, Clone, Copy)]
struct Circle<const L: usize> {
    centre: [Lane<L>; 2],
    radius: Lane<L>,
}

impl<const L: usize> Circle<L> {
    #[inline(always)]
    fn round(corners: &[Corner<L>]) -> Circle<L> {
        let (first, last) = (&corners[0].at, &corners[corners.len() - 1].at);
        let (mut centre, mut radius) = ([Lane::ZERO; 2], Lane::ZERO);
        for axis in 0..2 {
            for l in 0..L {
                centre[axis][l] = 0.5 * (first[axis][l] + last[axis][l]);
            }
        }
        for corner in corners {
            for l in 0..L {
                let (x, y) = (corner.at[0][l] - centre[0][l], corner.at[1][l] - centre[1][l]);
                radius[l] = at_least(radius[l], x * x + y * y);
            }
        }
        Circle { centre, radius: Lane(radius.0.map(|square| square.sqrt() + CIRCLE_MARGIN)) }
    }

    /// Returns whether, in any lane, the circle is within the distance `limit` of `p`.
    #[inline(always)]
    fn reaches(&self, [px, py]: &[Lane<L>; 2], limit: &Lane<L>) -> bool {
        let mut near = false;
        for l in 0..L {
            let (x, y) = (px[l] - self.centre[0][l], py[l] - self.centre[1][l]);
            let reach = at_least(limit[l] + self.radius[l], 0.0);
            near |= x * x + y * y <= reach * reach;
        }
        near
    }
}

#[derive(Debug)]
pub(crate) struct MovingOutline<const L: usize> {
    pub(crate) points: Curve<L>,
    /// Points of the previous step, for Eq. 4.
    pub(crate) before: Curve<L>,
    /// One more than there are points; the last repeats the first.
    corners: Vec<Corner<L>>,
    /// The bounding circle of each [`GROUP`] of sides.
    circles: Vec<Circle<L>>,
    /// Distance that each vertex can move before it can be outside.
    slack: Vec<Lane<L>>,
}

impl<const L: usize> MovingOutline<L> {
    pub(crate) fn new(points: Curve<L>, vertices: usize) -> MovingOutline<L> {
        let corner = |&at: &[Lane<L>; 2]| Corner { at, normal: [Lane::ZERO; 2], inverse: Lane::ZERO };
        let corners: Vec<Corner<L>> = points.iter().chain(points.first()).map(corner).collect();
        let circles = (0..points.len().div_ceil(GROUP)).map(|group| Circle::round(group_of(&corners, group))).collect();
        MovingOutline { corners, circles, before: points.clone(), points, slack: vec![Lane::ZERO; vertices] }
    }

    /// Moves every vertex from `first` on that is outside to the nearest side in its search window, after step `step`.
    #[inline(always)]
    pub(crate) fn push_inside(&mut self, now: &mut [Node<L>], windows: &[SearchWindow], first: usize, step: usize) {
        let pace = self.measure();
        // A vertex is checked before its slack is used up, at a step that is a multiple of the greatest possible power
        // of two. So lanes, which wait for each other, are checked together.
        let stride = (1_u32 << step.trailing_zeros().min(MAX_INTERVAL_LOG2)) as f32;
        for ((node, window), slack) in now.iter_mut().zip(windows).zip(&mut self.slack).skip(first) {
            let mut any = false;
            for l in 0..L {
                slack[l] -= pace[l];
                any |= slack[l] < pace[l] * stride;
            }
            if any {
                // Lanes that are not due remain unchanged, so that lanes stay independent.
                let due: [bool; L] = std::array::from_fn(|l| slack[l] < pace[l] * stride);
                let nearest = Nearest::to(&[node[0], node[1]], &due, &self.corners, &self.circles, window);
                for l in 0..L {
                    let outside = nearest.outwards[l] > 0.0;
                    for (value, off) in node.iter_mut().zip(&nearest.off) {
                        value[l] = if due[l] & outside { value[l] - off[l] } else { value[l] };
                    }
                    let gap = if outside { 0.0 } else { nearest.away[l].sqrt() };
                    slack[l] = if due[l] { gap } else { slack[l] };
                }
            }
        }
    }

    /// Updates the corners from the points. Returns an upper bound of the approach of a vertex and a side since the
    /// last update.
    #[inline(always)]
    fn measure(&mut self) -> Lane<L> {
        let count = self.points.len();
        let mut fastest = Lane::ZERO;
        let (_, mut previous) = side(&self.points[count - 1], &self.points[0]);
        for k in 0..count {
            let (a, b) = (self.points[k], self.points[if k + 1 < count { k + 1 } else { 0 }]);
            let (inverse, own) = side(&a, &b);
            let at = self.corners[k].at;
            let mut normal = previous;
            for l in 0..L {
                let (mx, my) = (a[0][l] - at[0][l], a[1][l] - at[1][l]);
                fastest[l] = at_least(fastest[l], mx * mx + my * my);
                normal[0][l] += own[0][l];
                normal[1][l] += own[1][l];
            }
            self.corners[k] = Corner { at: a, normal, inverse };
            previous = own;
        }
        self.corners[count] = self.corners[0];
        for (group, circle) in self.circles.iter_mut().enumerate() {
            *circle = Circle::round(group_of(&self.corners, group));
        }
        Lane(fastest.0.map(|square| square.sqrt() * APPROACH.0 + APPROACH.1))
    }
}

/// Returns 1 / length² and the outward unit normal of the side from `a` to `b`.
#[inline(always)]
fn side<const L: usize>(a: &[Lane<L>; 2], b: &[Lane<L>; 2]) -> (Lane<L>, [Lane<L>; 2]) {
    let (mut inverse, mut normal) = (Lane::ZERO, [Lane::ZERO; 2]);
    for l in 0..L {
        let (ux, uy) = (b[0][l] - a[0][l], b[1][l] - a[1][l]);
        inverse[l] = 1.0 / (ux * ux + uy * uy + TINY);
        let unit = inverse[l].sqrt();
        normal[0][l] = uy * unit;
        normal[1][l] = -(ux * unit);
    }
    (inverse, normal)
}

/// Returns the corners of the sides of a group, and the next one.
#[inline(always)]
fn group_of<C>(corners: &[C], group: usize) -> &[C] {
    let first = group * GROUP;
    &corners[first..=(first + GROUP).min(corners.len() - 1)]
}

/// The nearest point of the outline found so far.
#[derive(Debug)]
struct Nearest<const L: usize> {
    /// Square of the distance.
    away: Lane<L>,
    /// Vector from there to the vertex.
    off: [Lane<L>; 2],
    /// Outward component of that vector.
    outwards: Lane<L>,
}

impl<const L: usize> Nearest<L> {
    /// Searches the window of a vertex at `p`, in the lanes that are `due`; other lanes are unspecified.
    #[inline(always)]
    fn to(
        p: &[Lane<L>; 2],
        due: &[bool; L],
        corners: &[Corner<L>],
        circles: &[Circle<L>],
        window: &SearchWindow,
    ) -> Nearest<L> {
        let (zero, far) = (Lane::ZERO, f32::MAX);
        let mut nearest = Nearest { away: Lane([far; L]), off: [zero; 2], outwards: zero };
        let mut limit = Lane(due.map(|due| if due { far } else { -far }));
        for group in window.groups(circles.len()) {
            if circles[group].reaches(p, &limit) {
                for pair in group_of(corners, group).windows(2) {
                    nearest.update(p, &pair[0], &pair[1]);
                }
                for l in 0..L {
                    limit[l] = if due[l] { nearest.away[l].sqrt() } else { -far };
                }
            }
        }
        nearest
    }

    /// Updates with the side from `a` to `b`.
    #[inline(always)]
    fn update(&mut self, [px, py]: &[Lane<L>; 2], a: &Corner<L>, b: &Corner<L>) {
        for l in 0..L {
            let (rx, ry) = (px[l] - a.at[0][l], py[l] - a.at[1][l]);
            let (ux, uy) = (b.at[0][l] - a.at[0][l], b.at[1][l] - a.at[1][l]);
            let t = at_most(at_least((rx * ux + ry * uy) * a.inverse[l], 0.0), 1.0);
            let (ex, ey) = (rx - t * ux, ry - t * uy);
            let away = ex * ex + ey * ey;
            let nx = a.normal[0][l] + t * (b.normal[0][l] - a.normal[0][l]);
            let ny = a.normal[1][l] + t * (b.normal[1][l] - a.normal[1][l]);
            // Weights of 1 and 0 instead of a branch: a masked store would stall the next load.
            let (new, old) = if away < self.away[l] { (1.0, 0.0) } else { (0.0, 1.0) };
            self.away[l] = at_most(self.away[l], away);
            self.off[0][l] = new * ex + old * self.off[0][l];
            self.off[1][l] = new * ey + old * self.off[1][l];
            self.outwards[l] = new * (ex * nx + ey * ny) + old * self.outwards[l];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_search_window_contains_each_group_once() {
        for sides in [8_usize, 13, 75, 112, 330] {
            let all = sides.div_ceil(GROUP);
            for k in 0..100 {
                let (angle, radius) = (f64::from(k), f64::from(k) / 99.0);
                let window = SearchWindow::from([radius * libm::cos(angle), radius * libm::sin(angle)], sides);
                let mut groups: Vec<usize> = window.groups(all).collect();
                let seen = groups.len() * GROUP;
                groups.sort_unstable();
                groups.dedup();
                assert_eq!(groups.len(), window.count as usize);
                assert!(groups.iter().all(|&g| g < all));
                let part = seen as f64 / sides as f64;
                assert!(part >= (2.0 * HALF_WINDOW / radius.max(FULL_WINDOW_RADIUS)).min(1.0), "{sides} {k}: {part}");
            }
        }
    }
}
