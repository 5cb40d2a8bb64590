use core::f64::consts::TAU;

use multiversion::multiversion;

use crate::Microscope;
use crate::canvas::amplitudes;
use crate::filter::Filter;

/// In-focus correction of objects that are smooth at the scale of a pixel, without Fourier transforms.
///
/// In focus, an object of amplitude transmittance 1 − a transmits (1 − W₀ ⊗ a)², less than the blurred transmittance by
/// V = W₀ ⊗ a² − (W₀ ⊗ a)², the variance of a under the point spread function. V is added to the absorbed light, which
/// the lens blurs once more. That is negligible for a smooth object, and V is zero except at steep folds and edges.
#[derive(Debug)]
pub(crate) struct SmoothCorrection {
    /// Rows of the kernel of W₀ from the central one on, each from its centre on.
    kernel: Vec<Vec<f32>>,
}

/// Radius of the kernel, in multiples of λ/NA.
const REACH: f64 = 1.25;

/// Largest radius of a kernel in pixels. Beyond it Fourier transforms are faster.
const MAX_RADIUS: usize = 5;

/// Pixels computed in parallel.
const LANES: usize = 16;

/// Pixels of a row around a block, in full vectors.
const AROUND: usize = (LANES + 2 * MAX_RADIUS).next_multiple_of(LANES);

/// Difference of an amplitude from the mean of its four neighbours up to which V is omitted. It then changes the light
/// by less than a hundredth.
const NEGLIGIBLE: f32 = 0.02;

impl SmoothCorrection {
    /// Computes the kernel. Returns `None` if the point spread function is not round, or too wide for this method.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few pixels in single precision")]
    pub(crate) fn new(microscope: &Microscope, in_focus: &Filter) -> Option<Self> {
        /// Samples of the spectrum along each axis.
        const SIDE: i32 = 64;
        let params = microscope.params();
        let radius = (REACH * params.wavelength_um / params.na / params.pixel_um).ceil() as usize;
        if radius > MAX_RADIUS {
            return None;
        }
        let turn = TAU / f64::from(SIDE);
        let cosines: Vec<f64> = (0..SIDE).map(|i| libm::cos(turn * f64::from(i))).collect();
        let cosine = |k: i32, x: usize| cosines[(k.unsigned_abs() as usize * x) % cosines.len()];
        let mut kernel = vec![vec![0.0; radius + 1]; radius + 1];
        for ky in -SIDE / 2..SIDE / 2 {
            for kx in -SIDE / 2..SIDE / 2 {
                let cycles = f64::from(kx * kx + ky * ky).sqrt() / f64::from(SIDE) / params.pixel_um;
                let w = in_focus.round_absorption(cycles, microscope)?;
                for (y, row) in kernel.iter_mut().enumerate() {
                    for (x, value) in row.iter_mut().enumerate() {
                        *value += w * cosine(kx, x) * cosine(ky, y);
                    }
                }
            }
        }
        // Each value occurs once at the centre, twice on an axis, and four times elsewhere.
        let times = |at: usize| if at == 0 { 1.0 } else { 2.0 };
        let in_row = |row: &Vec<f64>| row.iter().enumerate().map(|(x, value)| times(x) * value).sum::<f64>();
        let sum: f64 = kernel.iter().enumerate().map(|(y, row)| times(y) * in_row(row)).sum();
        let scaled = |row: Vec<f64>| row.into_iter().map(|value| (value / sum) as f32).collect();
        Some(Self { kernel: kernel.into_iter().map(scaled).collect() })
    }

    /// Writes V at each pixel of an image of absorbed light, 1 − T, in rows of `width`. Beyond its borders the slide is
    /// empty. `padded` is working memory.
    pub(crate) fn variance(&self, absorbed: &[f32], width: usize, out: &mut Vec<f32>, padded: &mut Vec<f32>) {
        out.clear();
        out.resize(absorbed.len(), 0.0);
        let radius = self.kernel.len() - 1;
        // Blocks may read beyond a row.
        let padded_width = width.next_multiple_of(LANES) + AROUND - LANES;
        padded.clear();
        padded.resize(padded_width * (absorbed.len() / width + 2 * radius), 0.0);
        for (row, padded) in absorbed.chunks_exact(width).zip(padded.chunks_exact_mut(padded_width).skip(radius)) {
            amplitudes(row, &[], &mut padded[radius..radius + width]);
        }
        for (y, out) in out.chunks_exact_mut(width).enumerate() {
            variances(&self.kernel, &padded[padded_width * y..][..padded_width * (2 * radius + 1)], out);
        }
    }
}

