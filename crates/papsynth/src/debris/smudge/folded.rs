//! Folded shreds of cytoplasm without a nucleus: a ragged sheet, folded several times, with granular and fibrous
//! structure.

use cloth_verlet::{Crease, FoldKind, crease_outline};

use super::Smudge;
use crate::debris::prelude::*;

/// Corners of a sheet before folding.
const CORNERS: usize = 13;
/// Curve points per corner.
const POINTS_PER_CORNER: usize = 3;
/// Relative standard deviation of the radius of the corners at irregularity 1.
const RAGGED: f64 = 0.22;
/// Size of the sheet relative to the folded shred: folds make it smaller.
const UNFOLDED: f64 = 1.2;

/// Number of folds: minimum, and range above it.
const FOLDS: [usize; 2] = [1, 2];
/// Distance of a crease from the centre of the sheet, relative to its reach in the direction of the fold: minimum,
/// maximum.
const CREASE: [f64; 2] = [0.1, 0.65];
/// Radius of a crease, µm.
const CREASE_UM: f64 = 0.25;

/// Length of the waves that bend a shred, relative to its radius: minimum, maximum.
const BEND_WAVE: [f64; 2] = [0.7, 2.2];
/// Amplitude of these waves relative to their length.
const BEND: f64 = 0.07;

/// Distance of the points of a frayed rim, µm.
const RIM_STEP_UM: f64 = 0.7;
/// Displacement of these points (standard deviation), µm.
const FRAY_UM: f64 = 0.55;

/// Size (standard deviation) relative to the diameter, and strength, of coarse differences of thickness.
const PATCHES: (f64, f32) = (0.1, 0.35);
/// Size of the fine structure relative to the grain size, and its strength relative to the contrast of grains.
const GRAINS: (f64, f64) = (0.6, 1.0);

/// Number of streaks: minimum, and range above it.
const STREAKS: [usize; 2] = [3, 6];
/// Absorbance of a streak relative to a layer: minimum, maximum.
const STREAK: [f64; 2] = [0.2, 0.7];
/// Half-width of a streak, µm: minimum, maximum.
const STREAK_UM: [f64; 2] = [0.4, 1.0];
/// Straight segments of a streak.
const PARTS: usize = 5;

