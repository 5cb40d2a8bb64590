//! Correlated noise of an extended-depth-of-field (EDF) image, which is fused from several planes.
//!
//! Real EDF images were reduced from a sensor with smaller pixels by linear interpolation: this correlates the noise
//! and lets its variance change periodically along rows and columns. Most of the noise is a fixed pattern of the
//! camera, which is equal in all planes and so remains everywhere, less so in the dark. The rest is averaged on the
//! empty slide, where a tenth of the variance is uncorrelated. In the dark it is less correlated. In structured
//! regions, where the sharpest plane changes every few pixels, it is stronger and uncorrelated, and short lines along
//! rows and columns appear, as fusion by wavelets produces them (Forster et al. 2004, doi:10.1002/jemt.20092).
//! Correlations, the period and lines were measured on real EDF images.

use multiversion::multiversion;

use crate::scene::Fusion;
use crate::truth::{Mask, Run};

mod reduction;
mod wavelet;

/// Gives the noise, the difference between grey levels and expected grey levels, the properties of EDF images.
///
/// The variance of the noise is unchanged, except just below the highest grey level, where the mean is lower too, and
/// on structure, apart from the pattern of columns. `input_top` is the grey level of the planes that
/// becomes the highest one of the image, `top`.
pub(crate) fn correlate(
    grey: &mut [u16],
    expected: &mut [f32],
    width: usize,
    channels: usize,
    fusion: &Fusion,
    [input_top, top]: [f32; 2],
) {
    let row = width * channels;
    if row == 0 {
        return;
    }
    let scale = top / input_top;
    let mut own: Vec<f32> = grey.iter().zip(&*expected).map(|(grey, mean)| scale * (f32::from(*grey) - mean)).collect();
    expected.iter_mut().for_each(|mean| *mean *= scale);
    let variance = own.iter().map(|n| f64::from(n * n)).sum::<f64>() / own.len() as f64;
    let models: Vec<NoiseModel> = (0..channels)
        .map(|channel| NoiseModel::new((channel..own.len()).step_by(channels).map(|i| [expected[i], own[i]])))
        .collect();
    let deviation = |i: usize| models[i % channels].deviation(expected[i]);
    own.iter_mut().enumerate().for_each(|(i, noise)| *noise /= deviation(i));
    // Rounding adds uncorrelated noise.
    let rounding_gain = 1.0 + ROUNDING / variance.max(ROUNDING);
    let wanted = fusion.noise_correlation.map(|wanted| wanted * rounding_gain);
    let common = common_weight(wanted);
    let wanted = wanted.map(|wanted| (wanted / (common * common)).min(MAX_CORRELATION));
    let common = common as f32;
    select_largest(&mut own, width, channels);
    let shared = reduction::reduced(&own, width, channels, wanted, fusion.noise_skew, fusion.reduction);
    let lines = lines(&own, width, channels);
    let columns = reduction::column_pattern(width, fusion.reduction, fusion.column_pattern);
    let structure = structure(&*expected, width, channels);
    let half = (HALF_UNCORRELATED * variance) as f32;
    // Near the highest grey level, planes are clipped before fusion.
    let of_plane = ((PLANE_NOISE * PLANE_NOISE - 1.0) * variance).sqrt().max(1e-6) as f32;
    let clipped = clipped_table();
    let bright = BRIGHT * expected.iter().copied().fold(f32::MIN_POSITIVE, f32::max).min(top);
    let height = grey.len() / row;
    for (y, grey) in grey.chunks_exact_mut(row).enumerate() {
        let read_out = (y as f32 + 0.5) / height as f32;
        for (i, grey) in grey.iter_mut().enumerate() {
            let at = y * row + i;
            let structured = structure[at] / (structure[at] + half).max(f32::MIN_POSITIVE);
            let sharp = structure[at] / (structure[at] + variance as f32).max(f32::MIN_POSITIVE);
            let dark = (1.0 - expected[at] / bright).clamp(0.0, 1.0);
            let correlated = common - ((common - FIXED) * structured).max(DARK * dark);
            let uncorrelated = (1.0 - correlated * correlated + GAIN * sharp).sqrt();
            let noise = uncorrelated * own[at] + correlated * shared[at] + LINES * structured * lines[at];
            let level = expected[at] * (1.0 + read_out * columns[i / channels]) + deviation(at) * noise;
            let fused = level + of_plane * interpolated(&clipped, (top - level) / of_plane);
            *grey = (fused + 0.5).clamp(0.0, top) as u16;
        }
    }
    expected.iter_mut().for_each(|mean| *mean = mean.min(top));
}

