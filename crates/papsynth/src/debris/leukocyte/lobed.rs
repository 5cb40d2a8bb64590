//! Neutrophils and histiocytes: a nucleus of overlapping lobes in a pale, irregular cytoplasm.
//!
//! At the resolution of these images, the lobes of most neutrophils overlap and blur into one dark, irregular body.

use core::f64::consts::{PI, TAU};

use optics_psf::{Border, Gaussian};

use super::{Leukocyte, NucleusForm};
use crate::debris::prelude::*;
use crate::debris::tuft::{Tuft, crop};
use crate::scene::cell::stretched;

/// Corners of the cytoplasm outline before smoothing.
const CORNERS: usize = 16;
/// Curve points per corner.
const POINTS_PER_CORNER: usize = 3;

/// Relative standard deviation of the radius of the corners of an intact cytoplasm.
const RAGGED: f64 = 0.05;
/// The same for a frayed cytoplasm.
const FRAYED: f64 = 0.1;

/// Length of a cytoplasm without its tail relative to its width: the logarithm is the magnitude of a normal deviate
/// with this standard deviation, up to this maximum. Free leukocytes of Cervix93, with their tails, have ratios of 1.22
/// in the median and of 1.58 in the upper quartile.
const ELONGATION: [f64; 2] = [0.15, 0.45];
/// Standard deviation of the direction of the nucleus around the long axis of the cytoplasm, radians.
const MISALIGNED: f64 = 0.6;

/// Probability of a tail.
const TAIL_PROBABILITY: f64 = 0.35;
/// Length of a tail relative to the radius: minimum, maximum.
const TAIL: [f64; 2] = [0.15, 0.65];

/// Lobes of the nucleus of a histiocyte: a bean is a curved row of overlapping discs.
const BEAN_LOBES: usize = 4;

/// Arrangement of a row of lobes.
struct Row {
    /// Distance of neighbouring lobes, in radii of a lobe: minimum, maximum.
    step: [f64; 2],
    /// Change of direction of the row at each lobe, radians: minimum, maximum.
    turn: [f64; 2],
    /// Radius of a lobe relative to their mean: minimum, maximum.
    size: [f64; 2],
}

/// The row of a neutrophil.
const NEUTROPHIL: Row = Row { step: [0.65, 1.2], turn: [0.6, 2.1], size: [0.8, 1.15] };
/// The row of a histiocyte.
const HISTIOCYTE: Row = Row { step: [0.55, 0.7], turn: [0.3, 0.7], size: [0.92, 1.0] };

/// Half-width of the bridge between two lobes, in radii of a lobe.
const BRIDGE: f64 = 0.5;

/// Absorbance at the rim of a nucleus relative to its centre: minimum, maximum. Spherical nuclei have softer
/// edges than the flat nuclei of epithelial cells. Set by eye beside real fields, as the numbers of clefts below.
const RIM: [f64; 2] = [0.1, 0.6];

/// Irregularity of the outline of a lobe, standard deviation of the second harmonic: minimum, maximum.
const IRREGULAR: [f64; 2] = [0.05, 0.16];

/// Contrast of the chromatin of an intact nucleus: minimum, maximum.
const CHROMATIN: [f64; 2] = [0.02, 0.2];
/// Contrast of the chromatin of a smudged nucleus.
const SMUDGED: f64 = 0.2;
/// Contrast of the chromatin of a pyknotic nucleus.
const PYKNOTIC: f64 = 0.03;
/// Strength of the vacuoles of a cytoplasm: minimum, maximum. The relative standard deviation of the absorbance is 0.6
/// times this number.
const VACUOLES: [f64; 2] = [0.0, 0.5];
/// Strength of the vacuoles of a histiocyte.
const FOAM: f64 = 0.8;

