//! Paths of wrinkles: along the rim, across the cell, forked, and beside another one.

use portable_numerics::rounding::round_to_count;

use crate::key::Stream;
use crate::phantom::cell::autoregression::Autoregression;
use crate::phantom::tile::{Point, area, radius_of};
use crate::random;

/// Length over which a path along the rim is averaged, relative to its mean distance from the rim: paths farther inside
/// follow less of the shape of the rim.
const SMOOTHED: f64 = 3.0;

/// Standard deviation of the direction of wrinkles across a cell from that of its streaks, radians. Set by eye.
const DEVIATION: f64 = 0.5;

/// Where wrinkles across a cell begin: distance from the middle relative to that of the rim. Set by eye.
const NEAR_RIM: f64 = 0.97;

/// Correlation of the noise at neighbouring points of a wrinkle, half a micrometre apart.
pub(super) const MEMORY: f64 = 0.93;

/// Draws a part of a path: a fraction of its points, at least three of them if it has as many.
pub(super) fn random_part(path: &[Point], fraction: f64, rng: &mut Stream) -> Vec<Point> {
    let count = ((fraction * path.len() as f64) as usize).max(3).min(path.len());
    let start = random::below(path.len() - count + 1, rng);
    path[start..start + count].to_vec()
}

/// Returns a path beside another one: on its right, where y points down, if the distance is positive. The distance
/// changes by the fraction `fan` along the path.
pub(super) fn beside(path: &[Point], distance: f64, fan: f64) -> Vec<Point> {
    let last = path.len() - 1;
    let length = super::super::length(path);
    // Directions over about twice the distance: a rough path does not fold back beside itself.
    let span = ((distance.abs() * last as f64 / length.max(f64::MIN_POSITIVE)).ceil() as usize).clamp(1, last.max(1));
    let at = |index: usize| {
        let [a, b] = [path[index.saturating_sub(span)], path[(index + span).min(last)]];
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let per_length = 1.0 / (dx * dx + dy * dy).sqrt().max(f64::MIN_POSITIVE);
        let distance = distance * (1.0 + fan * (index as f64 / last as f64 - 0.5));
        [path[index][0] - distance * dy * per_length, path[index][1] + distance * dx * per_length]
    };
    (0..=last).map(at).collect()
}

/// Returns the side of a path on which a point lies: 1 if it is the right one, where y points down, else −1.
pub(super) fn side_of(path: &[Point], point: Point) -> f64 {
    let (first, last, middle) = (path[0], path[path.len() - 1], path[path.len() / 2]);
    let cross = (last[0] - first[0]) * (point[1] - middle[1]) - (last[1] - first[1]) * (point[0] - middle[0]);
    1.0_f64.copysign(cross)
}

/// Returns points at equal steps along a path.
pub(super) fn at_steps(path: &[Point], step: f64) -> Vec<Point> {
    let mut points: Vec<Point> = path.first().copied().into_iter().collect();
    let mut next = step;
    for ends in path.windows(2) {
        let [dx, dy] = [0, 1].map(|axis| ends[1][axis] - ends[0][axis]);
        let length = (dx * dx + dy * dy).sqrt();
        while next <= length {
            let t = next / length;
            points.push([ends[0][0] + t * dx, ends[0][1] + t * dy]);
            next += step;
        }
        next -= length;
    }
    points
}

/// Draws a path along the rim, averaged over a part of it, and moved inwards by `inset` radii of the cell, plus `drift`
/// from end to end. `fine` is the outline at equal steps.
pub(super) fn along_rim(outline: &[Point], fine: &[Point], inset: f64, drift: f64, rng: &mut Stream) -> Vec<Point> {
    let middle = fsd_shape::centroid(outline);
    let length = round_to_count(fine.len() as f64 * random::between(0.06, 0.45, rng)).max(4);
    let first = random::below(fine.len(), rng);
    let mut noise = Autoregression::new(MEMORY, 0.022, rng);
    // A circle of n points has n/2π points per radius.
    let reach = round_to_count(0.5 * SMOOTHED * inset * fine.len() as f64 / core::f64::consts::TAU);
    (0..length)
        .map(|i| {
            let p = mean_near(fine, first + i, reach);
            let t = i as f64 / length as f64;
            let shrink = 1.0 - (inset + drift * (t - 0.5) + noise.next(rng)).max(0.008);
            [middle[0] + shrink * (p[0] - middle[0]), middle[1] + shrink * (p[1] - middle[1])]
        })
        .collect()
}

/// Returns the mean of a point of a closed line and of its neighbours up to `reach` points away.
fn mean_near(line: &[Point], index: usize, reach: usize) -> Point {
    let near = (0..=2 * reach).map(|k| line[(index + line.len() + k - reach) % line.len()]);
    let sum = near.fold([0.0, 0.0], |sum, p| [sum[0] + p[0], sum[1] + p[1]]);
    sum.map(|sum| sum / (2 * reach + 1) as f64)
}

/// Draws a curved path from the rim into the cell, about along the streaks of the cell. `across_streaks_rad` is the
/// direction across them.
pub(super) fn across_cell(outline: &[Point], step: f64, across_streaks_rad: f64, rng: &mut Stream) -> Vec<Point> {
    let middle = fsd_shape::centroid(outline);
    let rim = outline[random::below(outline.len(), rng)];
    let start = [0, 1].map(|axis| middle[axis] + NEAR_RIM * (rim[axis] - middle[axis]));
    let along = across_streaks_rad + DEVIATION * random::normal(rng) + 0.5 * core::f64::consts::PI;
    let inwards = libm::cos(along) * (middle[0] - rim[0]) + libm::sin(along) * (middle[1] - rim[1]) >= 0.0;
    let along = if inwards { along } else { along + core::f64::consts::PI };
    curved_path(start, along, radius_of(area(outline)), step, rng)
}

