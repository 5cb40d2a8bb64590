//! Tests of the Gaussian blur: invariants, and fast methods against slow references.

use optics_psf::{Border, Error, Gaussian, Method, Scratch};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

const SEED: u64 = 0x0b1a_f0c5;
const WIDTHS: [f64; 7] = [0.0, 0.05, 0.2, 0.5, 0.9, 3.6, 20.0];
const BORDERS: [Border; 3] = [Border::Zero, Border::Reflect, Border::Replicate];

fn direct(sigma_px: f64) -> Gaussian {
    Gaussian::truncated(sigma_px, Method::Direct, 1e-7).unwrap()
}

fn noise(len: usize) -> Vec<f32> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(SEED);
    (0..len).map(|_| (rng.next_u32() >> 8) as f32 / 16_777_216.0).collect()
}

fn largest_difference(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

fn transposed(image: &[f32], width: usize) -> Vec<f32> {
    (0..width).flat_map(|x| image.iter().skip(x).step_by(width).copied()).collect()
}

/// Reference: two-dimensional convolution in double precision, one pixel at a time.
fn oracle(image: &[f32], width: usize, border: Border, gaussian: &Gaussian) -> Vec<f64> {
    let (w, h) = (width.cast_signed(), (image.len() / width).cast_signed());
    let r = gaussian.radius().cast_signed();
    let fold = |i: isize, n: isize| match border {
        Border::Zero => Some(i).filter(|i| (0..n).contains(i)),
        Border::Replicate => Some(i.clamp(0, n - 1)),
        Border::Reflect => Some(i.rem_euclid(2 * n).min(2 * n - 1 - i.rem_euclid(2 * n))),
    };
    let tap = |i: isize| gaussian.taps()[i.unsigned_abs()];
    let pixel = |x: isize, y: isize| f64::from(image[(y * w + x).cast_unsigned()]);
    let at = |x, y| fold(x, w).zip(fold(y, h)).map_or(0.0, |(x, y)| pixel(x, y));
    let row = |x, y| (-r..=r).map(|i| tap(i) * at(x + i, y)).sum::<f64>();
    let sum = |x, y| (-r..=r).map(|j| tap(j) * row(x, y + j)).sum::<f64>();
    (0..h).flat_map(|y| (0..w).map(move |x| (x, y))).map(|(x, y)| sum(x, y)).collect()
}

#[test]
fn direct_matches_convolution() {
    for (width, height) in [(1, 1), (1, 9), (7, 1), (5, 4), (33, 20), (150, 9), (19, 70)] {
        let image = noise(width * height);
        for sigma in [0.05, 0.5, 0.9, 2.3] {
            let gaussian = direct(sigma);
            for border in BORDERS {
                let fast = gaussian.blur(&image, width, border);
                let slow = oracle(&image, width, border, &gaussian);
                let difference = |(a, b): (&f32, &f64)| (f64::from(*a) - b).abs();
                let error = fast.iter().zip(&slow).map(difference).fold(0.0, f64::max);
                assert!(error < 3e-7, "{width} x {height}, {sigma}, {border:?}: {error}");
            }
        }
    }
}

#[test]
fn zero_sigma_is_the_identity() {
    let image = noise(200 * 30);
    for border in BORDERS {
        assert_eq!(direct(0.0).blur(&image, 200, border), image);
    }
    assert_eq!(direct(0.0).blur_expanded(&image, 200), (image, 0));
}

#[test]
fn constants_are_preserved() {
    for sigma in WIDTHS {
        for method in [Method::Direct, Method::Decimated, Method::Auto] {
            let gaussian = Gaussian::truncated(sigma, method, 1e-7).unwrap();
            for border in [Border::Reflect, Border::Replicate] {
                let blurred = gaussian.blur(&vec![0.7; 61 * 47], 61, border);
                let error = largest_difference(&blurred, &vec![0.7; 61 * 47]);
                assert!(error < 4e-7, "{sigma}, {method:?}, {border:?}: {error}");
            }
        }
    }
}

#[test]
fn sum_is_conserved() {
    let sum = |image: &[f32]| image.iter().copied().map(f64::from).sum::<f64>();
    let image = noise(61 * 47);
    for sigma in WIDTHS {
        for method in [Method::Direct, Method::Decimated, Method::Auto] {
            let gaussian = Gaussian::truncated(sigma, method, 1e-7).unwrap();
            let spread = sum(&gaussian.blur_expanded(&image, 61).0) / sum(&image) - 1.0;
            assert!(spread.abs() < 1e-6, "{sigma}, {method:?}: {spread}");
        }
        let reflected = sum(&direct(sigma).blur(&image, 61, Border::Reflect)) / sum(&image) - 1.0;
        assert!(reflected.abs() < 3e-7, "{sigma}: {reflected}");
    }
}

/// Returns variance along x of the impulse response, and distance of its mean from the impulse.
fn response(gaussian: &Gaussian, x: usize, y: usize) -> [f64; 2] {
    let mut image = vec![0.0; 17 * 17];
    image[y * 17 + x] = 1.0;
    let (spread, margin) = gaussian.blur_expanded(&image, 17);
    let wide = 17 + 2 * margin;
    let moment = |p: i32| {
        let weigh = |(i, v): (usize, &f32)| {
            let d = (i % wide) as f64 - (x + margin) as f64;
            f64::from(*v) * (0..p).fold(1.0, |m, _| m * d)
        };
        spread.iter().enumerate().map(weigh).sum::<f64>()
    };
    [moment(2) / moment(0), moment(1) / moment(0)]
}

#[test]
fn impulse_response_has_the_requested_variance() {
    for sigma in WIDTHS.into_iter().chain([0.01, 1.7, 8.0]) {
        let [variance, mean] = response(&direct(sigma), 8, 8);
        assert!((variance - sigma * sigma).abs() <= 2e-6 * sigma * sigma, "{sigma}: {variance}");
        assert!(mean.abs() < 1e-6 * sigma.max(0.01), "{sigma}: {mean}");
    }
}

#[test]
fn decimated_keeps_the_variance_at_every_phase() {
    for sigma in [2.81, 3.6, 5.0, 12.0, 20.0, 33.3] {
        let gaussian = Gaussian::truncated(sigma, Method::Decimated, 1e-7).unwrap();
        for (x, y) in (0..17).map(|i| (i, 16 - i)) {
            let [variance, mean] = response(&gaussian, x, y);
            let error = variance / (sigma * sigma) - 1.0;
            assert!(error.abs() < 2e-5, "{sigma} at {x}: {error}");
            assert!(mean.abs() < 1e-5 * sigma, "{sigma} at {x}: {mean}");
        }
    }
}

#[test]
fn successive_blurs_add_their_variances() {
    // Error for a unit impulse, relative to the highest pixel. Narrow kernels on a lattice are not closed under
    // convolution; wide kernels are.
    let widths = [
        (0.1, 0.2, 2e-3),
        (0.5, 0.5, 0.13),
        (0.7, 0.9, 1e-2),
        (0.9, 0.9, 1.4e-3),
        (0.9, 1.2, 2e-4),
        (1.5, 1.5, 1e-6),
        (3.0, 4.0, 1e-6),
    ];
    for (a, b, bound) in widths {
        let mut image = vec![0.0; 81 * 81];
        image[40 * 81 + 40] = 1.0;
        let twice = direct(a).blur(&direct(b).blur(&image, 81, Border::Zero), 81, Border::Zero);
        let once = direct(f64::sqrt(a * a + b * b)).blur(&image, 81, Border::Zero);
        let error = largest_difference(&once, &twice) / once[40 * 81 + 40];
        assert!(error < bound, "{a} then {b}: {error}");
    }
}

#[test]
fn mirrored_images_give_mirrored_blurs() {
    let (width, height) = (141, 75);
    let image = noise(width * height);
    let mirrored = |i: &[f32]| -> Vec<f32> { i.chunks(width).flat_map(|r| r.iter().rev().copied()).collect() };
    let flipped = |i: &[f32]| -> Vec<f32> { i.chunks(width).rev().flatten().copied().collect() };
    for sigma in [0.3, 0.9, 3.6] {
        for border in BORDERS {
            let blur = |i: &[f32]| direct(sigma).blur(i, width, border);
            let blurred = blur(&image);
            assert_eq!(blur(&mirrored(&image)), mirrored(&blurred));
            assert_eq!(blur(&flipped(&image)), flipped(&blurred));
            let turned = direct(sigma).blur(&transposed(&image, width), height, border);
            let error = largest_difference(&turned, &transposed(&blurred, width));
            assert!(error < 3e-7, "{sigma}, {border:?}: {error}");
        }
    }
}

#[test]
fn shifted_objects_give_shifted_blurs() {
    let (tile, wide) = (noise(40 * 40), 400);
    let placed = |x: usize, y: usize| {
        let mut image = vec![0.0; wide * 120];
        for (j, row) in tile.chunks(40).enumerate() {
            image[(y + j) * wide + x..][..40].copy_from_slice(row);
        }
        image
    };
    let cut = |image: &[f32], x: usize, y: usize| -> Vec<f32> {
        image.chunks(wide).skip(y - 30).take(100).flat_map(|r| r[x - 30..x + 70].to_vec()).collect()
    };
    let blurred = |gaussian: &Gaussian, x, y| cut(&gaussian.blur(&placed(x, y), wide, Border::Zero), x, y);
    for (x, y) in [(31, 30), (77, 41), (203, 50), (330, 33)] {
        let exact = direct(4.0);
        assert_eq!(blurred(&exact, x, y), blurred(&exact, 30, 30));
        let near = Gaussian::truncated(5.0, Method::Decimated, 1e-7).unwrap();
        let error = largest_difference(&blurred(&near, x, y), &blurred(&near, 30, 30));
        assert!(error < 2e-4, "at {x}, {y}: {error}");
    }
}

#[test]
fn blur_expanded_matches_a_blur_in_an_empty_frame() {
    for (width, height) in [(3, 5), (50, 41), (130, 20)] {
        let tile = noise(width * height);
        for sigma in [0.05, 0.9, 3.6] {
            let gaussian = direct(sigma);
            let (spread, margin) = gaussian.blur_expanded(&tile, width);
            let wide = width + 2 * margin;
            let mut frame = vec![0.0; wide * (height + 2 * margin)];
            for (j, row) in tile.chunks(width).enumerate() {
                frame[(margin + j) * wide + margin..][..width].copy_from_slice(row);
            }
            assert_eq!(margin, gaussian.radius());
            assert_eq!(spread, gaussian.blur(&frame, wide, Border::Zero));
        }
    }
}

/// Returns white noise, a corner, a small disc and a smooth ramp, all from 0 to 1.
fn phantoms(width: usize, height: usize) -> [Vec<f32>; 4] {
    let image = |f: &dyn Fn(f32, f32) -> f32| -> Vec<f32> {
        (0..width * height).map(|i| f((i % width) as f32, (i / width) as f32)).collect()
    };
    let disc = |x: f32, y: f32| {
        let (x, y) = (x - 140.3, y - 110.8);
        (30.5 - (x * x + y * y).sqrt()).clamp(0.0, 1.0)
    };
    [
        noise(width * height),
        image(&|x, y| f32::from(u8::from(x > 123.0 && y > 77.0))),
        image(&disc),
        image(&|x, y| (x + y) / (width + height) as f32),
    ]
}

#[test]
fn decimated_matches_direct() {
    let (width, height) = (301, 219);
    let images = phantoms(width, height);
    let mut scratch = Scratch::new();
    for (method, bound, widths) in
        [(Method::Decimated, 1e-3, [2.81, 3.3, 5.7, 8.0]), (Method::Auto, 2e-4, [3.5, 6.0, 7.2, 20.0])]
    {
        for sigma in widths {
            let fast = Gaussian::truncated(sigma, method, 1e-7).unwrap();
            for border in BORDERS {
                for (i, image) in images.iter().enumerate() {
                    let mut blurred = vec![0.0; image.len()];
                    fast.blur_into(image, width, border, &mut blurred, &mut scratch);
                    let exact = direct(sigma).blur(image, width, border);
                    let error = largest_difference(&blurred, &exact);
                    assert!(error < bound, "{sigma}, {border:?}, phantom {i}: {error}");
                    assert_ne!(blurred, exact, "{sigma} was not decimated");
                }
            }
            let (spread, _) = fast.blur_expanded(&images[2], width);
            let error = largest_difference(&spread, &direct(sigma).blur_expanded(&images[2], width).0);
            assert!(error < bound, "{sigma}, spread: {error}");
        }
    }
}

#[test]
fn decimation_error_is_bounded_for_every_image() {
    let width = 161;
    for (method, sigma, bound) in [
        (Method::Decimated, 2.81, 1e-3),
        (Method::Decimated, 5.7, 1e-3),
        (Method::Auto, 3.5, 2e-4),
        (Method::Auto, 7.2, 2e-4),
    ] {
        let fast = Gaussian::truncated(sigma, method, 1e-7).unwrap();
        // Largest error of each pixel of a row, with the worst values of all other pixels.
        let mut worst = vec![0.0; width];
        for x in 0..width {
            let mut row = vec![0.0; width];
            row[x] = 1.0;
            let [fast, exact] = [&fast, &direct(sigma)].map(|gaussian| gaussian.blur(&row, width, Border::Replicate));
            worst.iter_mut().zip(fast.iter().zip(&exact)).for_each(|(sum, (a, b))| *sum += (a - b).abs());
        }
        // Half of it for a range of 1, along both axes.
        let error = worst.iter().copied().fold(0.0, f32::max);
        assert!(error < bound, "{sigma}: {error}");
    }
}

#[test]
fn narrow_kernels_are_never_decimated() {
    let image = noise(100 * 80);
    for (method, sigma) in [(Method::Decimated, 2.79), (Method::Auto, 3.46)] {
        let gaussian = Gaussian::truncated(sigma, method, 1e-7).unwrap();
        let exact = direct(sigma).blur(&image, 100, Border::Reflect);
        assert_eq!(gaussian.blur(&image, 100, Border::Reflect), exact);
    }
}

#[test]
fn blurred_rows_match_the_complete_blur() {
    let (width, height) = (150, 43);
    let image = noise(width * height);
    let mut scratch = Scratch::new();
    for sigma in [0.0, 0.9, 3.6, 20.0] {
        for border in BORDERS {
            let whole = direct(sigma).blur(&image, width, border);
            for (first, rows) in [(0, 1), (0, 43), (5, 16), (42, 1), (43, 0)] {
                let mut part = vec![f32::NAN; rows * width];
                let gaussian = Gaussian::new(sigma).unwrap();
                gaussian.blur_rows_into(&image, width, border, first, &mut part, &mut scratch);
                assert_eq!(part, whole[first * width..][..part.len()], "{sigma}, {border:?}, {first}");
            }
        }
    }
}

#[test]
#[should_panic(expected = "exceed the 3 rows of the image")]
fn rows_beyond_the_image_panic() {
    direct(1.0).blur_rows_into(&[0.0; 9], 3, Border::Zero, 2, &mut [0.0; 6], &mut Scratch::new());
}

#[test]
fn truncation_error_is_bounded_by_the_lost_tail() {
    let (width, height) = (301, 219);
    let images = phantoms(width, height);
    for (lost_tail, shorter) in [(1e-5, 0.9), (1e-4, 0.75), (1e-3, 0.65)] {
        for sigma in [0.9, 2.3, 3.4, 8.0] {
            let (exact, short) = (direct(sigma), Gaussian::truncated(sigma, Method::Direct, lost_tail).unwrap());
            assert!((short.radius() as f64) < shorter * exact.radius() as f64 + 0.5, "{sigma}, {lost_tail}");
            let variance: f64 = short.taps().iter().enumerate().map(|(n, w)| 2.0 * (n * n) as f64 * w).sum();
            assert!((variance / (sigma * sigma) - 1.0).abs() < 1e-12, "{sigma}, {lost_tail}: {variance}");
            for image in &images {
                let blur = |gaussian: &Gaussian| gaussian.blur(image, width, Border::Reflect);
                let error = f64::from(largest_difference(&blur(&short), &blur(&exact)));
                // The worst image has 5.2 times this error along each axis.
                assert!(error < 5.0 * lost_tail, "{sigma}, {lost_tail}: {error}");
            }
        }
    }
    // Decimated kernels are truncated in the same way.
    for lost_tail in [1e-4, 1e-3, 1e-2] {
        for sigma in [3.5, 5.1, 8.0] {
            let short = Gaussian::truncated(sigma, Method::Auto, lost_tail).unwrap();
            for image in &images {
                let blur = |gaussian: &Gaussian| gaussian.blur(image, width, Border::Reflect);
                let error = f64::from(largest_difference(&blur(&short), &blur(&direct(sigma))));
                assert!(error < 5.0 * lost_tail + 2e-4, "{sigma}, {lost_tail}: {error}");
            }
        }
    }
    assert_eq!(Gaussian::truncated(2.0, Method::Auto, 1e-7), Gaussian::new(2.0));
    for bad in [0.0, 9e-8, 0.02, f64::NAN] {
        let error = Gaussian::truncated(1.0, Method::Auto, bad).unwrap_err();
        assert!(matches!(error, Error::OutOfRange { field: "lost_tail", .. }), "{error}");
    }
}

#[test]
fn scratch_does_not_affect_results() {
    let mut scratch = Scratch::new();
    for (width, height, sigma) in [(300, 200, 20.0), (40, 30, 3.6), (131, 90, 9.9), (7, 5, 0.9), (90, 90, 30.0)] {
        let image = noise(width * height);
        let gaussian = Gaussian::new(sigma).unwrap();
        for border in BORDERS {
            let mut reused = vec![f32::NAN; image.len()];
            gaussian.blur_into(&image, width, border, &mut reused, &mut scratch);
            assert_eq!(reused, gaussian.blur(&image, width, border));
        }
    }
}

#[test]
fn impossible_widths_are_refused() {
    for bad in [-0.1, f64::NAN, f64::INFINITY, 4097.0] {
        let error = Gaussian::new(bad).unwrap_err();
        assert!(matches!(error, Error::OutOfRange { field: "sigma_px", .. }), "{error}");
        assert!(error.to_string().contains("from 0 to 4096"), "{error}");
    }
    assert_eq!(Gaussian::new(3.0).unwrap().sigma_px(), 3.0);
}

#[test]
#[should_panic(expected = "not a multiple of the width")]
fn incomplete_rows_panic() {
    let _ = direct(1.0).blur(&[0.0; 10], 3, Border::Zero);
}

#[test]
#[should_panic(expected = "`dst` has the wrong number of pixels")]
fn short_destinations_panic() {
    direct(1.0).blur_into(&[0.0; 9], 3, Border::Zero, &mut [0.0; 6], &mut Scratch::new());
}

/// Pins the output bytes, independent of vector instructions.
#[test]
fn bits_are_pinned() {
    let image = noise(211 * 97);
    let hashes = [0.9, 3.6, 5.0, 20.0].map(|sigma| {
        let blurred = Gaussian::new(sigma).unwrap().blur(&image, 211, Border::Reflect);
        blurred
            .iter()
            .fold(0xcbf2_9ce4_8422_2325_u64, |h, v| (h ^ u64::from(v.to_bits())).wrapping_mul(0x100_0000_01b3))
    });
    let pinned = [0xaa80_296c_a49d_52eb, 0xa6ce_186d_ee65_fb97, 0x8ca3_143f_beb4_38f2, 0x9a29_6d97_e221_d2af];
    assert_eq!(hashes, pinned);
}
