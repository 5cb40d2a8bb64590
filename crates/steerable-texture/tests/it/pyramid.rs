//! Laws of the pyramid, and comparison with sums over all frequencies.

#![expect(clippy::cast_possible_truncation, reason = "images are single precision")]

use core::f64::consts::{PI, TAU};

use portable_numerics::random::normal;
use steerable_texture::{Bands, Error, Pyramid, PyramidParams};

use crate::textures::rng;

fn noise(len: usize, seed: u64) -> Vec<f32> {
    let mut rng = rng(seed);
    (0..len).map(|_| normal(&mut rng) as f32).collect()
}

fn pyramid(width: usize, height: usize, scales: usize, orientations: usize) -> Pyramid {
    Pyramid::new(width, height, &PyramidParams { scales, orientations }).unwrap()
}

fn mean_square(values: &[f32]) -> f64 {
    values.iter().map(|&v| f64::from(v) * f64::from(v)).sum::<f64>() / values.len() as f64
}

fn largest_difference(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

#[test]
fn bands_add_up_to_the_image() {
    for (width, height, scales, orientations) in [(64, 64, 4, 4), (32, 128, 2, 3), (64, 32, 3, 2), (128, 128, 5, 6)] {
        let pyramid = pyramid(width, height, scales, orientations);
        let image = noise(width * height, 1);
        let bands = pyramid.decompose(&image);
        assert_eq!((bands.oriented.len(), bands.oriented[0].len()), (scales, orientations));
        assert_eq!(bands.low_pass.len(), (width >> scales) * (height >> scales));
        assert!(largest_difference(&pyramid.reconstruct(&bands), &image) < 1e-5);
    }
}

#[test]
fn mean_squares_of_bands_sum_to_that_of_the_image() {
    for orientations in 2..=8 {
        let image = noise(64 * 64, 2);
        let Bands { high_pass, oriented, low_pass } = pyramid(64, 64, 3, orientations).decompose(&image);
        let real: f64 = oriented.iter().flatten().map(|band| mean_square(&band.real)).sum();
        let imaginary: f64 = oriented.iter().flatten().map(|band| mean_square(&band.imaginary)).sum();
        let total = mean_square(&high_pass) + mean_square(&low_pass);
        assert!((total + real - mean_square(&image)).abs() < 1e-5, "{orientations}");
        assert!((real - imaginary).abs() < 1e-5);
    }
}

#[test]
fn shifted_images_have_shifted_bands() {
    let (side, scales) = (64, 3);
    let pyramid = pyramid(side, side, scales, 4);
    let image = noise(side * side, 3);
    let [dx, dy] = [8, 24];
    let shifted = |values: &[f32], side: usize, [dx, dy]: [usize; 2]| -> Vec<f32> {
        (0..side * side).map(|i| values[(i / side + dy) % side * side + (i % side + dx) % side]).collect()
    };
    let (bands, found) = (pyramid.decompose(&image), pyramid.decompose(&shifted(&image, side, [dx, dy])));
    for scale in 0..scales {
        for (band, found) in bands.oriented[scale].iter().zip(&found.oriented[scale]) {
            for (values, found) in [(&band.real, &found.real), (&band.imaginary, &found.imaginary)] {
                let expected = shifted(values, side >> scale, [dx >> scale, dy >> scale]);
                assert!(largest_difference(found, &expected) < 1e-5);
            }
        }
    }
}

#[test]
fn rotated_images_have_permuted_orientations() {
    let side = 64;
    // A quarter turn about the origin: (x, y) -> (-y, x).
    let rotated = |values: &[f32], side: usize| -> Vec<f32> {
        (0..side * side).map(|i| values[(side - i % side) % side * side + i / side]).collect()
    };
    for orientations in [2, 4, 6] {
        let pyramid = pyramid(side, side, 3, orientations);
        let image = noise(side * side, 4);
        let (bands, found) = (pyramid.decompose(&image), pyramid.decompose(&rotated(&image, side)));
        for scale in 0..3 {
            let magnitudes = |bands: &Bands, k: usize| -> Vec<f32> {
                let band = &bands.oriented[scale][k];
                band.real.iter().zip(&band.imaginary).map(|(a, b)| (a * a + b * b).sqrt()).collect()
            };
            for k in 0..orientations {
                let expected = rotated(&magnitudes(&bands, k), side >> scale);
                let found = magnitudes(&found, (k + orientations / 2) % orientations);
                assert!(largest_difference(&found, &expected) < 1e-5, "{orientations}, {scale}, {k}");
            }
        }
    }
}

/// The coarser band by the definition: a product of raised cosines for each frequency.
fn slow_band(image: &[f32], side: usize, scale: usize, k: usize, orientations: usize) -> Vec<[f64; 2]> {
    let signed = |i: usize| if 2 * i >= side { i as f64 - side as f64 } else { i as f64 };
    let ramp = |r: f64, edge: f64| (PI / 2.0 * libm::log2(2.0 * r / edge)).clamp(0.0, PI / 2.0);
    let factorial = |n: usize| (1..=n).map(|i| i as f64).product::<f64>();
    let alpha = libm::exp2(orientations as f64 - 1.0) * factorial(orientations - 1)
        / (orientations as f64 * factorial(2 * orientations - 2)).sqrt();
    let mut band = vec![[0.0; 2]; (side >> scale) * (side >> scale)];
    for (kx, ky) in (0..side).flat_map(|kx| (0..side).map(move |ky| (kx, ky))) {
        let [u, v] = [signed(kx), signed(ky)].map(|f| TAU * f / side as f64);
        let r = (u * u + v * v).sqrt();
        let turn = libm::atan2(v, u) - PI * k as f64 / orientations as f64;
        if r == 0.0 || libm::cos(turn) <= 0.0 {
            continue;
        }
        let low = (0..=scale).map(|s| libm::cos(ramp(r, PI / f64::from(1 << s)))).product::<f64>();
        let high = libm::sin(ramp(r, PI / f64::from(2 << scale)));
        let gain = 2.0 * low * high * alpha * libm::pow(libm::cos(turn), orientations as f64 - 1.0);
        if gain < 1e-12 {
            continue;
        }
        let mut z = [0.0; 2];
        for (i, &value) in image.iter().enumerate() {
            let (sin, cos) = libm::sincos(u * (i % side) as f64 + v * (i / side) as f64);
            z[0] += f64::from(value) * cos;
            z[1] -= f64::from(value) * sin;
        }
        // The factor (−i)^(K−1) makes the filters of the real parts real.
        let (sin, cos) = libm::sincos(-PI / 2.0 * (orientations as f64 - 1.0));
        let z = [z[0] * cos - z[1] * sin, z[0] * sin + z[1] * cos].map(|part| part * gain / (side * side) as f64);
        for (i, to) in band.iter_mut().enumerate() {
            let [x, y] = [i % (side >> scale), i / (side >> scale)].map(|p| (p << scale) as f64);
            let (sin, cos) = libm::sincos(u * x + v * y);
            to[0] += z[0] * cos - z[1] * sin;
            to[1] += z[0] * sin + z[1] * cos;
        }
    }
    band
}

#[test]
fn bands_match_the_definition() {
    let side = 16;
    let image = noise(side * side, 5);
    for orientations in [2, 3, 4] {
        let bands = pyramid(side, side, 2, orientations).decompose(&image);
        for (scale, k) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let expected = slow_band(&image, side, scale, k, orientations);
            let band = &bands.oriented[scale][k];
            for ((re, im), expected) in band.real.iter().zip(&band.imaginary).zip(expected) {
                let difference = (f64::from(*re) - expected[0]).abs() + (f64::from(*im) - expected[1]).abs();
                assert!(difference < 1e-5, "{orientations}, {scale}, {k}: {difference}");
            }
        }
    }
}

#[test]
fn orientation_0_responds_to_changes_along_x() {
    let side = 64;
    let image: Vec<f32> = (0..side * side).map(|i| libm::cosf(0.5 * PI as f32 * (i % side) as f32)).collect();
    let bands = pyramid(side, side, 2, 4).decompose(&image);
    let power: Vec<f64> = bands.oriented[0].iter().map(|band| mean_square(&band.real)).collect();
    assert!(power[0] > 0.25 && power[0] > 4.0 * power[1] && power[2] < 1e-9, "{power:?}");
}

#[test]
fn invalid_sizes_are_errors() {
    let error = Pyramid::new(48, 64, &PyramidParams::default()).unwrap_err();
    assert_eq!(error, Error::Side { field: "width", value: 48, least: 64, most: 8192 });
    assert_eq!(error.to_string(), "width is 48 px; accepted: powers of two from 64 to 8192");
}

#[test]
#[should_panic(expected = "the image must have 64 x 64 pixels")]
fn images_of_another_size_are_reported() {
    let _ = pyramid(64, 64, 2, 4).decompose(&[0.0; 64]);
}
