//! The flat sheet before it is pressed, and the outline's way from there to its shape.

use crate::batch::Start;
use crate::mesh::Disc;
use crate::outline::{Outline, moments};
use crate::sheet::cross;
use crate::{ClothParams, Point, Rest, Rng, Solver};
use portable_numerics::random::uniform;
use std::f64::consts::{PI, TAU};

/// Stretches of the outline that press inwards more than the rest does.
const PUSHES: usize = 3;
/// Least half width of a push and its random part, as parts of the way round.
const PUSH_WIDTH: (f64, f64) = (0.06, 0.12);
/// Least depth of a push and its random part; only their proportion counts.
const PUSH_DEPTH: (f64, f64) = (0.3, 1.0);
/// Depth by which the outline presses in everywhere, on the scale of [`PUSH_DEPTH`].
const PUSH_EVERYWHERE: f64 = 0.15;
/// How much deeper, on that scale, the outline presses in for each unit that it lies within its own smoothed self: notches
/// are where a sheet has been pushed in.
const PUSH_INTO_NOTCH: f64 = 10.0;
/// Widths of the Gaussians that smooth the outline, its normals and the pushes, as parts of the way round.
const SMOOTH: [f64; 3] = [0.05, 0.033, 0.025];
/// Least area of a triangle of the flat sheet, as part of the same triangle of the disc scaled to the sheet.
const LEAST_TRIANGLE: f64 = 0.1;

/// Points that the outline of a sheet has while it moves.
pub(crate) fn outline_points(disc: &Disc, params: &ClothParams) -> usize {
    match params.solver {
        Solver::Verlet(_) => params.outline_points,
        Solver::Xpbd(_) => disc.rim,
    }
}

/// A sheet before it is pressed.
pub(crate) fn start<R: Rng + ?Sized>(
    disc: &Disc,
    shape: Outline,
    excess: f64,
    params: &ClothParams,
    rng: &mut R,
) -> Start {
    let offset = uniform(rng);
    let target = shape.resampled(outline_points(disc, params), offset);
    let (rest, from) = match params.rest {
        Rest::Disc => round(disc, &target, &shape, excess, params),
        Rest::Outline => {
            let from = grown(&target, excess, rng);
            (flattened(disc, &from, excess), from)
        }
    };
    let (lift, held) = match &params.solver {
        Solver::Verlet(p) => (p.lift, 0),
        Solver::Xpbd(p) => (p.lift, disc.rim),
    };
    let heights = (0..rest.len()).map(|v| if v < held { 0.0 } else { lift * uniform(rng) }).collect();
    Start { shape, offset, rest, heights, outline: [from, target] }
}

/// The paper's start: a disc, turned so that its rim stands where the outline's points are.
fn round(
    disc: &Disc,
    target: &[Point],
    outline: &Outline,
    excess: f64,
    params: &ClothParams,
) -> (Vec<Point>, Vec<Point>) {
    let farthest = outline.points.iter().fold(0.0_f64, |m, p| m.max(p[0] * p[0] + p[1] * p[1])).sqrt();
    let radius = farthest.max(excess.sqrt());
    let room = match &params.solver {
        Solver::Verlet(p) => p.outline_start,
        Solver::Xpbd(_) => 1.0,
    };
    let turn = turn(target);
    let turned = |p: &Point| [radius * (p[0] * turn[0] - p[1] * turn[1]), radius * (p[0] * turn[1] + p[1] * turn[0])];
    let from = circle(target.len()).iter().map(|p| turned(p).map(|c| c * room)).collect();
    (disc.points.iter().map(turned).collect(), from)
}

/// Points at equal angles on the unit circle.
fn circle(count: usize) -> Vec<Point> {
    (0..count).map(|k| TAU * k as f64 / count as f64).map(|angle| [libm::cos(angle), libm::sin(angle)]).collect()
}

/// Cosine and sine of the turn that brings the circle closest to the curve: the direction of its first Fourier coefficient.
fn turn(curve: &[Point]) -> Point {
    let mut sum = [0.0, 0.0];
    for (p, c) in curve.iter().zip(circle(curve.len())) {
        sum[0] += p[0] * c[0] + p[1] * c[1];
        sum[1] += p[1] * c[0] - p[0] * c[1];
    }
    let length = (sum[0] * sum[0] + sum[1] * sum[1]).sqrt();
    if length > 0.0 { sum.map(|s| s / length) } else { [1.0, 0.0] }
}

