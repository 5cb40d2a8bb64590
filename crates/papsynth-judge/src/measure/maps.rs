//! Maps of an image that several measurements use.

use crate::background::Background;
use crate::filter::{blur, gradient, halved, slope};
use crate::image::FieldImage;
use crate::statistics::of_sorted;

/// Maps of an image.
pub(crate) struct Maps {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) background: Background,
    /// Grey levels, 0 to 255.
    pub(crate) grey: Vec<f32>,
    pub(crate) absorbance: Vec<f32>,
    /// Absorbance after a Gaussian of 1 pixel.
    pub(crate) smooth: Vec<f32>,
    /// Absorbance after a Gaussian of 2 pixels.
    pub(crate) smoother: Vec<f32>,
    /// Magnitude of the gradient of `smooth`.
    pub(crate) slope: Vec<f32>,
    pub(crate) edges: Vec<Edge>,
    /// Band-pass images of absorbance with their widths; each has half the resolution of the previous one.
    pub(crate) bands: Vec<(Vec<f32>, usize)>,
}

/// Number of bands, at scales of 1, 2, 4, … pixels.
pub(crate) const BANDS: usize = 6;

impl Maps {
    pub(crate) fn new(image: &FieldImage) -> Self {
        let width = image.width;
        let background = Background::new(&image.grey, width, image.full_scale);
        let absorbance = background.absorbance(&image.grey, image.full_scale);
        let smooth = blur(&absorbance, width, 1.0);
        // Variances add: 1² + √3² = 2².
        let smoother = blur(&smooth, width, 3.0_f64.sqrt());
        let to_8_bits = 255.0 / image.full_scale;
        let (slope, wide_slope) = (slope(&smooth, width), slope(&smoother, width));
        Self {
            width,
            height: image.height(),
            background,
            grey: image.grey.iter().map(|g| g * to_8_bits).collect(),
            edges: edges(&smooth, width, &slope, &wide_slope),
            slope,
            bands: bands(&absorbance, width),
            absorbance,
            smooth,
            smoother,
        }
    }

    /// Returns the root mean square of a band over pixels.
    pub(crate) fn power(&self, pixels: impl Iterator<Item = usize>, band: usize) -> f64 {
        let (values, wide) = &self.bands[band];
        let (mut sum, mut count) = (0.0, 0_usize);
        for p in pixels {
            let v = f64::from(values[((p / self.width) >> band) * wide + ((p % self.width) >> band)]);
            sum += v * v;
            count += 1;
        }
        (sum / count.max(1) as f64).sqrt()
    }

    /// Returns the fractions of pixels that are darker and that are paler than all eight neighbours.
    pub(crate) fn extrema(&self, pixels: impl Iterator<Item = usize>) -> [f64; 2] {
        let (mut dark, mut pale, mut count) = (0.0, 0.0, 0.0);
        let width = self.width;
        for p in pixels {
            count += 1.0;
            let (x, y) = (p % width, p / width);
            if x == 0 || y == 0 || x + 1 == width || y + 1 == self.height {
                continue;
            }
            let around =
                [p - width - 1, p - width, p - width + 1, p - 1, p + 1, p + width - 1, p + width, p + width + 1];
            let own = self.smooth[p];
            dark += f64::from(u8::from(around.iter().all(|q| own > self.smooth[*q])));
            pale += f64::from(u8::from(around.iter().all(|q| own < self.smooth[*q])));
        }
        [dark, pale].map(|v| v / f64::max(count, 1.0))
    }
}

fn bands(absorbance: &[f32], width: usize) -> Vec<(Vec<f32>, usize)> {
    let mut bands = Vec::with_capacity(BANDS);
    let (mut image, mut width) = (absorbance.to_vec(), width);
    for _ in 0..BANDS {
        let smooth = blur(&image, width, 1.0);
        bands.push((image.iter().zip(&smooth).map(|(a, b)| a - b).collect(), width));
        (image, width) = halved(&image, width);
    }
    bands
}

