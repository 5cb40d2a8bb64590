//! Outlines of cytoplasm: angularity, notches, protrusions, and a frayed rim.

use portable_numerics::rounding::round_to_count;

use super::autoregression::Autoregression;
use crate::key::Stream;
use crate::phantom::tile::{Point, area, radius_of};
use crate::random;
use crate::scene::cell::CellDetail;

/// Number of corners of the polygon that an angular cell approaches: minimum, and range above it.
const CORNERS: [usize; 2] = [5, 5];

/// Maximum outward bow of a polygon side, relative to its length; half of that inwards.
const BOW: f64 = 0.07;

/// Depth of notches, relative to the cell radius: minimum, maximum. The logarithm is uniform.
const NOTCH: [f64; 2] = [0.03, 0.25];
/// Length of protrusions, relative to the cell radius: minimum, maximum. The logarithm is uniform.
const PROTRUSION: [f64; 2] = [0.03, 0.30];

/// Base width of notches and protrusions, relative to their depth: minimum, maximum.
const BASE_WIDTH: [f64; 2] = [0.7, 2.2];

/// Number of smoothing passes over an outline of 180 points: corners get a radius of about 1 µm.
const SMOOTHING_PASSES: usize = 6;

/// Increase of the irregularity of the outline of a cell with its degeneration.
const FRAYED: f64 = 0.5;

/// Returns the amplitude of the irregularity of the outline, µm.
pub(super) fn fray_um(detail: &CellDetail) -> f64 {
    detail.fray_um * (1.0 + FRAYED * detail.degeneration)
}

/// Returns the outline with the angularity, notches and protrusions of its cell, with the same area and centroid.
///
/// Changes that would make the outline cross itself are skipped.
pub(super) fn shaped(outline: Vec<Point>, detail: &CellDetail, rng: &mut Stream) -> Vec<Point> {
    if detail.angularity <= 0.0 && detail.notches == 0 && detail.protrusions == 0 {
        return outline;
    }
    let before = area(&outline);
    let middle = fsd_shape::centroid(&outline);
    let mut shape = simple(angular(&outline, detail.angularity, rng)).unwrap_or(outline);
    let radius = radius_of(before);
    for (count, [low, high], sign) in [(detail.notches, NOTCH, -1.0), (detail.protrusions, PROTRUSION, 1.0)] {
        for _ in 0..count {
            let depth = sign * radius * low * libm::pow(high / low, random::between(0.0, 1.0, rng));
            if let Some(changed) = simple(displaced(&shape, depth, rng)) {
                shape = changed;
            }
        }
    }
    let scale = (before / area(&shape).max(f64::MIN_POSITIVE)).sqrt();
    let at = fsd_shape::centroid(&shape);
    shape.iter().map(|p| [middle[0] + scale * (p[0] - at[0]), middle[1] + scale * (p[1] - at[1])]).collect()
}

/// Returns the outline if it does not cross itself.
fn simple(outline: Vec<Point>) -> Option<Vec<Point>> {
    (!fsd_shape::self_intersects(&outline)).then_some(outline)
}

/// Moves an outline towards a polygon through some of its points: `fraction` is 0 for the outline, 1 for the polygon.
fn angular(outline: &[Point], fraction: f64, rng: &mut Stream) -> Vec<Point> {
    let n = outline.len();
    let wanted = CORNERS[0] + random::below(CORNERS[1] + 1, rng);
    // The next corner is the outline point farthest from the polygon (Douglas and Peucker,
    // doi:10.3138/FM57-6770-U75U-7727).
    let mut corners = vec![random::below(n, rng)];
    corners.push((corners[0] + n / 2) % n);
    corners.sort_unstable();
    while corners.len() < wanted {
        let mut farthest = (0.0, 0);
        for (from, steps) in sides(&corners, n) {
            for step in 1..steps {
                let at = (from + step) % n;
                let off = distance_to_line(outline[at], outline[from], outline[(from + steps) % n]);
                // Avoids corners next to existing ones, which would blunt them.
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
            // The orientation of the outline is not needed, because the sign of the bow is random.
            let target =
                [a[0] + t * (b[0] - a[0]) + out * (b[1] - a[1]), a[1] + t * (b[1] - a[1]) - out * (b[0] - a[0])];
            let point = &mut shape[(from + step) % n];
            for axis in 0..2 {
                point[axis] += fraction * (target[axis] - point[axis]);
            }
        }
    }
    for _ in 0..SMOOTHING_PASSES {
        let sharp = shape.clone();
        for (i, point) in shape.iter_mut().enumerate() {
            for axis in 0..2 {
                point[axis] += 0.25 * (sharp[(i + n - 1) % n][axis] + sharp[(i + 1) % n][axis] - 2.0 * sharp[i][axis]);
            }
        }
    }
    shape
}

/// Returns the sides of a polygon whose corners are points of an outline of `n` points: first point and number of
/// steps.
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

/// Displaces the outline outwards at a random point, or inwards if `depth` is negative.
fn displaced(outline: &[Point], depth: f64, rng: &mut Stream) -> Vec<Point> {
    let n = outline.len();
    let base = depth.abs() * random::between(BASE_WIDTH[0], BASE_WIDTH[1], rng);
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
            let t = (1.0 - distance / base).max(0.0);
            let weight = t * t * (3.0 - 2.0 * t);
            [p[0] + weight * depth * towards[0], p[1] + weight * depth * towards[1]]
        })
        .collect()
}

