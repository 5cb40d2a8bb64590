//! The noise of a picture that was fused of several planes: neighbouring pixels share some of it.
//!
//! Planes are fused by weights that change slowly from pixel to pixel, after filters and shifts by parts of a pixel, which
//! leave noise correlated. What neighbours share is measured on real pictures of extended focus.

use crate::scene::Fusion;

/// Filters what noise has added to the expected grey levels so that neighbours correlate as they should. Its variance
/// stays what it was.
pub(crate) fn correlate(
    grey: &mut [u16],
    expected: &[f32],
    width: usize,
    channels: usize,
    fusion: &Fusion,
    bits: u32,
) {
    let [across, down] = fusion.noise_correlation.map(side);
    let row = width * channels;
    if row == 0 || (across == 0.0 && down == 0.0) {
        return;
    }
    let mut noise: Vec<f32> = grey.iter().zip(expected).map(|(grey, mean)| f32::from(*grey) - mean).collect();
    let norm = |side: f32| 1.0 / (1.0 + 2.0 * side * side).sqrt();
    let mut line = vec![0.0; row];
    for noise in noise.chunks_exact_mut(row) {
        line.copy_from_slice(noise);
        for (i, value) in noise.iter_mut().enumerate() {
            // Beyond the border the noise is that of the border's pixel on the other side.
            let before = if i < channels { (i + channels).min(row - 1) } else { i - channels };
            let after = if i + channels < row { i + channels } else { i.saturating_sub(channels) };
            *value = norm(across) * (line[i] + across * (line[before] + line[after]));
        }
    }
    let height = noise.len() / row;
    let top = ((1_u32 << bits.min(16)) - 1) as f32;
    for y in 0..height {
        let before = if y == 0 { 1.min(height - 1) } else { y - 1 };
        let after = if y + 1 < height { y + 1 } else { y.saturating_sub(1) };
        for x in 0..row {
            let value = noise[y * row + x] + down * (noise[before * row + x] + noise[after * row + x]);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the grey levels")]
            let level = (expected[y * row + x] + norm(down) * value + 0.5).clamp(0.0, top) as u16;
            grey[y * row + x] = level;
        }
    }
}

/// The weight a of the neighbours in a filter (a, 1, a) that leaves neighbours a correlation ρ = 2a / (1 + 2a²).
fn side(correlation: f64) -> f32 {
    if correlation <= 0.0 {
        return 0.0;
    }
    let root = (1.0 - 2.0 * correlation * correlation).max(0.0).sqrt();
    ((1.0 - root) / (2.0 * correlation)) as f32
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
    }
}
