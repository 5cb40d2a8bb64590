//! Slowly changing images, drawn with coarse pixels.

use multiversion::multiversion;
use portable_numerics::rounding::round_to_count;

use crate::phantom::box_sums::averaged;
use crate::phantom::noise_fields::{FieldSampler, NoiseField, SIDE};
use crate::phantom::tile::{Point, Tile};

/// Smallest standard deviation of the smoothing of clouds that are interpolated from coarse pixels, px: three coarse
/// pixels. The root mean square error is then a hundredth of the standard deviation of the clouds.
pub(super) const SMOOTH_PX: f64 = 3.0 * COARSE as f64;

/// A slowly changing image on a tile, drawn with pixels [`COARSE`] times as large and interpolated linearly.
pub(super) struct CoarseTile {
    /// One pixel of margin surrounds the area of the tile.
    coarse: Tile,
    line: Vec<f32>,
}

/// Width of a coarse pixel, px.
const COARSE: usize = 4;

/// Position of the first coarse pixel, px.
const FIRST: f64 = -0.5 - 0.5 * COARSE as f64;

impl CoarseTile {
    fn blank(like: &Tile) -> Self {
        let (width, height) = (like.width.div_ceil(COARSE) + 2, like.height().div_ceil(COARSE) + 2);
        let coarse = Tile { origin: [0, 0], width, values: vec![0.0; width * height] };
        Self { coarse, line: vec![0.0; width] }
    }

    /// Rasterizes a polygon (1 inside, 0 outside) and blurs it with three box filters, which approximate a Gaussian of
    /// standard deviation `sigma_px`.
    pub(super) fn smoothed(like: &Tile, polygon: &[Point], sigma_px: f64) -> Self {
        let place = |p: &Point| [0, 1].map(|axis| (p[axis] - like.origin[axis] as f64 - FIRST) / COARSE as f64);
        let polygon: Vec<Point> = polygon.iter().map(place).collect();
        let mut drawn = Self::blank(like);
        drawn.coarse.cover(&polygon);
        let sigma = sigma_px / COARSE as f64;
        // The variance of a square of side s is (s² − 1)/12.
        let radius = 0.5 * ((4.0 * sigma * sigma + 1.0).sqrt() - 1.0);
        for more in [0.0, 1.0 / 3.0, -1.0 / 3.0] {
            drawn.coarse = averaged(&drawn.coarse, round_to_count((radius + more).max(0.0)));
        }
        drawn
    }

    /// Samples a noise field.
    pub(super) fn noise(like: &Tile, noise_field: &NoiseField, sampler: &FieldSampler) -> Self {
        let mut drawn = Self::blank(like);
        let (sampler, mut texels) = (sampler.coarser(COARSE as f64), [0.0; SIDE + 1]);
        for (y, row) in drawn.coarse.values.chunks_exact_mut(drawn.coarse.width).enumerate() {
            let first = [FIRST / COARSE as f64, FIRST / COARSE as f64 + y as f64];
            noise_field.row_into(row, &sampler, first, &mut texels);
        }
        drawn
    }

    /// Writes row `y` of the tile.
    pub(super) fn row_into(&mut self, row: &mut [f32], y: usize) {
        let width = self.coarse.width;
        let [upper, lower] = [0, 1].map(|k| &self.coarse.values[((y + COARSE / 2) / COARSE + k) * width..][..width]);
        mix(&mut self.line, upper, lower, PHASES[y % COARSE]);
        interpolate_by_four(row, &self.line);
    }
}

/// Weights of the second of two coarse pixels at the four positions of a fine one.
const PHASES: [f32; COARSE] = [0.625, 0.875, 0.125, 0.375];

#[multiversion(targets = "simd")]
fn mix(line: &mut [f32], upper: &[f32], lower: &[f32], weight: f32) {
    for ((out, upper), lower) in line.iter_mut().zip(upper).zip(lower) {
        *out = upper + weight * (lower - upper);
    }
}

/// Interpolates a row between coarse pixels; the first of them lies before the row.
#[multiversion(targets = "simd")]
fn interpolate_by_four(row: &mut [f32], coarse: &[f32]) {
    let blend = |a: f32, b: f32, k: usize| a + PHASES[k] * (b - a);
    let (whole, rest) = row.as_chunks_mut::<COARSE>();
    let between = |near: &[f32]| {
        let [a, b, c] = [near[0], near[1], near[2]];
        [blend(a, b, 0), blend(a, b, 1), blend(b, c, 2), blend(b, c, 3)]
    };
    for (fine, near) in whole.iter_mut().zip(coarse.windows(3)) {
        *fine = between(near);
    }
    if let Some(near) = coarse.get(whole.len()..whole.len() + 3) {
        rest.copy_from_slice(&between(near)[..rest.len()]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Key;
    use crate::phantom::noise_fields::NoiseFieldGenerator;
    use crate::random;

    #[test]
    fn a_smoothed_half_plane_is_the_normal_distribution_function() {
        for (origin, width, sigma) in [([-20, -20], 161, 12.0), ([-17, -23], 243, 20.0), ([5, 6], 242, 33.0)] {
            let like = Tile { origin, width, values: vec![0.0; width * 301] };
            let [left, top] = origin.map(|o| o as f64);
            let edge = left + 0.5 * width as f64;
            let half = [[left - 9.0, top - 9.0], [edge, top - 9.0], [edge, top + 400.0], [left - 9.0, top + 400.0]];
            let mut zone = CoarseTile::smoothed(&like, &half, sigma);
            let mut row = vec![0.0; width];
            zone.row_into(&mut row, 150);
            let middle = width / 4..3 * width / 4;
            for (x, found) in row.iter().enumerate().take(middle.end).skip(middle.start) {
                let distance = (edge - left - x as f64) / sigma;
                let wanted = 0.5 * libm::erfc(-distance * core::f64::consts::FRAC_1_SQRT_2);
                assert!((f64::from(*found) - wanted).abs() < 0.03, "{sigma} {x}: {found} {wanted}");
            }
            assert!(row[middle].windows(2).all(|pair| pair[1] <= pair[0] + 1e-5));
        }
    }

    #[test]
    fn coarse_clouds_are_close_to_the_clouds() {
        let generator = NoiseFieldGenerator::new();
        let noise_fields = generator.fields(Key { seed: 4, index: 0 });
        let mut rng = Key { seed: 4, index: 0 }.stream("test", 0, "clouds");
        let like = Tile { origin: [5, -9], width: 83, values: vec![0.0; 83 * 61] };
        for (sigma_px, stretch) in [(SMOOTH_PX, 1.0), (20.0, 1.0), (2.0 * SMOOTH_PX, 4.0), (50.0, 1.0)].repeat(4) {
            let sampler = FieldSampler::clouds(sigma_px, &mut rng).stretched(stretch, random::direction(&mut rng));
            let mut coarse = CoarseTile::noise(&like, noise_fields.clouds(), &sampler);
            let [mut row, mut exact] = [(); 2].map(|()| vec![0.0_f32; like.width]);
            let mut squares = 0.0;
            for y in 0..like.height() {
                coarse.row_into(&mut row, y);
                noise_fields.clouds().row_into(&mut exact, &sampler, [0.0, y as f64], &mut [0.0; SIDE + 1]);
                squares += row.iter().zip(&exact).map(|(a, b)| f64::from((a - b) * (a - b))).sum::<f64>();
            }
            let error = (squares / like.values.len() as f64).sqrt();
            assert!(error < 0.02, "{sigma_px}: {error}");
        }
    }
}
