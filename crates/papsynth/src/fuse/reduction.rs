//! Noise of a sensor's pixels that is filtered and reduced to the pixels of an image by linear interpolation.

/// Correlation of noise two pixels apart, in x and y: measured on EDF images.
const SECOND_NEIGHBOUR: [f64; 2] = [-0.01, 0.02];

/// A filter along one axis: the weights of a pixel, of its two neighbours and of their neighbours.
type Filter = [f64; 3];

/// Pixels of the sensor around those that are read, so that filters have all their neighbours.
const MARGIN: usize = 2;

/// A position on the sensor: a pixel, and the weight of the next one.
struct Position {
    first: usize,
    weight: f64,
}

/// Returns the positions of `count` pixels of an image, which are `reduction` pixels of the sensor apart.
fn positions(count: usize, reduction: f64) -> Vec<Position> {
    let at = |i: usize| {
        let position = i as f64 * reduction;
        Position { first: position as usize, weight: position - libm::floor(position) }
    };
    (0..count).map(at).collect()
}

/// White noise of the pixels of a sensor, made of the noise of an image.
struct Sensor {
    /// Grey levels in a row.
    row: usize,
    channels: usize,
    values: Vec<f32>,
}

impl Sensor {
    /// Returns the noise of a sensor of this size. Beyond the size of the image, the noise of the image is repeated.
    ///
    /// Rows are shifted by half of the image, and repetitions are mirrored along the other axis: no pixel depends on
    /// the noise of the same pixel of the image, and the noise at no fixed distance is the same.
    fn new(unit: &[f32], row: usize, channels: usize, [columns, rows]: [usize; 2]) -> Self {
        let (width, height) = (row / channels, unit.len() / row);
        let mut values = Vec::with_capacity(columns * rows * channels);
        for y in 0..rows {
            for x in 0..columns {
                let mirrored = |at: usize, side: usize, mirror: bool| if mirror { side - 1 - at } else { at };
                let column = mirrored(x % width, width, (y / height) % 2 == 0);
                let line = (mirrored(y % height, height, (x / width) % 2 == 1) + height / 2) % height;
                let first = line * row + column * channels;
                values.extend_from_slice(&unit[first..first + channels]);
            }
        }
        Self { row: columns * channels, channels, values }
    }

    /// Filters rows and columns. The result is smaller by the [`MARGIN`] on each side.
    fn filtered(&self, [across, down]: [Filter; 2]) -> Self {
        let [across, down] = [across, down].map(|filter| filter.map(|weight| weight as f32));
        let row = self.row - 2 * MARGIN * self.channels;
        let mut lines = Vec::with_capacity(self.values.len());
        for line in self.values.chunks_exact(self.row) {
            let at = |i: usize, step: usize| line[i + step * self.channels];
            lines.extend(
                (0..row).map(|i| {
                    across[0] * at(i, 2) + across[1] * (at(i, 1) + at(i, 3)) + across[2] * (at(i, 0) + at(i, 4))
                }),
            );
        }
        let count = (lines.len() - 2 * MARGIN * row) / row;
        let mut values = Vec::with_capacity(count * row);
        for y in 0..count {
            let at = |i: usize, step: usize| lines[(y + step) * row + i];
            values.extend(
                (0..row)
                    .map(|i| down[0] * at(i, 2) + down[1] * (at(i, 1) + at(i, 3)) + down[2] * (at(i, 0) + at(i, 4))),
            );
        }
        Self { row, channels: self.channels, values }
    }

    /// Adds this part of the noise of the four diagonal neighbours, with different signs for the two diagonals.
    ///
    /// To first order, this changes only the correlation along the diagonals.
    fn add_diagonals(&mut self, part: f32) {
        let (row, channels) = (self.row, self.channels);
        let source = self.values.clone();
        let rows = source.len() / row;
        for y in 1..rows.saturating_sub(1) {
            for i in channels..row.saturating_sub(channels) {
                let at = |line: usize, i: usize| source[line * row + i];
                let (left, right) = (i - channels, i + channels);
                let diagonals = at(y + 1, right) + at(y - 1, left) - at(y + 1, left) - at(y - 1, right);
                self.values[y * row + i] += part * diagonals;
            }
        }
    }
}

