//! Segments of wrinkles: rectangles with a profile across them, painted into an image.

use core::ops::Range;

use multiversion::multiversion;
use portable_numerics::elementary::exp_f32;

use crate::phantom::tile::Point;

/// Height of the slope next to a wrinkle, relative to its crest.
pub(super) const SLOPE: f64 = 0.30;
/// Width of the slope, relative to the wrinkle.
pub(super) const SLOPE_WIDTH: f64 = 4.0;

/// A segment of a wrinkle: a rectangle with a profile across it.
pub(super) struct Segment {
    pub(super) from: Point,
    /// Unit vector along the wrinkle.
    pub(super) along: Point,
    /// Unit vector towards the slope.
    pub(super) off: Point,
    /// Range in these two directions, px.
    pub(super) range: [[f64; 2]; 2],
    /// Strengths at both ends; linear between them, constant beyond.
    pub(super) strengths: [f64; 2],
    /// 1/length, px⁻¹.
    pub(super) per_length: f64,
    /// 1/σ of the crest, px⁻¹.
    pub(super) per_width: f64,
    pub(super) crest: Crest,
}

/// The profile of a crest: (f₀ + f₁x²)·exp(e₀x² + e₁x⁴) at the distance x from its middle, relative to its width.
#[derive(Clone, Copy)]
pub(super) struct Crest {
    factors: [f32; 2],
    exponents: [f32; 2],
}

/// A normal distribution.
pub(super) const RIDGE: Crest = Crest { factors: [1.0, 0.0], exponents: [-0.5, 0.0] };

/// Sharp sides that are higher than the middle.
pub(super) const PLEAT: Crest = Crest { factors: [0.55, 0.9], exponents: [0.0, -0.3] };

impl Segment {
    /// Returns the rows of the image that it intersects.
    fn rows(&self, height: usize) -> Range<usize> {
        let corner = |along: usize, off: usize| {
            self.from[1] + self.range[0][along] * self.along[1] + self.range[1][off] * self.off[1]
        };
        let corners = [corner(0, 0), corner(0, 1), corner(1, 0), corner(1, 1)];
        let (low, high) = corners.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), y| (a.min(*y), b.max(*y)));
        integers(low, high, height)
    }

    /// Returns the first column and the end of the last one in several rows from `top` on.
    #[inline(always)]
    fn columns(&self, top: usize, width: usize) -> [[i32; 2]; LANES] {
        /// Smallest component along a row, so that bounds are finite.
        const LEAST: f64 = 1e-9;
        let mut bounds = [[0.0, width as f64 - 1.0]; LANES];
        for (direction, range) in [self.along, self.off].into_iter().zip(self.range) {
            // The position x d₀ + y d₁ − from · d is within the range.
            let across = if direction[0].abs() > LEAST { direction[0] } else { LEAST };
            let [a, b] = range.map(|end| end / across);
            let (low, high) = if a < b { (a, b) } else { (b, a) };
            for (r, [least, most]) in bounds.iter_mut().enumerate() {
                let centre = self.from[0] - ((top + r) as f64 - self.from[1]) * (direction[1] / across);
                *least = if centre + low > *least { centre + low } else { *least };
                *most = if centre + high < *most { centre + high } else { *most };
            }
        }
        bounds.map(|[least, most]| {
            let (least, most) = (least.min(width as f64), most.max(-1.0));
            let start = least as i32;
            [start + i32::from(f64::from(start) < least), (most + 1.0) as i32]
        })
    }
}

/// Pixels computed together: few rows of a segment are longer. Also the rows whose ends are computed together.
pub(in crate::phantom::cell) const LANES: usize = 16;

/// Raises pixels to the profile and extends the touched column range of each row.
#[multiversion(targets = "simd")]
pub(super) fn paint(segment: &Segment, canvas: &mut [f32], width: usize, touched: &mut [Range<usize>]) {
    /// Rate at which the slope falls, per standard deviation of the crest.
    const RATE: f32 = (-1.0 / SLOPE_WIDTH) as f32;
    let Segment { from, along, off, strengths, per_width, per_length, crest: Crest { factors, exponents }, .. } =
        *segment;
    let step = (off[0] * per_width) as f32;
    let gradient = (strengths[1] - strengths[0]) * per_length;
    let stronger = (gradient * along[0]) as f32;
    let [weak, strong] = [strengths[0].min(strengths[1]), strengths[0].max(strengths[1])].map(|end| end as f32);
    // The slope falls by these factors from a pixel to the next ones. Loops, since closures are compiled separately.
    let mut falls = [0.0; LANES];
    for (i, fall) in falls.iter_mut().enumerate() {
        *fall = exp_f32(RATE * step * i as f32);
    }
    let fall = exp_f32(RATE * step * LANES as f32);
    let rows = segment.rows(touched.len());
    for top in rows.clone().step_by(LANES) {
        let columns = segment.columns(top, width);
        // Position of the first pixel of each row, and the strength and the slope there.
        let (mut offs, mut firsts, mut slopes) = ([0.0_f32; LANES], [0.0_f32; LANES], [0.0_f32; LANES]);
        for (r, (first, strength)) in offs.iter_mut().zip(&mut firsts).enumerate() {
            let [x, y] = [f64::from(columns[r][0]) - from[0], (top + r) as f64 - from[1]];
            *first = ((x * off[0] + y * off[1]) * per_width) as f32;
            *strength = (strengths[0] + (x * along[0] + y * along[1]) * gradient) as f32;
        }
        for (slope, first) in slopes.iter_mut().zip(offs) {
            *slope = SLOPE as f32 * exp_f32(RATE * first);
        }
        for (r, y) in (top..rows.end.min(top + LANES)).enumerate() {
            let [start, end] = columns[r].map(|column| column as usize);
            if start >= end {
                continue;
            }
            touched[y] = touched[y].start.min(start)..touched[y].end.max(end);
            let (mut first, mut strength, mut slope) = (offs[r], firsts[r], slopes[r]);
            for start in (start..end).step_by(LANES) {
                let Some(canvas) = canvas[y * width + start..].first_chunk_mut::<LANES>() else { break };
                let left = (end - start) as f32;
                for i in 0..LANES {
                    let off = first + step * i as f32;
                    let square = off * off;
                    let fall = exp_f32(square * (exponents[0] + exponents[1] * square));
                    let above = slope * falls[i] - SLOPE as f32 * fall;
                    let crest = fall * (factors[0] + factors[1] * square);
                    let own = strength + stronger * i as f32;
                    let own = if own > weak { own } else { weak };
                    let own = if own < strong { own } else { strong };
                    let profile = own * (crest + if off > 0.0 { above } else { 0.0 });
                    let profile = if (i as f32) < left { profile } else { 0.0 };
                    canvas[i] = if profile > canvas[i] { profile } else { canvas[i] };
                }
                first += step * LANES as f32;
                strength += stronger * LANES as f32;
                slope *= fall;
            }
        }
    }
}

/// Returns the integers between two numbers, limited to `0..count`.
fn integers(low: f64, high: f64, count: usize) -> Range<usize> {
    let whole = |value: f64| value.clamp(0.0, count as f64) as usize;
    let start = whole(low);
    start + usize::from((start as f64) < low)..whole(high + 1.0)
}

/// Adds painted values where the cell covers, and clears them.
#[multiversion(targets = "simd")]
pub(super) fn add_and_clear(thickness: &mut [f32], cover: &[f32], painted: &mut [f32]) {
    for ((value, cover), added) in thickness.iter_mut().zip(cover).zip(painted) {
        *value += if *cover > 0.0 { *added } else { 0.0 };
        *added = 0.0;
    }
}
