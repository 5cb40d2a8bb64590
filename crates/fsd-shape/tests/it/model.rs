//! Tests of the shape model, on synthetic outlines.

use crate::support;
use std::f64::consts::TAU;

use fsd_shape::{
    CovarianceModel, Descriptors, Error, Point, PrincipalComponent, Residual, ShapeModel, ShapeModelParams,
    ShapeStatistics, resample, self_intersects, signed_area,
};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

fn rng(seed: u64) -> Xoshiro256PlusPlus {
    Xoshiro256PlusPlus::seed_from_u64(seed)
}

fn cells() -> Vec<Vec<Point>> {
    support::polygons(60, 100.0, &support::CELL, &mut rng(0xCE11))
}

fn params(harmonics: usize, covariance: CovarianceModel) -> ShapeModelParams {
    ShapeModelParams { harmonics, covariance }
}

/// Returns the statistics of circles.
fn circles(harmonics: usize) -> ShapeStatistics {
    let mut mean = vec![0.0; 4 * harmonics];
    mean[2 * harmonics] = 1.0;
    ShapeStatistics {
        harmonics,
        outlines: 3,
        ln_radius_mean: 2.0,
        ln_radius_sd: 0.1,
        mean,
        components: Vec::new(),
        residual: Residual::Descriptors,
        residual_sd: vec![0.0; 4 * harmonics],
        roughness_sd: 0.0,
        local_roughness: 0.0,
    }
}

#[test]
fn default_and_paper_parameters() {
    assert_eq!(ShapeModelParams::default(), params(40, CovarianceModel::Shrinkage { lambda: 0.1 }));
    assert_eq!(ShapeModelParams::paper_nucleus(), params(4, CovarianceModel::Independent));
    // All descriptors of the paper's K = 420 points, except u_{K/2}.
    assert_eq!(ShapeModelParams::paper_cytoplasm(), params(420 / 2 - 1, CovarianceModel::Independent));
}

#[test]
fn draws_are_simple_centred_and_of_the_requested_size() {
    let outlines = cells();
    for params in [
        ShapeModelParams::default(),
        params(8, CovarianceModel::Shrinkage { lambda: 0.1 }),
        params(40, CovarianceModel::Independent),
        params(1, CovarianceModel::Shrinkage { lambda: 0.0 }),
        params(3, CovarianceModel::Shrinkage { lambda: 1.0 }),
    ] {
        let model = ShapeModel::fit(&outlines, &params).unwrap();
        let mut rng = rng(0xD4A3);
        for radius in [0.5, 20.0, 400.0] {
            for _ in 0..50 {
                let draw = model.draw(radius, &mut rng).unwrap();
                assert_eq!(draw.descriptors.harmonics(), params.harmonics);
                assert_eq!(draw.descriptors.harmonic(0), [0.0, 0.0]);
                assert!((draw.descriptors.radius() / radius - 1.0).abs() < 1e-12);
                assert!(draw.descriptors.area() > 0.0);
                let outline = draw.descriptors.outline(420);
                assert!(signed_area(&outline) > 0.0);
                assert!(!self_intersects(&outline));
            }
        }
    }
}

#[test]
fn the_same_seed_draws_the_same_shape() {
    let model = ShapeModel::fit(&cells(), &ShapeModelParams::default()).unwrap();
    let again = ShapeModel::from_statistics(model.statistics().clone()).unwrap();
    assert_eq!(again, model);
    assert_eq!(model.draw(30.0, &mut rng(5)), again.draw(30.0, &mut rng(5)));
    assert_ne!(model.draw(30.0, &mut rng(5)), model.draw(30.0, &mut rng(6)));
}

#[test]
fn a_model_does_not_depend_on_orientation_start_position_or_rotation() {
    // Outlines with an unambiguous pose.
    let clear = |outline: &Vec<Point>| {
        let aligned = Descriptors::from_outline(&resample(outline, 512)).unwrap().normalised().aligned();
        aligned.harmonic(2)[0] > 0.005 && aligned.magnitude(-1) > 0.02
    };
    let outlines: Vec<Vec<Point>> = cells().into_iter().filter(clear).collect();
    assert!(outlines.len() > 20);
    let (sin, cos) = libm::sincos(1.1);
    let moved: Vec<Vec<Point>> = outlines
        .iter()
        .map(|outline| {
            let turn = |p: &Point| [cos * p[0] - sin * p[1] + 500.0, sin * p[0] + cos * p[1] - 70.0];
            outline.iter().rev().map(turn).collect()
        })
        .collect();
    let one = ShapeModel::fit(&outlines, &params(12, CovarianceModel::Shrinkage { lambda: 0.1 })).unwrap();
    let other = ShapeModel::fit(&moved, &params(12, CovarianceModel::Shrinkage { lambda: 0.1 })).unwrap();
    let (one, other) = (one.statistics(), other.statistics());
    assert!((one.ln_radius_mean - other.ln_radius_mean).abs() < 1e-3);
    // Start points differ by less than a sample, which slightly changes high harmonics.
    for (a, b) in one.mean.iter().zip(&other.mean) {
        assert!((a - b).abs() < 1e-3, "{a} {b}");
    }
}

