//! Correlated noise of an extended-depth-of-field (EDF) image, which is fused from several planes.
//!
//! On the empty slide, fusion weights change slowly from pixel to pixel, after filters and subpixel shifts, which
//! correlates noise. In structured regions the sharpest plane changes every few pixels: the correlation is weaker, and
//! short lines along rows and columns appear, as fusion by wavelets produces them (Forster et al. 2004,
//! doi:10.1002/jemt.20092). Correlations and lines were measured on real EDF images.

use multiversion::multiversion;

use crate::scene::Fusion;

mod wavelet;

/// Filters the noise, the difference between grey levels and expected grey levels, so that neighbours are correlated.
///
/// The variance of the noise is unchanged, except just below the highest grey level, where the mean is lower too, and
/// on structure. Input has `bits[0]`, output `bits[1]`.
pub(crate) fn correlate(
    grey: &mut [u16],
    expected: &mut [f32],
    width: usize,
    channels: usize,
    fusion: &Fusion,
    bits: [u32; 2],
) {
    let row = width * channels;
    if row == 0 {
        return;
    }
    let [input_top, top] = bits.map(|bits| ((1_u32 << bits.min(16)) - 1) as f32);
    let scale = top / input_top;
    let mut own: Vec<f32> = grey.iter().zip(&*expected).map(|(grey, mean)| scale * (f32::from(*grey) - mean)).collect();
    expected.iter_mut().for_each(|mean| *mean *= scale);
    let expected = &*expected;
    let variance = own.iter().map(|n| f64::from(n * n)).sum::<f64>() / own.len() as f64;
    select_largest(&mut own, expected, width, channels);
    // Rounding adds uncorrelated noise.
    let rounding_gain = 1.0 + ROUNDING / variance.max(ROUNDING);
    let correlation = fusion.noise_correlation.map(|wanted| (wanted * rounding_gain).min(MAX_CORRELATION));
    let [across, down] = kernels(correlation);
    let structure = structure(expected, width, channels);
    let half = (HALF_UNCORRELATED * variance) as f32;
    let centre = across[0] * down[0];
    let mut noise = own.clone();
    for (noise, line) in noise.chunks_exact_mut(row).zip(own.chunks_exact(row)) {
        for (i, value) in noise.iter_mut().enumerate() {
            let (x, channel) = (i / channels, i % channels);
            *value = filtered(across, |step| line[mirrored(x, step, width) * channels + channel]);
        }
    }
    let height = noise.len() / row;
    let mut shared = vec![0.0; noise.len()];
    for (y, shared) in shared.chunks_exact_mut(row).enumerate() {
        let rows: [usize; 5] = core::array::from_fn(|k| mirrored(y, k as i64 - 2, height) * row);
        for (x, value) in shared.iter_mut().enumerate() {
            *value = filtered(down, |step| noise[rows[(step + 2) as usize] + x]);
        }
    }
    let mut lines = vec![0.0; noise.len()];
    for (smooth, line) in noise.chunks_exact_mut(row).zip(own.chunks_exact(row)) {
        for (i, value) in smooth.iter_mut().enumerate() {
            let (x, channel) = (i / channels, i % channels);
            *value = smoothed(|step| line[mirrored(x, step, width) * channels + channel]);
        }
    }
    for (y, lines) in lines.chunks_exact_mut(row).enumerate() {
        let rows: [usize; 7] = core::array::from_fn(|k| mirrored(y, k as i64 - 3, height) * row);
        for (x, value) in lines.iter_mut().enumerate() {
            let [along_column, both] = [&own, &noise].map(|of| smoothed(|step| of[rows[(step + 3) as usize] + x]));
            *value = noise[y * row + x] + along_column - 2.0 * both;
        }
    }
    // To first order, this changes only the correlation along the diagonals.
    let skew = (0.5 * fusion.noise_skew / filtered_share(f64::from(centre))) as f32;
    // Near the highest grey level, planes are clipped before fusion: the mean is lower and the noise weaker.
    let plane_noise = (PLANE_NOISE * variance.sqrt()).max(1e-6);
    let clipped = clipped_table(plane_noise);
    let per_level = (1.0 / plane_noise) as f32;
    for (y, grey) in grey.chunks_exact_mut(row).enumerate() {
        let [above, below] = [-1, 1].map(|step| mirrored(y, step, height) * row);
        for (i, grey) in grey.iter_mut().enumerate() {
            let (x, channel) = (i / channels, i % channels);
            let [left, right] = [-1, 1].map(|step| mirrored(x, step, width) * channels + channel);
            let diagonals = shared[below + right] + shared[above + left] - shared[below + left] - shared[above + right];
            let at = y * row + i;
            let structured = structure[at] / (structure[at] + half).max(f32::MIN_POSITIVE);
            let sharp = structure[at] / (structure[at] + variance as f32).max(f32::MIN_POSITIVE);
            let bright = ((expected[at] / top - DARK[0]) / (DARK[1] - DARK[0])).clamp(0.0, 1.0);
            let correlated = (1.0 - WHITE) * bright * (1.0 - structured);
            let uncorrelated = 1.0 - correlated;
            // The filtered noise includes the pixel's own noise, so the two variances do not simply add.
            let norm =
                (uncorrelated * uncorrelated + correlated * correlated + 2.0 * uncorrelated * correlated * centre)
                    .sqrt();
            let [lowered, remaining] = interpolated(&clipped, (top - expected[at]) * per_level);
            let value = remaining
                * (uncorrelated * own[at] + correlated * (shared[at] + skew * diagonals))
                * (1.0 + GAIN * sharp).sqrt()
                / norm
                + LINES * structured * lines[at];
            *grey = (expected[at] + lowered + value + 0.5).clamp(0.0, top) as u16;
        }
    }
}

