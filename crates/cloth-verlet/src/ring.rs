//! The outline in motion, and how it pushes the vertices that it touches.

use crate::Point;
use crate::lanes::{Curve, Lane, Node, TINY, at_least, at_most};
use std::f64::consts::TAU;

/// Half of the part of the outline that a vertex on the rim looks at for its nearest side: an eighth of the way round.
const HALF_VIEW: f64 = 0.125;
/// Distance from the disc's centre below which the view grows no wider; it is the whole outline there.
const WIDEST: f64 = 0.25;
/// Power of two of the longest rest between two looks at a vertex, in steps.
const LONGEST: u32 = 4;
/// Distance by which a vertex and the outline are expected to near each other in a step: this many times the way of the outline's
/// fastest point, and this much more, in equivalent radii.
const HASTE: (f32, f32) = (2.0, 1e-3);

/// Sides that follow each other and are passed over together where all lanes have met a nearer one.
const GROUP: usize = 4;
/// What the circle round a group is wider by than its corners lie apart, in equivalent radii: a hundred times the rounding of f32.
const SPARE: f32 = 1e-5;

/// The sides of the outline that a vertex may meet: `count` groups, from the group `own` on by turns to both sides.
#[derive(Debug, Clone, Copy)]
pub(crate) struct View {
    own: u32,
    count: u32,
}

impl View {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "side numbers, reduced to 0..sides")]
    pub(crate) fn from([x, y]: Point, sides: usize) -> View {
        let count = sides as f64;
        let half = (count * HALF_VIEW / (x * x + y * y).sqrt().max(WIDEST)).ceil() as usize;
        let own = ((libm::atan2(y, x) / TAU + 1.0) * count) as usize % sides;
        let groups = (2 * half.div_ceil(GROUP) + 1).min(sides.div_ceil(GROUP));
        View { own: (own / GROUP) as u32, count: groups as u32 }
    }

    /// Numbers of the groups, of which there are `all`. The order is the vertex's own: of sides equally near, the first counts in
    /// every lane, whatever is passed over.
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
    /// Outward normal, of any length. Interpolated along a side, it tells outside from inside even where a corner is nearest.
    normal: [Lane<L>; 2],
    /// 1 / length² of the side.
    inverse: Lane<L>,
}

#[derive(Debug, Clone, Copy)]
struct Circle<const L: usize> {
    middle: [Lane<L>; 2],
    radius: Lane<L>,
}

impl<const L: usize> Circle<L> {
    #[inline(always)]
    fn round(corners: &[Corner<L>]) -> Circle<L> {
        let (first, last) = (&corners[0].at, &corners[corners.len() - 1].at);
        let (mut middle, mut radius) = ([Lane::ZERO; 2], Lane::ZERO);
        for axis in 0..2 {
            for l in 0..L {
                middle[axis][l] = 0.5 * (first[axis][l] + last[axis][l]);
            }
        }
        for corner in corners {
            for l in 0..L {
                let (x, y) = (corner.at[0][l] - middle[0][l], corner.at[1][l] - middle[1][l]);
                radius[l] = at_least(radius[l], x * x + y * y);
            }
        }
        Circle { middle, radius: Lane(radius.0.map(|square| square.sqrt() + SPARE)) }
    }

    /// Whether, in any lane, something in the circle may be as near to `p` as `limit`.
    #[inline(always)]
    fn reaches(&self, [px, py]: &[Lane<L>; 2], limit: &Lane<L>) -> bool {
        let mut near = false;
        for l in 0..L {
            let (x, y) = (px[l] - self.middle[0][l], py[l] - self.middle[1][l]);
            let reach = at_least(limit[l] + self.radius[l], 0.0);
            near |= x * x + y * y <= reach * reach;
        }
        near
    }
}

#[derive(Debug)]
pub(crate) struct Ring<const L: usize> {
    pub(crate) points: Curve<L>,
    /// Points of the step before, for Eq. 4.
    pub(crate) before: Curve<L>,
    /// One more than there are points: the last is the first.
    corners: Vec<Corner<L>>,
    /// One round each [`GROUP`] of sides.
    circles: Vec<Circle<L>>,
    /// How far each vertex may still go before it could be outside.
    slack: Vec<Lane<L>>,
}

impl<const L: usize> Ring<L> {
    pub(crate) fn new(points: Curve<L>, vertices: usize) -> Ring<L> {
        let corner = |&at: &[Lane<L>; 2]| Corner { at, normal: [Lane::ZERO; 2], inverse: Lane::ZERO };
        let corners: Vec<Corner<L>> = points.iter().chain(points.first()).map(corner).collect();
        let circles = (0..points.len().div_ceil(GROUP)).map(|group| Circle::round(group_of(&corners, group))).collect();
        Ring { corners, circles, before: points.clone(), points, slack: vec![Lane::ZERO; vertices] }
    }

