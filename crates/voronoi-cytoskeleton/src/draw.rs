use crate::error::{Error, require};
use crate::geometry::{Point, single};
use crate::path::DescentPath;

/// Intensity profile across a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Profile {
    /// Constant, with anti-aliased edges: the fraction of a pixel that a band of this width covers.
    Flat,
    /// (1 − d²/r²)² with its full width at half maximum equal to the width: similar to a Gaussian, but with finite
    /// support.
    #[default]
    Smooth,
}

/// Parameters of [`draw_into`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LineParams {
    /// Width of a line at the largest height, in pixels: above 0, at most 1000. Lines thinner than a pixel are fainter.
    /// Default: 1.7 (ours; similar to the paper's lines, which are one pixel wide and smoothed).
    pub width_px: f64,
    /// Intensity profile across a line. Default: [`Profile::Smooth`] (ours).
    pub profile: Profile,
    /// Relative reduction of the width at height 0: from 0 (constant width) to 1 (width 0). Default: 0.5 (ours).
    pub taper: f64,
    /// Value on the axis of a line: above 0. Default: 1.
    pub peak: f32,
}

impl Default for LineParams {
    fn default() -> Self {
        Self { width_px: 1.7, profile: Profile::default(), taper: 0.5, peak: 1.0 }
    }
}

/// Draws paths into an image. A pixel becomes the maximum of its value and the lines, 0 to [`LineParams::peak`], so
/// that junctions and bends are not brighter than lines. Parts outside the image are clipped.
///
/// # Errors
/// [`Error::OutOfRange`] for a parameter that is out of range.
///
/// # Panics
/// If `width` is zero or does not divide the length of `image`.
pub fn draw_into(image: &mut [f32], width: usize, paths: &[DescentPath], params: &LineParams) -> Result<(), Error> {
    let LineParams { width_px, profile: _, taper, peak } = *params;
    require("width_px", width_px, width_px > 0.0 && width_px <= 1000.0, "above 0, at most 1000")?;
    require("taper", taper, (0.0..=1.0).contains(&taper), "between 0 and 1")?;
    require("peak", f64::from(peak), peak > 0.0, "above 0")?;
    assert!(
        width > 0 && image.len().is_multiple_of(width),
        "{} pixels are not a multiple of the width {width}",
        image.len()
    );
    for path in paths {
        draw(image, width, path, params);
    }
    Ok(())
}

#[multiversion::multiversion(targets = "simd")]
fn draw(image: &mut [f32], width: usize, path: &DescentPath, params: &LineParams) {
    let LineParams { width_px, profile, taper, peak } = *params;
    let half = |height: f64| width_px / 2.0 * (1.0 - taper * (1.0 - height));
    for (points, heights) in path.points.windows(2).zip(path.heights.windows(2)) {
        let halves = [half(heights[0]), half(heights[1])];
        match profile {
            Profile::Flat => splat(image, width, points, halves, 0.5, |distance2, half| {
                let distance = distance2.sqrt();
                peak * larger(smaller(distance + 0.5, half) - larger(distance - 0.5, -half), 0.0)
            }),
            Profile::Smooth => {
                let narrowest = single(NARROWEST);
                let radii = halves.map(|half| half * REACH);
                splat(image, width, points, radii, NARROWEST, |distance2, radius| {
                    let drawn = larger(radius, narrowest);
                    let rest = larger(1.0 - distance2 / (drawn * drawn), 0.0);
                    peak * (radius / drawn) * rest * rest
                });
            }
        }
    }
}

/// Ratio of the radius and the half width at half maximum of (1 − d²/r²)²: r / d = 1 / √(1 − √½).
const REACH: f64 = 1.847_759_065_022_573_5;

/// Minimum radius of a smooth line, in pixels: a thinner line would be interrupted between pixel centres.
const NARROWEST: f64 = 1.0;

/// Pixels computed together: most rows of a line are shorter.
const LANES: usize = 8;

/// Takes the maximum of the image and `value(distance², half width)` around a segment, up to a distance of the half
/// width, or `least` if that is more, plus half a pixel.
#[inline(always)]
fn splat(
    image: &mut [f32],
    width: usize,
    ends: &[Point],
    halves: [f64; 2],
    least: f64,
    value: impl Fn(f32, f32) -> f32,
) {
    let height = image.len() / width;
    let reach = halves[0].max(halves[1]).max(least) + 0.5;
    let (a, b) = (ends[0], ends[1]);
    let d = [b[0] - a[0], b[1] - a[1]];
    let square = d[0] * d[0] + d[1] * d[1];
    let inverse = if square > 0.0 { single(1.0 / square) } else { 0.0 };
    let (dx, dy) = (single(d[0]), single(d[1]));
    let (from, growth) = (single(halves[0]), single(halves[1] - halves[0]));

    let per_row = 1.0 / d[1];
    for row in pixels(a[1].min(b[1]) - reach, a[1].max(b[1]) + reach, height) {
        // The part of the segment within reach of this row bounds the columns.
        let y = row as f64;
        let stretch = [y - reach, y + reach].map(|edge| ((edge - a[1]) * per_row).clamp(0.0, 1.0));
        let [s, t] = if d[1] == 0.0 { [0.0, 1.0] } else { stretch };
        let (left, right) = (a[0] + s * d[0], a[0] + t * d[0]);
        let columns = pixels(left.min(right) - reach, left.max(right) + reach, width);

        let py = single(y - a[1]);
        for start in columns.clone().step_by(LANES) {
            let offset = single(start as f64 - a[0]);
            let mut values = [0.0; LANES];
            for (i, drawn) in values.iter_mut().enumerate() {
                let px = offset + i as f32;
                let along = smaller(larger((px * dx + py * dy) * inverse, 0.0), 1.0);
                let (ex, ey) = (px - along * dx, py - along * dy);
                *drawn = value(ex * ex + ey * ey, from + along * growth);
            }
            // Most rows end within a block.
            let end = columns.end.min(start + LANES);
            match image[row * width + start..].first_chunk_mut::<LANES>() {
                Some(pixels) => {
                    let count = (end - start) as f32;
                    for (i, (pixel, drawn)) in pixels.iter_mut().zip(values).enumerate() {
                        *pixel = larger(*pixel, if (i as f32) < count { drawn } else { f32::NEG_INFINITY });
                    }
                }
                None => {
                    for (pixel, drawn) in image[row * width + start..row * width + end].iter_mut().zip(values) {
                        *pixel = larger(*pixel, drawn);
                    }
                }
            }
        }
    }
}

// These compile to one vector instruction; `f32::max` and `f32::min` also handle NaN.

#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}

#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if b < a { b } else { a }
}

/// Returns the pixels of a row or column with centres between two positions.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates, which clips to the image")]
fn pixels(from: f64, to: f64, count: usize) -> core::ops::Range<usize> {
    let start = (from.ceil() as usize).min(count);
    let end = ((to.floor() + 1.0) as usize).min(count);
    start..end.max(start)
}

#[cfg(test)]
mod tests;
