//! Outlines of cytoplasm: straight runs between corners, notches, tongues, and a frayed rim.

use crate::key::Stream;
use crate::phantom::tile::{Point, area};
use crate::random;
use crate::scene::cell::CellDetail;

/// Corners of the polygon that a flattened cell comes near to: from, and how many more at most.
const CORNERS: [usize; 2] = [5, 5];

/// How far a side bows outwards at most, relative to its length; half of that inwards.
const BOW: f64 = 0.07;

/// Depth of notches and length of tongues, relative to the cell's radius: from, to. Their logarithms are uniform: most are small.
const NOTCH: [f64; 2] = [0.03, 0.25];
const TONGUE: [f64; 2] = [0.03, 0.30];

/// Width of notches and tongues at their foot, relative to their depth.
const FOOT: [f64; 2] = [0.7, 2.2];

/// How often an outline of 180 points is smoothed by its neighbours: corners of a fold of cytoplasm are about a micrometre
/// round.
const ROUNDINGS: usize = 6;

/// The outline with the corners, notches and tongues that its cell has, of the same area about the same middle. What would
/// cross itself is left out.
pub(super) fn shaped(outline: Vec<Point>, detail: &CellDetail, rng: &mut Stream) -> Vec<Point> {
    if detail.angularity <= 0.0 && detail.notches == 0 && detail.protrusions == 0 {
        return outline;
    }
    let before = area(&outline);
    let middle = fsd_shape::centroid(&outline);
    let mut shape = sound(angular(&outline, detail.angularity, rng)).unwrap_or(outline);
    let radius = (before / core::f64::consts::PI).sqrt();
    for (count, [low, high], sign) in [(detail.notches, NOTCH, -1.0), (detail.protrusions, TONGUE, 1.0)] {
        for _ in 0..count {
            let depth = sign * radius * low * libm::pow(high / low, random::between(0.0, 1.0, rng));
            if let Some(poked) = sound(poked(&shape, depth, rng)) {
                shape = poked;
            }
        }
    }
    let scale = (before / area(&shape).max(f64::MIN_POSITIVE)).sqrt();
    let at = fsd_shape::centroid(&shape);
    shape.iter().map(|p| [middle[0] + scale * (p[0] - at[0]), middle[1] + scale * (p[1] - at[1])]).collect()
}

fn sound(outline: Vec<Point>) -> Option<Vec<Point>> {
    (!fsd_shape::self_intersects(&outline)).then_some(outline)
}

/// An outline drawn towards a polygon through some of its points: `share` is 0 for none of the way, 1 for all of it.
fn angular(outline: &[Point], share: f64, rng: &mut Stream) -> Vec<Point> {
    let n = outline.len();
    let wanted = CORNERS[0] + random::below(CORNERS[1] + 1, rng);
    // Corners are where the polygon so far leaves the outline most (Douglas and Peucker, doi:10.3138/FM57-6770-U75U-7727).
    let mut corners = vec![random::below(n, rng)];
    corners.push((corners[0] + n / 2) % n);
    corners.sort_unstable();
    while corners.len() < wanted {
        let mut farthest = (0.0, 0);
        for (from, steps) in sides(&corners, n) {
            for step in 1..steps {
                let at = (from + step) % n;
                let off = distance_to_line(outline[at], outline[from], outline[(from + steps) % n]);
                // Near a corner that is there already another one would only blunt it.
                let room = step.min(steps - step) as f64 / n as f64;
                if off * room.min(0.06) > farthest.0 {
                    farthest = (off * room.min(0.06), at);
                }
            }
        }
        if farthest.0 <= 0.0 {
            break;
        }
        corners.push(farthest.1);
        corners.sort_unstable();
    }
    let mut shape = outline.to_vec();
    for (from, steps) in sides(&corners, n) {
        let [a, b] = [outline[from], outline[(from + steps) % n]];
        let bow = random::between(-0.5 * BOW, BOW, rng);
        for step in 1..steps {
            let t = step as f64 / steps as f64;
            let out = 4.0 * t * (1.0 - t) * bow;
            // Outlines run so that what lies to the right of a side, y down, is outside or inside as a whole: the sign of the
            // bow is random anyway.
            let target =
                [a[0] + t * (b[0] - a[0]) + out * (b[1] - a[1]), a[1] + t * (b[1] - a[1]) - out * (b[0] - a[0])];
            let point = &mut shape[(from + step) % n];
            for axis in 0..2 {
                point[axis] += share * (target[axis] - point[axis]);
            }
        }
    }
    for _ in 0..ROUNDINGS {
        let sharp = shape.clone();
        for (i, point) in shape.iter_mut().enumerate() {
            for axis in 0..2 {
                point[axis] += 0.25 * (sharp[(i + n - 1) % n][axis] + sharp[(i + 1) % n][axis] - 2.0 * sharp[i][axis]);
            }
        }
    }
    shape
}