/// Returns the pixels of an EDF image with the highest grey level in at least one channel. `row` is the number of grey
/// levels in a row.
pub(crate) fn saturated(grey: &[u16], row: usize, channels: usize, top: u16) -> Mask {
    let mut runs: Vec<Run> = Vec::new();
    for (y, line) in (0_u32..).zip(grey.chunks_exact(row.max(1))) {
        for (x, pixel) in (0_u32..).zip(line.chunks_exact(channels)) {
            if pixel.contains(&top) {
                match runs.last_mut() {
                    Some(last) if last.y == y && last.x1 == x => last.x1 += 1,
                    _ => runs.push(Run { y, x0: x, x1: x + 1 }),
                }
            }
        }
    }
    Mask::from_runs(runs)
}

/// Scales of the wavelets by which planes are fused.
const LEVELS: u32 = 2;

/// Changes noise of unit variance as fusion by wavelets does, which takes the largest coefficient of several planes:
/// coefficients keep their variance, but their magnitudes differ less than those of normal deviates.
fn select_largest(noise: &mut [f32], width: usize, channels: usize) {
    let row = width * channels;
    let [columns, rows] = [width, noise.len() / row].map(|side| side >> LEVELS << LEVELS);
    if columns == 0 || rows == 0 {
        return;
    }
    for channel in 0..channels {
        let indices = || (0..rows).flat_map(|y| (0..columns).map(move |x| y * row + x * channels + channel));
        let mut values: Vec<f32> = indices().map(|i| noise[i]).collect();
        wavelet::forward(&mut values, columns, LEVELS);
        for (y, line) in values.chunks_exact_mut(columns).enumerate() {
            let means = if y < rows >> LEVELS { columns >> LEVELS } else { 0 };
            equalise(&mut line[means..]);
        }
        wavelet::inverse(&mut values, columns, LEVELS);
        indices().zip(values).for_each(|(i, value)| noise[i] = value);
    }
}

/// Returns noise along short lines: smoothed along rows, and along columns, without what both have in common.
fn lines(noise: &[f32], width: usize, channels: usize) -> Vec<f32> {
    let row = width * channels;
    let height = noise.len() / row;
    let mut smooth = vec![0.0; noise.len()];
    for (smooth, line) in smooth.chunks_exact_mut(row).zip(noise.chunks_exact(row)) {
        for (i, value) in smooth.iter_mut().enumerate() {
            let (x, channel) = (i / channels, i % channels);
            *value = smoothed(|step| line[mirrored(x, step, width) * channels + channel]);
        }
    }
    let mut lines = vec![0.0; noise.len()];
    for (y, lines) in lines.chunks_exact_mut(row).enumerate() {
        let rows: [usize; 7] = core::array::from_fn(|k| mirrored(y, k as i64 - 3, height) * row);
        for (x, value) in lines.iter_mut().enumerate() {
            let [along_column, both] = [noise, &smooth].map(|of| smoothed(|step| of[rows[(step + 3) as usize] + x]));
            *value = smooth[y * row + x] + along_column - 2.0 * both;
        }
    }
    lines
}

/// The standard deviation of noise as a function of the expected grey level: its square is linear.
struct NoiseModel {
    level: f64,
    square: f64,
    slope: f64,
}

impl NoiseModel {
    /// Fits the model to pairs of expected grey level and noise by least squares.
    fn new(pixels: impl Iterator<Item = [f32; 2]>) -> Self {
        let [mut count, mut level, mut square, mut level_level, mut level_square] = [0.0_f64; 5];
        for [expected, noise] in pixels {
            let (x, y) = (f64::from(expected), f64::from(noise * noise));
            count += 1.0;
            level += x;
            square += y;
            level_level += x * x;
            level_square += x * y;
        }
        let [level, square] = [level, square].map(|sum| sum / count);
        let spread = level_level / count - level * level;
        let slope = if spread > 1.0 { (level_square / count - level * square) / spread } else { 0.0 };
        Self { level, square, slope }
    }

    fn deviation(&self, expected: f32) -> f32 {
        let least = (0.1 * self.square).max(1e-6);
        (self.square + self.slope * (f64::from(expected) - self.level)).max(least).sqrt() as f32
    }
}

