//! The variation of depth over a field: "a median filtered Perlin noise image, scaled to encompass the desired depth".

use perlin_bg::{Fractal, FractalParams};
use portable_numerics::rounding::round_to_count;

/// Depth of the places of a field.
#[derive(Debug, Clone)]
pub(crate) struct Relief {
    width: usize,
    height: usize,
    pitch_um: f64,
    depths: Vec<f64>,
}

impl Relief {
    /// Returns a relief with a range of `depth_um` over a field of `size_um`: Perlin noise with cells of `relief_um`,
    /// after a median filter of `median_um`.
    pub(crate) fn new(size_um: [f64; 2], depth_um: f64, relief_um: f64, median_um: f64, key: u64) -> Self {
        /// Samples per cell of the noise, for linear interpolation.
        const SAMPLES: f64 = 8.0;
        let pitch_um = relief_um / SAMPLES;
        let samples = |length: f64| round_to_count((length / pitch_um).ceil()) + 2;
        let (width, height) = (samples(size_um[0]), samples(size_um[1]));
        let params = FractalParams { octaves: 2, ..FractalParams::default() };
        let noise = Fractal::new(&params, key).expect("two octaves of noise are valid");
        let mut raw = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                raw.push(f64::from(noise.at(x as f64 / SAMPLES, y as f64 / SAMPLES)));
            }
        }
        let mut depths = median(&raw, width, round_to_count(median_um / pitch_um / 2.0));
        // Scaled to the range of depth, about the centre of the slide.
        let (low, high) = depths.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
        let scale = if high > low { depth_um / (high - low) } else { 0.0 };
        for depth in &mut depths {
            *depth = (*depth - 0.5 * (low + high)) * scale;
        }
        Self { width, height, pitch_um, depths }
    }

    /// Returns the depth at a place, µm. Outside the field it is that of the nearest place of the field.
    pub(crate) fn at(&self, place_um: [f64; 2]) -> f64 {
        let grid = |value: f64, count: usize| {
            let position = (value / self.pitch_um).clamp(0.0, (count - 1) as f64);
            let cell = round_to_count(position.floor()).min(count - 2);
            (cell, position - cell as f64)
        };
        let ((x, fx), (y, fy)) = (grid(place_um[0], self.width), grid(place_um[1], self.height));
        let at = |x: usize, y: usize| self.depths[y * self.width + x];
        let upper = at(x, y) * (1.0 - fx) + at(x + 1, y) * fx;
        let lower = at(x, y + 1) * (1.0 - fx) + at(x + 1, y + 1) * fx;
        upper * (1.0 - fy) + lower * fy
    }
}

/// Returns the median over squares of 2·radius + 1, cropped at the border.
fn median(values: &[f64], width: usize, radius: usize) -> Vec<f64> {
    let height = values.len() / width;
    let mut window = Vec::new();
    let mut out = Vec::with_capacity(values.len());
    for y in 0..height {
        for x in 0..width {
            window.clear();
            for row in y.saturating_sub(radius)..(y + radius + 1).min(height) {
                window.extend_from_slice(
                    &values[row * width + x.saturating_sub(radius)..row * width + (x + radius + 1).min(width)],
                );
            }
            let middle = window.len() / 2;
            out.push(*window.select_nth_unstable_by(middle, f64::total_cmp).1);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_relief_spans_its_depth_and_is_centred() {
        let relief = Relief::new([300.0, 200.0], 5.0, 60.0, 15.0, 42);
        let (low, high) = relief.depths.iter().fold((0.0_f64, 0.0_f64), |(a, b), v| (a.min(*v), b.max(*v)));
        assert!((low + 2.5).abs() < 1e-9 && (high - 2.5).abs() < 1e-9, "{low} {high}");
        for step in 0..100 {
            let depth = relief.at([f64::from(step) * 3.0, f64::from(step) * 2.0]);
            assert!(depth.abs() <= 2.5 + 1e-9);
            let near = relief.at([f64::from(step) * 3.0 + 0.1, f64::from(step) * 2.0]);
            assert!((depth - near).abs() < 0.2, "continuous");
        }
    }

    #[test]
    fn a_median_removes_a_single_spike() {
        let mut values = vec![1.0; 49];
        values[24] = 100.0;
        assert_eq!(median(&values, 7, 1), vec![1.0; 49]);
        assert_eq!(median(&values, 7, 0), values);
    }
}
