//! Wrinkles: narrow creases in which a sheet lies doubled, some along its rim, some across it, some forked.

use super::super::tile::{Point, Tile};
use crate::key::Stream;
use crate::random;
use crate::scene::CellDetail;

/// Distance of the points of a wrinkle, µm.
const STEP_UM: f64 = 0.5;

/// Share of wrinkles that follow the rim, and of the others that fork off one drawn before.
const ALONG_RIM: f64 = 0.5;
const FORKED: f64 = 0.35;

/// Share of a wrinkle's length over which it rises and dies away.
const TAPER: f64 = 0.3;

/// What of a wrinkle's strength lies in the slope beside it, and how many times as wide as the wrinkle that is.
const SLOPE: f64 = 0.30;
const SLOPE_WIDTH: f64 = 4.0;

/// Adds a cell's wrinkles to its thickness.
pub(super) fn add(
    thickness: &mut Tile,
    coverage: &Tile,
    outline: &[Point],
    detail: &CellDetail,
    pixel_um: f64,
    rng: &mut Stream,
) {
    let mut drawn: Vec<Vec<Point>> = Vec::new();
    let mut canvas = vec![0.0; thickness.values.len()];
    for _ in 0..detail.wrinkles {
        let path = match random::uniform(rng) {
            u if u < ALONG_RIM => along_rim(outline, STEP_UM / pixel_um, rng),
            u if u < ALONG_RIM + (1.0 - ALONG_RIM) * FORKED && !drawn.is_empty() => {
                let stem = &drawn[random::below(drawn.len(), rng)];
                forked(stem, outline, STEP_UM / pixel_um, rng)
            }
            _ => across(outline, STEP_UM / pixel_um, rng),
        };
        let brush = Brush {
            width: detail.wrinkle_um * random::between(0.6, 1.6, rng) / pixel_um,
            strength: detail.wrinkle * random::between(0.4, 1.6, rng),
            side: if random::chance(0.5, rng) { 1.0 } else { -1.0 },
            rise: random::between(0.05, TAPER, rng),
            fall: random::between(0.1, 2.0 * TAPER, rng),
            uneven: uneven(path.len(), rng),
        };
        brush.draw(&path, thickness, coverage, &mut canvas);
        drawn.push(path);
    }
}

/// Random factors of mean 1 or so that change over a few micrometres, some of them 0.
fn uneven(count: usize, rng: &mut Stream) -> Vec<f64> {
    let mut walk = Walk::new(0.45, rng);
    (0..count).map(|_| (0.9 + walk.next(rng)).clamp(0.0, 2.5)).collect()
}

/// A stretch of the rim, moved inwards.
fn along_rim(outline: &[Point], step: f64, rng: &mut Stream) -> Vec<Point> {
    let fine = fsd_shape::resample(outline, random::count(fsd_shape::perimeter(outline) / step).max(8));
    let middle = fsd_shape::centroid(outline);
    let length = random::count(fine.len() as f64 * random::between(0.06, 0.35, rng)).max(4);
    let first = random::below(fine.len(), rng);
    // Most lie near the rim: it is there that a thin sheet is free to fold.
    let depth = random::uniform(rng);
    let inset = 0.015 + 0.35 * depth * depth;
    let drift = random::between(-0.3, 0.3, rng);
    let mut walk = Walk::new(0.022, rng);
    (0..length)
        .map(|i| {
            let p = fine[(first + i) % fine.len()];
            let t = i as f64 / length as f64;
            let shrink = 1.0 - (inset + drift * (t - 0.5) + walk.next(rng)).max(0.008);
            [middle[0] + shrink * (p[0] - middle[0]), middle[1] + shrink * (p[1] - middle[1])]
        })
        .collect()
}

/// A bent line that starts anywhere.
fn across(outline: &[Point], step: f64, rng: &mut Stream) -> Vec<Point> {
    let middle = fsd_shape::centroid(outline);
    let rim = outline[random::below(outline.len(), rng)];
    let share = 0.2 + 0.75 * random::uniform(rng).sqrt();
    let start = [middle[0] + share * (rim[0] - middle[0]), middle[1] + share * (rim[1] - middle[1])];
    wander(start, random::direction(rng), radius_of(outline), step, rng)
}

/// A line that leaves another one at an acute angle.
fn forked(stem: &[Point], outline: &[Point], step: f64, rng: &mut Stream) -> Vec<Point> {
    let at = random::below(stem.len().saturating_sub(1), rng);
    let (a, b) = (stem[at], stem[(at + 1).min(stem.len() - 1)]);
    let turn = random::between(0.25, 0.9, rng) * if random::chance(0.5, rng) { 1.0 } else { -1.0 };
    wander(a, libm::atan2(b[1] - a[1], b[0] - a[0]) + turn, radius_of(outline), step, rng)
}

fn radius_of(outline: &[Point]) -> f64 {
    (super::area(outline) / core::f64::consts::PI).sqrt()
}

