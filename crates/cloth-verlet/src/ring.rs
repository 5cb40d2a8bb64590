//! The outline in motion, and how it pushes the vertices that it touches.

use crate::Point;
use crate::kernel::Real;
use crate::lanes::{Lane, Node};
use std::f64::consts::TAU;

/// A closed curve in every lane.
pub(crate) type Curve<T, const L: usize> = Vec<[Lane<T, L>; 2]>;

/// Half of the part of the outline that a vertex on the rim looks at for its nearest side: an eighth of the way round.
const HALF_VIEW: f64 = 0.125;
/// Distance from the disc's centre below which the view grows no wider; it is the whole outline there.
const WIDEST: f64 = 0.25;
/// Power of two of the longest rest between two looks at a vertex, in steps.
const LONGEST: u32 = 4;
/// Distance by which a vertex and the outline are expected to near each other in a step: this many times the way of the outline's
/// fastest point, and this much more, in equivalent radii.
const HASTE: (f64, f64) = (2.0, 1e-3);

/// The sides of the outline that a vertex may meet: `count` of them from `first` on, round the end if need be.
#[derive(Debug, Clone, Copy)]
pub(crate) struct View {
    first: u32,
    count: u32,
}

impl View {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "side numbers, reduced to 0..sides"
    )]
    pub(crate) fn from([x, y]: Point, sides: usize) -> View {
        let count = sides as f64;
        let half = (count * HALF_VIEW / (x * x + y * y).sqrt().max(WIDEST)).ceil().min((count / 2.0).floor());
        let own = (libm::atan2(y, x) / TAU + 1.0) * count;
        View { first: (own - half) as u32 % sides as u32, count: (2.0 * half) as u32 }
    }
}

/// A corner of the outline and the side that starts there.
#[derive(Debug, Clone, Copy)]
struct Corner<T, const L: usize> {
    at: [Lane<T, L>; 2],
    /// Outward normal, of any length. Interpolated along a side, it tells outside from inside even where a corner is nearest.
    normal: [Lane<T, L>; 2],
    /// 1 / length² of the side.
    inverse: Lane<T, L>,
}

/// The outline of every lane.
#[derive(Debug)]
pub(crate) struct Ring<T, const L: usize> {
    pub(crate) points: Curve<T, L>,
    /// Points of the step before, for Eq. 4.
    pub(crate) before: Curve<T, L>,
    /// One more than there are points: the last is the first.
    corners: Vec<Corner<T, L>>,
    /// How far each vertex may still go before it could be outside.
    slack: Vec<Lane<T, L>>,
}

impl<T: Real, const L: usize> Ring<T, L> {
    pub(crate) fn new(points: Curve<T, L>, vertices: usize) -> Ring<T, L> {
        let corner =
            |&at: &[Lane<T, L>; 2]| Corner { at, normal: [Lane([T::ZERO; L]); 2], inverse: Lane([T::ZERO; L]) };
        let corners = points.iter().chain(points.first()).map(corner).collect();
        Ring { corners, before: points.clone(), points, slack: vec![Lane([T::ZERO; L]); vertices] }
    }

    /// Moves every vertex from `first` on that is outside to the nearest of the sides in its view, after step `step`.
    #[inline(always)]
    pub(crate) fn press(&mut self, now: &mut [Node<T, L>], views: &[View], first: usize, step: usize) {
        let pace = self.measure();
        // A vertex is looked at before its slack is used up, in a step that is a multiple of as great a power of two as may be: so
        // the lanes, which all wait for one, are looked at together.
        let stride = T::of(f64::from(1_u32 << step.trailing_zeros().min(LONGEST)));
        for ((node, view), slack) in now.iter_mut().zip(views).zip(&mut self.slack).skip(first) {
            let mut due = false;
            for l in 0..L {
                slack[l] = slack[l] - pace[l];
                due |= slack[l] < pace[l] * stride;
            }
            if due {
                let nearest = Nearest::to(&[node[0], node[1]], &self.corners, view);
                for l in 0..L {
                    // Lanes that are not due stay as they are, whatever their neighbours do.
                    let due = slack[l] < pace[l] * stride;
                    let outside = nearest.outwards[l] > T::ZERO;
                    for (value, off) in node.iter_mut().zip(&nearest.off) {
                        value[l] = if due & outside { value[l] - off[l] } else { value[l] };
                    }
                    let gap = if outside { T::ZERO } else { nearest.away[l].sqrt() };
                    slack[l] = if due { gap } else { slack[l] };
                }
            }
        }
    }

