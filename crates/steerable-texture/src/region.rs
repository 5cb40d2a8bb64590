//! Regions of images: weights of the pixels of every scale, and smooth continuation outside.

use crate::Error;

/// Largest magnitude of a grey level. Fourth powers of larger numbers would lose precision.
const LARGEST: f32 = 1e6;

/// Number of smoothing steps outside a region.
const RELAXATIONS: usize = 24;

/// Checks an image and its mask.
pub(crate) fn check(image: &[f32], width: usize, mask: Option<&[f32]>) -> Result<(), Error> {
    let in_mask = mask.map_or(image.len(), <[f32]>::len);
    if width == 0 || !image.len().is_multiple_of(width) || in_mask != image.len() {
        return Err(Error::Shape { pixels: image.len(), mask: in_mask, width });
    }
    let weight = |i: usize| mask.map_or(1.0, |mask| mask[i]);
    for (index, &value) in image.iter().enumerate() {
        if !(0.0..=1.0).contains(&weight(index)) {
            return Err(Error::Mask { index, value: weight(index) });
        }
        if weight(index) > 0.0 && !(-LARGEST..=LARGEST).contains(&value) {
            return Err(Error::Pixel { index, value });
        }
    }
    if (0..image.len()).all(|i| weight(i) == 0.0) { Err(Error::EmptyMask) } else { Ok(()) }
}

/// Returns the weights of the next coarser scale: the mean of the 3 x 3 finer weights around each pixel, with binomial
/// weights. Periodic.
pub(crate) fn coarser(weights: &[f32], width: usize) -> Vec<f32> {
    let height = weights.len() / width;
    let mut result = Vec::with_capacity(weights.len() / 4);
    for y in (0..height).step_by(2) {
        let rows = [y + height - 1, y, y + 1].map(|y| &weights[y % height * width..][..width]);
        for x in (0..width).step_by(2) {
            let columns = [x + width - 1, x, x + 1].map(|x| x % width);
            let row = |row: &[f32]| 0.25 * row[columns[0]] + 0.5 * row[columns[1]] + 0.25 * row[columns[2]];
            result.push(0.25 * row(rows[0]) + 0.5 * row(rows[1]) + 0.25 * row(rows[2]));
        }
    }
    result
}

/// Returns the weights of bands: each weight w times m⁴, where m is the mean of the 5 x 5 weights around it. Near the
/// border of a region, the filters also see the outside, and the weight there is small, but not 0: even a region of a
/// single pixel has a weight.
pub(crate) fn inner(weights: &[f32], width: usize) -> Vec<f32> {
    let height = weights.len() / width;
    let mut sums = vec![0.0_f32; weights.len()];
    for (to, row) in sums.chunks_exact_mut(width).zip(weights.chunks_exact(width)) {
        for (x, to) in to.iter_mut().enumerate() {
            *to = (0..5).map(|i| row[(x + width + i - 2) % width]).sum();
        }
    }
    let mean = |i: usize| {
        let (x, y) = (i % width, i / width);
        (0..5).map(|j| sums[(y + height + j - 2) % height * width + x]).sum::<f32>() / 25.0
    };
    let fourth = |v: f32| v * v * v * v;
    weights.iter().enumerate().map(|(i, &w)| if w > 0.0 { w * fourth(mean(i)) } else { 0.0 }).collect()
}

/// Replaces pixels as far as their weights are below 1 by a smooth continuation of the region, so that the filters see
/// no edge at its border. Both sides are powers of two.
///
/// Means over squares of 2 x 2, 4 x 4, ... pixels fill the gaps of the next finer level (pull and push). Then repeated
/// steps towards (1 − S)² v = 0, where S is the mean of the 3 x 3 pixels around each, remove steps and kinks at the
/// border.
pub(crate) fn continue_smoothly(image: &mut [f32], weights: &[f32], width: usize) {
    if weights.iter().all(|&weight| weight >= 1.0) {
        return;
    }
    let height = image.len() / width;
    let sums: Vec<f32> = image.iter().zip(weights).map(|(v, w)| if *w > 0.0 { v * w } else { 0.0 }).collect();
    let mut filled = filled(&sums, weights, width, height);
    for _ in 0..RELAXATIONS {
        let once = smooth(&filled, width);
        let twice = smooth(&once, width);
        for (i, value) in filled.iter_mut().enumerate() {
            *value = sums[i] + (1.0 - weights[i]) * (2.0 * once[i] - twice[i]);
        }
    }
    for ((value, &weight), filled) in image.iter_mut().zip(weights).zip(filled) {
        *value = if weight >= 1.0 { *value } else { filled };
    }
}