/// Parts of a smudged nucleus of one lobe, with pale clefts between them: fewest and most.
const SMUDGED_PARTS: [usize; 2] = [1, 4];
/// Relative decrease of absorbance in a cleft: minimum, maximum.
const CLEFT: [f64; 2] = [0.1, 0.4];
/// Width (standard deviation) of a cleft, µm.
const CLEFT_UM: f64 = 0.35;

/// Size (standard deviation) of clumps of chromatin, µm.
const CLUMP_UM: f64 = 0.45;
/// Smoothing (standard deviation) of the noise field of vacuoles, µm: minimum, maximum. Walls are 4.4 times this number
/// apart on average.
const VACUOLE_UM: [f64; 2] = [0.3, 0.6];

/// Width of the darker border of a cytoplasm, µm.
const BORDER_UM: f64 = 0.5;
/// Relative increase of absorbance in the border: minimum, maximum.
const BORDER: [f64; 2] = [0.0, 0.7];
/// Absorbance at the edge of a cytoplasm relative to its centre, from a sphere to a flat disc: minimum, maximum.
/// Independent of that of the nucleus.
const FLATNESS: [f64; 2] = [0.0, 0.6];

/// Softness, µm: standard deviation of the blur of a leukocyte, minimum and maximum. Many leukocytes are about as high
/// as wide, so that most of such a leukocyte is out of focus in every plane, and also in EDF images. The range was
/// chosen by eye beside EDF images and single planes.
const SOFTNESS_UM: [f64; 2] = [0.05, 0.4];
/// Reach of this blur, in standard deviations.
const SOFT_REACH: f64 = 3.0;

