//! An orthogonal wavelet transform of images: Daubechies' filters of four values, computed by lifting (Daubechies and
//! Sweldens 1998, doi:10.1007/BF02476026), with periodic borders.

use multiversion::multiversion;

/// Transforms an image in place, from the finest scale to the coarsest of `levels`.
///
/// The means of each scale are in the left and upper halves, in which the next scale is transformed. Sides are
/// multiples of 2 to the power of `levels`.
pub(super) fn forward(image: &mut [f32], width: usize, levels: u32) {
    let mut buffer = vec![0.0; image.len()];
    let height = image.len() / width;
    for level in 0..levels {
        let [columns, rows] = [width >> level, height >> level];
        for row in image.chunks_exact_mut(width).take(rows) {
            split_row(&mut row[..columns], &mut buffer);
        }
        split_columns(image, &mut buffer, width, columns, rows);
    }
}

/// Undoes [`forward`].
pub(super) fn inverse(image: &mut [f32], width: usize, levels: u32) {
    let mut buffer = vec![0.0; image.len()];
    let height = image.len() / width;
    for level in (0..levels).rev() {
        let [columns, rows] = [width >> level, height >> level];
        join_columns(image, &mut buffer, width, columns, rows);
        for row in image.chunks_exact_mut(width).take(rows) {
            join_row(&mut row[..columns], &mut buffer);
        }
    }
}

/// √3.
const ROOT: f32 = 1.732_050_8;

/// Coefficients of the two terms of the second lifting step.
const SECOND: [f32; 2] = [ROOT / 4.0, (ROOT - 2.0) / 4.0];

/// Factors of means and differences.
const NORMS: [f32; 2] =
    [(ROOT - 1.0) * core::f32::consts::FRAC_1_SQRT_2, (ROOT + 1.0) * core::f32::consts::FRAC_1_SQRT_2];

#[multiversion(targets = "simd")]
fn split_row(row: &mut [f32], buffer: &mut [f32]) {
    let half = row.len() / 2;
    let (means, rest) = buffer.split_at_mut(half);
    let differences = &mut rest[..half];
    for (k, pair) in row.chunks_exact(2).enumerate() {
        means[k] = pair[0] + ROOT * pair[1];
        differences[k] = pair[1];
    }
    for k in 0..half {
        let before = means[if k == 0 { half - 1 } else { k - 1 }];
        differences[k] -= SECOND[0] * means[k] + SECOND[1] * before;
    }
    for k in 0..half {
        let after = differences[if k + 1 == half { 0 } else { k + 1 }];
        row[k] = NORMS[0] * (means[k] - after);
        row[half + k] = NORMS[1] * differences[k];
    }
}

#[multiversion(targets = "simd")]
fn join_row(row: &mut [f32], buffer: &mut [f32]) {
    let half = row.len() / 2;
    let (means, rest) = buffer.split_at_mut(half);
    let differences = &mut rest[..half];
    for k in 0..half {
        differences[k] = row[half + k] / NORMS[1];
    }
    for k in 0..half {
        let after = differences[if k + 1 == half { 0 } else { k + 1 }];
        means[k] = row[k] / NORMS[0] + after;
    }
    for k in 0..half {
        let before = means[if k == 0 { half - 1 } else { k - 1 }];
        let odd = differences[k] + SECOND[0] * means[k] + SECOND[1] * before;
        row[2 * k + 1] = odd;
        row[2 * k] = means[k] - ROOT * odd;
    }
}

/// Sets `out[i]` to `a·x[i] + b·y[i] + c·z[i]`.
#[multiversion(targets = "simd")]
fn combine(out: &mut [f32], [x, y, z]: [&[f32]; 3], [a, b, c]: [f32; 3]) {
    for (((out, x), y), z) in out.iter_mut().zip(x).zip(y).zip(z) {
        *out = a * x + b * y + c * z;
    }
}

