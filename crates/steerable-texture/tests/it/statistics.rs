//! Laws of the statistics, and comparison with sums over all pixels.

#![expect(clippy::cast_possible_truncation, reason = "images are single precision")]

use steerable_texture::{Analyzer, Error, Moments, Pyramid, PyramidParams, Statistics, TextureParams};

use crate::textures::{SIDE, noise, rng, skewed, spots, walls};

fn measure(image: &[f32]) -> Statistics {
    Statistics::measure(image, SIDE, None, &TextureParams::default()).unwrap()
}

/// Returns the largest coefficient of correlation between magnitudes of a scale and the next coarser one at the same
/// orientation.
fn across_scales(statistics: &Statistics, scale: usize) -> f64 {
    let k = statistics.params.pyramid.orientations;
    let [fine, coarse] = [scale, scale + 1].map(|scale| &statistics.scales[scale]);
    let of = |i: usize| {
        let product = fine.magnitude_covariance[i * (k + 1)] * coarse.magnitude_covariance[i * (k + 1)];
        fine.magnitude_coarser[i * (k + 1)] / product.sqrt()
    };
    (0..k).map(of).fold(0.0, f64::max)
}

#[test]
fn a_mask_of_ones_changes_nothing() {
    let image = spots();
    let masked = Statistics::measure(&image, SIDE, Some(&vec![1.0; image.len()]), &TextureParams::default()).unwrap();
    assert_eq!(masked, measure(&image));
    // Also for an image that is enlarged.
    let part = &image[..100 * SIDE];
    let masked = Statistics::measure(part, SIDE, Some(&vec![1.0; part.len()]), &TextureParams::default()).unwrap();
    assert_eq!(masked, Statistics::measure(part, SIDE, None, &TextureParams::default()).unwrap());
}

#[test]
fn means_of_equal_statistics_change_nothing() {
    let a = measure(&spots());
    assert_eq!(Statistics::mean(&[(&a, 3.0)]).unwrap(), a);
    let b = measure(&walls());
    let mean = Statistics::mean(&[(&a, 1.0), (&b, 3.0)]).unwrap();
    assert!((mean.pixels.variance - 0.25 * a.pixels.variance - 0.75 * b.pixels.variance).abs() < 1e-12);
    let of = |s: &Statistics| s.scales[1].real_coarser[3];
    assert!((of(&mean) - 0.25 * of(&a) - 0.75 * of(&b)).abs() < 1e-12);
}

#[test]
fn invalid_means_are_errors() {
    let a = measure(&spots());
    let other = TextureParams { neighbourhood: 5, ..TextureParams::default() };
    let b = Statistics::measure(&spots(), SIDE, None, &other).unwrap();
    assert!(matches!(Statistics::mean(&[(&a, 1.0), (&b, 1.0)]), Err(Error::Mismatch { index: 1, .. })));
    for list in [&[][..], &[(&a, 0.0)], &[(&a, -1.0), (&a, 3.0)], &[(&a, f64::NAN)]] {
        assert_eq!(Statistics::mean(list), Err(Error::Weights));
    }
    let mut damaged = a.clone();
    damaged.scales[2].magnitude_means.pop();
    assert!(matches!(Statistics::mean(&[(&damaged, 1.0)]), Err(Error::Statistics { .. })));
    damaged = a.clone();
    damaged.high_pass_variance = -1.0;
    assert!(damaged.check().is_err());
    damaged.high_pass_variance = f64::NAN;
    assert!(damaged.check().is_err());
}

#[test]
fn pixels_outside_the_mask_do_not_count() {
    let image = walls();
    let inside = |i: usize| (i % SIDE).abs_diff(60) < 40 && (i / SIDE).abs_diff(64) < 45;
    let mask: Vec<f32> = (0..image.len()).map(|i| if inside(i) { 1.0 } else { 0.0 }).collect();
    let other: Vec<f32> = (0..image.len()).map(|i| if inside(i) { image[i] } else { f32::NAN }).collect();
    let params = TextureParams { pyramid: PyramidParams { scales: 3, orientations: 4 }, neighbourhood: 7 };
    let of = |image: &[f32]| Statistics::measure(image, SIDE, Some(&mask), &params).unwrap();
    assert_eq!(of(&image), of(&other));
}