/// Compares second moments of normalised, aligned draws with those of the statistics.
#[test]
fn draws_reproduce_the_fitted_variances() {
    let harmonics = 6;
    let model = ShapeModel::fit(&cells(), &params(harmonics, CovarianceModel::Shrinkage { lambda: 0.1 })).unwrap();
    // Small deviations, so that no draw is rejected and the alignment is unambiguous.
    let mut statistics = model.statistics().clone();
    for value in statistics.components.iter_mut().flat_map(|c| &mut c.loading).chain(&mut statistics.residual_sd) {
        *value *= 0.05;
    }
    statistics.roughness_sd = 0.0;
    statistics.mean[2 * harmonics - 2] = 0.3;
    statistics.mean[2 * harmonics + 2] = 0.2;
    let mut expected: Vec<f64> = vec![0.0; 4 * harmonics];
    for component in &statistics.components {
        for (k, v) in component.loading.iter().enumerate() {
            expected[k] += v * v;
        }
    }
    // The residual in steps, transformed to descriptors; see `Residual::Steps`.
    for l in 1..=harmonics {
        let (high, low) = (2 * (harmonics + l - 1), 2 * (harmonics - l));
        let sd = &statistics.residual_sd;
        let paired = |l: i64| l >= 4 || (l <= -2 && l >= 2 - harmonics as i64);
        for k in 0..2 {
            if paired(l as i64) {
                let m = l - 1;
                let step = 2 * (harmonics + 1 - m);
                let (d, s) = (sd[high + 1 - k], sd[step + k]);
                expected[high + k] += (d * d + s * s) / (l * l) as f64;
            } else {
                expected[high + k] += sd[high + k] * sd[high + k];
            }
            if paired(-(l as i64)) {
                let m = l + 1;
                let direction = 2 * (harmonics + m);
                let (d, s) = (sd[direction + 1 - k], sd[low + k]);
                expected[low + k] += (d * d + s * s) / (l * l) as f64;
            } else {
                expected[low + k] += sd[low + k] * sd[low + k];
            }
        }
    }
    let model = ShapeModel::from_statistics(statistics.clone()).unwrap();
    let mut rng = rng(0x7A2);
    let draws = 20_000;
    let mut squares = vec![0.0; 4 * harmonics];
    for _ in 0..draws {
        let draw = model.draw(1.0, &mut rng).unwrap();
        assert_eq!(draw.rejected, 0);
        let aligned = draw.descriptors.aligned();
        let terms = aligned.as_slice().iter().enumerate().filter(|&(k, _)| k != harmonics);
        for (k, v) in terms.flat_map(|(_, u)| *u).enumerate() {
            squares[k] += (v - statistics.mean[k]) * (v - statistics.mean[k]);
        }
    }
    for (k, (sum, expected)) in squares.iter().zip(&expected).enumerate() {
        let variance = sum / f64::from(draws);
        // Four standard errors of a variance, widened for the kurtosis of the scores (up to 6), and 2 % for
        // nonlinearity.
        let bound = expected * (4.0 * (8.0 / f64::from(draws)).sqrt() + 0.02) + 1e-20;
        assert!((variance - expected).abs() < bound, "coordinate {k}: {variance} for {expected}");
    }
}

#[test]
fn roughness_varies_detail_and_preserves_its_mean_square() {
    let fine = |d: &Descriptors| -> f64 {
        (9..=40).flat_map(|l| [d.magnitude(l), d.magnitude(-l)]).map(|m| m * m).sum::<f64>()
    };
    let spread = |statistics: &ShapeStatistics| {
        let model = ShapeModel::from_statistics(statistics.clone()).unwrap();
        let mut rng = rng(0x20C);
        let values: Vec<f64> = (0..3000).map(|_| fine(&model.draw(1.0, &mut rng).unwrap().descriptors)).collect();
        support::mean_and_sd(&values)
    };
    let mut statistics = circles(40);
    for (k, sd) in statistics.residual_sd.iter_mut().enumerate() {
        if (k / 2).abs_diff(40) > 2 {
            *sd = 0.0004;
        }
    }
    let (mean, sd) = spread(&statistics);
    statistics.roughness_sd = 0.4;
    let (rough_mean, rough_sd) = spread(&statistics);
    assert!((rough_mean / mean - 1.0).abs() < 0.07, "a mean square of 1");
    assert!(rough_sd > 4.0 * sd);
    statistics.roughness_sd = 0.0;
    statistics.local_roughness = 0.5;
    let (local_mean, local_sd) = spread(&statistics);
    assert!((local_mean / mean - 1.0).abs() < 0.02, "{local_mean} for {mean}");
    assert!(local_sd < 2.0 * sd);
    // Local roughness has no effect with too few harmonics.
    let mut few = circles(10);
    few.residual_sd = vec![0.001; 40];
    let without = spread(&few);
    few.local_roughness = 0.5;
    assert_eq!(spread(&few), without);
}

