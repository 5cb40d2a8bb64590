//! The nucleus of a cell: outline, chromatin, rim.

use multiversion::multiversion;
use optics_psf::{Border, Gaussian, Method};

use super::assets::ClassAssets;
use super::cell_context::CellContext;
use super::chromatin::standardise;
use super::noise_fields::{FieldSampler, SIDE, Texels};
use super::parametric_shape::{make_irregular, perturbed_circle, placed};
use super::piece::Piece;
use super::tile::{Point, Tile, area, radius_of, scaled_about};
use crate::error::ErrorKind;
use crate::key::Stream;
use crate::random;
use crate::recipe::Chromatin;
use crate::scene::NucleusBody;
use crate::truth::part::Part;

/// Points of the outline of a nucleus (the paper's K = 64).
const POINTS: usize = 64;

/// Width of the dark rim, µm: the nuclear membrane and adjacent chromatin, as imaged.
const RIM_UM: f64 = 0.45;

/// Minimum absorbance relative to the nucleus: chromatin above and below a gap is stained too.
const PALEST: f32 = 0.3;

/// Harmonics of nuclear wrinkles.
const WRINKLES: core::ops::RangeInclusive<u32> = 3..=7;

/// Amplitude of the strongest wrinkles, relative to the radius.
const WRINKLE: f64 = 0.075;

/// Roundness of the notches of wrinkles: 0 gives corners.
const NOTCH_ROUNDNESS: f64 = 0.3;

/// Mean over all angles of √(cos² + r²) with this roundness r, so that wrinkles keep the mean radius.
const MEAN_BULGE: f64 = 0.7246;

/// Irregularity of the outline of a pyknotic nucleus: standard deviation of the second harmonic.
const PYKNOTIC: f64 = 0.05;

/// Minimum width of the edge of a pyknotic nucleus, µm.
const PYKNOTIC_EDGE_UM: f64 = 0.3;

/// Fraction of the edge blur in its truncated tails.
const EDGE_TAIL: f64 = 1e-3;

/// Draws the nucleus of a cell.
pub(super) fn make(cell: &CellContext<'_>, class: &ClassAssets) -> Result<Piece, ErrorKind> {
    let CellContext { assets, scene, object, body, .. } = *cell;
    let nucleus = &body.nucleus;
    let pixel_um = scene.grid().pixel_um;
    let cell_centre = scene.grid().to_px(object.centre_um);
    let mut shape_rng = cell.stream("nucleus.shape");
    let radius_px = nucleus.radius_um / pixel_um;
    let mut outline = class.nucleus(radius_px, &mut shape_rng)?.outline(POINTS);
    if nucleus.wrinkle > 0.0 {
        wrinkle(&mut outline, nucleus.wrinkle * WRINKLE, &mut shape_rng);
    }
    if nucleus.pyknotic {
        make_irregular(&mut outline, PYKNOTIC, &mut cell.stream("nucleus.pyknotic"));
    }
    let [dx, dy] = nucleus.off_centre.map(|fraction| fraction * body.radius_um / pixel_um);
    let centre = [cell_centre[0] + dx, cell_centre[1] + dy];
    let outline: Vec<Point> = outline.iter().map(|p| placed(*p, nucleus.rotation_deg.to_radians(), centre)).collect();

    let edge_um = if nucleus.pyknotic { nucleus.edge_um.max(PYKNOTIC_EDGE_UM) } else { nucleus.edge_um };
    let edge = Gaussian::truncated(edge_um / pixel_um, Method::Direct, EDGE_TAIL)?;
    let mut coverage = Tile::around(&outline, 2.0 + edge.radius() as f64);
    coverage.cover(&outline);
    let mut inner = coverage.blank();
    let shrink = (1.0 - RIM_UM / nucleus.radius_um).max(0.0);
    inner.cover(&scaled_about(&outline, centre, shrink));

    let mut rng = cell.stream("nucleus.texture");
    let mut texture = match assets.settings.chromatin {
        Chromatin::Quilt => {
            let donors = assets.settings.donors.draw_count(&mut rng).max(1);
            class.donors.quilt(&coverage, pixel_um, donors, &class.quilt, &mut rng)?
        }
        Chromatin::Field => class.donors.field(&coverage, pixel_um, &mut rng),
    };
    let imaged = class.donors.imaged && assets.settings.chromatin == Chromatin::Quilt;
    if nucleus.clumping > 0.0 && !imaged {
        clump(&mut texture, &coverage, cell);
    }
    let contrast = (nucleus.texture * class.donors.sharpening) as f32;
    // The texture of an imaged donor includes its rim.
    let rim_strength = if imaged { 0.0 } else { nucleus.rim as f32 };
    let mut thickness = coverage.blank();
    if imaged {
        // The texture of an imaged donor includes its thickness.
        thickness.values.fill(1.0);
    } else {
        dome(&mut thickness, &outline, nucleus);
    }
    let mut absorbance = coverage.clone();
    if edge.radius() > 0 && !imaged {
        absorbance.values = edge.blur(&coverage.values, coverage.width, Border::Zero);
    }
    for (i, value) in absorbance.values.iter_mut().enumerate() {
        let rim = (coverage.values[i] - inner.values[i]).max(0.0) * rim_strength;
        let level = thickness.values[i] * (nucleus.absorbance as f32 * (1.0 + rim) + contrast * texture[i]);
        *value *= level.max(PALEST * nucleus.absorbance as f32);
    }
    let mut own = cell.stream("nucleoli");
    for _ in 0..nucleus.nucleoli {
        add_nucleolus(&mut absorbance, &outline, centre, cell, &mut own);
    }
    Ok(Piece { part: Part::Nucleus, imaged, ..Piece::whole(absorbance, coverage, area(&outline), nucleus.dyes) })
}