/// Computes K ⊗ a² − (K ⊗ a)² for a row, from the rows of a around it.
#[multiversion(targets = "simd")]
fn variances(kernel: &[Vec<f32>], rows: &[f32], out: &mut [f32]) {
    let radius = kernel.len() - 1;
    let width = rows.len() / (2 * radius + 1);
    for (block, out) in out.chunks_mut(LANES).enumerate() {
        let row = |y: usize| &rows[width * y + block * LANES..][..AROUND];
        if !is_rough(row(radius - 1), row(radius), row(radius + 1), radius) {
            continue;
        }
        let mut sums = [[0.0_f32; LANES]; 2];
        for (y, weights) in kernel.iter().enumerate() {
            // The two rows at this distance.
            let scale = if y == 0 { 0.5 } else { 1.0 };
            let mut folded = [[0.0_f32; AROUND]; 2];
            let [amplitudes, squares] = &mut folded;
            let places = amplitudes.iter_mut().zip(squares);
            for ((sum, square), (a, b)) in places.zip(row(radius - y).iter().zip(row(radius + y))) {
                (*sum, *square) = (scale * (a + b), scale * (a * a + b * b));
            }
            for (x, weight) in weights.iter().enumerate() {
                let weight = if x == 0 { 0.5 * weight } else { *weight };
                for (sum, folded) in sums.iter_mut().zip(&folded) {
                    let (before, after) = (part(folded, radius - x), part(folded, radius + x));
                    for l in 0..LANES {
                        sum[l] += weight * (before[l] + after[l]);
                    }
                }
            }
        }
        let [mean, mean_square] = sums;
        for ((out, mean), mean_square) in out.iter_mut().zip(mean).zip(mean_square) {
            *out = mean_square - mean * mean;
        }
    }
}

/// Returns whether an amplitude, in rows of `width`, differs noticeably from the mean of its four neighbours anywhere,
/// or from 0 at its border.
#[multiversion(targets = "simd")]
pub(crate) fn is_detailed(amplitude: &[f32], width: usize) -> bool {
    let height = amplitude.len() / width;
    if width < 3 || height < 3 {
        return true;
    }
    let mut detailed = 0_u32;
    for y in 1..height - 1 {
        let row = |y: usize| &amplitude[y * width..][..width];
        let (above, row, below) = (&row(y - 1)[1..], row(y), &row(y + 1)[1..]);
        detailed += u32::from(row[0] > NEGLIGIBLE) + u32::from(row[width - 1] > NEGLIGIBLE);
        let beside = row.iter().zip(&row[2..]);
        for (((centre, above), below), (left, right)) in row[1..].iter().zip(above).zip(below).zip(beside) {
            let mean = 0.25 * ((above + below) + (left + right));
            detailed += u32::from((centre - mean).abs() > NEGLIGIBLE);
        }
    }
    for value in amplitude[..width].iter().chain(&amplitude[(height - 1) * width..]) {
        detailed += u32::from(*value > NEGLIGIBLE);
    }
    detailed > 0
}

/// Returns the values from an index on.
#[inline(always)]
fn part(row: &[f32], first: usize) -> [f32; LANES] {
    let mut values = [0.0; LANES];
    values.copy_from_slice(&row[first..first + LANES]);
    values
}

