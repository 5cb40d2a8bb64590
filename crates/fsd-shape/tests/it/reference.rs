//! The default model against real outlines, which are found through the environment variable `PAPSYNTH_REFERENCE` and are not part of the project.

use crate::support;
use std::path::PathBuf;

use fsd_shape::{Descriptors, Point, ShapeModel, ShapeModelParams, Spread, circularity, resample, self_intersects};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

const HARMONICS: usize = 40;
const DRAWS: u32 = 10_000;
const NAMES: [&str; 4] = ["circularity", "|u-1|", "|u2|", "|u3|"];

/// None, with a message, where there is no reference material; on a build server there must be.
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

/// Statistics of the draws, and the share of tries rejected.
fn drawn(outlines: &[Vec<Point>], params: &ShapeModelParams, draws: u32) -> ([(f64, f64); 4], f64) {
    let model = ShapeModel::fit(outlines, params).unwrap();
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(0xC0);
    let mut rejected = 0;
    let mut rows = Vec::new();
    for _ in 0..draws {
        let draw = model.draw(100.0, &mut rng).unwrap();
        rejected += draw.rejected;
        // Coarser polygons cut corners: the paper's 209 harmonics need more points than its 420.
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
        assert!((sd / real_sd - 1.0).abs() < 0.15, "{name}: spread {sd} for {real_sd}");
    }
    assert!(rejected < 0.01, "{rejected}");
}

#[test]
fn the_papers_model_is_too_round_and_crosses_itself() {
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
    for spread in [Spread::Independent, ShapeModelParams::default().spread] {
        let params = ShapeModelParams { harmonics: HARMONICS, spread };
        let statistics = ShapeModel::fit(&outlines, &params).unwrap().statistics().rounded(5).unwrap();
        // A number of five digits prints in about as many characters as in JSON.
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