/// Replaces unit normal deviates by numbers proportional to powers of their magnitudes, with the same sign and
/// variance. The power gives about the binary patterns of the noise of real EDF images.
#[multiversion(targets = "simd")]
fn equalise(values: &mut [f32]) {
    /// Mean of the root of the magnitude.
    const SQUARE: f32 = 0.822_18;
    let norm = SQUARE.sqrt().recip();
    for value in values {
        *value = (norm * value.abs().sqrt().sqrt()).copysign(*value);
    }
}

/// Weight of the correlated noise on the empty slide; the rest of its variance is uncorrelated. Fitted to the spectrum
/// of the empty slide of real EDF images: after a filter alone, the power at the highest frequencies is too low.
const COMMON: f64 = 0.95;

/// Returns the weight of the correlated noise on the empty slide: [`COMMON`], or more if its neighbours could otherwise
/// not have the wanted correlations.
fn common_weight(wanted: [f64; 2]) -> f64 {
    let least = wanted[0].max(wanted[1]) / MAX_CORRELATION;
    least.sqrt().clamp(COMMON, 1.0)
}

/// Weight of the correlated noise on structure, where only the fixed pattern of the camera is correlated: measured on
/// 24 real EDF images of one camera, whose fixed pattern is the mean of their empty areas.
const FIXED: f32 = 0.87;

/// Variance of structure, relative to that of noise, at which half of the change from the empty slide to structure is
/// reached: fitted to the noise on cytoplasm and nuclei of real EDF images.
const HALF_UNCORRELATED: f64 = 60.0;

/// Grey level, relative to the brightest place, below which noise is less correlated.
const BRIGHT: f32 = 0.6;

/// Increase of the variance of noise where a plane is sharper than others, relative to the empty slide, where several
/// planes are averaged: fitted to the evenest blocks in cells of 24 real EDF images, [`LINES`] to the spectra in cells.
const GAIN: f32 = 0.07;

/// Decrease of the weight of the correlated noise in the dark: fitted to the correlation of neighbours in nuclei of
/// real EDF images.
const DARK: f32 = 0.5;

/// Amplitude of the lines along rows and columns in structured regions, relative to the noise filtered to such lines.
const LINES: f32 = 2.6;

/// Noise of a plane relative to that of the EDF image: fitted to the decrease of noise just below the highest grey
/// level of real EDF images, and to the histograms of their empty slide.
const PLANE_NOISE: f64 = 2.2;

/// Returns the mean of an EDF image, in grey levels below the highest one, and the standard deviation of its noise,
/// where its planes are clipped before fusion. `below` is the mean without clipping, negative above that level,
/// and `sd` the standard deviation far below it.
///
/// The EDF image is the mean of the clipped planes for the noise that all planes share. Its variance is that of the
/// first two Hermite polynomials of that noise.
#[must_use]
pub fn clipped_noise(below: f64, sd: f64) -> [f64; 2] {
    let of_planes = (PLANE_NOISE * sd).max(1e-6);
    let max = below / of_planes;
    let [mean, slope] = clipped_normal(max);
    let curvature = density(max) / PLANE_NOISE;
    [below - of_planes * mean, sd * (slope * slope + 0.5 * curvature * curvature).sqrt()]
}

/// Number of steps of the table of clipped noise, and its range on both sides of the highest grey level in standard
/// deviations.
const STEPS: usize = 128;
const RANGE: f64 = 4.0;

/// Returns the means of min(n, m) for a standard normal deviate n, for equal steps of m from −[`RANGE`] to [`RANGE`].
fn clipped_table() -> [f32; STEPS + 1] {
    core::array::from_fn(|step| clipped_normal(RANGE * (2.0 * step as f64 / STEPS as f64 - 1.0))[0] as f32)
}

/// Interpolates linearly in a [`clipped_table`]. `max` is the clipping level in standard deviations.
fn interpolated(table: &[f32; STEPS + 1], max: f32) -> f32 {
    if max < -RANGE as f32 {
        return max;
    }
    let step = ((max / RANGE as f32 + 1.0) * (0.5 * STEPS as f32)).min(STEPS as f32);
    let index = (step as usize).min(STEPS - 1);
    table[index] + (step - index as f32) * (table[index + 1] - table[index])
}

/// Returns the mean of min(n, `max`) for a standard normal deviate n, and the part of n below `max`, which is the
/// derivative of min(n + t, `max`) with respect to t.
fn clipped_normal(max: f64) -> [f64; 2] {
    let below = 0.5 * libm::erfc(-max * core::f64::consts::FRAC_1_SQRT_2);
    [max * (1.0 - below) - density(max), below]
}