/// The sides of a polygon whose corners are those points of an outline of `n`: first point and number of steps.
fn sides(corners: &[usize], n: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
    (0..corners.len()).map(move |i| {
        let (from, to) = (corners[i], corners[(i + 1) % corners.len()]);
        (from, if to > from { to - from } else { to + n - from })
    })
}

fn distance_to_line(p: Point, a: Point, b: Point) -> f64 {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let length = (dx * dx + dy * dy).sqrt().max(f64::MIN_POSITIVE);
    ((p[0] - a[0]) * dy - (p[1] - a[1]) * dx).abs() / length
}

/// The outline pulled out at a random place, or pushed in where `depth` is negative.
fn poked(outline: &[Point], depth: f64, rng: &mut Stream) -> Vec<Point> {
    let n = outline.len();
    let foot = depth.abs() * random::between(FOOT[0], FOOT[1], rng);
    let at = outline[random::below(n, rng)];
    let lean = random::between(-0.5, 0.5, rng);
    let middle = fsd_shape::centroid(outline);
    let (dx, dy) = (at[0] - middle[0], at[1] - middle[1]);
    let length = (dx * dx + dy * dy).sqrt().max(f64::MIN_POSITIVE);
    let towards = [(dx - lean * dy) / length, (dy + lean * dx) / length];
    outline
        .iter()
        .map(|p| {
            let distance = ((p[0] - at[0]) * (p[0] - at[0]) + (p[1] - at[1]) * (p[1] - at[1])).sqrt();
            let share = (1.0 - distance / foot).max(0.0);
            let share = share * share * (3.0 - 2.0 * share);
            [p[0] + share * depth * towards[0], p[1] + share * depth * towards[1]]
        })
        .collect()
}

/// Strength of the jags of a torn rim, a few micrometres long, relative to its fraying.
const JAGGED: f64 = 1.0;

/// An outline whose points are pushed in and out a little, finely and unevenly: the frayed rim of a real cell.
pub(super) fn roughened(outline: &[Point], depth_px: f64, step_px: f64, rng: &mut Stream) -> Vec<Point> {
    if depth_px < 0.05 || outline.len() < 3 {
        return outline.to_vec();
    }
    let count = random::count(fsd_shape::perimeter(outline) / step_px).max(outline.len());
    let fine = fsd_shape::resample_along(outline, count);
    // Slow waves say where the rim is frayed, quick ones how: a first-order autoregression of either.
    let (mut slow, mut quick, mut middle) = (random::normal(rng), random::normal(rng), random::normal(rng));
    let step = |state: f64, memory: f64, rng: &mut Stream| {
        memory * state + (1.0 - memory * memory).sqrt() * random::normal(rng)
    };
    (0..count)
        .map(|i| {
            slow = step(slow, 0.985, rng);
            quick = step(quick, 0.6, rng);
            middle = step(middle, 0.88, rng);
            let [before, here, after] = [fine[(i + count - 1) % count], fine[i], fine[(i + 1) % count]];
            let (tx, ty) = (after[0] - before[0], after[1] - before[1]);
            let length = (tx * tx + ty * ty).sqrt().max(1e-9);
            let frayed = quick * (0.35 + slow.max(0.0)) + JAGGED * middle;
            let push = (0.5 * depth_px * frayed).clamp(-2.5 * depth_px, 2.5 * depth_px);
            [here[0] + push * ty / length, here[1] - push * tx / length]
        })
        .collect()
}