/// The curve smoothed by a Gaussian of `width` parts of the way round.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "counts far below 2^31")]
fn smoothed(curve: &[Point], width: f64) -> Vec<Point> {
    let count = curve.len();
    let sigma = width * count as f64;
    let reach = ((3.0 * sigma).ceil() as usize).min((count - 1) / 2);
    let weights: Vec<f64> = (0..=reach).map(|i| libm::exp(-0.5 * (i as f64 / sigma) * (i as f64 / sigma))).collect();
    let total = weights[0] + 2.0 * weights[1..].iter().sum::<f64>();
    let twice = [curve, curve, curve].concat();
    (count..2 * count)
        .map(|k| {
            [0, 1].map(|axis| {
                let pairs = (1..=reach).map(|i| weights[i] * (twice[k + i][axis] + twice[k - i][axis]));
                (weights[0] * twice[k][axis] + pairs.sum::<f64>()) / total
            })
        })
        .collect()
}

/// The outline with its notches partly filled and pushed outwards here and there until it holds `excess` times its area:
/// the sheet gathers where the outline comes back in.
fn grown<R: Rng + ?Sized>(target: &[Point], excess: f64, rng: &mut R) -> Vec<Point> {
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
            let bell = libm::cos(0.5 * PI * (apart.min(1.0 - apart) / width).min(1.0));
            depth += most * bell * bell;
        }
        [n[0] * depth, n[1] * depth]
    };
    let outwards = smoothed(&(0..count).map(push).collect::<Vec<_>>(), SMOOTH[2]);
    let moved = |far: f64| -> Vec<Point> {
        target.iter().zip(&outwards).map(|(p, v)| [p[0] + far * v[0], p[1] + far * v[1]]).collect()
    };
    // Area is a quadratic of how far the curve is pushed: A₀ + A₁ f + A₂ f² = excess A₀.
    let (a0, a2) = (moments(target).0, moments(&outwards).0);
    let a1 = moments(&moved(1.0)).0 - a0 - a2;
    let wanted = (excess - 1.0) * a0;
    let root = (a1 * a1 + 4.0 * a2 * wanted).max(0.0).sqrt();
    let far = if a1 + root > 0.0 { 2.0 * wanted / (a1 + root) } else { 0.0 };
    moved(far)
}

/// The disc's mesh laid out within the curve. A curve too crooked for that is smoothed until it fits; in the end it is convex,
/// where harmonic coordinates never fold (Radó, Kneser and Choquet).
fn flattened(disc: &Disc, curve: &[Point], excess: f64) -> Vec<Point> {
    let narrowest = 1.0 / disc.rim as f64;
    let area = PI * excess;
    let rim = |curve: &[Point]| -> Vec<Point> {
        let scale = (area / moments(curve).0.max(f64::MIN_POSITIVE)).sqrt();
        (0..disc.rim).map(|k| between(curve, k, disc.rim).map(|c| c * scale)).collect()
    };
    let mut rest = disc.spread(&rim(curve));
    let mut width = narrowest;
    while width < 1.0 {
        if fits(disc, &rest, excess) {
            return rest;
        }
        rest = disc.spread(&rim(&smoothed(curve, width)));
        width *= 2.0;
    }
    let [c, s] = turn(curve).map(|t| t * excess.sqrt());
    disc.points.iter().map(|p| [p[0] * c - p[1] * s, p[0] * s + p[1] * c]).collect()
}

/// The point `k / count` of the way round, counted in the curve's points.
fn between(curve: &[Point], k: usize, count: usize) -> Point {
    let whole = k * curve.len() / count;
    let part = (k * curve.len() % count) as f64 / count as f64;
    let (a, b) = (curve[whole], curve[(whole + 1) % curve.len()]);
    [a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1])]
}

fn fits(disc: &Disc, rest: &[Point], excess: f64) -> bool {
    disc.triangles.iter().all(|t| {
        let [a, b, c] = t.map(|v| v as usize);
        cross(rest[a], rest[b], rest[c])
            > LEAST_TRIANGLE * excess * cross(disc.points[a], disc.points[b], disc.points[c])
    })
}