fn split_columns(image: &mut [f32], buffer: &mut [f32], width: usize, columns: usize, rows: usize) {
    let half = rows / 2;
    let (means, differences) = buffer[..columns * rows].split_at_mut(columns * half);
    let line = |k: usize| k * columns..(k + 1) * columns;
    let of_image = |y: usize| y * width..y * width + columns;
    for k in 0..half {
        let [even, odd] = [0, 1].map(|part| &image[of_image(2 * k + part)]);
        combine(&mut means[line(k)], [even, odd, odd], [1.0, ROOT, 0.0]);
    }
    for k in 0..half {
        let [own, before] = [k, if k == 0 { half - 1 } else { k - 1 }].map(|k| &means[line(k)]);
        let odd = &image[of_image(2 * k + 1)];
        combine(&mut differences[line(k)], [odd, own, before], [1.0, -SECOND[0], -SECOND[1]]);
    }
    for k in 0..half {
        let [own, after] = [k, if k + 1 == half { 0 } else { k + 1 }].map(|k| &differences[line(k)]);
        let mean = &means[line(k)];
        combine(&mut image[of_image(k)], [mean, after, after], [NORMS[0], -NORMS[0], 0.0]);
        combine(&mut image[of_image(half + k)], [own, own, own], [NORMS[1], 0.0, 0.0]);
    }
}

fn join_columns(image: &mut [f32], buffer: &mut [f32], width: usize, columns: usize, rows: usize) {
    let half = rows / 2;
    let (means, differences) = buffer[..columns * rows].split_at_mut(columns * half);
    let line = |k: usize| k * columns..(k + 1) * columns;
    let of_image = |y: usize| y * width..y * width + columns;
    for k in 0..half {
        let own = &image[of_image(half + k)];
        combine(&mut differences[line(k)], [own, own, own], [1.0 / NORMS[1], 0.0, 0.0]);
    }
    for k in 0..half {
        let after = &differences[line(if k + 1 == half { 0 } else { k + 1 })];
        let mean = &image[of_image(k)];
        combine(&mut means[line(k)], [mean, after, after], [1.0 / NORMS[0], 1.0, 0.0]);
    }
    for k in 0..half {
        let [own, before] = [k, if k == 0 { half - 1 } else { k - 1 }].map(|k| &means[line(k)]);
        let (upper, lower) = image.split_at_mut((2 * k + 1) * width);
        let odd = &mut lower[..columns];
        combine(odd, [&differences[line(k)], own, before], [1.0, SECOND[0], SECOND[1]]);
        combine(&mut upper[of_image(2 * k)], [own, odd, odd], [1.0, -ROOT, 0.0]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Key;
    use crate::random;

    #[test]
    fn the_transform_keeps_energy_and_is_undone_by_the_inverse() {
        let mut rng = Key { seed: 2, index: 0 }.stream("test", 0, "wavelet");
        let (width, height, levels) = (24, 20, 2);
        let image: Vec<f32> = (0..width * height).map(|_| random::normal(&mut rng) as f32).collect();
        let energy = |image: &[f32]| image.iter().map(|v| f64::from(v * v)).sum::<f64>();
        let mut changed = image.clone();
        forward(&mut changed, width, levels);
        assert!((energy(&changed) / energy(&image) - 1.0).abs() < 1e-5);
        assert!(changed.iter().zip(&image).any(|(a, b)| (a - b).abs() > 0.5));
        inverse(&mut changed, width, levels);
        assert!(changed.iter().zip(&image).all(|(a, b)| (a - b).abs() < 1e-5));
    }

    #[test]
    fn differences_of_linear_images_vanish_except_at_borders() {
        let width = 32;
        let mut image: Vec<f32> = (0..width * width).map(|i| ((i % width) + 2 * (i / width)) as f32).collect();
        forward(&mut image, width, 1);
        for y in 1..width / 2 - 1 {
            for x in 1..width / 2 - 1 {
                let [a, b, c] = [[16, 0], [0, 16], [16, 16]].map(|[dx, dy]| image[(y + dy) * width + x + dx]);
                assert!(a.abs() < 1e-4 && b.abs() < 1e-4 && c.abs() < 1e-4, "{x} {y}: {a} {b} {c}");
            }
        }
    }
}
