//! Stray light that spreads over some distance.

use multiversion::multiversion;
use optics_psf::{Border, Gaussian, Scratch};
use portable_numerics::rounding::round_to_count;

use crate::error::ErrorKind;

/// Standard deviations of the parts of the kernel, relative to the distance of the recipe, and their weights.
///
/// Outside the cells of Cervix93 the light decreases towards them by these parts of the light that cells absorb, with
/// Gaussians of 5, 10 and 20 µm.
const PARTS: [(f64, f32); 3] = [(1.0, 0.5), (2.0, 0.25), (4.0, 0.25)];

/// The narrowest Gaussian on the coarse grid, pixels of it.
const COARSE_SD: f64 = 2.5;

/// Stray light in a neighbourhood: a kernel for an image of transmitted fractions.
#[derive(Debug)]
pub(super) struct Spread {
    /// Number of pixels of the side of a coarse pixel: even.
    side: usize,
    parts: Vec<(Gaussian, f32)>,
}

/// Absorbed fractions of a channel, spread by the kernel, on the coarse grid with a margin of one pixel.
#[derive(Debug, Default)]
pub(super) struct Absorbed {
    values: Vec<f32>,
    side: usize,
    width: usize,
    line: Vec<f32>,
    /// A row of the fine grid.
    row: Vec<f32>,
}

impl Spread {
    /// Returns the kernel for a distance in pixels.
    pub(super) fn new(distance_px: f64) -> Result<Self, ErrorKind> {
        let side = 2 * round_to_count(0.5 * distance_px / COARSE_SD).max(1);
        let part = |(relative, weight): (f64, f32)| {
            let gaussian = Gaussian::new(relative * distance_px / side as f64);
            gaussian
                .map(|gaussian| (gaussian, weight))
                .map_err(|error| ErrorKind::Optics("optics.stray_light_um", error))
        };
        Ok(Self { side, parts: PARTS.into_iter().map(part).collect::<Result<_, _>>()? })
    }

    /// Spreads the absorbed fractions of a channel of transmitted fractions.
    pub(super) fn of(&self, transmitted: &[f32], width: usize, absorbed: &mut Absorbed, scratch: &mut Scratch) {
        let (side, height) = (self.side, transmitted.len() / width);
        let (coarse_width, coarse_height) = (width.div_ceil(side), height.div_ceil(side));
        let mut means = vec![0.0; coarse_width * coarse_height];
        for (rows, means) in transmitted.chunks(side * width).zip(means.chunks_exact_mut(coarse_width)) {
            rows.chunks_exact(width).for_each(|row| add_absorbed(means, row, side));
            let count = (rows.len() / width * side) as f32;
            let last = (rows.len() / width * (width - (coarse_width - 1) * side)) as f32;
            means.iter_mut().for_each(|mean| *mean /= count);
            means[coarse_width - 1] *= count / last;
        }
        let mut spread = vec![0.0; means.len()];
        let mut sum = vec![0.0; means.len()];
        for (gaussian, weight) in &self.parts {
            gaussian.blur_into(&means, coarse_width, Border::Reflect, &mut spread, scratch);
            sum.iter_mut().zip(&spread).for_each(|(sum, value)| *sum += weight * value);
        }
        absorbed.side = side;
        absorbed.width = coarse_width + 2;
        absorbed.values.clear();
        let last = coarse_height - 1;
        for y in (0..1).chain(0..coarse_height).chain(last..last + 1) {
            let row = &sum[y * coarse_width..(y + 1) * coarse_width];
            absorbed.values.push(row[0]);
            absorbed.values.extend_from_slice(row);
            absorbed.values.push(row[coarse_width - 1]);
        }
    }
}

impl Absorbed {
    /// Returns row `y` of the image, of this width.
    pub(super) fn row(&mut self, y: usize, width: usize) -> &[f32] {
        let Self { values, side, width: coarse, line, row } = self;
        let from_centre = y + *side / 2;
        let upper = &values[from_centre / *side * *coarse..];
        let (upper, lower) = (&upper[..*coarse], &upper[*coarse..2 * *coarse]);
        line.resize(*coarse, 0.0);
        let weight = |at: usize| (at as f32 + 0.5) / *side as f32;
        mix(line, upper, lower, weight(from_centre % *side));
        row.resize(line.len() * *side, 0.0);
        interpolate(row, line, *side);
        &row[*side / 2..*side / 2 + width]
    }
}

/// Adds the absorbed fractions of a row to the sums of its coarse pixels.
#[multiversion(targets = "simd")]
fn add_absorbed(sums: &mut [f32], transmitted: &[f32], side: usize) {
    for (sum, part) in sums.iter_mut().zip(transmitted.chunks(side)) {
        *sum += part.iter().fold(0.0, |sum, value| sum + (1.0 - value));
    }
}

/// Interpolates between two rows.
#[multiversion(targets = "simd")]
fn mix(line: &mut [f32], upper: &[f32], lower: &[f32], weight: f32) {
    for ((out, upper), lower) in line.iter_mut().zip(upper).zip(lower) {
        *out = upper + weight * (lower - upper);
    }
}

/// Interpolates a row: the first value is that of the centre of the first coarse pixel.
#[multiversion(targets = "simd")]
fn interpolate(row: &mut [f32], coarse: &[f32], side: usize) {
    let step = 1.0 / side as f32;
    for (part, pair) in row.chunks_exact_mut(side).zip(coarse.windows(2)) {
        let slope = step * (pair[1] - pair[0]);
        let first = pair[0] + 0.5 * slope;
        part.iter_mut().enumerate().for_each(|(k, out)| *out = first + k as f32 * slope);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spread(transmitted: &[f32], width: usize, distance_px: f64) -> Vec<f32> {
        let mut absorbed = Absorbed::default();
        Spread::new(distance_px).unwrap().of(transmitted, width, &mut absorbed, &mut Scratch::new());
        (0..transmitted.len() / width).flat_map(|y| absorbed.row(y, width).to_vec()).collect()
    }

    #[test]
    fn an_even_field_spreads_to_itself() {
        // Neither side is a multiple of a coarse pixel.
        let (width, height) = (131, 77);
        assert!(spread(&vec![1.0; width * height], width, 15.0).iter().all(|value| *value == 0.0));
        let even = spread(&vec![0.7; width * height], width, 15.0);
        assert!(
            even.len() == width * height && even.iter().all(|value| (value - 0.3).abs() < 1e-5),
            "{:?}",
            &even[..9]
        );
    }

    #[test]
    fn the_coarse_grid_approximates_the_kernel() {
        let (width, height, radius) = (240, 200, 22.0);
        for distance_px in [1.5, 5.0, 16.0] {
            let inside = |p: usize| libm::hypot((p % width) as f64 - 101.0, (p / width) as f64 - 93.0) < radius;
            let transmitted: Vec<f32> = (0..width * height).map(|p| if inside(p) { 0.4 } else { 1.0 }).collect();
            let absorbed: Vec<f32> = transmitted.iter().map(|value| 1.0 - value).collect();
            let mut expected = vec![0.0; absorbed.len()];
            for (relative, weight) in PARTS {
                let blurred = Gaussian::new(relative * distance_px).unwrap().blur(&absorbed, width, Border::Reflect);
                expected.iter_mut().zip(blurred).for_each(|(sum, value)| *sum += weight * value);
            }
            let found = spread(&transmitted, width, distance_px);
            let largest = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            // Of the 0.6 that the disc absorbs; stray light has a tenth of that.
            assert!(largest < 0.03, "{distance_px}: {largest}");
        }
    }
}
