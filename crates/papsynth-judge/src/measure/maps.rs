//! What is computed once for a picture.

use super::edges::{Edge, edges};
use crate::background::Background;
use crate::filter::{blur, gradient, halved, slope};
use crate::picture::Picture;

/// A picture and what several measurements need of it.
pub(crate) struct Maps {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) background: Background,
    /// Grey levels of 8 bits, 0 to 255.
    pub(crate) grey: Vec<f32>,
    pub(crate) absorbance: Vec<f32>,
    /// Absorbance after a Gaussian of 1 pixel.
    pub(crate) smooth: Vec<f32>,
    /// After one of 2 pixels.
    pub(crate) smoother: Vec<f32>,
    /// Length of the gradient of `smooth`.
    pub(crate) slope: Vec<f32>,
    pub(crate) edges: Vec<Edge>,
    /// Absorbance between one scale and the next, each scale in half as many pixels a side as the one before.
    pub(crate) bands: Vec<(Vec<f32>, usize)>,
}

/// Scales of the bands: 1, 2, 4, … pixels.
pub(crate) const BANDS: usize = 6;

impl Maps {
    pub(crate) fn new(picture: &Picture) -> Self {
        let width = picture.width;
        let background = Background::new(&picture.grey, width, picture.full_scale);
        let absorbance = background.absorbance(&picture.grey, picture.full_scale);
        let smooth = blur(&absorbance, width, 1.0);
        // Variances add: 1² + √3² = 2².
        let smoother = blur(&smooth, width, 3.0_f64.sqrt());
        let to_8_bits = 255.0 / picture.full_scale;
        let (slope, wide_slope) = (slope(&smooth, width), slope(&smoother, width));
        Self {
            width,
            height: picture.height(),
            background,
            grey: picture.grey.iter().map(|g| g * to_8_bits).collect(),
            edges: edges(&smooth, width, &slope, &wide_slope),
            slope,
            bands: bands(&absorbance, width),
            absorbance,
            smooth,
            smoother,
        }
    }

    /// The gradient of absorbance after a Gaussian of 1 pixel.
    pub(crate) fn gradient(&self) -> [Vec<f32>; 2] {
        gradient(&self.smooth, self.width)
    }

    /// Root mean square of a band over pixels.
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

    /// How many of the pixels are darker and how many paler than all eight around them, as parts of them.
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