/// Returns binomial means over 3 x 3 pixels, periodic.
fn smooth(image: &[f32], width: usize) -> Vec<f32> {
    let height = image.len() / width;
    let mut rows = vec![0.0; image.len()];
    for (to, row) in rows.chunks_exact_mut(width).zip(image.chunks_exact(width)) {
        for (x, to) in to.iter_mut().enumerate() {
            *to = 0.25 * row[(x + width - 1) % width] + 0.5 * row[x] + 0.25 * row[(x + 1) % width];
        }
    }
    let row = |y: usize| &rows[y % height * width..][..width];
    let around = (0..height).flat_map(|y| row(y + height - 1).iter().zip(row(y)).zip(row(y + 1)));
    around.map(|((above, here), below)| 0.25 * above + 0.5 * here + 0.25 * below).collect()
}

/// Returns weighted sums divided by their weights, completed by coarser means where the weights are below 1.
fn filled(sums: &[f32], weights: &[f32], width: usize, height: usize) -> Vec<f32> {
    if width == 1 || height == 1 {
        let total: f32 = weights.iter().sum();
        let mean = if total > 0.0 { sums.iter().sum::<f32>() / total } else { 0.0 };
        return vec![mean; sums.len()];
    }
    let halved = |values: &[f32]| -> Vec<f32> {
        let pairs = values.chunks_exact(2 * width).map(|rows| rows.split_at(width));
        let squares = pairs.flat_map(|(upper, lower)| {
            (0..width).step_by(2).map(|x| upper[x] + upper[x + 1] + lower[x] + lower[x + 1])
        });
        squares.collect()
    };
    let (mut coarse_sums, mut coarse_weights) = (halved(sums), halved(weights));
    for (sum, weight) in coarse_sums.iter_mut().zip(&mut coarse_weights) {
        if *weight > 1.0 {
            *sum /= *weight;
            *weight = 1.0;
        }
    }
    let [half_width, half_height] = [width / 2, height / 2];
    let coarse = filled(&coarse_sums, &coarse_weights, half_width, half_height);
    let mut result = Vec::with_capacity(sums.len());
    for y in 0..height {
        // The nearest coarse pixel and the next in the direction of this one; periodic.
        let next =
            |i: usize, side: usize| if i.is_multiple_of(2) { (i / 2 + side - 1) % side } else { (i / 2 + 1) % side };
        let rows = [y / 2, next(y, half_height)].map(|y| &coarse[y * half_width..][..half_width]);
        for x in 0..width {
            let columns = [x / 2, next(x, half_width)];
            let row = |row: &[f32]| 0.75 * row[columns[0]] + 0.25 * row[columns[1]];
            let around = 0.75 * row(rows[0]) + 0.25 * row(rows[1]);
            let i = y * width + x;
            result.push(sums[i] + (1.0 - weights[i].min(1.0)) * around);
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_of_one_stay_one_at_every_scale() {
        let mut weights = vec![1.0; 32 * 16];
        for width in [32, 16, 8] {
            assert_eq!(inner(&weights, width), weights);
            weights = coarser(&weights, width);
            assert!(weights.iter().all(|&w| w == 1.0));
        }
    }

    #[test]
    fn coarse_pixels_count_as_far_as_their_fine_pixels() {
        let half: Vec<f32> = (0..256).map(|i| if (4..12).contains(&(i % 16)) { 1.0 } else { 0.0 }).collect();
        let coarse = coarser(&half, 16);
        assert_eq!(coarse[..8], [0.0, 0.0, 0.75, 1.0, 1.0, 1.0, 0.25, 0.0]);
    }

    #[test]
    fn bands_count_less_near_the_border() {
        let half: Vec<f32> = (0..256).map(|i| if (4..12).contains(&(i % 16)) { 1.0 } else { 0.0 }).collect();
        let weights = inner(&half, 16);
        let expected = [0.0, 0.1296, 0.4096, 1.0, 1.0, 1.0, 1.0, 0.4096, 0.1296, 0.0];
        assert!(weights[3..13].iter().zip(expected).all(|(a, b): (&f32, f32)| (a - b).abs() < 1e-6), "{weights:?}");
    }

    #[test]
    fn continuation_keeps_the_region_and_the_constant() {
        let (width, height) = (32, 16);
        let inside = |i: usize| (i % width).abs_diff(12) + (i / width).abs_diff(7) < 6;
        let weights: Vec<f32> = (0..width * height).map(|i| if inside(i) { 1.0 } else { 0.0 }).collect();
        let mut image: Vec<f32> = (0..width * height).map(|i| if inside(i) { 7.0 } else { f32::NAN }).collect();
        continue_smoothly(&mut image, &weights, width);
        assert!(image.iter().all(|v| (v - 7.0).abs() < 1e-5));
        let mut ramp: Vec<f32> =
            (0..width * height).map(|i| if inside(i) { (i % width) as f32 } else { -99.0 }).collect();
        let before = ramp.clone();
        continue_smoothly(&mut ramp, &weights, width);
        for i in 0..width * height {
            assert!(if inside(i) { ramp[i] == before[i] } else { (6.0..=18.0).contains(&ramp[i]) }, "{}", ramp[i]);
        }
    }
}