#[test]
fn radii_are_log_normal() {
    let model = ShapeModel::from_statistics(circles(2)).unwrap();
    let mut rng = rng(0x3AD);
    let logs: Vec<f64> = (0..50_000).map(|_| libm::log(model.draw_radius(&mut rng))).collect();
    let (mean, sd) = support::mean_and_sd(&logs);
    assert!((mean - 2.0).abs() < 4.0 * 0.1 / 50_000_f64.sqrt());
    assert!((sd - 0.1).abs() < 4.0 * 0.1 / 100_000_f64.sqrt());
}

#[test]
fn rotations_are_uniform() {
    let model = ShapeModel::from_statistics(circles(1)).unwrap();
    let mut rng = rng(0x207);
    let mut counts = [0_u32; 8];
    for _ in 0..8000 {
        let [re, im] = model.draw(1.0, &mut rng).unwrap().descriptors.harmonic(1);
        let turn = libm::atan2(im, re) / TAU + 0.5;
        let eighth = (1..8).filter(|&k| turn >= f64::from(k) / 8.0).count();
        counts[eighth] += 1;
    }
    let chi2: f64 = counts.iter().map(|&c| (f64::from(c) - 1000.0) * (f64::from(c) - 1000.0) / 1000.0).sum();
    // 7 degrees of freedom: mean 7, standard deviation 3.7; four standard deviations above.
    assert!(chi2 < 22.0, "{chi2}");
}

#[test]
fn rejected_draws_are_counted_and_limited() {
    let mut wild = circles(12);
    wild.residual_sd.fill(0.02);
    let model = ShapeModel::from_statistics(wild.clone()).unwrap();
    let mut rng = rng(0x11D);
    let rejected: u32 = (0..100).map(|_| model.draw(1.0, &mut rng).unwrap().rejected).sum();
    assert!(rejected > 20, "{rejected}");
    wild.residual_sd.fill(1.0);
    let model = ShapeModel::from_statistics(wild).unwrap();
    assert_eq!(model.draw(1.0, &mut rng), Err(Error::NoSimpleOutline { tries: 200, harmonics: 12 }));
    // A mean with reversed orientation has no outline of positive area.
    let mut backwards = circles(2);
    backwards.mean.swap(4, 2);
    let model = ShapeModel::from_statistics(backwards).unwrap();
    assert!(matches!(model.draw(1.0, &mut rng), Err(Error::NoSimpleOutline { .. })));
}

#[test]
fn invalid_input_is_rejected() {
    let outlines = cells();
    for lambda in [-0.1, 1.1, f64::NAN] {
        let fitted = ShapeModel::fit(&outlines, &params(10, CovarianceModel::Shrinkage { lambda }));
        assert!(matches!(fitted, Err(Error::Parameter { field: "lambda", .. })));
    }
    for harmonics in [0, 5000] {
        let fitted = ShapeModel::fit(&outlines, &params(harmonics, CovarianceModel::Independent));
        assert!(matches!(fitted, Err(Error::Parameter { field: "harmonics", .. })));
    }
    let few = ShapeModel::fit(&outlines[..2], &ShapeModelParams::default());
    assert_eq!(few, Err(Error::TooFewOutlines { count: 2, needed: 3 }));
    let mut invalid = outlines.clone();
    invalid[7][3] = [f64::NAN, 0.0];
    let source = Box::new(Error::PointValue { index: 3 });
    assert_eq!(
        ShapeModel::fit(&invalid, &ShapeModelParams::default()),
        Err(Error::TrainingOutline { index: 7, source })
    );
    let model = ShapeModel::from_statistics(circles(3)).unwrap();
    for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(model.draw(radius, &mut rng(1)), Err(Error::Parameter { field: "radius_px", .. })));
    }
}

