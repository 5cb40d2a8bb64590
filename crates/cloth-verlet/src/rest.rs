//! The flat sheet before it is crumpled, and the start of its outline.

use crate::batch::{Flat, Start};
use crate::mesh::Disc;
use crate::outline::{Outline, moments};
use crate::sheet::cross;
use crate::{ClothParams, Point, RestShape, Rng, Solver};
use portable_numerics::random::uniform;
use std::f64::consts::{PI, TAU};

/// Number of stretches of the outline that are pushed inwards further than the others.
const PUSHES: usize = 3;
/// Smallest half width of a push and its random part, as fractions of the perimeter.
const PUSH_WIDTH: (f64, f64) = (0.06, 0.12);
/// Smallest depth of a push and its random part; only their ratio matters.
const PUSH_DEPTH: (f64, f64) = (0.3, 1.0);
/// Depth by which the complete outline is pushed inwards, on the scale of [`PUSH_DEPTH`].
const PUSH_EVERYWHERE: f64 = 0.15;
/// Additional depth, on that scale, per unit distance of the outline inside its smoothed version: notches are pushed
/// inwards further.
const PUSH_INTO_NOTCH: f64 = 10.0;
/// Standard deviations of the Gaussians that smooth the outline, its normals and the pushes, as fractions of the
/// perimeter.
const SMOOTH: [f64; 3] = [0.05, 0.033, 0.025];
/// Smallest area of a triangle of the flat sheet, as a fraction of the same triangle of the disc scaled to the sheet.
const LEAST_TRIANGLE: f64 = 0.1;

/// Returns the number of points of the moving outline.
pub(crate) fn outline_points(disc: &Disc, params: &ClothParams) -> usize {
    match params.solver {
        Solver::Verlet(_) => params.outline_points,
        Solver::Xpbd(_) => disc.rim,
    }
}

/// Returns a sheet before it is crumpled.
pub(crate) fn start<R: Rng + ?Sized>(
    disc: &Disc,
    shape: Outline,
    area_ratio: f64,
    params: &ClothParams,
    rng: &mut R,
) -> Start {
    let offset = uniform(rng);
    let target = shape.resampled(outline_points(disc, params), offset);
    let (rest, from) = match params.rest_shape {
        RestShape::Disc => disc_start(disc, &target, &shape, area_ratio, params),
        RestShape::Outline => {
            let from = expanded(&target, area_ratio, rng);
            (mapped_into(disc, &from, area_ratio), from)
        }
    };
    let (lift, held) = match &params.solver {
        Solver::Verlet(p) => (p.lift, 0),
        Solver::Xpbd(p) => (p.lift, disc.rim),
    };
    let heights = (0..rest.len()).map(|v| if v < held { 0.0 } else { lift * uniform(rng) }).collect();
    Start { shape, offset, flat: Flat { rest, heights, outline: [from, target] } }
}

/// Returns the paper's start: a disc, rotated so that its rim is close to the points of the outline.
fn disc_start(
    disc: &Disc,
    target: &[Point],
    outline: &Outline,
    area_ratio: f64,
    params: &ClothParams,
) -> (Vec<Point>, Vec<Point>) {
    let farthest = outline.points.iter().fold(0.0_f64, |m, p| m.max(p[0] * p[0] + p[1] * p[1])).sqrt();
    let radius = farthest.max(area_ratio.sqrt());
    let room = match &params.solver {
        Solver::Verlet(p) => p.outline_start,
        Solver::Xpbd(_) => 1.0,
    };
    let rotation = rotation(target);
    let turned = |p: &Point| {
        [radius * (p[0] * rotation[0] - p[1] * rotation[1]), radius * (p[0] * rotation[1] + p[1] * rotation[0])]
    };
    let from = circle(target.len()).iter().map(|p| turned(p).map(|c| c * room)).collect();
    (disc.points.iter().map(turned).collect(), from)
}

/// Returns points at equal angles on the unit circle.
fn circle(count: usize) -> Vec<Point> {
    (0..count).map(|k| TAU * k as f64 / count as f64).map(|angle| [libm::cos(angle), libm::sin(angle)]).collect()
}

/// Returns cosine and sine of the rotation that brings the circle closest to the curve: the direction of its first
/// Fourier coefficient.
fn rotation(curve: &[Point]) -> Point {
    let mut sum = [0.0, 0.0];
    for (p, c) in curve.iter().zip(circle(curve.len())) {
        sum[0] += p[0] * c[0] + p[1] * c[1];
        sum[1] += p[1] * c[0] - p[0] * c[1];
    }
    let length = (sum[0] * sum[0] + sum[1] * sum[1]).sqrt();
    if length > 0.0 { sum.map(|s| s / length) } else { [1.0, 0.0] }
}