    /// Brings the corners up to date with the points; returns how far a vertex may have come towards a side meanwhile.
    #[inline(always)]
    fn measure(&mut self) -> Lane<T, L> {
        let count = self.points.len();
        let mut fastest = Lane([T::ZERO; L]);
        for k in 0..count {
            let (a, b) = (self.points[k], self.points[if k + 1 < count { k + 1 } else { 0 }]);
            let corner = &mut self.corners[k];
            for l in 0..L {
                let (mx, my) = (a[0][l] - corner.at[0][l], a[1][l] - corner.at[1][l]);
                fastest[l] = fastest[l].at_least(mx * mx + my * my);
                let (ux, uy) = (b[0][l] - a[0][l], b[1][l] - a[1][l]);
                let inverse = T::ONE / (ux * ux + uy * uy + T::TINY);
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
        Lane(fastest.0.map(|square| square.sqrt() * T::of(HASTE.0) + T::of(HASTE.1)))
    }
}

/// The nearest point of the outline found so far.
#[derive(Debug)]
struct Nearest<T, const L: usize> {
    /// Square of its distance.
    away: Lane<T, L>,
    /// From there to the vertex.
    off: [Lane<T, L>; 2],
    /// How far outwards that is.
    outwards: Lane<T, L>,
}

impl<T: Real, const L: usize> Nearest<T, L> {
    /// Looks at the sides in view of a vertex at `p`.
    #[inline(always)]
    fn to(p: &[Lane<T, L>; 2], corners: &[Corner<T, L>], view: &View) -> Nearest<T, L> {
        let zero = Lane([T::ZERO; L]);
        let mut nearest = Nearest { away: Lane([T::of(f64::from(f32::MAX)); L]), off: [zero; 2], outwards: zero };
        let sides = corners.len() - 1;
        let (start, end) = (view.first as usize, (view.first + view.count) as usize);
        let (head, tail) = (&corners[start..=end.min(sides)], &corners[..=end.saturating_sub(sides)]);
        for pairs in [head.windows(2), tail.windows(2)] {
            for pair in pairs {
                nearest.meet(p, &pair[0], &pair[1]);
            }
        }
        nearest
    }

    /// Looks at the side from `a` to `b`.
    #[inline(always)]
    fn meet(&mut self, [px, py]: &[Lane<T, L>; 2], a: &Corner<T, L>, b: &Corner<T, L>) {
        for l in 0..L {
            let (rx, ry) = (px[l] - a.at[0][l], py[l] - a.at[1][l]);
            let (ux, uy) = (b.at[0][l] - a.at[0][l], b.at[1][l] - a.at[1][l]);
            let t = ((rx * ux + ry * uy) * a.inverse[l]).at_least(T::ZERO).at_most(T::ONE);
            let (ex, ey) = (rx - t * ux, ry - t * uy);
            let away = ex * ex + ey * ey;
            let nx = a.normal[0][l] + t * (b.normal[0][l] - a.normal[0][l]);
            let ny = a.normal[1][l] + t * (b.normal[1][l] - a.normal[1][l]);
            // Weights of 1 and 0 instead of a choice: a masked store could not be read back without waiting for it.
            let (new, old) = if away < self.away[l] { (T::ONE, T::ZERO) } else { (T::ZERO, T::ONE) };
            self.away[l] = self.away[l].at_most(away);
            self.off[0][l] = new * ex + old * self.off[0][l];
            self.off[1][l] = new * ey + old * self.off[1][l];
            self.outwards[l] = new * (ex * nx + ey * ny) + old * self.outwards[l];
        }
    }
}