/// Returns noise that is correlated between neighbours, of unit variance on average.
///
/// `unit` is white noise of unit variance, `channels` interleaved. `correlation` holds the correlations of neighbours
/// of a row and of a column, `skew` half the difference of the correlations along the diagonals. The noise is filtered
/// on a sensor whose pixels are `reduction` times smaller than those of the image, and interpolated linearly.
pub(super) fn reduced(
    unit: &[f32],
    width: usize,
    channels: usize,
    correlation: [f64; 2],
    skew: f64,
    reduction: f64,
) -> Vec<f32> {
    let row = width * channels;
    let sides = [width, unit.len() / row];
    let positions = sides.map(|side| positions(side, reduction));
    let filters: [Filter; 2] = core::array::from_fn(|axis| {
        let second = if correlation[axis] > 0.0 { SECOND_NEIGHBOUR[axis] } else { 0.0 };
        filter_for([correlation[axis], second], &positions[axis])
    });
    let [across, down] = [0, 1].map(|axis| mean_product(&autocorrelation(&filters[axis]), &positions[axis], 0));
    let norm = (1.0 / (across * down).sqrt()) as f32;
    // The pixel after the last position, and the margins.
    let size = [0, 1].map(|axis| positions[axis].last().map_or(0, |last| last.first) + 2 + 2 * MARGIN);
    let mut sensor = Sensor::new(unit, row, channels, size).filtered(filters);
    // Interpolation reduces the correlation along the diagonals.
    sensor.add_diagonals((0.5 * skew * reduction) as f32);
    let mut out = Vec::with_capacity(unit.len());
    for Position { first, weight } in &positions[1] {
        let lines = [*first, first + 1].map(|y| &sensor.values[y * sensor.row..][..sensor.row]);
        let below = *weight as f32;
        let at = |i: usize| lines[0][i] + below * (lines[1][i] - lines[0][i]);
        for Position { first, weight } in &positions[0] {
            let right = *weight as f32;
            out.extend((first * channels..(first + 1) * channels).map(|i| {
                let (left, next) = (at(i), at(i + channels));
                norm * (left + right * (next - left))
            }));
        }
    }
    out
}

/// Returns the pattern of even and odd columns of the sensor in each column of the image, as a fraction of the level.
pub(super) fn column_pattern(width: usize, reduction: f64, amplitude: f64) -> Vec<f32> {
    let at = |i: usize| {
        let position = i as f64 * reduction;
        let phase = position - 2.0 * libm::floor(0.5 * position);
        // 1 at even columns and −1 at odd ones, linear between them.
        amplitude * ((2.0 * phase - 2.0).abs() - 1.0)
    };
    (0..width).map(|i| at(i) as f32).collect()
}

/// Returns the filter after which interpolated noise has these correlations one and two pixels apart. Very small images
/// are not filtered.
fn filter_for(wanted: [f64; 2], positions: &[Position]) -> Filter {
    /// Steps of the fixed-point iteration, far more than convergence needs.
    const ITERATIONS: usize = 40;
    /// Largest correlation of the sensor's pixels for which [`filter`] converges.
    const LIMIT: f64 = 0.57;
    let (mut of_sensor, mut found_filter) = (wanted, [1.0, 0.0, 0.0]);
    if positions.len() < 5 {
        return found_filter;
    }
    for _ in 0..ITERATIONS {
        found_filter = filter(of_sensor);
        let products = autocorrelation(&found_filter);
        let [variance, first, second] = [0, 1, 2].map(|step| mean_product(&products, positions, step));
        of_sensor[0] = (of_sensor[0] + wanted[0] - first / variance).clamp(-0.3, LIMIT);
        of_sensor[1] = (of_sensor[1] + wanted[1] - second / variance).clamp(-0.2, 0.2);
    }
    found_filter
}

/// Returns the symmetric filter (b, a, 1, a, b), normalised by the root of the sum of squares, that gives these
/// correlations: ρ₁ = 2a(1 + b)/n, ρ₂ = (2b + a²)/n with n = 1 + 2a² + 2b².
fn filter([correlation, second]: [f64; 2]) -> Filter {
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
    [norm, norm * a, norm * b]
}

