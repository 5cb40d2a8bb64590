//! Neutrophils: a lobed nucleus in a pale, irregular cytoplasm that is often elongated to one side.

use super::Leukocyte;
use crate::debris::prelude::*;

/// Corners of the cytoplasm outline before smoothing.
const CORNERS: usize = 14;
/// Curve points per corner.
const POINTS_PER_CORNER: usize = 4;

/// Relative standard deviation of the radius of the corners of an intact cytoplasm.
const RAGGED: f64 = 0.06;
/// The same for a frayed cytoplasm.
const FRAYED: f64 = 0.13;

/// Probability of a tail.
const TAIL_PROBABILITY: f64 = 0.45;
/// Length of a tail relative to the radius: minimum, maximum.
const TAIL: [f64; 2] = [0.15, 0.65];

/// Distance of neighbouring lobes, in radii of a lobe: minimum, maximum.
const STEP: [f64; 2] = [1.15, 1.6];
/// Change of direction of the row at each lobe, radians: minimum, maximum.
const TURN: [f64; 2] = [0.5, 1.5];

/// Half-width of the bridge between two lobes, in radii of a lobe.
const BRIDGE: f64 = 0.42;

/// Absorbance at the rim of a lobe relative to its centre.
const RIM: f64 = 0.7;
/// The same for a smudged nucleus.
const SMUDGED_RIM: f64 = 0.4;

/// Strength of the chromatin texture.
const CHROMATIN: f32 = 0.10;
/// Strength of the chromatin texture of a degenerated nucleus.
const SMUDGED: f32 = 0.14;
/// Strength of the cytoplasm texture.
const VACUOLES: f32 = 0.2;

/// Size (standard deviation) of clumps of chromatin, µm.
const CLUMP_UM: f64 = 0.45;
/// Size (standard deviation) of vacuoles, µm.
const VACUOLE_UM: f64 = 0.3;

/// Width of the darker border of the cytoplasm, µm.
const BORDER_UM: f64 = 0.5;
/// Relative increase of absorbance in the border.
const BORDER: f32 = 0.2;

pub(super) fn make(leukocyte: &Leukocyte, context: &ObjectContext<'_>) -> Phantom {
    let mut rng = context.stream("shape");
    let cell_radius = 0.5 * leukocyte.cytoplasm_diameter_um;
    let tail =
        if random::chance(TAIL_PROBABILITY, &mut rng) { random::between(TAIL[0], TAIL[1], &mut rng) } else { 0.0 };
    let toward = random::direction(&mut rng);
    let body = cytoplasm(leukocyte, cell_radius, tail, toward, &mut rng);
    let lobes = lobes(leukocyte, cell_radius, &mut rng);
    // The nucleus is on the side opposite to the tail.
    let shift = -0.35 * tail * cell_radius + 0.08 * cell_radius * random::normal(&mut rng);
    let at = [shift * libm::cos(toward), shift * libm::sin(toward)];
    let outline = context.curve_to_grid(&body);
    let shapes: Vec<Vec<Point>> = lobes
        .iter()
        .map(|lobe| {
            let shape = perturbed_circle(lobe.radius, leukocyte.alpha, leukocyte.beta, &mut rng);
            let stretch = |p: &Point| [p[0] * lobe.stretch, p[1] / lobe.stretch];
            let turned = shape.iter().map(|p| placed(stretch(p), lobe.heading, lobe.centre));
            turned.map(|p| context.to_grid([p[0] + at[0], p[1] + at[1]])).collect()
        })
        .collect();

    let mut canvas = context.canvas(outline.iter().chain(shapes.iter().flatten()), 0.0);
    canvas.coverage.cover(&outline);
    for (value, absorbance) in
        border(&canvas.coverage, &outline, context).values.iter().zip(&mut canvas.absorbance.values)
    {
        *absorbance = leukocyte.cytoplasm_absorbance as f32 * value;
    }
    if leukocyte.degenerated {
        shreds(&mut canvas, context, cell_radius, leukocyte.cytoplasm_absorbance, &mut rng);
    }
    let sampler = FieldSampler::clouds(context.px(VACUOLE_UM), &mut rng);
    canvas.texture(context.noise_fields.clouds(), &sampler, VACUOLES);

    let mut nucleus = canvas.blank();
    for shape in &shapes {
        nucleus.coverage.cover(shape);
    }
    for pair in lobes.windows(2) {
        let ends = [0, 1].map(|i| context.to_grid([pair[i].centre[0] + at[0], pair[i].centre[1] + at[1]]));
        let half_width = context.px(BRIDGE * pair[0].radius.min(pair[1].radius));
        nucleus.stroke(&Stroke::even(ends[0], ends[1], half_width), 0.0);
    }
    domed(&mut nucleus, &shapes, leukocyte);
    let sampler = FieldSampler::clouds(context.px(CLUMP_UM), &mut rng);
    nucleus.texture(context.noise_fields.clouds(), &sampler, if leukocyte.degenerated { SMUDGED } else { CHROMATIN });
    for (cover, inside) in canvas.coverage.values.iter_mut().zip(&nucleus.coverage.values) {
        *cover = cover.max(*inside);
    }
    let mut phantom = canvas
        .into_phantom(leukocyte.dyes, 0.0, leukocyte.cytoplasm_absorbance)
        .with_inclusion(nucleus.absorbance, context.dyes.nucleus);
    if leukocyte.degenerated {
        phantom.traits.push(Trait::Degenerated);
    }
    phantom
}