#[test]
fn regions_have_nearly_the_statistics_of_the_texture() {
    let params = TextureParams { pyramid: PyramidParams { scales: 3, orientations: 4 }, neighbourhood: 7 };
    let of = |image: &[f32], mask: Option<&[f32]>| Statistics::measure(image, SIDE, mask, &params).unwrap();
    // Discs of 80 px in a bright surrounding, in several places.
    let images: Vec<_> = (0..6).map(noise).collect();
    let distance = |i: usize| (i % SIDE).abs_diff(64).pow(2) + (i / SIDE).abs_diff(64).pow(2);
    let mask: Vec<f32> = (0..SIDE * SIDE).map(|i| if distance(i) < 1600 { 1.0 } else { 0.0 }).collect();
    let regions: Vec<_> = images
        .iter()
        .map(|image| {
            let surrounded: Vec<f32> = image.iter().zip(&mask).map(|(v, m)| v * m + 50.0 * (1.0 - m)).collect();
            of(&surrounded, Some(&mask))
        })
        .collect();
    let mean = |list: &[Statistics]| {
        let list: Vec<_> = list.iter().map(|statistics| (statistics, 1.0)).collect();
        Statistics::mean(&list).unwrap()
    };
    let region = mean(&regions);
    let whole = mean(&images.iter().map(|image| of(image, None)).collect::<Vec<_>>());
    let close = |name: &str, a: f64, b: f64, tolerance: f64| {
        assert!((a / b - 1.0).abs() < tolerance, "{name}: {a}, {b}");
    };
    close("variance", region.pixels.variance, whole.pixels.variance, 0.05);
    // The border adds little to a residual of 0.1 % of the variance.
    let added = (region.high_pass_variance - whole.high_pass_variance) / whole.pixels.variance;
    assert!(added.abs() < 1e-3, "{added}");
    for scale in 0..2 {
        for k in 0..4 {
            let of = |s: &Statistics| s.scales[scale].magnitude_means[k];
            close("magnitudes", of(&region), of(&whole), 0.08);
            let of = |s: &Statistics| s.scales[scale].real_covariance[5 * k];
            close("variances of bands", of(&region), of(&whole), 0.15);
        }
    }
}

#[test]
fn magnitudes_of_spots_are_correlated_across_scales_and_those_of_noise_are_not() {
    let white: Vec<f32> = {
        let mut rng = rng(9);
        (0..SIDE * SIDE).map(|_| portable_numerics::random::normal(&mut rng) as f32).collect()
    };
    let noise = measure(&white);
    let spots = measure(&spots());
    for scale in 0..2 {
        // The filters of both scales overlap, which gives about 0.1. At scale 1, some 32² independent pixels have a
        // standard error of 0.03; the largest of four correlations is tested.
        assert!(across_scales(&noise, scale) < 0.2, "{}", across_scales(&noise, scale));
        assert!(across_scales(&spots, scale) > 0.4, "{}", across_scales(&spots, scale));
    }
}

#[test]
fn moments_match_direct_sums() {
    let image = skewed();
    let found = measure(&image);
    let mean = image.iter().map(|&v| f64::from(v)).sum::<f64>() / image.len() as f64;
    let moment = |power: i32| {
        let powers = image.iter().map(|&v| (0..power).fold(1.0, |p, _| p * (f64::from(v) - mean)));
        powers.sum::<f64>() / image.len() as f64
    };
    let Moments { variance, third, fourth, .. } = found.pixels;
    for (found, power) in [(variance, 2), (third, 3), (fourth, 4)] {
        assert!((found / moment(power) - 1.0).abs() < 1e-6, "{power}");
    }
    assert!(found.pixels.skewness() > 0.5);
    let range = image.iter().fold([f32::INFINITY, f32::NEG_INFINITY], |r, &v| [r[0].min(v), r[1].max(v)]);
    assert_eq!([found.min, found.max], range.map(f64::from));
}

