//! Clue cells: epithelial cells covered with coccobacilli, most densely at the rim and beyond it.
//!
//! The coat of bacteria is part of its cell: it follows the outline and folds of the cell and has its depth. The row of
//! the cell in the ground truth has the trait `clue`.

use multiversion::multiversion;
use portable_numerics::rounding::round_to_count;

use super::prelude::*;
use crate::phantom::box_sums::averaged;
use crate::scene::view::FieldNumbers;

section! {
    /// Clue cells: cells covered with coccobacilli, and cells with patches of them.
    pub struct ClueCells, drawn from rng as pub Coat {
        /// Fraction of cells with a coat; drawn once per field.
        fraction: Number (undrawn) = Number::log_normal(0.004, 1.3).at_most(0.8), 0..=1;
        /// Coccobacilli per µm² in dense regions of a coat.
        density: Number = Number::uniform(1.5, 4.5), 0..=10;
        /// Fraction of the cell that the dense patches of its coat cover.
        coverage: Number = Number::uniform(0.35, 0.95), 0..=1;
        /// Width of the coat beyond the rim of the cell.
        overhang_um: Number = Number::uniform(0.8, 3.0), 0..=20, "µm";
        /// Width of a coccobacillus.
        width_um: Number = Number::normal(0.6, 0.04), 0.1..=5, "µm";
        /// Absorbance.
        absorbance: Number = Number::log_normal(0.045, 0.25), 0..=4;
    }
}

impl ClueCells {
    /// Draws the coats of cells, which are given with their numbers.
    pub(crate) fn draw<'a>(&self, field: &FieldNumbers, cells: impl Iterator<Item = (u64, &'a mut Option<Coat>)>) {
        let fraction = field.draw(named!("debris.clue_cells", self.fraction));
        if fraction <= 0.0 {
            return;
        }
        for (number, coat) in cells {
            let mut rng = field.key.stream("cell", number, "coat");
            *coat = random::chance(fraction, &mut rng).then(|| self.one(&mut rng));
        }
    }
}

/// Size (standard deviation) of the patches of a coat, µm.
const PATCH_UM: f64 = 3.0;

/// Density of a coat between its patches, relative to the patches.
const THIN: f32 = 0.08;
/// Density along the rim, relative to the patches.
const RIM: f32 = 0.5;

/// Increase of density from the border of a patch inwards, per standard deviation of the noise field.
const SOFT: f32 = 1.2;

/// Size (standard deviation) of the tufts beyond the rim, µm.
const TUFT_UM: f64 = 0.8;
/// Density between the tufts, relative to them.
const TUFTED: f32 = 0.15;

/// Distance over which the density increases towards the rim, µm.
const RIM_UM: f64 = 2.0;

/// Adds the coat of a cell to its phantom.
pub(crate) fn add_coat(coat: &Coat, context: &ObjectContext<'_>, phantom: &mut Phantom) {
    let Some(cell) = phantom.pieces.first() else { return };
    let (noise_fields, pixel_um) = (context.noise_fields, context.pixel_um);
    let mut rng = context.stream("coat.shape");
    let margin = (coat.overhang_um + RIM_UM) / pixel_um + 2.0;
    let whole = cell.coverage.clone().repeated(cell.step);
    let corner = whole.origin.map(|at| at as f64);
    let opposite = [corner[0] + (whole.width - 1) as f64, corner[1] + (whole.height() - 1) as f64];
    let mut canvas = ObjectCanvas::around(&[corner, opposite], margin);
    let inside = widened(&whole, &canvas.coverage);
    let near = |um: f64| averaged(&inside, round_to_count(um / pixel_um).max(1));
    let (rim, beyond) = (near(RIM_UM), near(coat.overhang_um));
    // Beyond the rim, bacteria form tufts.
    let tufts = FieldSampler::clouds(TUFT_UM / pixel_um, &mut rng);
    let mut tufted = Vec::with_capacity(canvas.coverage.values.len());
    canvas.rows(noise_fields.clouds(), &tufts, |_, _, _, field| tufted.extend_from_slice(field));
    // Density of the coat at each pixel.
    let threshold = noise_fields.clouds().quantile(1.0 - coat.coverage);
    let sampler = FieldSampler::clouds(PATCH_UM / pixel_um, &mut rng);
    let width = canvas.coverage.width;
    let mut density = tufted;
    let mut row = 0;
    canvas.rows(noise_fields.clouds(), &sampler, |_, _, _, field| {
        let here = row * width..(row + 1) * width;
        let covers = [&inside, &rim, &beyond].map(|tile| &tile.values[here.clone()]);
        to_density(&mut density[here], field, threshold, covers);
        row += 1;
    });
    let origin = canvas.coverage.origin.map(|at| at as f64);
    let height = canvas.coverage.height();
    let tries = round_to_count(coat.density * (width * height) as f64 * pixel_um * pixel_um);
    let half_width = 0.5 * coat.width_um / pixel_um;
    for _ in 0..tries {
        let (x, y) = (random::below(width, &mut rng), random::below(height, &mut rng));
        if !random::chance(f64::from(density[y * width + x]), &mut rng) {
            continue;
        }
        let at = [x as f64 + origin[0] + random::uniform(&mut rng), y as f64 + origin[1] + random::uniform(&mut rng)];
        let (way, length) = (random::direction(&mut rng), half_width * random::between(0.0, 2.0, &mut rng));
        let end = [at[0] + length * libm::cos(way), at[1] + length * libm::sin(way)];
        canvas.stroke(&Stroke::even(at, end, half_width), coat.absorbance * random::between(0.6, 1.3, &mut rng));
    }
    *phantom = core::mem::take(phantom).with_inclusion(canvas.absorbance, context.dyes.bacillus);
    phantom.traits.push(Trait::Clue);
}

/// Replaces the noise field of the tufts in a row by the density of the coat. The others are the noise field of the
/// patches, the coverage by the cell, and its means within the distances of the rim and of the overhang.
#[multiversion(targets = "simd")]
fn to_density(tufts: &mut [f32], patches: &[f32], threshold: f32, [inside, rim, beyond]: [&[f32]; 3]) {
    let within = |value: f32, low: f32| value.max(low).min(1.0);
    let rows = tufts.iter_mut().zip(patches).zip(inside).zip(rim).zip(beyond);
    for ((((value, patch), covered), rim), beyond) in rows {
        let patchy = within(0.5 + SOFT * (patch - threshold), THIN);
        let at_rim = RIM * (2.0 * (1.0 - rim)).min(1.0);
        let outside = (2.0 * beyond).min(1.0);
        let tuft = within(TUFTED + (1.0 - TUFTED) * *value, 0.0);
        *value = covered * (patchy + at_rim).min(1.0) + (1.0 - covered) * outside * tuft * patchy.max(RIM);
    }
}

/// Copies a tile to a blank tile of the size and position of a larger one.
fn widened(tile: &Tile, place: &Tile) -> Tile {
    let mut wide = place.blank();
    let origin = wide.origin;
    crate::phantom::tile::overlay(&mut wide.values, place.width, origin, tile, |row, values| {
        row.copy_from_slice(values);
    });
    wide
}