pub(super) fn make(leukocyte: &Leukocyte, context: &ObjectContext<'_>) -> Phantom {
    let mut rng = context.stream("shape");
    let cell_radius = 0.5 * leukocyte.cytoplasm_diameter_um;
    let tail =
        if random::chance(TAIL_PROBABILITY, &mut rng) { random::between(TAIL[0], TAIL[1], &mut rng) } else { 0.0 };
    let toward = random::direction(&mut rng);
    let elongation = libm::exp((ELONGATION[0] * random::normal(&mut rng).abs()).min(ELONGATION[1]));
    let body = cytoplasm(leukocyte, cell_radius, tail, toward, &mut rng);
    let body: Vec<Point> = body.into_iter().map(|p| stretched(p, elongation, toward)).collect();
    let heading = toward + MISALIGNED * random::normal(&mut rng);
    let lobes = lobes(leukocyte, cell_radius, heading, &mut rng);
    // The nucleus is on the side opposite to the tail.
    let shift = -0.35 * tail * cell_radius + 0.1 * cell_radius * random::normal(&mut rng);
    let at = [shift * libm::cos(toward), shift * libm::sin(toward)];
    let outline = context.curve_to_grid(&body);
    let irregular = random::between(IRREGULAR[0], IRREGULAR[1], &mut rng);
    let shapes: Vec<Vec<Point>> = lobes
        .iter()
        .map(|lobe| {
            let mut shape = perturbed_circle(lobe.radius, leukocyte.alpha, leukocyte.beta, &mut rng);
            make_irregular(&mut shape, irregular, &mut rng);
            let stretch = |p: &Point| [p[0] * lobe.stretch, p[1] / lobe.stretch];
            let turned = shape.iter().map(|p| placed(stretch(p), lobe.heading, lobe.centre));
            turned.map(|p| context.to_grid([p[0] + at[0], p[1] + at[1]])).collect()
        })
        .collect();
    let remains = leukocyte.remains.then(|| remains(cell_radius, context, &mut rng));

    let corners = remains.iter().flat_map(Tuft::corners);
    let points: Vec<Point> = outline.iter().chain(shapes.iter().flatten()).copied().chain(corners).collect();
    let softness_um = random::between(SOFTNESS_UM[0], SOFTNESS_UM[1], &mut rng);
    let mut canvas = context.canvas(&points, SOFT_REACH * softness_um);
    canvas.coverage.cover(&outline);
    let axis = toward + context.rotation_deg.to_radians();
    shade_cytoplasm(&mut canvas, &outline, [elongation, axis], leukocyte, context, &mut rng);
    let vacuoles = match leukocyte.form {
        NucleusForm::Kidney => FOAM,
        NucleusForm::Lobed | NucleusForm::Round => random::between(VACUOLES[0], VACUOLES[1], &mut rng),
    };
    let vacuole_um = random::between(VACUOLE_UM[0], VACUOLE_UM[1], &mut rng);
    let sampler = FieldSampler::clouds(context.px(vacuole_um), &mut rng);
    canvas.foam(context.noise_fields.clouds(), &sampler, vacuoles as f32);
    if let Some(remains) = &remains {
        add_remains(remains, &mut canvas, context, &mut rng);
    }

    let mut nucleus = canvas.blank();
    for shape in &shapes {
        nucleus.coverage.cover(shape);
    }
    for pair in lobes.windows(2) {
        let ends = [0, 1].map(|i| context.to_grid([pair[i].centre[0] + at[0], pair[i].centre[1] + at[1]]));
        let half_width = context.px(BRIDGE * pair[0].radius.min(pair[1].radius));
        nucleus.stroke(&Stroke::even(ends[0], ends[1], half_width), 0.0);
    }
    let smudged = leukocyte.degenerated && !leukocyte.pyknotic;
    let rim = random::between(RIM[0], RIM[1], &mut rng);
    domed(&mut nucleus, &shapes, leukocyte.absorbance, rim);
    if smudged {
        let clefts = Clefts::new(at, &lobes, context, &mut rng);
        nucleus.absorbance.for_each(|p, value| *value *= clefts.factor(p));
    }
    let chromatin = match (leukocyte.pyknotic, leukocyte.degenerated) {
        (true, _) => PYKNOTIC,
        (false, true) => SMUDGED,
        (false, false) => random::between(CHROMATIN[0], CHROMATIN[1], &mut rng),
    };
    let sampler = FieldSampler::clouds(context.px(CLUMP_UM), &mut rng);
    nucleus.texture(context.noise_fields.clouds(), &sampler, chromatin as f32);
    for (cover, inside) in canvas.coverage.values.iter_mut().zip(&nucleus.coverage.values) {
        *cover = cover.max(*inside);
    }
    if let Ok(blur) = Gaussian::new(context.px(softness_um)) {
        // The coverage as well, so that it is positive wherever the leukocyte absorbs.
        for tile in [&mut canvas.absorbance, &mut canvas.coverage, &mut nucleus.absorbance] {
            tile.values = blur.blur(&tile.values, tile.width, Border::Zero);
        }
        canvas.coverage.values.iter_mut().for_each(|cover| *cover = cover.min(1.0));
    }
    let reach = context.px(leukocyte.reach_um(context.pixel_um));
    crop(&mut canvas, context, reach);
    crop(&mut nucleus, context, reach);
    let mut phantom = canvas
        .into_phantom(leukocyte.dyes, 0.0, leukocyte.cytoplasm_absorbance)
        .with_inclusion(nucleus.absorbance, context.dyes.nucleus);
    let traits = [
        (leukocyte.pyknotic, Trait::Pyknotic),
        (leukocyte.degenerated, Trait::Degenerated),
        (leukocyte.form == NucleusForm::Kidney, Trait::Histiocyte),
    ];
    phantom.traits.extend(traits.into_iter().filter(|(present, _)| *present).map(|(_, name)| name));
    phantom
}