/// Returns the density of the standard normal distribution.
fn density(at: f64) -> f64 {
    libm::exp(-0.5 * at * at) / (2.0 * core::f64::consts::PI).sqrt()
}

/// Returns the structure around every pixel: half the mean square of noise-free differences four pixels apart.
fn structure(expected: &[f32], width: usize, channels: usize) -> Vec<f32> {
    /// Half of the distance of the differences, px.
    const STEP: i64 = 2;
    /// Half of the width of the averaging window, px.
    const WINDOW: i64 = 3;
    let row = width * channels;
    let height = expected.len() / row;
    let mut squares = vec![0.0; expected.len()];
    for y in 0..height {
        let [above, below] = [-STEP, STEP].map(|step| mirrored(y, step, height) * row);
        for i in 0..row {
            let (x, channel) = (i / channels, i % channels);
            let at_step = |step: i64| expected[y * row + mirrored(x, step, width) * channels + channel];
            let (dx, dy) = (at_step(STEP) - at_step(-STEP), expected[below + i] - expected[above + i]);
            squares[y * row + i] = 0.25 * (dx * dx + dy * dy);
        }
    }
    let weight = 1.0 / (2 * WINDOW + 1) as f32;
    let mut rows = vec![0.0; squares.len()];
    for (y, mean) in rows.chunks_exact_mut(row).enumerate() {
        for (i, mean) in mean.iter_mut().enumerate() {
            let (x, channel) = (i / channels, i % channels);
            let at = |step: i64| squares[y * row + mirrored(x, step, width) * channels + channel];
            *mean = weight * (-WINDOW..=WINDOW).map(at).sum::<f32>();
        }
    }
    for (y, mean) in squares.chunks_exact_mut(row).enumerate() {
        for (i, mean) in mean.iter_mut().enumerate() {
            let at = |step: i64| rows[mirrored(y, step, height) * row + i];
            *mean = weight * (-WINDOW..=WINDOW).map(at).sum::<f32>();
        }
    }
    squares
}

/// Variance of rounding noise.
const ROUNDING: f64 = 1.0 / 12.0;

/// Largest correlation of neighbours, as in recipes.
const MAX_CORRELATION: f64 = 0.5;

/// Returns the index `step` away from `at`, mirrored at the borders.
fn mirrored(at: usize, step: i64, count: usize) -> usize {
    let index = (at as i64 + step).unsigned_abs();
    let last = count as u64 - 1;
    usize::try_from(if index > last { (2 * last).saturating_sub(index) } else { index }).unwrap_or(0)
}

