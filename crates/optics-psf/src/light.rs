use multiversion::multiversion;

use crate::{Factor, Microscope};

/// The transmitted light of an image: the product of the transmission factors of many objects.
#[derive(Debug, Clone, Default)]
pub struct TransmittedLight {
    width_px: usize,
    stray_light: f64,
    product: Vec<f32>,
}

impl TransmittedLight {
    /// Creates the light of an empty slide.
    #[must_use]
    pub fn new(microscope: &Microscope, width_px: usize, height_px: usize) -> Self {
        let mut light = Self::default();
        light.reset(microscope, width_px, height_px);
        light
    }

    /// Resets to the light of an empty slide, possibly of another microscope and size, and reuses the memory.
    pub fn reset(&mut self, microscope: &Microscope, width_px: usize, height_px: usize) {
        (self.width_px, self.stray_light) = (width_px, microscope.params().stray_light);
        self.product.clear();
        self.product.resize(width_px * height_px, 1.0);
    }

    /// Resets to the light of an empty slide.
    pub fn clear(&mut self) {
        self.product.fill(1.0);
    }

    /// Multiplies by the factor of a patch. `at_px` is the pixel position of the patch's upper left corner, without the
    /// margin. Parts outside of the image are ignored.
    pub fn multiply(&mut self, factor: &Factor, at_px: [i64; 2]) {
        let (light, width) = (&mut self.product, self.width_px);
        let (Some(height), Some(factor_height)) =
            (light.len().checked_div(width), factor.values.len().checked_div(factor.width))
        else {
            return;
        };
        let place = |at: i64, len: usize, side: usize| overlap(at - factor.margin_px as i64, len, side);
        let (from_x, to_x, columns) = place(at_px[0], factor.width, width);
        let (from_y, to_y, rows) = place(at_px[1], factor_height, height);
        for row in 0..rows {
            let values = &factor.values[(from_y + row) * factor.width + from_x..][..columns];
            let light = &mut light[(to_y + row) * width + to_x..][..columns];
            times(light, values);
        }
    }

    /// Writes the image: the intensity at each camera pixel relative to an empty slide, including stray light.
    ///
    /// # Panics
    ///
    /// If `out` does not have as many pixels as the image.
    pub fn image_into(&self, out: &mut [f32]) {
        out.copy_from_slice(&self.product);
        add_stray_light(out, self.stray_light);
    }

    /// As [`image_into`](Self::image_into), but exchanges the memory of the image and of `out` instead of copying.
    /// Afterwards, the light must be [`reset`](Self::reset).
    pub fn swap_image(&mut self, out: &mut Vec<f32>) {
        add_stray_light(&mut self.product, self.stray_light);
        core::mem::swap(&mut self.product, out);
    }
}

#[multiversion(targets = "simd")]
pub(crate) fn times(light: &mut [f32], values: &[f32]) {
    light.iter_mut().zip(values).for_each(|(light, value)| *light *= value);
}

/// Returns the part of `at..at + len` inside `0..side`: its start in the source, its start in the target, and its
/// length.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to `side`")]
fn overlap(at: i64, len: usize, side: usize) -> (usize, usize, usize) {
    let first = (-at).max(0);
    let end = (side as i64 - at).min(len as i64);
    if end <= first { (0, 0, 0) } else { (first as usize, (at + first) as usize, (end - first) as usize) }
}

/// Adds stray light, as a fraction of the light of an empty slide.
#[expect(clippy::cast_possible_truncation, reason = "pixels use single precision")]
pub(crate) fn add_stray_light(out: &mut [f32], stray_light: f64) {
    if stray_light > 0.0 {
        let (stray, rest) = (stray_light as f32, (1.0 - stray_light) as f32);
        for light in out {
            *light = stray + rest * *light;
        }
    }
}
