//! Neutrophils: a lobed nucleus in a pale, ragged cytoplasm that is often drawn out to one side.

use super::Leukocyte;
use crate::debris::prelude::*;

/// Corners of a cytoplasm's outline before it is smoothed, and points between two of them.
const CORNERS: usize = 14;
const BETWEEN: usize = 4;

/// How much the corners' distances from the middle vary, of a whole cytoplasm and of a frayed one.
const RAGGED: f64 = 0.06;
const FRAYED: f64 = 0.13;

/// Share of the cytoplasms that are drawn out, and by how much of their radius.
const DRAWN_OUT: f64 = 0.45;
const TAIL: [f64; 2] = [0.15, 0.65];

/// Distance of neighbouring lobes in radii of a lobe, and the angle by which the row of lobes turns at each.
const STEP: [f64; 2] = [1.15, 1.6];
const TURN: [f64; 2] = [0.5, 1.5];

/// Half-width of the bridge between two lobes, in radii of a lobe.
const BRIDGE: f64 = 0.42;

/// Absorbance at a lobe's rim relative to its middle: lobes are balls that dried flat; smudged ones have lost their edge.
const RIM: f64 = 0.7;
const SMUDGED_RIM: f64 = 0.4;

/// Strengths of texture: clumps of chromatin, and of degenerated ones; granules and vacuoles of the cytoplasm.
const CHROMATIN: f32 = 0.10;
const SMUDGED: f32 = 0.14;
const VACUOLES: f32 = 0.2;

/// Sizes (standard deviations) of clumps and vacuoles, µm.
const CLUMP_UM: f64 = 0.45;
const VACUOLE_UM: f64 = 0.3;

/// Width of the darker border of the cytoplasm, µm, and how much darker it is.
const BORDER_UM: f64 = 0.5;
const BORDER: f32 = 0.2;

pub(super) fn make(leukocyte: &Leukocyte, site: &Site<'_>) -> Phantom {
    let mut rng = site.stream("shape");
    let cell_radius = 0.5 * leukocyte.cell_um;
    let tail = if random::chance(DRAWN_OUT, &mut rng) { random::between(TAIL[0], TAIL[1], &mut rng) } else { 0.0 };
    let toward = random::direction(&mut rng);
    let body = cytoplasm(leukocyte, cell_radius, tail, toward, &mut rng);
    let lobes = lobes(leukocyte, cell_radius, &mut rng);
    // The nucleus stays behind where the cytoplasm is drawn out.
    let shift = -0.35 * tail * cell_radius + 0.08 * cell_radius * random::normal(&mut rng);
    let at = [shift * libm::cos(toward), shift * libm::sin(toward)];
    let outline = site.places(&body);
    let shapes: Vec<Vec<Point>> = lobes
        .iter()
        .map(|lobe| {
            let shape = perturbed_circle(lobe.radius, leukocyte.alpha, leukocyte.beta, &mut rng);
            let stretch = |p: &Point| [p[0] * lobe.stretch, p[1] / lobe.stretch];
            let turned = shape.iter().map(|p| placed(stretch(p), lobe.heading, lobe.centre));
            turned.map(|p| site.place([p[0] + at[0], p[1] + at[1]])).collect()
        })
        .collect();

    let mut painting = site.painting(outline.iter().chain(shapes.iter().flatten()), 0.0);
    painting.coverage.cover(&outline);
    for (value, share) in border(&painting.coverage, &outline, site).values.iter().zip(&mut painting.absorbance.values)
    {
        *share = leukocyte.halo as f32 * value;
    }
    if leukocyte.degenerated {
        strands(&mut painting, site, cell_radius, leukocyte.halo, &mut rng);
    }
    let look = FieldSampler::clouds(site.px(VACUOLE_UM), &mut rng);
    painting.texture(site.noise_fields.clouds(), &look, VACUOLES);

    let mut nucleus = painting.blank();
    for shape in &shapes {
        nucleus.coverage.cover(shape);
    }
    for pair in lobes.windows(2) {
        let ends = [0, 1].map(|i| site.place([pair[i].centre[0] + at[0], pair[i].centre[1] + at[1]]));
        let half_width = site.px(BRIDGE * pair[0].radius.min(pair[1].radius));
        nucleus.stroke(&Stroke::even(ends[0], ends[1], half_width), 0.0);
    }
    domed(&mut nucleus, &shapes, leukocyte);
    let look = FieldSampler::clouds(site.px(CLUMP_UM), &mut rng);
    nucleus.texture(site.noise_fields.clouds(), &look, if leukocyte.degenerated { SMUDGED } else { CHROMATIN });
    for (cover, inside) in painting.coverage.values.iter_mut().zip(&nucleus.coverage.values) {
        *cover = cover.max(*inside);
    }
    let mut phantom =
        painting.finish(leukocyte.dyes, 0.0, leukocyte.halo).with_inclusion(nucleus.absorbance, site.dyes.nucleus);
    if leukocyte.degenerated {
        phantom.traits.push(Trait::Degenerated);
    }
    phantom
}