#[test]
fn few_or_equal_outlines_are_sufficient() {
    let few = support::polygons(5, 20.0, &support::NUCLEUS, &mut rng(9));
    let model = ShapeModel::fit(&few, &params(8, CovarianceModel::Shrinkage { lambda: 0.1 })).unwrap();
    assert_eq!((model.statistics().roughness_sd, model.statistics().outlines), (0.0, 5));
    assert!(model.draw(10.0, &mut rng(2)).is_ok());
    let equal = vec![few[0].clone(); 40];
    let model = ShapeModel::fit(&equal, &params(8, CovarianceModel::Shrinkage { lambda: 0.1 })).unwrap();
    let (a, b) = (model.draw(10.0, &mut rng(2)).unwrap(), model.draw(10.0, &mut rng(3)).unwrap());
    for l in -8..=8 {
        assert!((a.descriptors.magnitude(l) - b.descriptors.magnitude(l)).abs() < 1e-6);
    }
}

#[test]
fn inconsistent_statistics_are_rejected() {
    type Change = (&'static str, fn(&mut ShapeStatistics));
    let component =
        |skewness, excess_kurtosis| PrincipalComponent { loading: vec![0.0; 12], skewness, excess_kurtosis };
    let changes: [Change; 11] = [
        ("harmonics", |s| s.harmonics = 0),
        ("mean", |s| s.harmonics = 4),
        ("mean", |s| s.mean[1] = f64::NAN),
        ("mean", |s| s.mean[1] = f64::INFINITY),
        ("residual_sd", |s| s.residual_sd[2] = -0.1),
        ("residual_sd", |s| s.residual_sd.truncate(3)),
        ("ln_radius_mean", |s| s.ln_radius_mean = f64::NAN),
        ("ln_radius_sd", |s| s.ln_radius_sd = -1.0),
        ("roughness_sd", |s| s.roughness_sd = 2.0),
        ("local_roughness", |s| s.local_roughness = f64::NAN),
        ("components.loading", |s| {
            s.components.push(PrincipalComponent { loading: vec![0.0; 3], skewness: 0.0, excess_kurtosis: 0.0 });
        }),
    ];
    for (name, change) in changes {
        let mut statistics = circles(3);
        change(&mut statistics);
        match ShapeModel::from_statistics(statistics) {
            Err(Error::Statistics { field, .. }) => assert_eq!(field, name),
            other => panic!("{name}: {other:?}"),
        }
    }
    for (skewness, kurtosis, good) in [
        (0.0, 0.0, true),
        (1.5, 4.0, true),
        (1.5, 0.0, false),
        (0.0, 13.0, false),
        (3.0, 12.0, false),
        (f64::NAN, 0.0, false),
    ] {
        let mut statistics = circles(3);
        statistics.components.push(component(skewness, kurtosis));
        assert_eq!(ShapeModel::from_statistics(statistics).is_ok(), good, "{skewness} {kurtosis}");
    }
}

#[test]
fn rounded_statistics_are_short_and_draw_nearly_the_same() {
    let model = ShapeModel::fit(&cells(), &ShapeModelParams::default()).unwrap();
    let full = model.statistics();
    let rounded = full.rounded(5).unwrap();
    assert_eq!(rounded.rounded(5).unwrap(), rounded);
    assert!(rounded.mean.iter().zip(&full.mean).all(|(a, b)| (a - b).abs() <= 5e-5 * b.abs()));
    assert!(rounded.mean.iter().any(|v| format!("{v:e}").len() > 5));
    let short = ShapeModel::from_statistics(rounded).unwrap();
    let (a, b) = (model.draw(100.0, &mut rng(4)).unwrap(), short.draw(100.0, &mut rng(4)).unwrap());
    for (p, q) in a.descriptors.outline(200).iter().zip(b.descriptors.outline(200)) {
        assert!((p[0] - q[0]).abs() < 0.005 && (p[1] - q[1]).abs() < 0.005);
    }
    for digits in [0, 18] {
        assert!(matches!(full.rounded(digits), Err(Error::Parameter { field: "digits", .. })));
    }
}

#[cfg(feature = "serde")]
#[test]
fn statistics_round_trip_through_compact_json() {
    let model = ShapeModel::fit(&cells(), &ShapeModelParams::default()).unwrap();
    let rounded = model.statistics().rounded(5).unwrap();
    let text = serde_json::to_string(&rounded).unwrap();
    assert!(text.len() < 60_000, "{} bytes", text.len());
    assert_eq!(serde_json::from_str::<ShapeStatistics>(&text).unwrap(), rounded);
    let unknown_field = text.replacen("\"mean\"", "\"meen\"", 1);
    assert!(serde_json::from_str::<ShapeStatistics>(&unknown_field).is_err());
}
