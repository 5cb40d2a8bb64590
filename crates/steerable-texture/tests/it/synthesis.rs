//! Synthesized textures have the statistics they were synthesized from.

#![expect(clippy::cast_possible_truncation, reason = "images are single precision")]

use portable_numerics::random::{between, normal};
use steerable_texture::{Error, PyramidParams, Statistics, SynthesisParams, Synthesizer, TextureParams};

use crate::textures::{SIDE, noise, rng, skewed, spots, stripes, walls};

fn synthesizer(iterations: usize) -> Synthesizer {
    Synthesizer::new(SIDE, SIDE, &SynthesisParams { iterations, ..SynthesisParams::default() }).unwrap()
}

fn measure(image: &[f32]) -> Statistics {
    Statistics::measure(image, SIDE, None, &TextureParams::default()).unwrap()
}

/// Returns the root-mean-square difference of two lists as a fraction of a variance.
fn difference(a: &[f64], b: &[f64], variance: f64) -> f64 {
    let squares: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    (squares / a.len().max(1) as f64).sqrt() / variance
}

#[test]
fn synthesized_textures_have_the_target_statistics() {
    let textures =
        [("spots", spots()), ("stripes", stripes()), ("walls", walls()), ("noise", noise(4)), ("skewed", skewed())];
    for (name, texture) in textures {
        let target = measure(&texture);
        let image = synthesizer(25).synthesize(&target, &mut rng(1)).unwrap();
        let found = measure(&image);
        let close = |what: &str, a: f64, tolerance: f64| assert!(a.abs() < tolerance, "{name}: {what} differs by {a}");
        close("mean", (found.pixels.mean - target.pixels.mean) / target.pixels.variance.sqrt(), 0.02);
        close("variance", found.pixels.variance / target.pixels.variance - 1.0, 0.03);
        close("skewness", found.pixels.skewness() - target.pixels.skewness(), 0.05);
        close("kurtosis", found.pixels.kurtosis() / target.pixels.kurtosis() - 1.0, 0.05);
        assert!(found.min >= target.min && found.max <= target.max);
        let total = target.pixels.variance;
        for (found, target) in found.low_pass.iter().zip(&target.low_pass) {
            close("autocovariance", difference(&found.autocovariance, &target.autocovariance, total), 0.02);
        }
        for (scale, (found, target)) in found.scales.iter().zip(&target.scales).enumerate() {
            let variance = |values: &[f64]| values.iter().step_by(5).sum::<f64>() / 4.0;
            let (magnitude, real) = (variance(&target.magnitude_covariance), variance(&target.real_covariance));
            // Bands that contain nearly nothing.
            if real < 1e-3 * total {
                continue;
            }
            let check = |what: &str, a: &[f64], b: &[f64], unit: f64, tolerance: f64| {
                close(&format!("{what} of scale {scale}"), difference(a, b, unit), tolerance);
            };
            check("magnitudes", &found.magnitude_means, &target.magnitude_means, real.sqrt(), 0.05);
            check("magnitudes", &found.magnitude_covariance, &target.magnitude_covariance, magnitude, 0.1);
            check("coarser magnitudes", &found.magnitude_coarser, &target.magnitude_coarser, magnitude, 0.1);
            check("real parts", &found.real_covariance, &target.real_covariance, real, 0.05);
            check("coarser phases", &found.real_coarser, &target.real_coarser, real, 0.05);
            for (found, target) in found.magnitude_autocovariances.iter().zip(&target.magnitude_autocovariances) {
                check("autocovariance of magnitudes", found, target, magnitude, 0.15);
            }
        }
    }
}

#[test]
fn the_same_seed_gives_the_same_image() {
    let target = measure(&walls());
    let synthesizer = synthesizer(3);
    let draw = |seed| synthesizer.synthesize(&target, &mut rng(seed)).unwrap();
    assert_eq!(draw(1), draw(1));
    assert_ne!(draw(1), draw(2));
}