/// Minimum gradient of edges, absorbance per pixel after a Gaussian of 1 pixel.
const STEEP: f32 = 0.02;

/// Minimum number of edge pixels for a width.
const LEAST: usize = 20;

/// Returns a quantile of sorted blurs; NaN for too few.
pub(crate) fn width_at(sigmas: &[f64], q: f64) -> f64 {
    if sigmas.len() < LEAST { f64::NAN } else { of_sorted(sigmas, q) }
}

/// An edge pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Edge {
    pub(crate) pixel: usize,
    /// Blur of the edge: standard deviation of a Gaussian, pixels.
    pub(crate) sigma: f64,
}

/// Returns the pixels where the gradient is large and has a maximum across the edge. `slope` and `wide_slope` are the
/// magnitudes of the gradient after Gaussians of 1 and 2 pixels.
pub(crate) fn edges(smooth: &[f32], width: usize, slope: &[f32], wide_slope: &[f32]) -> Vec<Edge> {
    let [across, down] = gradient(smooth, width);
    let mut edges = Vec::new();
    for y in 1..smooth.len() / width - 1 {
        for x in 1..width - 1 {
            let pixel = y * width + x;
            let steepness = slope[pixel];
            if steepness < STEEP {
                continue;
            }
            let (gx, gy) = (across[pixel], down[pixel]);
            // One of four directions: tan 22.5° = 0.414.
            let beside = if gy.abs() < 0.414 * gx.abs() {
                1
            } else if gx.abs() < 0.414 * gy.abs() {
                width
            } else if gx * gy > 0.0 {
                width + 1
            } else {
                width - 1
            };
            if steepness >= slope[pixel - beside] && steepness > slope[pixel + beside] {
                let sigma = sigma(f64::from(steepness), f64::from(wide_slope[pixel]));
                edges.extend(sigma.map(|sigma| Edge { pixel, sigma }));
            }
        }
    }
    edges
}

/// Variance of the blur by central differences.
const DIFFERENCE: f64 = 1.0 / 3.0;

/// Returns the blur s of an edge from its gradients after Gaussians of 1 and 2 pixels, which are proportional to
/// 1/√(s² + 1 + ⅓) and 1/√(s² + 4 + ⅓). None if no edge has this ratio: the object is a thin line or a ramp.
fn sigma(slope: f64, wide_slope: f64) -> Option<f64> {
    let ratio = slope / wide_slope.max(1e-9);
    let square = ratio * ratio;
    (square > 1.0 && square < 4.0).then(|| ((4.0 - square) / (square - 1.0) - DIFFERENCE).max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    impl Maps {
        /// Returns the maps of an image with this light at each column and row.
        pub(crate) fn drawn(width: usize, height: usize, light: impl Fn(f64, f64) -> f64) -> Self {
            let at = |i: usize| crate::number::single(light((i % width) as f64, (i / width) as f64));
            Self::new(&FieldImage { grey: (0..width * height).map(at).collect(), width, ..FieldImage::default() })
        }
    }

    #[test]
    fn the_blur_of_an_edge_is_measured_in_all_directions() {
        for (sigma, turn) in [(0.8, 0.0), (1.0, 0.3), (1.5, 0.8), (2.0, 1.2), (3.0, 2.5)] {
            let (sin, cos) = (libm::sin(turn), libm::cos(turn));
            let maps = Maps::drawn(120, 100, |x, y| {
                let d = (x - 60.0) * cos + (y - 50.0) * sin;
                240.0 * libm::pow(10.0, -0.2 * (1.0 + libm::erf(d / (sigma * std::f64::consts::SQRT_2))))
            });
            let mut sigmas: Vec<f64> = maps.edges.iter().map(|e| e.sigma).collect();
            assert!(sigmas.len() > 80, "{} places", sigmas.len());
            let found = crate::statistics::median(&mut sigmas);
            assert!((found - sigma).abs() < 0.06 * sigma + 0.03, "{found}, not {sigma}, turned by {turn}");
        }
    }
}