    /// Moves every vertex from `first` on that is outside to the nearest of the sides in its view, after step `step`.
    #[inline(always)]
    pub(crate) fn press(&mut self, now: &mut [Node<L>], views: &[View], first: usize, step: usize) {
        let pace = self.measure();
        // A vertex is looked at before its slack is used up, in a step that is a multiple of as great a power of two as may be: so
        // the lanes, which all wait for one, are looked at together.
        let stride = (1_u32 << step.trailing_zeros().min(LONGEST)) as f32;
        for ((node, view), slack) in now.iter_mut().zip(views).zip(&mut self.slack).skip(first) {
            let mut any = false;
            for l in 0..L {
                slack[l] -= pace[l];
                any |= slack[l] < pace[l] * stride;
            }
            if any {
                // Lanes that are not due stay as they are, whatever their neighbours do.
                let due: [bool; L] = std::array::from_fn(|l| slack[l] < pace[l] * stride);
                let nearest = Nearest::to(&[node[0], node[1]], &due, &self.corners, &self.circles, view);
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

    /// Brings the corners up to date with the points; returns how far a vertex may have come towards a side meanwhile.
    #[inline(always)]
    fn measure(&mut self) -> Lane<L> {
        let count = self.points.len();
        let mut fastest = Lane::ZERO;
        for k in 0..count {
            let (a, b) = (self.points[k], self.points[if k + 1 < count { k + 1 } else { 0 }]);
            let corner = &mut self.corners[k];
            for l in 0..L {
                let (mx, my) = (a[0][l] - corner.at[0][l], a[1][l] - corner.at[1][l]);
                fastest[l] = at_least(fastest[l], mx * mx + my * my);
                let (ux, uy) = (b[0][l] - a[0][l], b[1][l] - a[1][l]);
                let inverse = 1.0 / (ux * ux + uy * uy + TINY);
                let unit = inverse.sqrt();
                corner.inverse[l] = inverse;
                // For now the normal of the side alone.
                corner.normal[0][l] = uy * unit;
                corner.normal[1][l] = -(ux * unit);
            }
            corner.at = a;
        }
        let mut previous = self.corners[count - 1].normal;
        for corner in &mut self.corners[..count] {
            let own = corner.normal;
            for axis in 0..2 {
                for l in 0..L {
                    corner.normal[axis][l] = previous[axis][l] + own[axis][l];
                }
            }
            previous = own;
        }
        self.corners[count] = self.corners[0];
        for (group, circle) in self.circles.iter_mut().enumerate() {
            *circle = Circle::round(group_of(&self.corners, group));
        }
        Lane(fastest.0.map(|square| square.sqrt() * HASTE.0 + HASTE.1))
    }
}

/// The corners of a group's sides, and the one after.
#[inline(always)]
fn group_of<C>(corners: &[C], group: usize) -> &[C] {
    let first = group * GROUP;
    &corners[first..=(first + GROUP).min(corners.len() - 1)]
}

/// The nearest point of the outline found so far.
#[derive(Debug)]
struct Nearest<const L: usize> {
    /// Square of its distance.
    away: Lane<L>,
    /// From there to the vertex.
    off: [Lane<L>; 2],
    /// How far outwards that is.
    outwards: Lane<L>,
}

impl<const L: usize> Nearest<L> {
    /// Looks at the sides in view of a vertex at `p`, in the lanes where that is `due`; the others hold anything.
    #[inline(always)]
    fn to(p: &[Lane<L>; 2], due: &[bool; L], corners: &[Corner<L>], circles: &[Circle<L>], view: &View) -> Nearest<L> {
        let (zero, far) = (Lane::ZERO, f32::MAX);
        let mut nearest = Nearest { away: Lane([far; L]), off: [zero; 2], outwards: zero };
        let mut limit = Lane(due.map(|due| if due { far } else { -far }));
        for group in view.groups(circles.len()) {
            if circles[group].reaches(p, &limit) {
                for pair in group_of(corners, group).windows(2) {
                    nearest.meet(p, &pair[0], &pair[1]);
                }
                for l in 0..L {
                    limit[l] = if due[l] { nearest.away[l].sqrt() } else { -far };
                }
            }
        }
        nearest
    }

    /// Looks at the side from `a` to `b`.
    #[inline(always)]
    fn meet(&mut self, [px, py]: &[Lane<L>; 2], a: &Corner<L>, b: &Corner<L>) {
        for l in 0..L {
            let (rx, ry) = (px[l] - a.at[0][l], py[l] - a.at[1][l]);
            let (ux, uy) = (b.at[0][l] - a.at[0][l], b.at[1][l] - a.at[1][l]);
            let t = at_most(at_least((rx * ux + ry * uy) * a.inverse[l], 0.0), 1.0);
            let (ex, ey) = (rx - t * ux, ry - t * uy);
            let away = ex * ex + ey * ey;
            let nx = a.normal[0][l] + t * (b.normal[0][l] - a.normal[0][l]);
            let ny = a.normal[1][l] + t * (b.normal[1][l] - a.normal[1][l]);
            // Weights of 1 and 0 instead of a choice: a masked store could not be read back without waiting for it.
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
    fn a_view_holds_its_part_of_the_outline_once() {
        for sides in [8_usize, 13, 75, 112, 330] {
            let all = sides.div_ceil(GROUP);
            for k in 0..100 {
                let (angle, radius) = (f64::from(k), f64::from(k) / 99.0);
                let view = View::from([radius * libm::cos(angle), radius * libm::sin(angle)], sides);
                let mut groups: Vec<usize> = view.groups(all).collect();
                let seen = groups.len() * GROUP;
                groups.sort_unstable();
                groups.dedup();
                assert_eq!(groups.len(), view.count as usize);
                assert!(groups.iter().all(|&g| g < all));
                let part = seen as f64 / sides as f64;
                assert!(part >= (2.0 * HALF_VIEW / radius.max(WIDEST)).min(1.0), "{sides} {k}: {part}");
            }
        }
    }
}