/// Returns the weighted mean of seven neighbours, with weights that decrease linearly.
fn smoothed(value: impl Fn(i64) -> f32) -> f32 {
    const WEIGHTS: [f32; 4] = [0.25, 0.1875, 0.125, 0.0625];
    let [own, first, second, third] = WEIGHTS;
    own * value(0) + first * (value(-1) + value(1)) + second * (value(-2) + value(2)) + third * (value(-3) + value(3))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Key;
    use crate::random;

    const WIDTH: usize = 320;

    /// Returns correlated noise and its variance, for camera noise of standard deviation `sd` in levels of planes.
    fn fused(expected: impl Fn(usize) -> f32, sd: f64, skew: f64, tops: [f32; 2]) -> (Vec<f64>, f64) {
        let mut rng = Key { seed: 3, index: 0 }.stream("test", 0, "noise");
        let mut expected: Vec<f32> = (0..WIDTH * 300).map(expected).collect();
        let noisy = |e: &f32| (f64::from(*e) + 0.5 + sd * random::normal(&mut rng)) as u16;
        let mut grey: Vec<u16> = expected.iter().map(noisy).collect();
        let fusion = Fusion {
            first_um: 0.0,
            step_um: 1.0,
            planes: 3,
            noise_correlation: [0.2, 0.4],
            noise_skew: skew,
            reduction: 1.0,
            column_pattern: 0.0,
        };
        correlate(&mut grey, &mut expected, WIDTH, 1, &fusion, tops);
        let noise: Vec<f64> = grey.iter().zip(&expected).map(|(g, e)| f64::from(*g) - f64::from(*e)).collect();
        let variance = product(&noise, 0);
        (noise, variance)
    }

    /// Returns the mean product of noise values `step` pixels apart.
    fn product(noise: &[f64], step: usize) -> f64 {
        let pairs = (0..noise.len() - step).filter(|i| step + 1 >= WIDTH || i % WIDTH + step < WIDTH);
        let products: Vec<f64> = pairs.map(|i| noise[i] * noise[i + step]).collect();
        products.iter().sum::<f64>() / products.len() as f64
    }

    #[test]
    fn noise_has_the_specified_correlation_and_the_same_variance() {
        let (noise, variance) = fused(|_| 3000.0, 30.0, 0.02, [4095.0; 2]);
        // Some 10⁵ pixels: a standard error of .003 for each.
        assert!((variance / 900.0 - 1.0).abs() < 0.03, "{variance}");
        for (step, wanted) in [(1, 0.2), (WIDTH, 0.4)] {
            let found = product(&noise, step) / variance;
            assert!((found - wanted).abs() < 0.012, "{step}: {found}");
        }
        let skew = 0.5 * (product(&noise, WIDTH + 1) - product(&noise, WIDTH - 1)) / variance;
        assert!((skew - 0.02).abs() < 0.005, "{skew}");
    }

    #[test]
    fn just_below_the_highest_level_the_mean_is_lower_and_the_noise_weaker() {
        // Grey levels of 8 bits below the highest one, from planes of 16 bits, of which 51 000 is level 255.
        for below in [-1.0_f64, 2.0, 6.0, 12.0, 40.0] {
            let level = (200.0 * (255.0 - below)) as f32;
            let (noise, square) = fused(|_| level, 200.0 * 2.6, 0.0, [51_000.0, 255.0]);
            let mean = noise.iter().sum::<f64>() / noise.len() as f64;
            let sd = (square - mean * mean - ROUNDING).sqrt();
            let [found, expected] = [[below.max(0.0) - mean, sd], clipped_noise(below, 2.6)];
            assert!((found[0] - expected[0]).abs() < 0.1, "{below}: {found:?} {expected:?}");
            assert!((found[1] / expected[1] - 1.0).abs() < 0.04, "{below}: {found:?} {expected:?}");
        }
    }

    #[test]
    fn coefficients_of_noise_differ_less_than_normal_deviates() {
        let mut rng = Key { seed: 4, index: 0 }.stream("test", 0, "noise");
        let white: Vec<f32> = (0..WIDTH * 240).map(|_| random::normal(&mut rng) as f32).collect();
        let mut noise = white.clone();
        select_largest(&mut noise, WIDTH, 1);
        let noise: Vec<f64> = noise.iter().map(|n| f64::from(*n)).collect();
        let variance = product(&noise, 0);
        assert!((variance - 1.0).abs() < 0.03, "{variance}");
        let kurtosis = noise.iter().map(|n| n * n * n * n).sum::<f64>() / noise.len() as f64 / (variance * variance);
        assert!((2.3..2.8).contains(&kurtosis), "{kurtosis}");
        for step in [1, 2, WIDTH, WIDTH + 1] {
            let found = product(&noise, step) / variance;
            assert!(found.abs() < 0.015, "{step}: {found}");
        }
        // Sides too short for the wavelets.
        let mut short = white[..6].to_vec();
        select_largest(&mut short, 3, 1);
        assert_eq!(short, white[..6]);
    }

    #[test]
    fn noise_on_structure_is_the_fixed_pattern_white_noise_and_lines() {
        // Bright enough for noise as on the empty slide.
        for [level, amplitude] in [[12_500.0, 2600.0], [13_000.0, 2000.0]] {
            let waves = |i: usize| level + amplitude * libm::sin((i % WIDTH) as f64 * 0.7) as f32;
            let (noise, variance) = fused(waves, 15.0, 0.0, [16_383.0; 2]);
            // Lines along a row and a column without their common mean.
            let one = |offset: i64| f64::from(u8::from(offset == 0));
            let mean = |offset: i64| if offset.abs() < 4 { (4 - offset.abs()) as f64 / 16.0 } else { 0.0 };
            let white = (1.0 - f64::from(FIXED * FIXED) + f64::from(GAIN)).sqrt();
            let weight = |x: i64, y: i64| {
                let lines = mean(x) * one(y) + one(x) * mean(y) - 2.0 * mean(x) * mean(y);
                white * one(x) * one(y) + f64::from(LINES) * lines
            };
            let window = || (-8..=8).flat_map(|y| (-8..=8).map(move |x| (x, y)));
            let of_filter =
                |across, down| window().map(|(x, y)| weight(x, y) * weight(x + across, y + down)).sum::<f64>();
            let wanted = |across, down, correlation: f64| {
                225.0 * (f64::from(FIXED * FIXED) * correlation + of_filter(across, down))
            };
            assert!((variance / wanted(0, 0, 1.0) - 1.0).abs() < 0.03, "{variance} {}", wanted(0, 0, 1.0));
            for (step, across, down, correlation) in [(1, 1, 0, 0.2), (WIDTH, 0, 1, 0.4)] {
                let found = product(&noise, step);
                let correlation = correlation / (COMMON * COMMON);
                let wanted = wanted(across, down, correlation);
                assert!((found - wanted).abs() < 0.03 * variance, "{step}: {found} {wanted}");
            }
        }
    }

    #[test]
    fn columns_differ_in_proportion_to_the_level_and_the_row() {
        let fusion = Fusion {
            first_um: 0.0,
            step_um: 1.0,
            planes: 3,
            noise_correlation: [0.2, 0.4],
            noise_skew: 0.02,
            reduction: 1.0,
            column_pattern: 0.02,
        };
        // Three channels without noise, of different levels.
        let levels = [30_000_u16, 20_000, 10_000];
        let (width, height) = (40, 50);
        let mut grey = levels.repeat(width * height);
        let mut expected: Vec<f32> = grey.iter().map(|level| f32::from(*level)).collect();
        correlate(&mut grey, &mut expected, width, 3, &fusion, [65_535.0; 2]);
        for (i, found) in grey.iter().enumerate() {
            let ([y, x], level) = ([i / (3 * width), i / 3 % width], f64::from(levels[i % 3]));
            let sign = if x % 2 == 0 { 1.0 } else { -1.0 };
            let wanted = level * (1.0 + sign * 0.02 * (y as f64 + 0.5) / height as f64);
            assert!((f64::from(*found) - wanted).abs() < 3.0, "{x} {y}: {found} {wanted}");
        }
    }

    #[test]
    fn saturated_pixels_have_the_highest_level_in_a_channel() {
        let grey = [255, 0, 9, 9, 255, 255, 9, 9, 255, 9, 255, 0];
        let runs = |channels, row| saturated(&grey, row, channels, 255).runs().to_vec();
        let run = |y, x0, x1| Run { y, x0, x1 };
        assert_eq!(runs(1, 6), [run(0, 0, 1), run(0, 4, 6), run(1, 2, 3), run(1, 4, 5)]);
        assert_eq!(runs(2, 6), [run(0, 0, 1), run(0, 2, 3), run(1, 1, 3)]);
    }

    #[test]
    fn noise_in_dark_areas_is_less_correlated() {
        const BRIGHT_ROWS: usize = 20;
        let level = |i: usize| if i < BRIGHT_ROWS * WIDTH { 12_000.0 } else { 1200.0 };
        let (noise, _) = fused(level, 30.0, 0.02, [16_383.0; 2]);
        // Far from the structure at the border of the bright rows.
        let noise = &noise[(BRIGHT_ROWS + 10) * WIDTH..];
        let variance = product(noise, 0);
        let dark = 1.0 - 0.1 / f64::from(BRIGHT);
        assert!((variance / 900.0 - 1.0).abs() < 0.03, "{variance}");
        let correlated = COMMON - f64::from(DARK) * dark;
        let part = correlated * correlated / (COMMON * COMMON);
        let [across, down] = [1, WIDTH].map(|step| product(noise, step) / variance);
        assert!((across - 0.2 * part).abs() < 0.015 && (down - 0.4 * part).abs() < 0.015, "{across} {down}, {part}");
    }

    #[test]
    fn noise_below_one_grey_level_is_correlated_too() {
        // Noise of 0.9 levels of 8 bits: rounding would undo a filter of integer levels.
        let (noise, variance) = fused(|_| 200.25 * 257.0, 0.9 * 257.0, 0.0, [65_535.0, 255.0]);
        assert!((variance - 0.81 - ROUNDING).abs() < 0.03, "{variance}");
        let down = product(&noise, WIDTH) / variance;
        assert!((down - 0.4).abs() < 0.03, "{down}");
    }

    #[test]
    fn clipped_noise_matches_clipped_samples() {
        let mut rng = Key { seed: 5, index: 0 }.stream("test", 0, "noise");
        let table = clipped_table();
        for max in [-6.0, -1.5, 0.0, 0.9, 2.0] {
            let drawn = (0..100_000).map(|_| random::normal(&mut rng).min(max));
            let mean = drawn.sum::<f64>() / 1e5;
            let found = f64::from(interpolated(&table, max as f32));
            assert!((found - mean).abs() < 0.015, "{max}: {mean} {found}");
        }
        assert!(interpolated(&table, 6.0).abs() < 1e-5);
    }
}
