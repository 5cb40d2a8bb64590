//! Compares the default model with real outlines, in the folder of the environment variable `PAPSYNTH_REFERENCE`. They
//! are not part of the project.

use crate::support;
use std::path::PathBuf;

use fsd_shape::{
    CovarianceModel, Descriptors, Point, ShapeModel, ShapeModelParams, circularity, resample, self_intersects,
};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

const HARMONICS: usize = 40;
const DRAWS: u32 = 10_000;
const NAMES: [&str; 4] = ["circularity", "|u-1|", "|u2|", "|u3|"];

/// Returns none, with a message, without reference material; in CI its absence is a failure.
fn outlines() -> Option<Vec<Vec<Point>>> {
    let Some(folder) = std::env::var_os("PAPSYNTH_REFERENCE") else {
        assert!(std::env::var("CI").as_deref() != Ok("true"), "PAPSYNTH_REFERENCE is not set");
        eprintln!("skipped: PAPSYNTH_REFERENCE is not set");
        return None;
    };
    let path = PathBuf::from(folder).join("outlines/cytoplasm.csv");
    Some(support::read_outlines(&path).expect("the table of outlines can be read"))
}

fn measure(descriptors: &Descriptors) -> [f64; 4] {
    let shape = descriptors.truncated(HARMONICS).normalised();
    let roundness = circularity(&shape.outline(1024));
    [roundness, shape.magnitude(-1), shape.magnitude(2), shape.magnitude(3)]
}

fn columns(rows: &[[f64; 4]]) -> [(f64, f64); 4] {
    std::array::from_fn(|k| support::mean_and_sd(&rows.iter().map(|row| row[k]).collect::<Vec<_>>()))
}

fn real(outlines: &[Vec<Point>]) -> [(f64, f64); 4] {
    let describe = |outline: &Vec<Point>| Descriptors::from_outline(&resample(outline, 1024)).unwrap();
    columns(&outlines.iter().map(|outline| measure(&describe(outline))).collect::<Vec<_>>())
}

/// Returns the statistics of the draws, and the fraction of rejected attempts.
fn drawn(outlines: &[Vec<Point>], params: &ShapeModelParams, draws: u32) -> ([(f64, f64); 4], f64) {
    let model = ShapeModel::fit(outlines, params).unwrap();
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(0xC0);
    let mut rejected = 0;
    let mut rows = Vec::new();
    for _ in 0..draws {
        let draw = model.draw(100.0, &mut rng).unwrap();
        rejected += draw.rejected;
        // A coarser polygon may intersect itself: the paper's 209 harmonics need more than its 420 points.
        let points = (16 * params.harmonics).max(1024);
        assert!(!self_intersects(&draw.descriptors.outline(points)));
        rows.push(measure(&draw.descriptors));
    }
    (columns(&rows), f64::from(rejected) / f64::from(rejected + draws))
}

#[test]
fn the_default_reproduces_real_cytoplasm() {
    let Some(outlines) = outlines() else { return };
    let real = real(&outlines);
    let (drawn, rejected) = drawn(&outlines, &ShapeModelParams::default(), DRAWS);
    for (name, ((mean, sd), (real_mean, real_sd))) in NAMES.iter().zip(drawn.iter().zip(&real)) {
        let error = real_sd / (outlines.len() as f64).sqrt();
        assert!((mean - real_mean).abs() < 2.5 * error, "{name}: mean {mean} for {real_mean} ± {error}");
        assert!((sd / real_sd - 1.0).abs() < 0.15, "{name}: standard deviation {sd} for {real_sd}");
    }
    assert!(rejected < 0.01, "{rejected}");
}

#[test]
fn the_papers_model_is_too_round_and_intersects_itself() {
    let Some(outlines) = outlines() else { return };
    let real = real(&outlines);
    let (drawn, rejected) = drawn(&outlines, &ShapeModelParams::paper_cytoplasm(), 300);
    assert!(rejected > 0.05, "{rejected}");
    let error = real[0].1 / (outlines.len() as f64).sqrt();
    assert!(drawn[0].0 - real[0].0 > 4.0 * error);
    assert!(drawn[0].1 < 0.7 * real[0].1);
}

#[test]
fn stored_statistics_are_small() {
    let Some(outlines) = outlines() else { return };
    for covariance in [CovarianceModel::Independent, ShapeModelParams::default().covariance] {
        let params = ShapeModelParams { harmonics: HARMONICS, covariance };
        let statistics = ShapeModel::fit(&outlines, &params).unwrap().statistics().rounded(5).unwrap();
        // The debug format of a number is about as long as in JSON.
        let length: usize = statistics
            .components
            .iter()
            .flat_map(|c| &c.loading)
            .chain(&statistics.mean)
            .chain(&statistics.residual_sd)
            .map(|v| format!("{v:?},").len())
            .sum();
        assert!(length < 58_000, "{length}");
    }
}