/// The outline of the cytoplasm, µm from its middle.
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
    smooth(&corners, BETWEEN)
}

/// A lobe of a nucleus, µm.
struct Lobe {
    centre: Point,
    radius: f64,
    /// The way the row of lobes runs, and how much longer the lobe is that way than across.
    heading: f64,
    stretch: f64,
}

/// A bent row of lobes about the middle of the nucleus.
fn lobes(leukocyte: &Leukocyte, cell_radius: f64, rng: &mut Stream) -> Vec<Lobe> {
    let count = if leukocyte.degenerated { 1 } else { leukocyte.lobes };
    // Neighbours overlap, so that a row of them covers less than all of them.
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
    // However long the row, the nucleus stays inside the cell.
    let reach = |l: &Lobe| (l.centre[0] * l.centre[0] + l.centre[1] * l.centre[1]).sqrt() + l.radius;
    let widest = lobes.iter().map(reach).fold(0.0, f64::max);
    let shrink = (0.9 * cell_radius / widest).min(1.0);
    for lobe in &mut lobes {
        lobe.centre = lobe.centre.map(|v| v * shrink);
        lobe.radius *= shrink;
    }
    lobes
}

/// The cytoplasm, 1 inside and darker along its border.
fn border(coverage: &Tile, outline: &[Point], site: &Site<'_>) -> Tile {
    let middle = fsd_shape::centroid(outline);
    let radius = (area(outline) / core::f64::consts::PI).sqrt();
    let shrink = (1.0 - site.px(BORDER_UM) / radius).max(0.0);
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

/// Shreds that hang out of a degenerated cell.
fn strands(painting: &mut Painting, site: &Site<'_>, radius: f64, halo: f64, rng: &mut Stream) {
    for _ in 0..1 + random::below(3, rng) {
        let angle = random::direction(rng);
        let reach = radius * random::between(1.0, 1.25, rng);
        let bend = angle + 0.5 * random::normal(rng);
        let ends = [0.5 * radius, reach].map(|r| site.place([r * libm::cos(angle), r * libm::sin(bend)]));
        let half_width = site.px(random::between(0.4, 1.0, rng));
        painting.stroke(&Stroke { ends, half_widths: [half_width, 0.3 * half_width] }, halo);
    }
}

/// Makes a nucleus as dark as its lobes are thick where they lie over each other.
fn domed(nucleus: &mut Painting, shapes: &[Vec<Point>], leukocyte: &Leukocyte) {
    /// Lobes that lie over each other hide each other's stain in part.
    const THICKEST: f64 = 1.3;
    let rim = if leukocyte.degenerated { SMUDGED_RIM } else { RIM };
    let balls: Vec<(Point, f64)> =
        shapes.iter().map(|lobe| (fsd_shape::centroid(lobe), area(lobe) / core::f64::consts::PI)).collect();
    nucleus.shade(|p| {
        let chord = |(centre, square): &(Point, f64)| {
            let (dx, dy) = (p[0] - centre[0], p[1] - centre[1]);
            (1.0 - (dx * dx + dy * dy) / square).max(0.0).sqrt()
        };
        let thickness = balls.iter().map(chord).sum::<f64>().min(THICKEST);
        leukocyte.absorbance * (rim + (1.0 - rim) * 1.2 * thickness)
    });
}
