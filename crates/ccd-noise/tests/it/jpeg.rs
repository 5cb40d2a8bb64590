//! Tests of JPEG against ITU-T T.81, against another program, and of invariants.

use ccd_noise::{Jpeg, JpegParams, NoiseField, Subsampling};

const KEY: u64 = 0x00e1_ec72_0000_0a81;

fn jpeg(quality: u32, subsampling: Subsampling) -> Jpeg {
    Jpeg::new(&JpegParams { quality, subsampling, ..JpegParams::default() }).unwrap()
}

fn grey(quality: u32) -> Jpeg {
    jpeg(quality, Subsampling::S444)
}

/// Returns a smooth background with a spot and noise.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "8 bits")]
fn scene(width: usize, height: usize, noise: f32) -> Vec<u8> {
    let mut normal = vec![0.0; width * height];
    NoiseField::new(KEY).normal_into(width, [0, 0], &mut normal);
    normal
        .iter()
        .enumerate()
        .map(|(i, n)| {
            let [x, y] = [i % width, i / width].map(|v| v as f32);
            let spot = (x - 30.0) * (x - 30.0) + (y - 20.0) * (y - 20.0) < 150.0;
            let ground = 190.0 - 0.005 * (x * x + 0.5 * y * y);
            (if spot { 90.0 } else { ground } + noise * n) as u8
        })
        .collect()
}

fn mean_loss(a: &[u8], b: &[u8]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / a.len() as f64
}

/// ITU-T T.81, A.3.3 and Annex K, for images of complete blocks. Coefficients are rounded to 1/8 before division, as in
/// common encoders. Halves may round differently from the fast routine.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "8 bits")]
fn reference(image: &[u8], width: usize, quality: u32) -> Vec<u8> {
    let luma = [
        [16, 11, 10, 16, 24, 40, 51, 61],
        [12, 12, 14, 19, 26, 58, 60, 55],
        [14, 13, 16, 24, 40, 57, 69, 56],
        [14, 17, 22, 29, 51, 87, 80, 62],
        [18, 22, 37, 56, 68, 109, 103, 77],
        [24, 35, 55, 64, 81, 104, 113, 92],
        [49, 64, 78, 87, 103, 121, 120, 101],
        [72, 92, 95, 98, 112, 100, 103, 99],
    ];
    let scale = if quality < 50 { 5000 / quality } else { 200 - 2 * quality };
    let cosine = |x: usize, u: usize| {
        let norm = if u == 0 { 0.125_f64.sqrt() } else { 0.5 };
        norm * libm::cos((2 * x + 1) as f64 * u as f64 * core::f64::consts::PI / 16.0)
    };
    let mut out = vec![0; image.len()];
    for top in (0..image.len() / width).step_by(8) {
        for left in (0..width).step_by(8) {
            let mut levels = [[0.0; 8]; 8];
            for (v, row) in levels.iter_mut().enumerate() {
                for (u, level) in row.iter_mut().enumerate() {
                    let step = f64::from(((luma[v][u] * scale + 50) / 100).clamp(1, 255));
                    let sum: f64 = (0..64)
                        .map(|i| {
                            let value = f64::from(image[(top + i / 8) * width + left + i % 8]) - 128.0;
                            value * cosine(i / 8, v) * cosine(i % 8, u)
                        })
                        .sum();
                    *level = ((sum * 8.0).round() / 8.0 / step).round() * step;
                }
            }
            for i in 0..64 {
                let sum: f64 =
                    (0..64).map(|k| levels[k / 8][k % 8] * cosine(i / 8, k / 8) * cosine(i % 8, k % 8)).sum();
                out[(top + i / 8) * width + left + i % 8] = (sum + 128.0).round().clamp(0.0, 255.0) as u8;
            }
        }
    }
    out
}

#[test]
fn grey_images_match_itu_t81() {
    let width = 96;
    for noise in [0.0, 3.0, 12.0] {
        let image = scene(width, 64, noise);
        for quality in [10, 49, 50, 75, 90, 95, 100] {
            let mut fast = image.clone();
            grey(quality).grey(&mut fast, width);
            let slow = reference(&image, width, quality);
            let blocks_off = (0..96).filter(|b| {
                let pixel = |i: usize| (b / 12 * 8 + i / 8) * width + b % 12 * 8 + i % 8;
                (0..64).any(|i| fast[pixel(i)].abs_diff(slow[pixel(i)]) > 1)
            });
            // A coefficient halfway between two steps may round either way, which changes its block.
            let off = blocks_off.count();
            assert!(off <= 12, "quality {quality}, noise {noise}: {off} of 96 blocks differ");
            assert!(mean_loss(&fast, &slow) < 0.3, "quality {quality}: {}", mean_loss(&fast, &slow));
        }
    }
}

/// Returns an image computed in integers, so that any program can reproduce it.
#[expect(clippy::cast_possible_truncation, reason = "8 bits")]
fn integer_scene(width: usize, height: usize, channels: usize) -> Vec<u8> {
    (0..width * height * channels)
        .map(|i| {
            let (c, x, y) = (i % channels, i / channels % width, i / channels / width);
            (90 + 40 * c + x * y / (7 + c) % 90 + (x * 31 + y * 17 + x * x * y) % 23) as u8
        })
        .collect()
}

