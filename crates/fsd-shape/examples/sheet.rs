//! Draws a sheet of outlines: four rows of cytoplasm, one of nuclei.
//!
//! `cargo run --release -p fsd-shape --example sheet -- sheet.png [outlines.csv]`; the models are fitted to synthetic
//! polygons, or the one of cytoplasm to a table with the columns outline, k, x_px, y_px.

mod support;

use fsd_shape::{Point, ShapeModel, ShapeModelParams};
use image::{GrayImage, Luma};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

const COLUMNS: u32 = 8;
const ROWS: u32 = 5;
const TILE: u32 = 112;
/// Sub-samples of a pixel along each axis.
const SUBSAMPLES: u32 = 4;
const PAPER: f64 = 255.0;
const INK: [f64; 2] = [196.0, 96.0];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().unwrap_or_else(|| "target/fsd-shape.png".to_owned());
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(0x5EED);
    let cells = match arguments.next() {
        Some(table) => support::read_outlines(table.as_ref())?,
        None => support::polygons(80, 100.0, &support::CELL, &mut rng),
    };
    let nuclei = support::polygons(80, 16.0, &support::NUCLEUS, &mut rng);
    let cytoplasm = ShapeModel::fit(&cells, &ShapeModelParams::default())?;
    let nucleus = ShapeModel::fit(&nuclei, &ShapeModelParams { harmonics: 5, ..ShapeModelParams::default() })?;

    let mut sheet = GrayImage::from_pixel(COLUMNS * TILE, ROWS * TILE, Luma([255]));
    for row in 0..ROWS {
        let is_nucleus = row + 1 == ROWS;
        let (model, median) = if is_nucleus { (&nucleus, 24.0) } else { (&cytoplasm, 38.0) };
        for column in 0..COLUMNS {
            // Sizes vary as in the training outlines, around a median that fits the tile.
            let radius =
                median * (model.draw_radius(&mut rng) / libm::exp(model.statistics().ln_radius_mean)).clamp(0.8, 1.15);
            let draw = model.draw(radius, &mut rng)?;
            let centre = |k: u32| f64::from(k * TILE + TILE / 2);
            let outline = draw.descriptors.translated([centre(column), centre(row)]).outline(512);
            paint(&mut sheet, &outline, INK[usize::from(is_nucleus)]);
        }
    }
    if let Some(folder) = std::path::Path::new(&path).parent() {
        std::fs::create_dir_all(folder)?;
    }
    sheet.save(path)?;
    Ok(())
}

/// Fills an outline by the even-odd rule, with anti-aliased edges.
fn paint(sheet: &mut GrayImage, outline: &[Point], ink: f64) {
    let mut coverage = vec![0_u32; (sheet.width() * sheet.height()) as usize];
    let sample = |k: u32| (f64::from(k) + 0.5) / f64::from(SUBSAMPLES) - 0.5;
    for line in 0..sheet.height() * SUBSAMPLES {
        let y = sample(line);
        let mut crossings: Vec<f64> = outline
            .iter()
            .zip(outline.iter().cycle().skip(1))
            .filter(|(p, q)| (p[1] <= y) != (q[1] <= y))
            .map(|(p, q)| p[0] + (y - p[1]) / (q[1] - p[1]) * (q[0] - p[0]))
            .collect();
        if crossings.is_empty() {
            continue;
        }
        crossings.sort_by(f64::total_cmp);
        for column in 0..sheet.width() * SUBSAMPLES {
            if crossings.partition_point(|&x| x < sample(column)) % 2 == 1 {
                coverage[(line / SUBSAMPLES * sheet.width() + column / SUBSAMPLES) as usize] += 1;
            }
        }
    }
    for (pixel, &hits) in sheet.pixels_mut().zip(&coverage) {
        let coverage_fraction = f64::from(hits) / f64::from(SUBSAMPLES * SUBSAMPLES);
        let value = f64::from(pixel.0[0]) - coverage_fraction * (PAPER - ink);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the range of a byte")]
        let byte = value.round().clamp(0.0, 255.0) as u8;
        pixel.0[0] = byte;
    }
}