/// Draws the outline of the cytoplasm, µm from its centre.
fn cytoplasm(leukocyte: &Leukocyte, radius: f64, tail: f64, toward: f64, rng: &mut Stream) -> Vec<Point> {
    let ragged = if leukocyte.degenerated { FRAYED } else { RAGGED };
    let squeeze = random::between(0.85, 1.0, rng);
    let corners: Vec<Point> = (0..CORNERS)
        .map(|i| {
            let angle = core::f64::consts::TAU * (i as f64 + 0.4 * random::uniform(rng)) / CORNERS as f64;
            let along = libm::cos(angle - toward).max(0.0);
            let reach = radius * (1.0 - 0.3 * tail) * (1.0 + ragged * random::normal(rng)).max(0.5);
            let reach = reach * (1.0 + 1.6 * tail * along * along * along);
            [reach * libm::cos(angle), squeeze * reach * libm::sin(angle)]
        })
        .collect();
    smooth(&corners, POINTS_PER_CORNER)
}

/// A lobe of a nucleus, µm.
struct Lobe {
    centre: Point,
    radius: f64,
    /// Direction of the row of lobes, radians.
    heading: f64,
    /// Elongation along this direction.
    stretch: f64,
}

/// Draws a bent row of lobes about the centre of the nucleus.
fn lobes(leukocyte: &Leukocyte, cell_radius: f64, rng: &mut Stream) -> Vec<Lobe> {
    let count = if leukocyte.degenerated { 1 } else { leukocyte.lobes };
    // Lobes overlap, so their radius is increased to keep the total area.
    let radius = leukocyte.radius_um / (count as f64).sqrt() * if count > 1 { 1.12 } else { 1.0 };
    let bend = random::between(TURN[0], TURN[1], rng) * if random::chance(0.5, rng) { 1.0 } else { -1.0 };
    let mut heading = random::direction(rng);
    let mut at = [0.0, 0.0];
    let mut lobes: Vec<Lobe> = (0..count)
        .map(|_| {
            let own = radius * random::between(0.82, 1.15, rng);
            let stretch =
                if leukocyte.degenerated { random::between(1.1, 1.45, rng) } else { random::between(1.0, 1.15, rng) };
            let lobe = Lobe { centre: at, radius: own, heading, stretch };
            let step = own * random::between(STEP[0], STEP[1], rng);
            at = [at[0] + step * libm::cos(heading), at[1] + step * libm::sin(heading)];
            heading += bend * random::between(0.6, 1.3, rng);
            lobe
        })
        .collect();
    let middle = lobes.iter().fold([0.0; 2], |m, l| [m[0] + l.centre[0], m[1] + l.centre[1]]).map(|v| v / count as f64);
    for lobe in &mut lobes {
        lobe.centre = [lobe.centre[0] - middle[0], lobe.centre[1] - middle[1]];
    }
    // Shrinks the row to fit inside the cell.
    let reach = |l: &Lobe| (l.centre[0] * l.centre[0] + l.centre[1] * l.centre[1]).sqrt() + l.radius;
    let widest = lobes.iter().map(reach).fold(0.0, f64::max);
    let shrink = (0.9 * cell_radius / widest).min(1.0);
    for lobe in &mut lobes {
        lobe.centre = lobe.centre.map(|v| v * shrink);
        lobe.radius *= shrink;
    }
    lobes
}

/// Returns the relative absorbance of the cytoplasm: 1 inside and larger along its border.
fn border(coverage: &Tile, outline: &[Point], context: &ObjectContext<'_>) -> Tile {
    let middle = fsd_shape::centroid(outline);
    let radius = (area(outline) / core::f64::consts::PI).sqrt();
    let shrink = (1.0 - context.px(BORDER_UM) / radius).max(0.0);
    let inner: Vec<Point> = outline
        .iter()
        .map(|p| [middle[0] + shrink * (p[0] - middle[0]), middle[1] + shrink * (p[1] - middle[1])])
        .collect();
    let mut inside = coverage.blank();
    inside.cover(&inner);
    for (value, cover) in inside.values.iter_mut().zip(&coverage.values) {
        *value = cover + BORDER * (cover - *value).max(0.0);
    }
    inside
}

/// Adds shreds to a degenerated cell.
fn shreds(canvas: &mut ObjectCanvas, context: &ObjectContext<'_>, radius: f64, absorbance: f64, rng: &mut Stream) {
    for _ in 0..1 + random::below(3, rng) {
        let angle = random::direction(rng);
        let reach = radius * random::between(1.0, 1.25, rng);
        let bend = angle + 0.5 * random::normal(rng);
        let ends = [0.5 * radius, reach].map(|r| context.to_grid([r * libm::cos(angle), r * libm::sin(bend)]));
        let half_width = context.px(random::between(0.4, 1.0, rng));
        canvas.stroke(&Stroke { ends, half_widths: [half_width, 0.3 * half_width] }, absorbance);
    }
}

/// Sets the absorbance of a nucleus from the summed thickness of its lobes.
fn domed(nucleus: &mut ObjectCanvas, shapes: &[Vec<Point>], leukocyte: &Leukocyte) {
    /// Upper limit of the thickness of overlapping lobes.
    const MAX_THICKNESS: f64 = 1.3;
    let rim = if leukocyte.degenerated { SMUDGED_RIM } else { RIM };
    let spheres: Vec<(Point, f64)> =
        shapes.iter().map(|lobe| (fsd_shape::centroid(lobe), area(lobe) / core::f64::consts::PI)).collect();
    nucleus.shade(|p| {
        let chord = |(centre, square): &(Point, f64)| {
            let (dx, dy) = (p[0] - centre[0], p[1] - centre[1]);
            (1.0 - (dx * dx + dy * dy) / square).max(0.0).sqrt()
        };
        let thickness = spheres.iter().map(chord).sum::<f64>().min(MAX_THICKNESS);
        leukocyte.absorbance * (rim + (1.0 - rim) * 1.2 * thickness)
    });
}