/// Draws a curved path that leaves another one at an acute angle.
pub(super) fn forked(stem: &[Point], outline: &[Point], step: f64, rng: &mut Stream) -> Vec<Point> {
    let at = random::below(stem.len().saturating_sub(1), rng);
    let (a, b) = (stem[at], stem[(at + 1).min(stem.len() - 1)]);
    let turn = random::between(0.25, 0.9, rng) * if random::chance(0.5, rng) { 1.0 } else { -1.0 };
    curved_path(a, libm::atan2(b[1] - a[1], b[0] - a[0]) + turn, radius_of(area(outline)), step, rng)
}

/// Draws a path of slowly changing curvature.
fn curved_path(start: Point, direction: f64, radius: f64, step: f64, rng: &mut Stream) -> Vec<Point> {
    let steps = round_to_count(random::between(0.4, 1.7, rng) * radius / step).max(4);
    let mean = random::normal(rng) * 0.4 / radius;
    let mut curvature = Autoregression::new(MEMORY, 1.2 / radius, rng);
    let (mut at, mut heading) = (start, direction);
    (0..steps)
        .map(|_| {
            heading += step * (mean + curvature.next(rng));
            at = [at[0] + step * libm::cos(heading), at[1] + step * libm::sin(heading)];
            at
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Key;

    #[test]
    fn a_ridge_beside_another_one_has_a_distance_that_changes_along_it() {
        let path: Vec<Point> = (0..21).map(|i| [2.0 * f64::from(i), 0.0]).collect();
        for (i, p) in beside(&path, -3.0, 0.5).iter().enumerate() {
            let t = i as f64 / 20.0;
            assert!((p[0] - 2.0 * i as f64).abs() < 1e-9 && (p[1] + 3.0 * (0.75 + 0.5 * t)).abs() < 1e-9, "{p:?}");
        }
        assert_eq!((side_of(&path, [9.0, 5.0]), side_of(&path, [9.0, -5.0])), (1.0, -1.0));
        // Beside a circle is a smaller circle.
        let circle: Vec<Point> = (0..=90).map(|i| f64::from(i) / 50.0).map(|a| [libm::cos(a), libm::sin(a)]).collect();
        for p in &beside(&circle, 0.25, 0.0)[20..70] {
            assert!((libm::hypot(p[0], p[1]) - 0.75).abs() < 1e-9, "{p:?}");
        }
    }

    #[test]
    fn the_mean_of_a_rough_line_is_smooth_and_closed() {
        let rough = |i: usize| 10.0 + if i.is_multiple_of(2) { 0.5 } else { -0.5 };
        let angle = |i: usize| core::f64::consts::TAU * i as f64 / 90.0;
        let line: Vec<Point> =
            (0..90).map(|i| [rough(i) * libm::cos(angle(i)), rough(i) * libm::sin(angle(i))]).collect();
        for i in 0..180 {
            assert_eq!(mean_near(&line, i, 0), line[i % 90]);
            let p = mean_near(&line, i, 3);
            assert!((libm::hypot(p[0], p[1]) - 9.9).abs() < 0.15, "{p:?}");
            // The mean is centred on the point.
            assert!((p[1] * libm::cos(angle(i)) - p[0] * libm::sin(angle(i))).abs() < 0.15, "{p:?}");
        }
    }

    #[test]
    fn a_ridge_beside_a_rough_path_goes_forward() {
        let mut rng = Key { seed: 3, index: 0 }.stream("test", 0, "path");
        for distance in [2.0, 8.0, 20.0] {
            let path: Vec<Point> = (0..120).map(|i| [1.5 * f64::from(i), 0.6 * random::normal(&mut rng)]).collect();
            let ridge = beside(&path, distance, 0.0);
            // Every third point is the end of a segment.
            let backwards = ridge.windows(4).filter(|p| p[3][0] < p[0][0]).count();
            assert!(backwards == 0, "{backwards} of {} segments at {distance} px", ridge.len() - 3);
        }
    }

    #[test]
    fn a_part_of_a_path_has_its_fraction_of_points_and_at_least_three() {
        let mut rng = Key { seed: 3, index: 0 }.stream("test", 0, "part");
        for (count, fraction, expected) in [(4, 0.35, 3), (40, 0.5, 20), (40, 1.0, 40), (2, 0.5, 2)] {
            let path: Vec<Point> = (0..count).map(|i| [f64::from(i), 0.0]).collect();
            let part = random_part(&path, fraction, &mut rng);
            assert_eq!(part.len(), expected);
            assert!(part.windows(2).all(|p| p[1][0] - p[0][0] == 1.0), "{part:?}");
        }
    }

    #[test]
    fn points_are_at_equal_steps_along_a_path() {
        let path = [[0.0, 0.0], [3.0, 0.0], [3.0, 0.2], [3.0, 4.0]];
        let found = at_steps(&path, 0.5);
        assert_eq!(found.len(), 15);
        for (k, p) in found.iter().enumerate() {
            let along = 0.5 * k as f64;
            let expected = [along.min(3.0), (along - 3.0).max(0.0)];
            assert!((p[0] - expected[0]).abs() < 1e-9 && (p[1] - expected[1]).abs() < 1e-9, "{p:?} {expected:?}");
        }
        assert_eq!(at_steps(&[[1.0, 2.0]], 0.5), [[1.0, 2.0]]);
    }
}