/// Standard deviation of the waves of an outline, relative to the amplitude of irregularities in the recipe.
const WAVES: f64 = 0.6;
/// Smallest amplitude of irregularities for these waves, µm: smooth outlines have them, too.
const SMOOTHEST_UM: f64 = 0.7;
/// Number of waves of an outline.
const WAVE_COUNT: usize = 6;
/// Length of a wave: minimum, maximum, µm.
const WAVE_UM: [f64; 2] = [8.0, 30.0];

/// Returns the outline with gentle waves. Without them, some cells would have straighter sides than real ones.
///
/// `amplitude_um` is the amplitude of irregularities in the recipe.
pub(super) fn wavy(outline: Vec<Point>, amplitude_um: f64, pixel_um: f64, rng: &mut Stream) -> Vec<Point> {
    if amplitude_um <= 0.0 {
        return outline;
    }
    let (n, perimeter_um) = (outline.len(), fsd_shape::perimeter(&outline) * pixel_um);
    let waves: [[f64; 2]; WAVE_COUNT] = core::array::from_fn(|_| {
        let periods = (perimeter_um / random::between(WAVE_UM[0], WAVE_UM[1], rng)).round();
        [core::f64::consts::TAU * periods / n as f64, random::direction(rng)]
    });
    let amplitude = WAVES * (2.0 / WAVE_COUNT as f64).sqrt() * amplitude_um.max(SMOOTHEST_UM) / pixel_um;
    let moved = |i: usize, amplitude: f64| {
        let [before, here, after] = [outline[(i + n - 1) % n], outline[i], outline[(i + 1) % n]];
        let (tx, ty) = (after[0] - before[0], after[1] - before[1]);
        let per_length = 1.0 / (tx * tx + ty * ty).sqrt().max(1e-9);
        let sum: f64 = waves.iter().map(|[number, phase]| libm::sin(number * i as f64 + phase)).sum();
        let push = amplitude * sum * per_length;
        [here[0] + push * ty, here[1] - push * tx]
    };
    // Large waves cross near some corners.
    let lower = |factor: &f64| simple((0..n).map(|i| moved(i, factor * amplitude)).collect());
    [1.0, 0.5, 0.25].iter().find_map(lower).unwrap_or(outline)
}

/// Mean amplitude of the roughness, relative to the depth of the recipe. This and the next two numbers were set so that
/// displacements of 0.5 to 4 µm are about as large and as uneven as those of real rims.
const AMPLITUDE: f64 = 0.37;

/// Amplitude of the roughness of a scale below a micrometre, relative to that of a few micrometres.
const FINE_SCALE: f64 = 0.75;

/// Standard deviation of the sum of both.
const BOTH_SCALES: f64 = 1.25;

/// Weight of the square of the roughness: tips are more pointed than bays. In single cells, the skewness of
/// displacements between outlines smoothed by 0.5 and 1 µm is 0.4 in real normal cells, and was 0.2 without it.
const POINTED: f64 = 0.25;

/// Standard deviation of the logarithm of the roughness along a rim: parts of it are smooth and others torn.
const UNEVENNESS: f64 = 0.7;

/// Correlation of the unevenness of a rim at two neighbouring points, 0.375 µm apart.
const UNEVENNESS_MEMORY: f64 = 0.985;

/// Correlation of the roughness of a scale below a micrometre at these points.
const FINE_MEMORY: f64 = 0.6;

/// Correlation of the roughness of a scale of a few micrometres at these points.
const COARSE_MEMORY: f64 = 0.88;