/// Replaces a fraction of the variance of a texture by coarse noise.
fn clump(texture: &mut [f32], coverage: &Tile, cell: &CellContext<'_>) {
    /// Standard deviation of the smoothing of white noise, µm.
    const CLUMP_UM: f64 = 0.7;
    let sampler = FieldSampler::clouds(CLUMP_UM / cell.scene.grid().pixel_um, &mut cell.stream("nucleus.clumps"));
    let mut coarse = vec![0.0; texture.len()];
    let mut texels: Texels = [0.0; SIDE + 1];
    for (y, row) in coarse.chunks_exact_mut(coverage.width).enumerate() {
        cell.noise_fields.clouds().row_into(row, &sampler, [0.0, y as f64], &mut texels);
    }
    standardise(&mut coarse, &coverage.values);
    let fraction = cell.body.nucleus.clumping;
    let [fine, rough] = [1.0 - fraction, fraction].map(|part| part.sqrt() as f32);
    texture.iter_mut().zip(&coarse).for_each(|(value, coarse)| *value = fine * *value + rough * coarse);
}

/// Computes the thickness of a nucleus relative to its mean: a mixture of a plate and an ellipsoid, with a linear
/// gradient.
fn dome(thickness: &mut Tile, outline: &[Point], nucleus: &NucleusBody) {
    let dome = nucleus.dome;
    /// Mean over a disc of the chord √(1 − ρ²) of a sphere.
    const MEAN_CHORD: f64 = 2.0 / 3.0;
    // The ellipse with the second moments of the outline; the points of a circle of radius r have moments r²/2.
    let centre = fsd_shape::centroid(outline);
    let moment = |a: usize, b: usize| {
        2.0 * outline.iter().map(|p| (p[a] - centre[a]) * (p[b] - centre[b])).sum::<f64>() / outline.len() as f64
    };
    let (xx, xy, yy) = (moment(0, 0), moment(0, 1), moment(1, 1));
    let determinant = (xx * yy - xy * xy).max(f64::MIN_POSITIVE);
    let squares = [yy, -2.0 * xy, xx].map(|moment| (moment / determinant) as f32);
    let slants = nucleus.thickness_gradient.map(|slope| (slope / determinant.sqrt().sqrt()) as f32);
    let weights = [1.0 - dome, dome / MEAN_CHORD].map(|weight| weight as f32);
    let (width, [x, y]) = (thickness.width, [0, 1].map(|axis| (thickness.origin[axis] as f64 - centre[axis]) as f32));
    for (row, dy) in thickness.values.chunks_exact_mut(width).zip(0_u16..) {
        dome_row(row, [x, y + f32::from(dy)], squares, slants, weights);
    }
}

/// Computes a row of the thickness; `first` is the position of its first pixel relative to the centre.
#[multiversion(targets = "simd")]
fn dome_row(row: &mut [f32], first: [f32; 2], squares: [f32; 3], slants: [f32; 2], weights: [f32; 2]) {
    let dy = first[1];
    for (i, value) in row.iter_mut().enumerate() {
        let dx = first[0] + i as f32;
        let rho2 = squares[0] * dx * dx + squares[1] * dx * dy + squares[2] * dy * dy;
        let chord = (1.0 - rho2).max(0.0).sqrt();
        *value = (weights[0] + weights[1] * chord) * (1.0 + slants[0] * dx + slants[1] * dy).max(0.0);
    }
}