/// A line of slowly changing curvature.
fn wander(start: Point, direction: f64, radius: f64, step: f64, rng: &mut Stream) -> Vec<Point> {
    let steps = random::count(random::between(0.35, 1.5, rng) * radius / step).max(4);
    let mean = random::normal(rng) * 0.5 / radius;
    let mut curvature = Walk::new(1.2 / radius, rng);
    let (mut at, mut heading) = (start, direction);
    (0..steps)
        .map(|_| {
            heading += step * (mean + curvature.next(rng));
            at = [at[0] + step * libm::cos(heading), at[1] + step * libm::sin(heading)];
            at
        })
        .collect()
}

/// A first-order autoregression.
struct Walk {
    state: f64,
    sd: f64,
}

impl Walk {
    const MEMORY: f64 = 0.93;

    fn new(sd: f64, rng: &mut Stream) -> Self {
        Self { state: sd * random::normal(rng), sd }
    }

    fn next(&mut self, rng: &mut Stream) -> f64 {
        let fresh = (1.0 - Self::MEMORY * Self::MEMORY).sqrt();
        self.state = Self::MEMORY * self.state + fresh * self.sd * random::normal(rng);
        self.state
    }
}

/// What draws a wrinkle: sharp on one side, sloping on the other.
struct Brush {
    /// Standard deviation of its crest, px.
    width: f64,
    /// Thickness added at its crest, relative to the flat sheet's.
    strength: f64,
    /// The side of the slope: 1 or −1.
    side: f64,
    /// Shares of the length over which it rises and dies away.
    rise: f64,
    fall: f64,
    /// Factor on its strength, step by step: wrinkles break off and begin again.
    uneven: Vec<f64>,
}

impl Brush {
    /// Adds the wrinkle to what the cell covers. `canvas` is zero before and after.
    fn draw(&self, path: &[Point], thickness: &mut Tile, coverage: &Tile, canvas: &mut [f32]) {
        let (width, height) = (thickness.width as i64, thickness.height() as i64);
        let origin = thickness.origin.map(|at| at as f64);
        let reach = (3.0 * self.width).max(2.2 * SLOPE_WIDTH * self.width) + 1.0;
        #[expect(clippy::cast_possible_truncation, reason = "a few pixels round a place in a tile")]
        let span = |a: f64, b: f64, size: i64| {
            let (low, high) = ((a.min(b) - reach).floor() as i64, (a.max(b) + reach).ceil() as i64);
            (low.clamp(0, size), (high + 1).clamp(0, size))
        };
        let mut touched = (height, 0);
        for (index, (ends, uneven)) in path.windows(2).zip(&self.uneven).enumerate() {
            let [a, b] = [ends[0], ends[1]].map(|p| [p[0] - origin[0], p[1] - origin[1]]);
            let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
            let length = (dx * dx + dy * dy).sqrt().max(f64::MIN_POSITIVE);
            let (tx, ty) = (dx / length, dy / length);
            let t = (index as f64 + 0.5) / (path.len() - 1) as f64;
            let fade = (t / self.rise).min((1.0 - t) / self.fall).min(1.0);
            let strength = self.strength * fade * (2.0 - fade) * uneven;
            if strength <= 0.0 {
                continue;
            }
            let ((x0, x1), (y0, y1)) = (span(a[0], b[0], width), span(a[1], b[1], height));
            touched = (touched.0.min(y0), touched.1.max(y1));
            for y in y0..y1 {
                for x in x0..x1 {
                    let (px, py) = (x as f64 - a[0], y as f64 - a[1]);
                    let along = px * tx + py * ty;
                    let beyond = if along < 0.0 { -along } else { (along - length).max(0.0) };
                    if beyond > self.width {
                        continue;
                    }
                    let off = self.side * (py * tx - px * ty);
                    let value = strength * self.profile(off);
                    let at = usize::try_from(y * width + x).unwrap_or(0);
                    canvas[at] = canvas[at].max(value as f32);
                }
            }
        }
        let rows = usize::try_from(touched.0.min(touched.1)).unwrap_or(0) * thickness.width
            ..usize::try_from(touched.1).unwrap_or(0) * thickness.width;
        let pixels = thickness.values[rows.clone()].iter_mut().zip(&coverage.values[rows.clone()]);
        for ((value, cover), added) in pixels.zip(&mut canvas[rows]) {
            if *cover > 0.0 {
                *value += *added;
            }
            *added = 0.0;
        }
    }

    /// Thickness over that of the crest, at a distance from it: a Gaussian crest, and a slope on one side.
    fn profile(&self, off: f64) -> f64 {
        let gauss = libm::exp(-0.5 * (off / self.width) * (off / self.width));
        if off <= 0.0 { gauss } else { gauss + SLOPE * (libm::exp(-off / (SLOPE_WIDTH * self.width)) - gauss) }
    }
}
