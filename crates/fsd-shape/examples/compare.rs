//! Compares drawn with real outlines: circularity, low harmonics, fine detail, and the fraction of draws that intersect
//! themselves.
//!
//! `cargo run --release -p fsd-shape --example compare -- outlines.csv [harmonics]`; the table has the columns outline,
//! k, x_px, y_px. Without a table it uses synthetic polygons.

#![expect(clippy::print_stdout, reason = "an example prints its table")]

mod support;

use fsd_shape::{
    CovarianceModel, Descriptors, Point, Rng, ShapeModel, ShapeModelParams, ShapeStatistics, circularity, resample,
    self_intersects,
};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

const DRAWS: usize = 10_000;
const NAMES: [&str; 8] = ["circularity", "|u-1|", "|u2|", "|u3|", "|u-2|", "|u-3|", "rms |l|>3", "rms |l|>10"];

/// Returns the columns of the table for one outline.
fn measure(shape: &Descriptors, harmonics: usize) -> [f64; 8] {
    let shape = shape.truncated(harmonics).normalised();
    let beyond = |least: i32| {
        let most = i32::try_from(harmonics).unwrap_or(i32::MAX);
        let squares: f64 =
            (least + 1..=most).flat_map(|l| [shape.magnitude(l), shape.magnitude(-l)]).map(|m| m * m).sum();
        squares.sqrt()
    };
    [
        circularity(&shape.outline(1024)),
        shape.magnitude(-1),
        shape.magnitude(2),
        shape.magnitude(3),
        shape.magnitude(-2),
        shape.magnitude(-3),
        beyond(3),
        beyond(10),
    ]
}

/// Returns the fraction of draws, without rejection, that intersect themselves.
fn crossing_fraction<R: Rng + ?Sized>(
    of: &ShapeStatistics,
    points: usize,
    rng: &mut R,
) -> Result<f64, fsd_shape::Error> {
    let mut crossing = 0;
    for _ in 0..DRAWS {
        let mut terms: Vec<Point> = Vec::with_capacity(2 * of.harmonics + 1);
        for (mean, sd) in of.mean.chunks_exact(2).zip(of.residual_sd.chunks_exact(2)) {
            let normals = normal_pair(rng);
            terms.push([mean[0] + sd[0] * normals[0], mean[1] + sd[1] * normals[1]]);
        }
        terms.insert(of.harmonics, [0.0, 0.0]);
        let outline = Descriptors::from_harmonics(terms)?.outline(points);
        crossing += u32::from(self_intersects(&outline));
    }
    Ok(f64::from(crossing) / DRAWS as f64)
}

/// Returns two standard normal numbers (Box and Muller).
fn normal_pair<R: Rng + ?Sized>(rng: &mut R) -> [f64; 2] {
    let uniform = |rng: &mut R| (f64::from(rng.next_u32()) + 0.5) / (f64::from(u32::MAX) + 1.0);
    let length = (-2.0 * libm::log(uniform(rng))).sqrt();
    let (sin, cos) = libm::sincos(std::f64::consts::TAU * uniform(rng));
    [length * cos, length * sin]
}

fn column(rows: &[[f64; 8]], k: usize) -> (f64, f64) {
    support::mean_and_sd(&rows.iter().map(|row| row[k]).collect::<Vec<_>>())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let outlines: Vec<Vec<Point>> = match std::env::args().nth(1) {
        Some(path) => support::read_outlines(path.as_ref())?,
        None => support::polygons(70, 100.0, &support::CELL, &mut Xoshiro256PlusPlus::seed_from_u64(0x51)),
    };
    let harmonics = match std::env::args().nth(2) {
        Some(text) => text.parse()?,
        None => ShapeModelParams::default().harmonics,
    };
    let ours = ShapeModelParams { harmonics, ..ShapeModelParams::default() };
    let models = [
        ("paper, all harmonics", ShapeModelParams::paper_cytoplasm()),
        ("paper, fewer harmonics", ShapeModelParams { covariance: CovarianceModel::Independent, ..ours.clone() }),
        ("default", ours),
    ];
    for (name, params) in models {
        let shown = params.harmonics.min(harmonics);
        let real: Vec<[f64; 8]> = outlines
            .iter()
            .map(|outline| Ok(measure(&Descriptors::from_outline(&resample(outline, 1024))?, shown)))
            .collect::<Result<_, fsd_shape::Error>>()?;
        let model = ShapeModel::fit(&outlines, &params)?;
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(0xC0);
        let mut rejected = 0;
        let mut drawn = Vec::with_capacity(DRAWS);
        for _ in 0..DRAWS {
            let draw = model.draw(100.0, &mut rng)?;
            rejected += draw.rejected;
            drawn.push(measure(&draw.descriptors, shown));
        }
        let fraction = f64::from(rejected) / (f64::from(rejected) + DRAWS as f64);
        let of = model.statistics();
        println!(
            "{name}: {:.2} % of attempts rejected; {} components, roughness {:.3}, local {:.3}, ln radius {:.3} ± {:.3}",
            100.0 * fraction,
            of.components.len(),
            of.roughness_sd,
            of.local_roughness,
            of.ln_radius_mean,
            of.ln_radius_sd
        );
        if of.components.is_empty() {
            let points = 2 * params.harmonics + 2;
            println!(
                "  self-intersecting at {points} points: {:.2} %",
                100.0 * crossing_fraction(of, points, &mut rng)?
            );
        }
        let checks = 16 * params.harmonics;
        let mut real_crossing = 0;
        for outline in &outlines {
            let smooth = Descriptors::from_outline(&resample(outline, 1024))?.truncated(params.harmonics);
            real_crossing += u32::from(self_intersects(&smooth.outline(checks)));
        }
        println!(
            "  self-intersecting real outlines at {} harmonics: {real_crossing} of {}",
            params.harmonics,
            outlines.len()
        );
        println!("  at {shown} harmonics      real mean ± sd      drawn mean ± sd   off by (s.e.)   sd ratio");
        for (k, label) in NAMES.iter().enumerate() {
            let (real_mean, real_sd) = column(&real, k);
            let (mean, sd) = column(&drawn, k);
            let error = real_sd / (real.len() as f64).sqrt();
            println!(
                "  {label:<16} {real_mean:8.4} ± {real_sd:.4}    {mean:8.4} ± {sd:.4}   {:+10.2}   {:12.3}",
                (mean - real_mean) / error,
                sd / real_sd
            );
        }
    }
    Ok(())
}