/// Returns the curve smoothed by a Gaussian; `width` is its standard deviation as a fraction of the number of points.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "counts displacement below 2^31")]
fn smoothed(curve: &[Point], width: f64) -> Vec<Point> {
    let count = curve.len();
    let sigma = width * count as f64;
    let reach = ((3.0 * sigma).ceil() as usize).min((count - 1) / 2);
    let weights: Vec<f64> = (0..=reach).map(|i| libm::exp(-0.5 * (i as f64 / sigma) * (i as f64 / sigma))).collect();
    let total = weights[0] + 2.0 * weights[1..].iter().sum::<f64>();
    let tripled = [curve, curve, curve].concat();
    (count..2 * count)
        .map(|k| {
            [0, 1].map(|axis| {
                let pairs = (1..=reach).map(|i| weights[i] * (tripled[k + i][axis] + tripled[k - i][axis]));
                (weights[0] * tripled[k][axis] + pairs.sum::<f64>()) / total
            })
        })
        .collect()
}

/// Returns the outline with its notches partly filled, and expanded at random places until it encloses `area_ratio`
/// times its area. The sheet folds where the outline moves back.
fn expanded<R: Rng + ?Sized>(target: &[Point], area_ratio: f64, rng: &mut R) -> Vec<Point> {
    let count = target.len();
    let soft = smoothed(target, SMOOTH[0]);
    let normals: Vec<Point> = (0..count)
        .map(|k| {
            let (a, b) = (soft[(k + count - 1) % count], soft[(k + 1) % count]);
            let (x, y) = (b[1] - a[1], a[0] - b[0]);
            let length = (x * x + y * y).sqrt();
            if length > 0.0 { [x / length, y / length] } else { [0.0, 0.0] }
        })
        .collect();
    let normals = smoothed(&normals, SMOOTH[1]);
    let pushes: [[f64; 3]; PUSHES] = std::array::from_fn(|_| {
        [uniform(rng), PUSH_WIDTH.0 + PUSH_WIDTH.1 * uniform(rng), PUSH_DEPTH.0 + PUSH_DEPTH.1 * uniform(rng)]
    });
    let push = |k: usize| -> Point {
        let n = normals[k];
        let notch = (soft[k][0] - target[k][0]) * n[0] + (soft[k][1] - target[k][1]) * n[1];
        let mut depth = PUSH_EVERYWHERE + PUSH_INTO_NOTCH * notch.max(0.0);
        for [at, width, most] in pushes {
            let apart = (k as f64 / count as f64 - at).abs();
            let part = apart.min(1.0 - apart) / width;
            if part < 1.0 {
                let bell = libm::cos(0.5 * PI * part);
                depth += most * bell * bell;
            }
        }
        [n[0] * depth, n[1] * depth]
    };
    let outwards = smoothed(&(0..count).map(push).collect::<Vec<_>>(), SMOOTH[2]);
    let moved = |displacement: f64| -> Vec<Point> {
        target.iter().zip(&outwards).map(|(p, v)| [p[0] + displacement * v[0], p[1] + displacement * v[1]]).collect()
    };
    // The area is a quadratic function of the displacement f: A₀ + A₁ f + A₂ f² = area_ratio A₀.
    let (a0, a2) = (moments(target).0, moments(&outwards).0);
    let a1 = moments(&moved(1.0)).0 - a0 - a2;
    let wanted = (area_ratio - 1.0) * a0;
    let root = (a1 * a1 + 4.0 * a2 * wanted).max(0.0).sqrt();
    let displacement = if a1 + root > 0.0 { 2.0 * wanted / (a1 + root) } else { 0.0 };
    moved(displacement)
}

/// Maps the disc into the curve by harmonic coordinates. If triangles fold over, the curve is smoothed until they do
/// not: for a convex curve they never do (Radó, Kneser and Choquet).
fn mapped_into(disc: &Disc, curve: &[Point], area_ratio: f64) -> Vec<Point> {
    let narrowest = 1.0 / disc.rim as f64;
    let area = PI * area_ratio;
    let rim = |curve: &[Point]| -> Vec<Point> {
        let scale = (area / moments(curve).0.max(f64::MIN_POSITIVE)).sqrt();
        (0..disc.rim).map(|k| interpolated(curve, k, disc.rim).map(|c| c * scale)).collect()
    };
    let mut rest = disc.harmonic_map(&rim(curve));
    let mut width = narrowest;
    while width < 1.0 {
        if is_unfolded(disc, &rest, area_ratio) {
            return rest;
        }
        rest = disc.harmonic_map(&rim(&smoothed(curve, width)));
        width *= 2.0;
    }
    let [c, s] = rotation(curve).map(|t| t * area_ratio.sqrt());
    disc.points.iter().map(|p| [p[0] * c - p[1] * s, p[0] * s + p[1] * c]).collect()
}

/// Returns the point at the fraction `k / count` of the curve's points.
pub(crate) fn interpolated(curve: &[Point], k: usize, count: usize) -> Point {
    let whole = k * curve.len() / count;
    let part = (k * curve.len() % count) as f64 / count as f64;
    let (a, b) = (curve[whole], curve[(whole + 1) % curve.len()]);
    [a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1])]
}

fn is_unfolded(disc: &Disc, rest: &[Point], area_ratio: f64) -> bool {
    disc.triangles.iter().all(|t| {
        let [a, b, c] = t.map(|v| v as usize);
        cross(rest[a], rest[b], rest[c])
            > LEAST_TRIANGLE * area_ratio * cross(disc.points[a], disc.points[b], disc.points[c])
    })
}