pub(super) fn draw(smudge: &Smudge, context: &ObjectContext<'_>, rng: &mut Stream) -> ObjectCanvas {
    let (radius, stretch) = (0.5 * UNFOLDED * smudge.diameter_um, smudge.elongation().sqrt());
    let corners: Vec<Point> = (0..CORNERS)
        .map(|i| {
            let angle = core::f64::consts::TAU * (i as f64 + 0.5 * random::uniform(rng)) / CORNERS as f64;
            let reach = radius * (1.0 + RAGGED * smudge.ragged * random::normal(rng)).clamp(0.45, 1.5);
            [reach * stretch * libm::cos(angle), reach * libm::sin(angle) / stretch]
        })
        .collect();
    let mut layers = vec![smooth(&corners, POINTS_PER_CORNER)];
    for _ in 0..FOLDS[0] + random::below(FOLDS[1], rng) {
        let direction = random::direction(rng);
        let normal = [libm::cos(direction), libm::sin(direction)];
        let reach = layers.iter().flatten().map(|p| p[0] * normal[0] + p[1] * normal[1]).fold(0.0, f64::max);
        let at = reach * random::between(CREASE[0], CREASE[1], rng);
        let point = [at * normal[0], at * normal[1]];
        let crease = Crease::straight(point, direction - core::f64::consts::FRAC_PI_2, CREASE_UM, FoldKind::Flap);
        // A layer that cannot be folded stays flat.
        layers = layers.iter().flat_map(|p| crease_outline(p, &crease).unwrap_or_else(|_| vec![p.clone()])).collect();
    }
    // The centre of the shred is that of its largest layer.
    let largest = layers.iter().max_by(|a, b| area(a).total_cmp(&area(b)));
    let middle = largest.map_or([0.0; 2], |layer| fsd_shape::centroid(layer));
    let mut layers: Vec<Vec<Point>> = layers.iter().map(|layer| divided(layer)).collect();
    // Shreds dry and shrink unevenly, which bends their creases.
    let waves: [[f64; 2]; 4] =
        core::array::from_fn(|_| [random::direction(rng), random::between(BEND_WAVE[0], BEND_WAVE[1], rng)]);
    let bend = |x: f64, of: &[[f64; 2]]| -> f64 {
        of.iter()
            .map(|[phase, length]| BEND * length * libm::sin(core::f64::consts::TAU * x / (length * radius) + phase))
            .sum()
    };
    for point in layers.iter_mut().flatten() {
        let [x, y] = [point[0] - middle[0], point[1] - middle[1]];
        *point = [x + radius * bend(y, &waves[..2]), y + radius * bend(x, &waves[2..])];
    }
    for point in layers.iter_mut().flatten() {
        *point = point.map(|v| v + FRAY_UM * random::normal(rng));
    }
    let layers: Vec<Vec<Point>> = layers.iter().map(|layer| context.curve_to_grid(layer)).collect();
    let mut canvas = context.canvas(layers.iter().flatten(), 0.0);
    let mut layer = canvas.coverage.blank();
    for outline in &layers {
        layer.values.fill(0.0);
        layer.cover(outline);
        canvas.add_shape(&layer, |cover| cover * smudge.absorbance as f32);
    }
    add_streaks(&mut canvas, smudge, [radius * stretch, radius / stretch], context, rng);
    let (size, strength) = PATCHES;
    let patches = FieldSampler::clouds(context.px((size * smudge.diameter_um).max(smudge.grain_um)), rng);
    canvas.texture(context.noise_fields.clouds(), &patches, strength);
    let (size, strength) = GRAINS;
    let grains = FieldSampler::clouds(context.px(size * smudge.grain_um), rng);
    canvas.texture(context.noise_fields.clouds(), &grains, (strength * smudge.granularity) as f32);
    canvas
}

/// Returns an outline with more points.
fn divided(outline: &[Point]) -> Vec<Point> {
    let mut points = Vec::new();
    for (a, b) in outline.iter().zip(outline.iter().cycle().skip(1)) {
        let d = [b[0] - a[0], b[1] - a[1]];
        let parts = ((d[0] * d[0] + d[1] * d[1]).sqrt() / RIM_STEP_UM).ceil().clamp(1.0, 400.0);
        points.extend((0..parts as u32).map(|part| [0, 1].map(|axis| a[axis] + f64::from(part) / parts * d[axis])));
    }
    points
}

/// Adds dark streaks along the shred, only where it is.
fn add_streaks(
    canvas: &mut ObjectCanvas,
    smudge: &Smudge,
    [a, b]: [f64; 2],
    context: &ObjectContext<'_>,
    rng: &mut Stream,
) {
    let mut streaks = canvas.blank();
    for _ in 0..STREAKS[0] + random::below(STREAKS[1], rng) {
        let (mut way, half) = (0.35 * random::normal(rng), a * random::between(0.3, 0.9, rng));
        let mut at = [0.5 * a * random::normal(rng) - half, 0.45 * b * random::normal(rng)];
        let step = 2.0 * half / PARTS as f64;
        let half_width = context.px(random::between(STREAK_UM[0], STREAK_UM[1], rng));
        let strength = smudge.absorbance * random::between(STREAK[0], STREAK[1], rng);
        for part in 0..PARTS {
            way += 0.3 * random::normal(rng);
            let next = [at[0] + step * libm::cos(way), at[1] + step * libm::sin(way)];
            // Streaks taper towards both ends.
            let taper = |i: usize| half_width * if i == 0 || i == PARTS { 0.4 } else { 1.0 };
            let ends = [context.to_grid(at), context.to_grid(next)];
            streaks.stroke_max(&Stroke { ends, half_widths: [taper(part), taper(part + 1)] }, strength);
            at = next;
        }
    }
    let values = canvas.absorbance.values.iter_mut().zip(&canvas.coverage.values).zip(&streaks.absorbance.values);
    values.for_each(|((value, cover), streak)| *value += cover * streak);
}