/// Radius of a nucleolus, µm: minimum, maximum.
const NUCLEOLUS_UM: [f64; 2] = [0.5, 1.1];

/// Absorbance of a nucleolus relative to the nucleus.
const NUCLEOLUS: f64 = 0.8;

/// Adds a nucleolus: a round, dark body of uniform absorbance.
fn add_nucleolus(absorbance: &mut Tile, outline: &[Point], centre: Point, cell: &CellContext<'_>, rng: &mut Stream) {
    let (strength, pixel_um) = (cell.body.nucleus.absorbance, cell.scene.grid().pixel_um);
    let radius = random::between(NUCLEOLUS_UM[0], NUCLEOLUS_UM[1], rng) / pixel_um;
    let rim = outline[random::below(outline.len(), rng)];
    let t = random::between(0.0, 0.6, rng);
    let at = [centre[0] + t * (rim[0] - centre[0]), centre[1] + t * (rim[1] - centre[1])];
    let mut cover = absorbance.blank();
    let round = perturbed_circle(radius, 0.08, 0.08, rng);
    cover.cover(&round.iter().map(|p| [p[0] + at[0], p[1] + at[1]]).collect::<Vec<_>>());
    for (value, cover) in absorbance.values.iter_mut().zip(&cover.values) {
        *value += cover * (NUCLEOLUS * strength) as f32;
    }
}

/// Displaces the points of an outline radially by harmonics of random phase, with notches.
fn wrinkle(outline: &mut [Point], strength: f64, rng: &mut Stream) {
    let radius = radius_of(area(outline));
    let waves: Vec<[f64; 3]> = WRINKLES
        .map(|harmonic| {
            let amplitude = strength * radius * random::normal(rng) / (f64::from(harmonic) / 3.0);
            [f64::from(harmonic), amplitude, random::direction(rng)]
        })
        .collect();
    for point in outline.iter_mut() {
        let angle = libm::atan2(point[1], point[0]);
        let length = (point[0] * point[0] + point[1] * point[1]).sqrt();
        // Round bulges with narrow notches between them, as in a wrinkled membrane.
        let bulge = |[h, a, phase]: &[f64; 3]| {
            let cos = libm::cos(h * angle + phase);
            a.abs() * ((cos * cos + NOTCH_ROUNDNESS * NOTCH_ROUNDNESS).sqrt() - MEAN_BULGE)
        };
        let push: f64 = waves.iter().map(bulge).sum();
        let scale = ((length + push) / length.max(1e-9)).clamp(0.5, 1.5);
        point[0] *= scale;
        point[1] *= scale;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Key;

    #[test]
    fn wrinkles_are_round_bulges_with_notches_and_keep_the_area() {
        let rng = &mut Key { seed: 7, index: 0 }.stream("test", 0, "wrinkles");
        let (mut areas, mut squares, mut cubes) = (0.0, 0.0, 0.0);
        const COUNT: usize = 500;
        for _ in 0..COUNT {
            let angles = (0..POINTS).map(|k| core::f64::consts::TAU * k as f64 / POINTS as f64);
            let mut outline: Vec<Point> = angles.map(|a| [10.0 * libm::cos(a), 10.0 * libm::sin(a)]).collect();
            wrinkle(&mut outline, WRINKLE, rng);
            areas += area(&outline) / (core::f64::consts::PI * 100.0);
            let at = |k: usize| outline[k % POINTS];
            let side = |k: usize| [at(k + 1)[0] - at(k)[0], at(k + 1)[1] - at(k)[1]];
            for k in 0..POINTS {
                let ([ax, ay], [bx, by]) = (side(k), side(k + 1));
                // Mean turn: a full turn over all points. Notches turn inwards, by more than bulges turn outwards.
                let turn = libm::atan2(ax * by - ay * bx, ax * bx + ay * by) - core::f64::consts::TAU / POINTS as f64;
                squares += turn * turn;
                cubes += turn * turn * turn;
            }
        }
        let count = (COUNT * POINTS) as f64;
        let variance = squares / count;
        let skewness = (cubes / count) / (variance * variance.sqrt());
        assert!(skewness < -0.3, "{skewness}");
        assert!((areas / COUNT as f64 - 1.0).abs() < 0.02, "{areas}");
    }
}
