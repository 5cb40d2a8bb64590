//! The noise of a picture that was fused of several planes: neighbouring pixels share some of it.
//!
//! Planes are fused by weights that change slowly from pixel to pixel, after filters and shifts by parts of a pixel, which
//! leave noise correlated. What neighbours share is measured on real pictures of extended focus.

use crate::scene::Fusion;

/// Filters what noise has added to the expected grey levels so that neighbours correlate as they should. Its variance
/// stays what it was.
pub(crate) fn correlate(grey: &mut [u16], expected: &[f32], width: usize, channels: usize, fusion: &Fusion, bits: u32) {
    let [across, down] = [0, 1].map(|axis| Kernel::of(fusion.noise_correlation[axis], SECOND[axis]));
    let row = width * channels;
    if row == 0 || fusion.noise_correlation == [0.0; 2] {
        return;
    }
    let mut noise: Vec<f32> = grey.iter().zip(expected).map(|(grey, mean)| f32::from(*grey) - mean).collect();
    let mut line = vec![0.0; row];
    for noise in noise.chunks_exact_mut(row) {
        line.copy_from_slice(noise);
        for (i, value) in noise.iter_mut().enumerate() {
            let (x, channel) = (i / channels, i % channels);
            *value = across.at(|step| line[mirrored(x, step, width) * channels + channel]);
        }
    }
    let height = noise.len() / row;
    let top = ((1_u32 << bits.min(16)) - 1) as f32;
    for y in 0..height {
        let rows: [usize; 5] = core::array::from_fn(|k| mirrored(y, k as i64 - 2, height) * row);
        for x in 0..row {
            #[expect(clippy::cast_sign_loss, clippy::cast_possible_truncation, reason = "steps from -2 to 2")]
            let value = down.at(|step| noise[rows[(step + 2) as usize] + x]);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the grey levels")]
            let level = (expected[y * row + x] + value + 0.5).clamp(0.0, top) as u16;
            grey[y * row + x] = level;
        }
    }
}

/// A place some steps away; beyond the border the one that a mirror shows.
fn mirrored(at: usize, step: i64, count: usize) -> usize {
    let place = (at as i64 + step).unsigned_abs();
    let last = count as u64 - 1;
    usize::try_from(if place > last { (2 * last).saturating_sub(place) } else { place }).unwrap_or(0)
}

/// Correlation of noise two pixels apart, across and down: measured on pictures of extended focus.
const SECOND: [f64; 2] = [-0.025, 0.01];

/// A symmetric filter of five values (b, a, 1, a, b) over the root of the sum of their squares.
struct Kernel {
    centre: f32,
    first: f32,
    second: f32,
}

impl Kernel {
    /// The filter that leaves neighbours a correlation: ρ₁ = 2a(1 + b)/n, ρ₂ = (2b + a²)/n with n = 1 + 2a² + 2b².
    fn of(correlation: f64, second: f64) -> Self {
        /// Steps of the fixed-point iteration: a fraction of a per mille is left after far fewer.
        const STEPS: usize = 60;
        let second = if correlation > 0.0 { second } else { 0.0 };
        let (mut a, mut b) = (0.0_f64, 0.0_f64);
        for _ in 0..STEPS {
            let n = 1.0 + 2.0 * a * a + 2.0 * b * b;
            let next = (correlation * n / (2.0 * (1.0 + b)), 0.5 * (second * n - a * a));
            a += 0.5 * (next.0 - a);
            b += 0.5 * (next.1 - b);
        }
        let norm = 1.0 / (1.0 + 2.0 * a * a + 2.0 * b * b).sqrt();
        Self { centre: norm as f32, first: (norm * a) as f32, second: (norm * b) as f32 }
    }

    fn at(&self, value: impl Fn(i64) -> f32) -> f32 {
        self.centre * value(0) + self.first * (value(-1) + value(1)) + self.second * (value(-2) + value(2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Key;
    use crate::random;

    #[test]
    fn neighbours_share_as_much_noise_as_asked_and_its_variance_stays() {
        let (width, height) = (320, 300);
        let mut rng = Key { seed: 3, index: 0 }.stream("test", 0, "noise");
        let expected = vec![2000.0_f32; width * height];
        let mut grey: Vec<u16> =
            (0..width * height).map(|_| (2000.5 + 30.0 * random::normal(&mut rng)) as u16).collect();
        let fusion = Fusion { first_um: 0.0, step_um: 1.0, planes: 3, noise_correlation: [0.2, 0.4] };
        correlate(&mut grey, &expected, width, 1, &fusion, 12);
        let noise: Vec<f64> = grey.iter().map(|g| f64::from(*g) - 2000.0).collect();
        let product = |step: usize| {
            let pairs = (0..noise.len() - step).filter(|i| step >= width || i % width + step < width);
            let products: Vec<f64> = pairs.map(|i| noise[i] * noise[i + step]).collect();
            products.iter().sum::<f64>() / products.len() as f64
        };
        let variance = product(0);
        // Some 10⁵ pixels: a standard error of .003 for each.
        assert!((variance / 900.0 - 1.0).abs() < 0.03, "{variance}");
        assert!((product(1) / variance - 0.2).abs() < 0.012, "{}", product(1) / variance);
        assert!((product(width) / variance - 0.4).abs() < 0.012, "{}", product(width) / variance);
        assert!((product(2) / variance - SECOND[0]).abs() < 0.012, "{}", product(2) / variance);
    }
}