/// Scales of the wavelets by which planes are fused.
const LEVELS: u32 = 2;

/// Changes white noise as fusion by wavelets does, which takes the largest coefficient of several planes: coefficients
/// keep their variance, but their magnitudes differ less than those of normal deviates. The noise stays white.
///
/// Each coefficient becomes proportional to the root of its magnitude, which gives about the binary patterns of the
/// noise of real EDF images.
fn select_largest(noise: &mut [f32], expected: &[f32], width: usize, channels: usize) {
    let row = width * channels;
    let [columns, rows] = [width, noise.len() / row].map(|side| side >> LEVELS << LEVELS);
    if columns == 0 || rows == 0 {
        return;
    }
    for channel in 0..channels {
        let indices = || (0..rows).flat_map(|y| (0..columns).map(move |x| y * row + x * channels + channel));
        let model = NoiseModel::new(indices().map(|i| [expected[i], noise[i]]));
        let mut unit: Vec<f32> = indices().map(|i| noise[i] / model.deviation(expected[i])).collect();
        wavelet::forward(&mut unit, columns, LEVELS);
        for (y, line) in unit.chunks_exact_mut(columns).enumerate() {
            let means = if y < rows >> LEVELS { columns >> LEVELS } else { 0 };
            equalise(&mut line[means..]);
        }
        wavelet::inverse(&mut unit, columns, LEVELS);
        indices().zip(unit).for_each(|(i, unit)| noise[i] = unit * model.deviation(expected[i]));
    }
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

/// Replaces unit normal deviates by numbers proportional to the roots of their magnitudes, with the same sign and
/// variance.
#[multiversion(targets = "simd")]
fn equalise(values: &mut [f32]) {
    // The mean magnitude is the root of 2/π.
    let norm = core::f32::consts::FRAC_PI_2.sqrt();
    for value in values {
        *value = (norm * value.abs()).sqrt().copysign(*value);
    }
}

/// Weight of uncorrelated noise on the empty slide, relative to the sum of both weights: fitted, with [`GAIN`] and
/// [`LINES`], to the spectra of 24 real EDF images on the empty slide and in cells. Where both spatial frequencies are
/// high, their noise is stronger than that of a product of two filters.
const WHITE: f32 = 0.2;

/// Variance of structure, relative to that of noise, at which the weight of correlated noise is halved: fitted to the
/// noise on cytoplasm and nuclei of real EDF images.
const HALF_UNCORRELATED: f64 = 80.0;

/// Grey levels, relative to the highest one, between which noise changes from uncorrelated to as correlated as that of
/// the empty slide; the first one is an extrapolation. Fitted to the flattest places at each grey level in nuclei and
/// cells of 24 real EDF images.
const DARK: [f32; 2] = [-0.1, 0.6];

/// Increase of the variance of noise where a plane is sharper than others, relative to the empty slide, where several
/// planes are averaged: fitted to the noise on the cytoplasm of real EDF images.
const GAIN: f32 = 0.1;

/// Amplitude of the lines along rows and columns in structured regions, relative to the noise filtered to such lines.
const LINES: f32 = 2.2;

/// Noise of a plane relative to that of the fused image: fitted to the decrease of noise just below the highest grey
/// level of real EDF images.
const PLANE_NOISE: f64 = 3.0;

/// Returns the mean of an EDF image, in grey levels below the highest one, and the standard deviation of its noise,
/// where its planes are clipped before fusion. `below` is the mean without clipping, at least 0, and `sd` the standard
/// deviation far below the highest level.
#[must_use]
pub fn clipped_noise(below: f64, sd: f64) -> [f64; 2] {
    let of_planes = (PLANE_NOISE * sd).max(1e-6);
    let [mean, remaining] = clipped_normal(below.max(0.0) / of_planes);
    [below - of_planes * mean, sd * remaining]
}

/// Number of steps of the table of clipped noise, and its range below the highest grey level in standard deviations.
const STEPS: usize = 64;
const RANGE: f64 = 4.0;

/// Returns the changes of the mean, and the remaining parts of the standard deviation, of noise with this standard
/// deviation that is clipped, for equal steps of the clipping level from 0 to [`RANGE`].
fn clipped_table(sd: f64) -> [[f32; 2]; STEPS + 1] {
    core::array::from_fn(|step| {
        let [mean, remaining] = clipped_normal(RANGE * step as f64 / STEPS as f64);
        [(sd * mean) as f32, remaining as f32]
    })
}

/// Interpolates linearly in a [`clipped_table`]. `max` is the clipping level in standard deviations.
fn interpolated(table: &[[f32; 2]; STEPS + 1], max: f32) -> [f32; 2] {
    let step = (max * (STEPS as f32 / RANGE as f32)).clamp(0.0, STEPS as f32);
    let index = (step as usize).min(STEPS - 1);
    let (before, after, t) = (table[index], table[index + 1], step - index as f32);
    [0, 1].map(|i| before[i] + t * (after[i] - before[i]))
}

/// Returns the mean and the standard deviation of min(n, `max`) for a standard normal deviate n.
fn clipped_normal(max: f64) -> [f64; 2] {
    let density = libm::exp(-0.5 * max * max) / (2.0 * core::f64::consts::PI).sqrt();
    let below = 0.5 * libm::erfc(-max * core::f64::consts::FRAC_1_SQRT_2);
    let (mean, square) = (max * (1.0 - below) - density, below - max * density + max * max * (1.0 - below));
    [mean, (square - mean * mean).max(0.0).sqrt()]
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

/// Correlation of noise two pixels apart, in x and y: measured on EDF images.
const SECOND_NEIGHBOUR: [f64; 2] = [-0.016, 0.021];

/// Returns the filters along rows and columns with which the noise of the empty slide, the sum of filtered and
/// uncorrelated noise, has these correlations of neighbours, and those of [`SECOND_NEIGHBOUR`].
fn kernels(neighbours: [f64; 2]) -> [[f32; 3]; 2] {
    /// Steps of the fixed-point iteration, far more than convergence needs.
    const ITERATIONS: usize = 40;
    /// Largest correlation for which [`kernel`] converges. With it, the correlations of the sum are 0.49 and more.
    const LIMIT: f64 = 0.57;
    let white = f64::from(WHITE);
    let rest = 1.0 - white;
    let wanted = [0, 1].map(|axis| {
        let second = if neighbours[axis] > 0.0 { SECOND_NEIGHBOUR[axis] } else { 0.0 };
        [neighbours[axis], second]
    });
    let (mut of_filters, mut filters) = (wanted, [[0.0; 3]; 2]);
    for _ in 0..ITERATIONS {
        filters = of_filters.map(kernel);
        let weights = filters.map(|filter| filter.map(f64::from));
        let variance = variance_of_sum(weights[0][0] * weights[1][0]);
        for (axis, of_filter) in of_filters.iter_mut().enumerate() {
            for (step, correlation) in of_filter.iter_mut().enumerate() {
                let shared = weights[axis][step + 1] * weights[1 - axis][0];
                let found = (rest * rest * *correlation + 2.0 * white * rest * shared) / variance;
                *correlation += wanted[axis][step] - found;
            }
            of_filter[0] = of_filter[0].clamp(0.0, LIMIT);
        }
    }
    filters
}

/// Returns the variance of the sum of filtered and uncorrelated noise on the empty slide, relative to that of each of
/// them. `centre` is the weight of a pixel's own noise in the filter.
fn variance_of_sum(centre: f64) -> f64 {
    let white = f64::from(WHITE);
    let rest = 1.0 - white;
    white * white + rest * rest + 2.0 * white * rest * centre
}

/// Returns the correlation along the diagonals of the sum of filtered and uncorrelated noise, relative to that which is
/// added to the filtered noise.
fn filtered_share(centre: f64) -> f64 {
    let white = f64::from(WHITE);
    let rest = 1.0 - white;
    rest * (rest + white * centre) / variance_of_sum(centre)
}

/// Returns the centre and right half of the symmetric filter (b, a, 1, a, b), normalised by the root of the sum of
/// squares, that gives these correlations: ρ₁ = 2a(1 + b)/n, ρ₂ = (2b + a²)/n with n = 1 + 2a² + 2b².
fn kernel([correlation, second]: [f64; 2]) -> [f32; 3] {
    /// Steps of the fixed-point iteration, far more than convergence to a fraction of a per mille needs.
    const STEPS: usize = 60;
    let (mut a, mut b) = (0.0_f64, 0.0_f64);
    for _ in 0..STEPS {
        let n = 1.0 + 2.0 * a * a + 2.0 * b * b;
        let next = (correlation * n / (2.0 * (1.0 + b)), 0.5 * (second * n - a * a));
        a += 0.5 * (next.0 - a);
        b += 0.5 * (next.1 - b);
    }
    let norm = 1.0 / (1.0 + 2.0 * a * a + 2.0 * b * b).sqrt();
    [norm as f32, (norm * a) as f32, (norm * b) as f32]
}

/// Returns the weighted mean of seven neighbours, with weights that decrease linearly.
fn smoothed(value: impl Fn(i64) -> f32) -> f32 {
    const WEIGHTS: [f32; 4] = [0.25, 0.1875, 0.125, 0.0625];
    let [own, first, second, third] = WEIGHTS;
    own * value(0) + first * (value(-1) + value(1)) + second * (value(-2) + value(2)) + third * (value(-3) + value(3))
}

fn filtered([centre, first, second]: [f32; 3], value: impl Fn(i64) -> f32) -> f32 {
    centre * value(0) + first * (value(-1) + value(1)) + second * (value(-2) + value(2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Key;
    use crate::random;

    const WIDTH: usize = 320;

    /// Returns correlated noise and its variance, for camera noise of standard deviation `sd` in levels of `bits[0]`.
    fn fused(expected: impl Fn(usize) -> f32, sd: f64, skew: f64, bits: [u32; 2]) -> (Vec<f64>, f64) {
        let mut rng = Key { seed: 3, index: 0 }.stream("test", 0, "noise");
        let mut expected: Vec<f32> = (0..WIDTH * 300).map(expected).collect();
        let noisy = |e: &f32| (f64::from(*e) + 0.5 + sd * random::normal(&mut rng)) as u16;
        let mut grey: Vec<u16> = expected.iter().map(noisy).collect();
        let fusion = Fusion { first_um: 0.0, step_um: 1.0, planes: 3, noise_correlation: [0.2, 0.4], noise_skew: skew };
        correlate(&mut grey, &mut expected, WIDTH, 1, &fusion, bits);
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
        let (noise, variance) = fused(|_| 3000.0, 30.0, 0.02, [12, 12]);
        // Some 10⁵ pixels: a standard error of .003 for each.
        assert!((variance / 900.0 - 1.0).abs() < 0.03, "{variance}");
        for (step, wanted) in [(1, 0.2), (WIDTH, 0.4), (2, SECOND_NEIGHBOUR[0])] {
            let found = product(&noise, step) / variance;
            assert!((found - wanted).abs() < 0.012, "{step}: {found}");
        }
        let skew = 0.5 * (product(&noise, WIDTH + 1) - product(&noise, WIDTH - 1)) / variance;
        assert!((skew - 0.02).abs() < 0.005, "{skew}");
    }

    #[test]
    fn just_below_the_highest_level_the_mean_is_lower_and_the_noise_weaker() {
        // Grey levels of 8 bits below the highest one, from planes of 16 bits. Nearer to it, planes are clipped twice.
        for below in [6.0, 12.0, 40.0] {
            let level = (257.0 * (255.0 - below)) as f32;
            let (noise, square) = fused(|_| level, 257.0 * 2.6, 0.0, [16, 8]);
            let mean = noise.iter().sum::<f64>() / noise.len() as f64;
            let sd = (square - mean * mean - ROUNDING).sqrt();
            let [found, expected] = [[below - mean, sd], clipped_noise(below, 2.6)];
            assert!((found[0] - expected[0]).abs() < 0.1, "{below}: {found:?} {expected:?}");
            assert!((found[1] / expected[1] - 1.0).abs() < 0.04, "{below}: {found:?} {expected:?}");
        }
    }

    #[test]
    fn filters_give_the_correlations_of_the_sum() {
        let correlations = [0.0, 0.2, 0.45, 0.5];
        for wanted in correlations.into_iter().flat_map(|x| correlations.map(|y| [x, y])) {
            let [across, down] = kernels(wanted).map(|[centre, first, second]| [second, first, centre, first, second]);
            // The filter of the sum.
            let weight = |x: usize, y: usize| {
                let own = if [x, y] == [2, 2] { WHITE } else { 0.0 };
                f64::from((1.0 - WHITE) * across[x] * down[y] + own)
            };
            let product = |dx: usize, dy: usize| -> f64 {
                let places = (0..5 - dy).flat_map(|y| (0..5 - dx).map(move |x| [x, y]));
                places.map(|[x, y]| weight(x, y) * weight(x + dx, y + dy)).sum()
            };
            let found =
                [product(1, 0), product(0, 1)].map(|product_of_neighbours| product_of_neighbours / product(0, 0));
            for (found, wanted) in found.into_iter().zip(wanted) {
                assert!((found - wanted).abs() < 0.01, "{found} {wanted}");
            }
        }
    }

    #[test]
    fn coefficients_of_noise_differ_less_than_normal_deviates() {
        let (width, height) = (WIDTH, 240);
        // Noise whose variance is proportional to the grey level.
        let level = |i: usize| if i % width < width / 2 { 400.0_f32 } else { 1600.0 };
        let expected: Vec<f32> = (0..width * height).map(level).collect();
        let mut rng = Key { seed: 4, index: 0 }.stream("test", 0, "noise");
        let white: Vec<f32> = expected.iter().map(|e| e.sqrt() * random::normal(&mut rng) as f32).collect();
        let mut noise = white.clone();
        select_largest(&mut noise, &expected, width, 1);
        for side in [0..width / 2, width / 2..width] {
            let part = || (0..width * height).filter(|i| side.contains(&(i % width)));
            let mean =
                |f: &dyn Fn(f64) -> f64| part().map(|i| f(f64::from(noise[i]))).sum::<f64>() / part().count() as f64;
            let variance = mean(&|n| n * n);
            let expected = f64::from(level(side.start));
            assert!((variance / expected - 1.0).abs() < 0.04, "{variance} {expected}");
            let kurtosis = mean(&|n| n * n * n * n) / (variance * variance);
            assert!((2.6..2.85).contains(&kurtosis), "{kurtosis}");
        }
        let noise: Vec<f64> = noise.iter().map(|n| f64::from(*n)).collect();
        for step in [1, 2, WIDTH, WIDTH + 1] {
            let found = product(&noise, step) / product(&noise, 0);
            assert!(found.abs() < 0.015, "{step}: {found}");
        }
        // Sides too short for the wavelets.
        let mut short = white[..6].to_vec();
        select_largest(&mut short, &expected[..6], 3, 1);
        assert_eq!(short, white[..6]);
    }

    #[test]
    fn noise_on_structure_is_uncorrelated_except_along_lines() {
        for [level, amplitude] in [[12_000.0, 3800.0], [3900.0, 3700.0]] {
            is_uncorrelated_except_along_lines(|i| level + amplitude * libm::sin((i % WIDTH) as f64 * 0.7) as f32);
        }
    }

    fn is_uncorrelated_except_along_lines(waves: impl Fn(usize) -> f32) {
        let (noise, variance) = fused(waves, 30.0, 0.02, [14, 14]);
        // The filter: one pixel, and lines along a row and a column without their common mean.
        let one = |offset: i64| f64::from(u8::from(offset == 0));
        let mean = |offset: i64| if offset.abs() < 4 { (4 - offset.abs()) as f64 / 16.0 } else { 0.0 };
        let weight = |x: i64, y: i64| {
            let lines = mean(x) * one(y) + one(x) * mean(y) - 2.0 * mean(x) * mean(y);
            f64::from(1.0 + GAIN).sqrt() * one(x) * one(y) + f64::from(LINES) * lines
        };
        let window = || (-8..=8).flat_map(|y| (-8..=8).map(move |x| (x, y)));
        let wanted =
            |across, down| 900.0 * window().map(|(x, y)| weight(x, y) * weight(x + across, y + down)).sum::<f64>();
        assert!((variance / wanted(0, 0) - 1.0).abs() < 0.03, "{variance} {}", wanted(0, 0));
        for (step, across, down) in [(1, 1, 0), (WIDTH, 0, 1), (WIDTH + 1, 1, 1)] {
            let found = product(&noise, step);
            assert!((found - wanted(across, down)).abs() < 0.03 * variance, "{step}: {found}");
        }
    }

    #[test]
    fn noise_in_dark_areas_is_less_correlated() {
        let (noise, variance) = fused(|_| 800.0, 30.0, 0.02, [14, 14]);
        assert!((variance / 900.0 - 1.0).abs() < 0.03, "{variance}");
        let [across, down] = [1, WIDTH].map(|step| product(&noise, step) / variance);
        assert!((0.03..0.1).contains(&across) && (0.06..0.2).contains(&down), "{across} {down}");
    }

    #[test]
    fn noise_below_one_grey_level_is_correlated_too() {
        // Noise of 0.9 levels of 8 bits: rounding would undo a filter of integer levels.
        let (noise, variance) = fused(|_| 200.25 * 257.0, 0.9 * 257.0, 0.0, [16, 8]);
        assert!((variance - 0.81 - ROUNDING).abs() < 0.03, "{variance}");
        let down = product(&noise, WIDTH) / variance;
        assert!((down - 0.4).abs() < 0.03, "{down}");
    }

    #[test]
    fn clipped_noise_matches_clipped_samples() {
        let mut rng = Key { seed: 5, index: 0 }.stream("test", 0, "noise");
        let table = clipped_table(1.0);
        for max in [0.0, 0.9, 2.0] {
            let drawn: Vec<f64> = (0..100_000).map(|_| random::normal(&mut rng).min(max)).collect();
            let mean = drawn.iter().sum::<f64>() / 1e5;
            let sd = (drawn.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / 1e5).sqrt();
            let found = interpolated(&table, max as f32).map(f64::from);
            assert!((found[0] - mean).abs() < 0.015 && (found[1] - sd).abs() < 0.01, "{max}: {mean} {sd} {found:?}");
        }
        let [mean, sd] = clipped_normal(6.0);
        assert!(mean.abs() < 1e-6 && (sd - 1.0).abs() < 1e-6);
    }
}