#[test]
fn the_size_and_the_unit_may_differ_from_those_of_the_source() {
    let texture = spots();
    let params = SynthesisParams { iterations: 10, ..SynthesisParams::default() };
    let synthesizer = Synthesizer::new(256, 128, &params).unwrap();
    for (offset, factor) in [(0.0, 1.0), (-3.0, 1e-5), (1e3, 1e5)] {
        let scaled: Vec<f32> = texture.iter().map(|v| offset + factor * v).collect();
        let target = measure(&scaled);
        let image = synthesizer.synthesize(&target, &mut rng(3)).unwrap();
        assert_eq!(image.len(), 256 * 128);
        let found = Statistics::measure(&image, 256, None, &TextureParams::default()).unwrap();
        assert!((found.pixels.variance / target.pixels.variance - 1.0).abs() < 0.1, "{offset}, {factor}");
    }
}

#[test]
fn constant_images_stay_constant() {
    let target = measure(&vec![0.25; SIDE * SIDE]);
    let image = synthesizer(3).synthesize(&target, &mut rng(1)).unwrap();
    assert!(image.iter().all(|v| (v - 0.25).abs() < 1e-6));
}

#[test]
fn degenerate_images_give_finite_textures() {
    let single = |i: usize| if i == 777 { 1.0 } else { 0.0 };
    let step = |i: usize| if i % SIDE < 64 { 1.0 } else { -1.0 };
    let wave = |i: usize| libm::sinf(core::f32::consts::TAU * (i % SIDE) as f32 / 16.0);
    let alternating = |i: usize| if (i + i / SIDE).is_multiple_of(2) { 1.0 } else { 0.0 };
    let tiny = |i: usize| 1.0 + 1e-7 * (i % 3) as f32;
    let images: [&dyn Fn(usize) -> f32; 5] = [&single, &step, &wave, &alternating, &tiny];
    let list: Vec<_> = images.iter().map(|image| measure(&(0..SIDE * SIDE).map(image).collect::<Vec<_>>())).collect();
    let mean = Statistics::mean(&list.iter().map(|statistics| (statistics, 1.0)).collect::<Vec<_>>()).unwrap();
    for target in list.iter().chain([&mean]) {
        let image = synthesizer(6).synthesize(target, &mut rng(5)).unwrap();
        assert!(image.iter().all(|v| (target.min as f32..=target.max as f32).contains(v)));
    }
}

#[test]
fn inconsistent_statistics_give_finite_textures() {
    let params = TextureParams { pyramid: PyramidParams { scales: 2, orientations: 3 }, neighbourhood: 5 };
    let image: Vec<f32> = noise(6)[..64 * 64].to_vec();
    let target = Statistics::measure(&image, 64, None, &params).unwrap();
    let synthesizer = Synthesizer::new(64, 64, &SynthesisParams { texture: params, iterations: 5 }).unwrap();
    for seed in 0..40 {
        let mut rng = rng(seed);
        let mut damaged = target.clone();
        let strength = [0.1, 1.0, 100.0, 1e12][(seed % 4) as usize];
        let fourth = between(0.0, 2.0, &mut rng);
        let mut change = |v: &mut f64| *v += strength * normal(&mut rng) * (v.abs() + 0.01);
        for scale in &mut damaged.scales {
            scale.magnitude_autocovariances.iter_mut().flatten().for_each(&mut change);
            for list in [&mut scale.magnitude_means, &mut scale.magnitude_coarser, &mut scale.real_coarser] {
                list.iter_mut().for_each(&mut change);
            }
            for list in [&mut scale.magnitude_covariance, &mut scale.real_covariance] {
                list.iter_mut().for_each(&mut change);
                list.iter_mut().step_by(4).for_each(|v| *v = v.abs());
            }
        }
        for low_pass in &mut damaged.low_pass {
            low_pass.autocovariance.iter_mut().for_each(&mut change);
            change(&mut low_pass.moments.third);
            low_pass.moments.fourth *= fourth;
        }
        let image = synthesizer.synthesize(&damaged, &mut rng).unwrap();
        assert!(image.iter().all(|v| v.is_finite()), "{seed}");
    }
}

#[test]
fn statistics_with_other_parameters_are_errors() {
    let params = TextureParams { neighbourhood: 5, ..TextureParams::default() };
    let target = Statistics::measure(&spots(), SIDE, None, &params).unwrap();
    let error = synthesizer(1).synthesize(&target, &mut rng(1)).unwrap_err();
    assert_eq!(error, Error::Mismatch { index: 0, scales: 4, orientations: 4, neighbourhood: 7 });
}