/// Returns an outline with irregular displacements, the frayed rim of a cell. `roughness` is a factor on them at each
/// point.
pub(super) fn roughened(
    outline: &[Point],
    depth_px: f64,
    step_px: f64,
    roughness: impl Fn(Point) -> f64,
    rng: &mut Stream,
) -> Vec<Point> {
    if depth_px < 0.05 || outline.len() < 3 {
        return outline.to_vec();
    }
    let count = round_to_count(fsd_shape::perimeter(outline) / step_px).max(outline.len());
    let fine = fsd_shape::resample_along(outline, count);
    let [mut unevenness, mut fine_scale, mut coarse_scale] =
        [UNEVENNESS_MEMORY, FINE_MEMORY, COARSE_MEMORY].map(|memory| Autoregression::new(memory, 1.0, rng));
    // Outwards is on the left of a path of positive area, where y points down.
    let outwards = 1.0_f64.copysign(fsd_shape::signed_area(outline));
    (0..count)
        .map(|i| {
            let uneven = unevenness.next(rng);
            let fine_roughness = fine_scale.next(rng);
            let coarse_roughness = coarse_scale.next(rng);
            let [before, here, after] = [fine[(i + count - 1) % count], fine[i], fine[(i + 1) % count]];
            let (tx, ty) = (after[0] - before[0], after[1] - before[1]);
            let length = (tx * tx + ty * ty).sqrt().max(1e-9);
            let factor = libm::exp(UNEVENNESS * uneven - 0.5 * UNEVENNESS * UNEVENNESS);
            let amplitude = AMPLITUDE * factor * roughness(here);
            let rough = (FINE_SCALE * fine_roughness + coarse_roughness) / BOTH_SCALES;
            let pointed = (rough + POINTED * (rough * rough - 1.0)) / (1.0 + 2.0 * POINTED * POINTED).sqrt();
            let push = outwards * depth_px * (BOTH_SCALES * amplitude * pointed).clamp(-2.5, 2.5);
            [here[0] + push * ty / length, here[1] - push * tx / length]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Key;

    #[test]
    fn waves_have_their_amplitude_and_no_step() {
        // Points of a circle of 25 µm.
        let circle: Vec<Point> = (0..180)
            .map(|i| core::f64::consts::TAU * f64::from(i) / 180.0)
            .map(|angle| [100.0 * libm::cos(angle), 100.0 * libm::sin(angle)])
            .collect();
        let (mut squares, mut largest) = (0.0, 0.0_f64);
        for index in 0..20 {
            let mut rng = Key { seed: 1, index }.stream("test", 0, "waves");
            // Smooth outlines have waves of the smallest amplitude.
            let wavy = wavy(circle.clone(), 0.5 * SMOOTHEST_UM, 0.25, &mut rng);
            let off: Vec<f64> = wavy.iter().map(|p| 0.25 * (libm::hypot(p[0], p[1]) - 100.0)).collect();
            squares += off.iter().map(|off| off * off).sum::<f64>() / (20.0 * 180.0);
            // The distance of two points is 0.9 µm.
            let steps = (0..180).map(|i| (off[(i + 1) % 180] - off[i]).abs());
            largest = largest.max(steps.fold(0.0, f64::max));
        }
        assert!((squares.sqrt() / (WAVES * SMOOTHEST_UM) - 1.0).abs() < 0.1, "{squares}");
        assert!(largest < 0.5, "{largest}");
        let mut rng = Key { seed: 1, index: 0 }.stream("test", 0, "waves");
        assert_eq!(wavy(circle.clone(), 0.0, 0.25, &mut rng), circle);
    }

    #[test]
    fn roughness_is_skewed_outwards_in_both_orientations() {
        for sign in [1.0, -1.0] {
            let circle: Vec<Point> = (0..720)
                .map(|i| sign * core::f64::consts::TAU * f64::from(i) / 720.0)
                .map(|angle| [100.0 * libm::cos(angle), 100.0 * libm::sin(angle)])
                .collect();
            let (mut squares, mut cubes) = (Vec::new(), Vec::new());
            for index in 0..40 {
                let mut rng = Key { seed: 1, index }.stream("test", 0, "roughness");
                let rough = roughened(&circle, 2.0, 1.0, |_| 1.0, &mut rng);
                let off: Vec<f64> = rough.iter().map(|p| libm::hypot(p[0], p[1]) - 100.0).collect();
                let mean = off.iter().sum::<f64>() / off.len() as f64;
                squares.extend(off.iter().map(|off| (off - mean) * (off - mean)));
                cubes.extend(off.iter().map(|off| (off - mean) * (off - mean) * (off - mean)));
            }
            let [square, cube] = [squares, cubes].map(|values| values.iter().sum::<f64>() / values.len() as f64);
            // The skewness of x + x²/4 is 1.3 for a normal x; the uneven amplitude of the roughness increases it.
            let skewness = cube / (square * square.sqrt());
            assert!((1.0..2.5).contains(&skewness), "{skewness}");
        }
    }
}