/// Returns the covariances of white noise after a filter, 0 to 4 pixels apart.
fn autocorrelation(filter: &Filter) -> [f64; 5] {
    let weights: [f64; 5] = core::array::from_fn(|i| filter[i.abs_diff(2)]);
    core::array::from_fn(|step| (0..5 - step).map(|i| weights[i] * weights[i + step]).sum())
}

/// Returns the mean product of interpolated noise `step` pixels apart, from the covariances of the sensor's pixels, or
/// 0 if the image is too small.
fn mean_product(covariances: &[f64; 5], positions: &[Position], step: usize) -> f64 {
    let pairs = || positions.iter().zip(&positions[step.min(positions.len())..]);
    let product = |(one, other): (&Position, &Position)| -> f64 {
        let weights = |of: &Position| [1.0 - of.weight, of.weight];
        let mut sum = 0.0;
        for (i, first) in weights(one).into_iter().enumerate() {
            for (j, second) in weights(other).into_iter().enumerate() {
                let distance = (other.first + j).abs_diff(one.first + i);
                sum += first * second * covariances.get(distance).copied().unwrap_or(0.0);
            }
        }
        sum
    };
    pairs().map(product).sum::<f64>() / (pairs().count() as f64).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Key;
    use crate::random;

    const WIDTH: usize = 480;
    const HEIGHT: usize = 360;

    /// Returns unit white noise.
    fn white() -> Vec<f32> {
        let mut rng = Key { seed: 3, index: 0 }.stream("test", 0, "noise");
        (0..WIDTH * HEIGHT).map(|_| random::normal(&mut rng) as f32).collect()
    }

    /// Returns the mean of a function of a pixel and of the one `dx` and `dy` pixels away.
    fn mean(noise: &[f32], dx: usize, dy: usize, of: impl Fn(f64, f64) -> f64) -> f64 {
        let places =
            (0..HEIGHT - dy).flat_map(|y| (0..WIDTH - dx).map(move |x| [y * WIDTH + x, (y + dy) * WIDTH + x + dx]));
        let sum: f64 = places.map(|[a, b]| of(f64::from(noise[a]), f64::from(noise[b]))).sum();
        sum / ((HEIGHT - dy) * (WIDTH - dx)) as f64
    }

    #[test]
    fn filters_give_the_wanted_correlations_after_interpolation() {
        for reduction in [1.0, 1.1, 1.252, 1.3] {
            let positions = positions(640, reduction);
            // The largest correlation that recipes accept is nearly reached.
            for (wanted, error) in
                [([0.2, -0.01], 0.01), ([0.4, 0.02], 0.01), ([0.45, 0.02], 0.01), ([0.5, 0.02], 0.035)]
            {
                let products = autocorrelation(&filter_for(wanted, &positions));
                let [variance, first, second] = [0, 1, 2].map(|step| mean_product(&products, &positions, step));
                assert!((first / variance - wanted[0]).abs() < error, "{reduction} {wanted:?}: {}", first / variance);
                assert!((second / variance - wanted[1]).abs() < 0.02, "{reduction} {wanted:?}: {}", second / variance);
            }
        }
    }

    #[test]
    fn reduced_noise_has_unit_variance_and_the_wanted_correlations() {
        for reduction in [1.0, 1.252] {
            let noise = reduced(&white(), WIDTH, 1, [0.2, 0.4], 0.02, reduction);
            let product = |dx, dy| mean(&noise, dx, dy, |a, b| a * b);
            // Some 10⁵ pixels: a standard error of .003 to .005 for each.
            assert!((product(0, 0) - 1.0).abs() < 0.02, "{}", product(0, 0));
            for (dx, dy, wanted) in [(1, 0, 0.2), (0, 1, 0.4), (2, 0, SECOND_NEIGHBOUR[0]), (0, 2, SECOND_NEIGHBOUR[1])]
            {
                assert!((product(dx, dy) - wanted).abs() < 0.015, "{reduction} {dx} {dy}: {}", product(dx, dy));
            }
            let mut mirrored = noise.clone();
            mirrored.chunks_exact_mut(WIDTH).for_each(<[f32]>::reverse);
            let skew = 0.5 * (product(1, 1) - mean(&mirrored, 1, 1, |a, b| a * b));
            assert!((skew - 0.02).abs() < 0.008, "{reduction}: {skew}");
        }
    }

    #[test]
    fn noise_does_not_repeat_within_an_image_and_does_not_depend_on_the_same_pixel() {
        let unit = white();
        for reduction in [1.0, 1.252] {
            let noise = reduced(&unit, WIDTH, 1, [0.2, 0.4], 0.0, reduction);
            for side in [WIDTH, HEIGHT] {
                for lag in [side / 2, libm::round(side as f64 / reduction) as usize] {
                    for lag in lag - 1..=(lag + 1).min(side - 20) {
                        let product = |dx, dy| mean(&noise, dx, dy, |a, b| a * b);
                        let found = if side == WIDTH { product(lag, 0) } else { product(0, lag) };
                        // The part beyond the lag is small: a standard error of .02 at most.
                        assert!(found.abs() < 0.08, "{reduction} {side} {lag}: {found}");
                    }
                }
            }
            let same: f64 = unit.iter().zip(&noise).map(|(a, b)| f64::from(a * b)).sum::<f64>() / unit.len() as f64;
            assert!(same.abs() < 0.015, "{reduction}: {same}");
        }
    }

    #[test]
    fn images_of_any_size_have_noise() {
        for [width, height, channels] in [[1, 1, 1], [1, 9, 1], [9, 1, 3], [2, 2, 1], [4, 4, 3], [5, 3, 1]] {
            let unit: Vec<f32> = white()[..width * height * channels].to_vec();
            for reduction in [1.0, 1.3] {
                let noise = reduced(&unit, width, channels, [0.25, 0.4], 0.02, reduction);
                assert_eq!(noise.len(), unit.len());
                assert!(noise.iter().all(|v| v.abs() < 6.0), "{width} {height} {channels}: {noise:?}");
            }
        }
    }

    #[test]
    fn channels_are_independent_and_equal_to_those_of_single_images() {
        let unit = white();
        let one = reduced(&unit, WIDTH, 1, [0.2, 0.4], 0.02, 1.252);
        let three: Vec<f32> = unit.iter().flat_map(|v| [*v, 2.0 * v, -v]).collect();
        for (pixel, expected) in reduced(&three, WIDTH, 3, [0.2, 0.4], 0.02, 1.252).chunks_exact(3).zip(one) {
            for (value, factor) in pixel.iter().zip([1.0, 2.0, -1.0]) {
                assert!((value - factor * expected).abs() < 1e-5, "{pixel:?} {expected}");
            }
        }
    }

    #[test]
    fn interpolation_lets_the_variance_change_with_the_period_of_the_reduction() {
        // Without correlation between the sensor's pixels, the variance of a column is (1 − w)² + w².
        let reduction = 1.25;
        let noise = reduced(&white(), WIDTH, 1, [0.05, 0.4], 0.0, reduction);
        let of_phase = [0, 1, 2, 3].map(|phase| {
            let columns = || (phase..WIDTH).step_by(4);
            let noise = &noise;
            let values = (0..HEIGHT).flat_map(|y| columns().map(move |x| f64::from(noise[y * WIDTH + x])));
            let squares = values.map(|v| v * v);
            squares.sum::<f64>() / (HEIGHT * columns().count()) as f64
        });
        // The weights of the four columns are 0, 1/4, 1/2 and 3/4.
        assert!(of_phase[0] > 1.15 * of_phase[1] && of_phase[0] > 1.3 * of_phase[2], "{of_phase:?}");
        assert!((of_phase[1] / of_phase[3] - 1.0).abs() < 0.03, "{of_phase:?}");
    }

    #[test]
    fn columns_alternate_on_the_sensor() {
        assert_eq!(column_pattern(4, 1.0, 0.5), [0.5, -0.5, 0.5, -0.5]);
        // Positions 0, 1.25, 2.5 and 3.75.
        assert_eq!(column_pattern(4, 1.25, 1.0), [1.0, -0.5, 0.0, 0.5]);
        assert!(column_pattern(9, 1.252, 0.0).iter().all(|v| *v == 0.0));
    }
}