#[test]
fn bands_have_the_sums_of_the_pyramid() {
    let image = spots();
    let found = measure(&image);
    let bands = Pyramid::new(SIDE, SIDE, &PyramidParams::default()).unwrap().decompose(&image);
    for (scale, side) in [(0, SIDE), (1, SIDE / 2)] {
        let magnitudes: Vec<Vec<f64>> = bands.oriented[scale]
            .iter()
            .map(|band| {
                let parts = band.real.iter().zip(&band.imaginary);
                let values: Vec<f64> = parts.map(|(&a, &b)| f64::from(a * a + b * b).sqrt()).collect();
                let mean = values.iter().sum::<f64>() / values.len() as f64;
                values.iter().map(|v| v - mean).collect()
            })
            .collect();
        let mean = |a: &[f64], b: &[f64], [dx, dy]: [usize; 2]| {
            let at = |i: usize| b[(i / side + dy) % side * side + (i % side + dx) % side];
            a.iter().enumerate().map(|(i, a)| a * at(i)).sum::<f64>() / a.len() as f64
        };
        let of_scale = &found.scales[scale];
        let variance = of_scale.magnitude_covariance[0];
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-4 * variance, "{a}, {b}");
        for (i, a) in magnitudes.iter().enumerate() {
            for (j, b) in magnitudes.iter().enumerate() {
                close(of_scale.magnitude_covariance[4 * i + j], mean(a, b, [0, 0]));
            }
            // (0, 0), (1, 0) ... (3, 0), (-3, 1), (-2, 1) ...
            for (index, lag) in [(0, [0, 0]), (2, [2, 0]), (4, [side - 3, 1]), (7, [0, 1]), (24, [3, 3])] {
                close(of_scale.magnitude_autocovariances[i][index], mean(a, a, lag));
            }
        }
    }
}

#[test]
fn invalid_images_are_errors() {
    let params = TextureParams::default();
    let measure = |image: &[f32], width, mask: Option<&[f32]>| Statistics::measure(image, width, mask, &params);
    let mut image = spots();
    assert!(matches!(measure(&image, 100, None), Err(Error::Shape { width: 100, .. })));
    assert!(matches!(measure(&image, 0, None), Err(Error::Shape { .. })));
    assert!(matches!(measure(&image, SIDE, Some(&[1.0])), Err(Error::Shape { mask: 1, .. })));
    assert_eq!(measure(&image, SIDE, Some(&vec![0.0; image.len()])), Err(Error::EmptyMask));
    assert!(matches!(measure(&[], SIDE, None), Err(Error::EmptyMask)));
    let mut mask = vec![1.0; image.len()];
    mask[3] = 1.5;
    assert_eq!(measure(&image, SIDE, Some(&mask)), Err(Error::Mask { index: 3, value: 1.5 }));
    image[7] = f32::INFINITY;
    assert_eq!(measure(&image, SIDE, None), Err(Error::Pixel { index: 7, value: f32::INFINITY }));
    let analyzer = Analyzer::new(SIDE, 2 * SIDE, &params).unwrap();
    assert!(matches!(analyzer.measure(&[0.0; SIDE * SIDE], None), Err(Error::Shape { .. })));
    assert!(matches!(Analyzer::new(64, 64, &params), Err(Error::Side { least: 128, .. })));
}

#[cfg(feature = "serde")]
#[test]
fn files_are_checked() {
    let statistics = measure(&spots());
    let text = serde_json::to_string(&statistics).unwrap();
    assert_eq!(serde_json::from_str::<Statistics>(&text).unwrap(), statistics);
    let mut value: serde_json::Value = serde_json::from_str(&text).unwrap();
    value["low_pass"].as_array_mut().unwrap().pop();
    let error = serde_json::from_value::<Statistics>(value).unwrap_err().to_string();
    assert_eq!(error, "low_pass of the statistics: expected 5 entries");
}