fn hash(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |h, &b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3))
}

/// Hashes of images that Pillow 13 with libjpeg-turbo saved and loaded; `external_jpeg.py` compares with the installed
/// Pillow.
#[test]
fn images_match_pillow() {
    let (width, height) = (93, 41);
    let mut hashes = Vec::new();
    for quality in [10, 50, 75, 90, 100] {
        let mut image = integer_scene(width, height, 1);
        grey(quality).grey(&mut image, width);
        hashes.push(hash(&image));
        for subsampling in [Subsampling::S444, Subsampling::S422, Subsampling::S420] {
            let mut image = integer_scene(width, height, 3);
            jpeg(quality, subsampling).rgb(&mut image, width);
            hashes.push(hash(&image));
        }
    }
    assert_eq!(hashes, PILLOW);
}

const PILLOW: [u64; 20] = [
    0x3793_83b1_7901_3304,
    0x780c_b768_0e4a_c9b7,
    0x6db0_4ae3_2e6a_08c3,
    0xd287_3770_7c28_fe27,
    0x421b_9112_edc7_66ff,
    0xf352_3015_8da1_9ac8,
    0x5d95_9622_f6f1_51ab,
    0x9437_cbf5_c0d5_d3ee,
    0x65cb_4b75_b2ec_06e1,
    0xe830_e2b9_9605_f5ed,
    0xa69e_a47b_0a6f_ca86,
    0x69ad_7f7a_e4b0_d41e,
    0xbf1e_9f7e_0e3e_0179,
    0x3628_f363_017d_58e8,
    0xd282_6f86_892b_e213,
    0x4921_f9e8_9432_33e9,
    0x8df4_7b2c_011e_2531,
    0xc7fc_6135_fdf5_ef3f,
    0xd0c4_5196_4139_0bc4,
    0x4d49_8231_36be_86bd,
];

#[test]
fn loss_decreases_with_quality() {
    let image = scene(333, 217, 4.0);
    let losses = [1, 10, 30, 50, 75, 90, 95, 100].map(|quality| {
        let mut lossy = image.clone();
        grey(quality).grey(&mut lossy, 333);
        mean_loss(&image, &lossy)
    });
    assert!(losses.windows(2).all(|w| w[1] < w[0]), "{losses:?}");
    assert!(losses[0] > 5.0 && losses[7] < 0.5, "{losses:?}");
}

#[test]
fn uniform_images_stay_uniform() {
    for (width, height) in [(1, 1), (7, 9), (16, 16), (33, 20)] {
        for level in [0, 1, 127, 128, 200, 255] {
            for quality in [50, 90, 100] {
                let mut image = vec![level; width * height];
                grey(quality).grey(&mut image, width);
                let steps = [2, 0, 0][[50, 90, 100].iter().position(|&q| q == quality).unwrap()];
                assert!(image.iter().all(|&v| v == image[0] && v.abs_diff(level) <= steps / 2), "{level} {quality}");
                for subsampling in [Subsampling::S444, Subsampling::S422, Subsampling::S420] {
                    let mut rgb = vec![level; 3 * width * height];
                    jpeg(quality, subsampling).rgb(&mut rgb, width);
                    assert!(rgb.iter().zip(image.iter().cycle()).all(|(a, b)| a == b), "{level} {quality}");
                }
            }
        }
    }
}

/// The chroma of a grey image is 0 and stays 0.
#[test]
fn frames_and_grey_rgb_images_match_grey_images() {
    let image = scene(50, 37, 5.0);
    let mut expected = image.clone();
    grey(85).grey(&mut expected, 50);
    let mut frame: Vec<u16> = image.iter().copied().map(u16::from).collect();
    grey(85).frame(&mut frame, 50);
    assert!(frame.iter().zip(&expected).all(|(a, b)| *a == u16::from(*b)));
    let mut rgb: Vec<u8> = image.iter().flat_map(|v| [*v; 3]).collect();
    jpeg(85, Subsampling::S420).rgb(&mut rgb, 50);
    assert!(rgb.chunks_exact(3).zip(&expected).all(|(rgb, grey)| rgb == [*grey; 3]));
    let mut bright = [300, 255, 256, 254];
    grey(100).frame(&mut bright, 4);
    assert!(bright.iter().all(|v| (254..=255).contains(v)));
}

#[test]
fn out_of_range_values_are_rejected_by_field() {
    let error = |params: JpegParams| Jpeg::new(&params).unwrap_err().to_string();
    for quality in [0, 101, u32::MAX] {
        let params = JpegParams { quality, ..JpegParams::default() };
        assert_eq!(error(params), format!("quality is {quality}; it must be from 1 to 100"));
    }
    let params = JpegParams { bit_depth: 16, ..JpegParams::default() };
    assert_eq!(error(params), "bit_depth is 16; it must be 8, the bit depth of baseline JPEG");
    assert_eq!(JpegParams::default().subsampling, Subsampling::S420);
}