/// Returns whether the middle row differs noticeably from the mean of its neighbours, except in the first and last
/// `margin` pixels.
#[inline(always)]
fn is_rough(above: &[f32], row: &[f32], below: &[f32], margin: usize) -> bool {
    let (above, below) = (part(above, margin), part(below, margin));
    let (left, centre, right) = (part(row, margin - 1), part(row, margin), part(row, margin + 1));
    let mut largest = [0.0_f32; LANES];
    for l in 0..LANES {
        let mean = 0.25 * ((above[l] + below[l]) + (left[l] + right[l]));
        largest[l] = (centre[l] - mean).abs();
    }
    largest.into_iter().fold(false, |rough, value| rough | (value > NEGLIGIBLE))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MicroscopeParams;

    #[test]
    #[expect(clippy::cast_possible_truncation, reason = "single precision")]
    fn variance_matches_the_definition() {
        for pixel_um in [0.16, 0.25, 0.35] {
            let microscope = Microscope::new(&MicroscopeParams { pixel_um, ..MicroscopeParams::default() }).unwrap();
            let in_focus = Filter::in_focus(&microscope);
            let smooth = SmoothCorrection::new(&microscope, &in_focus).unwrap();
            // Waves are transferred as by the lens.
            let radius = i32::try_from(smooth.kernel.len()).unwrap() - 1;
            let weight =
                |x: i32, y: i32| f64::from(smooth.kernel[y.unsigned_abs() as usize][x.unsigned_abs() as usize]);
            let around = || (-radius..=radius).flat_map(|y| (-radius..=radius).map(move |x| (x, y)));
            for cycles in [0.0, 0.1, 0.2, 0.3, 0.4] {
                let response = |(x, y): (i32, i32)| weight(x, y) * libm::cos(TAU * cycles * f64::from(x));
                let (sum, lens) =
                    (around().map(response).sum::<f64>(), in_focus.round_absorption(cycles / pixel_um, &microscope));
                assert!((sum - lens.unwrap()).abs() < 0.06, "{pixel_um} {cycles}: {sum} {lens:?}");
            }
            // A ridge, and an edge that the image cuts.
            let (width, height) = (41, 30);
            let amplitude = |x: i32, y: i32| {
                let ridge = 0.4 * libm::exp(-0.3 * f64::from((x - 12) * (x - 12)));
                if (0..width).contains(&x) && (0..height).contains(&y) {
                    ridge.max(0.3 / (1.0 + libm::exp(f64::from(20 - y))))
                } else {
                    0.0
                }
            };
            let absorbed = |(x, y): (i32, i32)| (amplitude(x, y) * (2.0 - amplitude(x, y))) as f32;
            let image: Vec<f32> = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(absorbed).collect();
            let (mut found, mut padded) = (Vec::new(), vec![7.0; 9]);
            smooth.variance(&image, width.unsigned_abs() as usize, &mut found, &mut padded);
            let mut largest = 0.0_f64;
            for (i, found) in found.iter().enumerate() {
                let i = i32::try_from(i).unwrap();
                let (x, y) = (i % width, i / width);
                let blurred = |value: &dyn Fn(f64) -> f64| -> f64 {
                    around().map(|(u, v)| weight(u, v) * value(amplitude(x + u, y + v))).sum()
                };
                let mean = blurred(&|a| a);
                let expected = blurred(&|a| a * a) - mean * mean;
                largest = largest.max(expected);
                // Flat blocks are left out.
                let error = (f64::from(*found) - expected).abs();
                assert!(error < if *found == 0.0 { 1e-2 } else { 1e-5 }, "{pixel_um} {x} {y}: {found} {expected}");
            }
            assert!(largest > 5e-3, "{pixel_um}: {largest}");
        }
    }

    #[test]
    fn detail_is_noticed() {
        // A pyramid.
        let height = |i: usize| (i % 20).min(19 - i % 20).min(i / 20).min(19 - i / 20) as f32;
        let image: Vec<f32> = (0..20 * 20).map(|i| 0.03 * height(i)).collect();
        assert!(!is_detailed(&image, 20));
        for place in [7 * 20 + 18, 10 * 20 + 10, 5, 20 * 20 - 1, 9 * 20] {
            let mut image = image.clone();
            image[place] += 0.03;
            assert!(is_detailed(&image, 20), "{place}");
        }
    }
}
