//! Compares toy fields of blurred borders with toy fields of sharp ones and draws the result: a field of each side with
//! its segmented nuclei, and histograms of the scores of the nuclei below.
//!
//! `cargo run --release -p papsynth-judge --example toys -- crates/papsynth-judge/docs/toys.png`

use std::error::Error;
use std::path::PathBuf;

use image::GrayImage;
use papsynth_judge::{Field, FieldImage, Judge, JudgeParams, Measurer, MeasurerParams};

#[path = "../tests/support/mod.rs"]
mod support;

use support::Toy;

const FIELDS: u64 = 8;
const GAP: u32 = 8;
const BINS: u32 = 40;
const BARS: u32 = 90;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args_os().nth(1).map_or_else(|| PathBuf::from("target/toys.png"), PathBuf::from);
    let measurer = Measurer::new(&MeasurerParams::default())?;
    let sharp = Toy::default().images(FIELDS, 1);
    let blunt = Toy { blur: 1.5, ..Toy::default() }.images(FIELDS, 100);
    let measure = |images: &[FieldImage]| images.iter().map(|p| measurer.measure(p)).collect::<Result<Vec<Field>, _>>();
    let (real, synthetic) = (measure(&sharp)?, measure(&blunt)?);
    let report = Judge::new(&JudgeParams::default())?.compare(&real, &synthetic)?;

    let (width, height) = (u32::try_from(sharp[0].width)?, u32::try_from(sharp[0].height())?);
    let mut drawing = GrayImage::from_pixel(2 * width + GAP, height + GAP + BARS, image::Luma([255]));
    let Some(nuclei) = report.two_sample.iter().find(|test| test.name == "nuclei") else { return Ok(()) };
    for (side, (grey, field)) in [(&sharp[0], &real[0]), (&blunt[0], &synthetic[0])].into_iter().enumerate() {
        let left = u32::try_from(side)? * (width + GAP);
        for (i, level) in (0_u32..).zip(&grey.grey) {
            drawing.put_pixel(left + i % width, i / width, image::Luma([byte(f64::from(*level))]));
        }
        for ([x, y], area) in field.nuclei.places.iter().zip(field.nuclei.column("nucleus area, um2")) {
            ring(&mut drawing, f64::from(left) + x, *y, (area / std::f64::consts::PI).sqrt() / 0.33 + 3.0);
        }
        let scores = &nuclei.result.scores[side];
        for bin in 0..BINS {
            let within = |s: &&f64| (**s * f64::from(BINS)).floor().clamp(0.0, f64::from(BINS - 1)) == f64::from(bin);
            let part = scores.iter().filter(within).count() as f64 / scores.len() as f64;
            let bar = (0..BARS).filter(|y| f64::from(*y) < 4.0 * part * f64::from(BARS)).count();
            for y in 0..u32::try_from(bar)? {
                for x in 0..width / BINS - 2 {
                    drawing.put_pixel(left + bin * (width / BINS) + x, height + GAP + BARS - 1 - y, image::Luma([96]));
                }
            }
        }
    }
    drawing.save(&path)?;
    eprintln!("{}: nuclei {}, AUC {:.2}", path.display(), nuclei.conclusion, nuclei.result.auc);
    for feature in nuclei.result.distinguishing_features.iter().take(3) {
        eprintln!("  {}: real {:.3}, synthetic {:.3}", feature.description, feature.real[1], feature.synthetic[1]);
    }
    Ok(())
}

fn ring(drawing: &mut GrayImage, x: f64, y: f64, radius: f64) {
    for step in 0..720 {
        let turn = std::f64::consts::TAU * f64::from(step) / 720.0;
        let (u, v) = (x + radius * libm::cos(turn), y + radius * libm::sin(turn));
        if u >= 0.0 && v >= 0.0 && u + 0.5 < f64::from(drawing.width()) && v + 0.5 < f64::from(drawing.height()) {
            drawing.put_pixel(whole(u + 0.5), whole(v + 0.5), image::Luma([0]));
        }
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "not negative, and inside the image")]
fn whole(value: f64) -> u32 {
    value as u32
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a level of 8 bits")]
fn byte(value: f64) -> u8 {
    value as u8
}