/// Draws the outline of the cytoplasm, µm from its centre.
fn cytoplasm(leukocyte: &Leukocyte, radius: f64, tail: f64, toward: f64, rng: &mut Stream) -> Vec<Point> {
    let ragged = if leukocyte.degenerated { FRAYED } else { RAGGED };
    let corners: Vec<Point> = (0..CORNERS)
        .map(|i| {
            let angle = TAU * (i as f64 + 0.4 * random::uniform(rng)) / CORNERS as f64;
            let along = libm::cos(angle - toward).max(0.0);
            let reach = radius * (1.0 - 0.3 * tail) * (1.0 + ragged * random::normal(rng)).max(0.5);
            let reach = reach * (1.0 + 1.6 * tail * along * along * along);
            [reach * libm::cos(angle), reach * libm::sin(angle)]
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

/// Draws a bent row of lobes about the centre of the nucleus, which begins in the direction `heading`, radians.
fn lobes(leukocyte: &Leukocyte, cell_radius: f64, mut heading: f64, rng: &mut Stream) -> Vec<Lobe> {
    let (row, count) = match leukocyte.form {
        NucleusForm::Kidney => (HISTIOCYTE, BEAN_LOBES),
        NucleusForm::Lobed | NucleusForm::Round => (NEUTROPHIL, leukocyte.lobes),
    };
    // The union of the lobes has the area of a disc of the specified radius.
    let free = uncovered(0.5 * (row.step[0] + row.step[1]));
    let radius = leukocyte.radius_um / (1.0 + (count - 1) as f64 * free).sqrt();
    let bend = random::between(row.turn[0], row.turn[1], rng) * if random::chance(0.5, rng) { 1.0 } else { -1.0 };
    let stretches = match (leukocyte.pyknotic, count) {
        (true, _) => [1.0, 1.15],
        (false, 1) => [1.05, 1.35],
        (false, _) => [1.0, 1.15],
    };
    let mut at = [0.0, 0.0];
    let mut lobes: Vec<Lobe> = (0..count)
        .map(|_| {
            let own = radius * if count > 1 { random::between(row.size[0], row.size[1], rng) } else { 1.0 };
            let stretch = random::between(stretches[0], stretches[1], rng);
            let lobe = Lobe { centre: at, radius: own, heading, stretch };
            let step = own * random::between(row.step[0], row.step[1], rng);
            at = [at[0] + step * libm::cos(heading), at[1] + step * libm::sin(heading)];
            heading += bend * random::between(0.6, 1.3, rng);
            lobe
        })
        .collect();
    let middle = lobes.iter().fold([0.0; 2], |m, l| [m[0] + l.centre[0], m[1] + l.centre[1]]).map(|v| v / count as f64);
    for lobe in &mut lobes {
        lobe.centre = [lobe.centre[0] - middle[0], lobe.centre[1] - middle[1]];
    }
    // Shrinks the row to fit inside a round cell.
    let reach = |l: &Lobe| (l.centre[0] * l.centre[0] + l.centre[1] * l.centre[1]).sqrt() + l.radius;
    let widest = lobes.iter().map(reach).fold(0.0, f64::max);
    let shrink = (cell_radius / widest).min(1.0);
    for lobe in &mut lobes {
        lobe.centre = lobe.centre.map(|v| v * shrink);
        lobe.radius *= shrink;
    }
    lobes
}

/// Returns the fraction of a disc that another disc of the same radius, `step` radii away, does not cover.
fn uncovered(step: f64) -> f64 {
    let half = (0.5 * step).min(1.0);
    1.0 - 2.0 / PI * (libm::acos(half) - half * (1.0 - half * half).sqrt())
}

/// Sets the absorbance of the cytoplasm: thicker in the middle, often with a darker border. The cytoplasm is a sphere
/// stretched by a factor along a direction of the grid, radians.
fn shade_cytoplasm(
    canvas: &mut ObjectCanvas,
    outline: &[Point],
    [elongation, axis]: [f64; 2],
    leukocyte: &Leukocyte,
    context: &ObjectContext<'_>,
    rng: &mut Stream,
) {
    let (middle, square) = (fsd_shape::centroid(outline), area(outline) / PI);
    let shrink = (1.0 - context.px(BORDER_UM) / square.sqrt()).max(0.0);
    let inner: Vec<Point> = outline
        .iter()
        .map(|p| [middle[0] + shrink * (p[0] - middle[0]), middle[1] + shrink * (p[1] - middle[1])])
        .collect();
    let mut inside = canvas.coverage.blank();
    inside.cover(&inner);
    let flatness = random::between(FLATNESS[0], FLATNESS[1], rng);
    let border = random::between(BORDER[0], BORDER[1], rng) as f32;
    canvas.shade(|p| {
        let [dx, dy] = stretched([p[0] - middle[0], p[1] - middle[1]], 1.0 / elongation, axis);
        let chord = (1.0 - (dx * dx + dy * dy) / square).max(0.0).sqrt();
        leukocyte.cytoplasm_absorbance * (flatness + (1.0 - flatness) * chord)
    });
    let values = canvas.absorbance.values.iter_mut().zip(&canvas.coverage.values).zip(&inside.values);
    for ((value, cover), inside) in values {
        *value *= 1.0 + border * (cover - inside).max(0.0);
    }
}

/// Distance of the centre of remains from the centre of the cell, in radii of the cell: minimum, maximum.
const REMAINS_DISTANCE: [f64; 2] = [0.5, 1.1];
/// Half length of remains in radii of the cell: minimum, maximum.
const REMAINS_LENGTH: [f64; 2] = [0.45, 1.1];
/// Width of remains relative to their length: minimum, maximum.
const REMAINS_WIDTH: [f64; 2] = [0.5, 1.0];
/// Grain size of remains, µm: minimum, maximum.
const REMAINS_GRAIN_UM: [f64; 2] = [0.6, 1.1];
/// Contrast of the grains of remains.
const REMAINS_GRANULARITY: f64 = 0.25;
/// Irregularity of the outline of remains.
const REMAINS_RAGGED: f64 = 1.2;
/// Absorbance of remains: minimum, maximum.
const REMAINS_ABSORBANCE: [f64; 2] = [0.06, 0.24];

/// Draws granular remains of cytoplasm and mucus on one side of a cell of this radius, µm.
fn remains(radius: f64, context: &ObjectContext<'_>, rng: &mut Stream) -> Tuft {
    let side = random::direction(rng);
    let distance = radius * random::between(REMAINS_DISTANCE[0], REMAINS_DISTANCE[1], rng);
    let length = radius * random::between(REMAINS_LENGTH[0], REMAINS_LENGTH[1], rng);
    let width = length * random::between(REMAINS_WIDTH[0], REMAINS_WIDTH[1], rng);
    Tuft {
        centre: context.to_grid([distance * libm::cos(side), distance * libm::sin(side)]),
        half: [context.px(length), context.px(width)],
        turn: random::direction(rng),
        grain: context.px(random::between(REMAINS_GRAIN_UM[0], REMAINS_GRAIN_UM[1], rng)),
        granularity: REMAINS_GRANULARITY,
        ragged: REMAINS_RAGGED,
        absorbance: random::between(REMAINS_ABSORBANCE[0], REMAINS_ABSORBANCE[1], rng),
    }
}

/// Adds the remains to a cell.
fn add_remains(remains: &Tuft, canvas: &mut ObjectCanvas, context: &ObjectContext<'_>, rng: &mut Stream) {
    let mut tuft = canvas.blank();
    remains.draw(&mut tuft, context, rng);
    let values = canvas.absorbance.values.iter_mut().zip(&tuft.absorbance.values);
    values.for_each(|(value, added)| *value += added);
    let covers = canvas.coverage.values.iter_mut().zip(&tuft.coverage.values);
    covers.for_each(|(cover, other)| *cover = cover.max(*other));
}

/// Pale clefts of a smudged nucleus, midway between the centres of its parts.
struct Clefts {
    /// Centres of the parts, px.
    centres: Vec<Point>,
    /// Relative decrease of absorbance.
    depth: f64,
    /// Width (standard deviation), px.
    width: f64,
}

impl Clefts {
    /// Returns the clefts between the lobes of a nucleus at `at`, µm, or draws them for a nucleus of one lobe.
    fn new(at: Point, lobes: &[Lobe], context: &ObjectContext<'_>, rng: &mut Stream) -> Self {
        /// Largest distance of the centre of a part from that of the lobe, in its radii.
        const REACH: f64 = 0.8;
        let centres: Vec<Point> = match lobes {
            [lobe] => {
                let count = SMUDGED_PARTS[0] + random::below(SMUDGED_PARTS[1] - SMUDGED_PARTS[0] + 1, rng);
                let part = |_| {
                    let distance = REACH * lobe.radius * random::uniform(rng).sqrt();
                    let direction = random::direction(rng);
                    [distance * libm::cos(direction), distance * libm::sin(direction)]
                };
                (0..count).map(part).collect()
            }
            lobes => lobes.iter().map(|lobe| lobe.centre).collect(),
        };
        let centres = centres.iter().map(|[x, y]| context.to_grid([at[0] + x, at[1] + y])).collect();
        Self { centres, depth: random::between(CLEFT[0], CLEFT[1], rng), width: context.px(CLEFT_UM) }
    }

    /// Returns the factor on the absorbance at a pixel.
    fn factor(&self, p: Point) -> f32 {
        let square = |a: Point, b: Point| (a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]);
        let nearest = self.centres.iter().min_by(|a, b| square(p, **a).total_cmp(&square(p, **b)));
        let Some(nearest) = nearest else { return 1.0 };
        // The distance from the closest line midway between two centres.
        let others = self.centres.iter().filter(|other| *other != nearest);
        let distance =
            |other: &Point| 0.5 * (square(p, *other) - square(p, *nearest)) / square(*other, *nearest).sqrt();
        let off = others.map(distance).fold(f64::INFINITY, f64::min) / self.width;
        (1.0 - self.depth * libm::exp(-0.5 * off * off)) as f32
    }
}

/// Sets the absorbance of a nucleus from the summed thickness of its lobes. `rim` is the absorbance at its edge
/// relative to its centre.
fn domed(nucleus: &mut ObjectCanvas, shapes: &[Vec<Point>], absorbance: f64, rim: f64) {
    /// Upper limit of the thickness of overlapping lobes.
    const MAX_THICKNESS: f64 = 1.3;
    let spheres: Vec<(Point, f64)> = shapes.iter().map(|lobe| (fsd_shape::centroid(lobe), area(lobe) / PI)).collect();
    nucleus.shade(|p| {
        let chord = |(centre, square): &(Point, f64)| {
            let (dx, dy) = (p[0] - centre[0], p[1] - centre[1]);
            (1.0 - (dx * dx + dy * dy) / square).max(0.0).sqrt()
        };
        let thickness = spheres.iter().map(chord).sum::<f64>().min(MAX_THICKNESS);
        absorbance * (rim + (1.0 - rim) * 1.2 * thickness)
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clefts_are_palest_midway_between_parts() {
        let clefts = Clefts { centres: vec![[0.0, 0.0], [10.0, 0.0], [4.0, 30.0]], depth: 0.4, width: 2.0 };
        assert!((clefts.factor([5.0, 2.0]) - 0.6).abs() < 1e-6);
        assert!(clefts.factor([4.0, 0.0]) > clefts.factor([5.0, 0.0]));
        // As wide far from the line between the centres.
        assert!((clefts.factor([3.0, 2.0]) - clefts.factor([3.0, -40.0])).abs() < 1e-6);
        let expected = 1.0 - 0.4 * libm::exp(-0.5);
        assert!((f64::from(clefts.factor([3.0, 2.0])) - expected).abs() < 1e-6);
        assert!(clefts.factor([-2.0, 0.0]) > 0.99 && clefts.factor([4.0, 29.0]) > 0.99);
        let one = Clefts { centres: vec![[0.0, 0.0]], ..clefts };
        assert_eq!(one.factor([3.0, 1.0]), 1.0);
    }
}
