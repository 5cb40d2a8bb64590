//! From a scene to phantoms: what each object absorbs when it is in focus, and the exact cover of its parts.
//!
//! Cells are made here, everything else in the file of its kind, in [`crate::debris`]. A phantom depends on its object and on the object's own streams alone.

mod cell;
mod chromatin;
mod form;
mod nucleus;
pub(crate) mod pools;
mod studio;
pub(crate) mod tile;
pub(crate) mod wobble;

use std::borrow::Cow;

use dye_spectra::Amounts;

use crate::debris;
use crate::error::Cause;
use crate::profile::Stage;
use crate::scene::{Body, Object, Scene, View};
use crate::truth::Part;

pub(crate) use pools::Pools;
pub(crate) use studio::Studio;
use tile::Tile;

/// A part of an object, in its own tile.
#[derive(Debug, Clone)]
pub(crate) struct Piece {
    /// Which part it is.
    pub(crate) part: Part,
    /// What it absorbs along the light's path when it is in focus, decadic.
    pub(crate) absorbance: Tile,
    /// Share that its in-focus outline covers of each square of so many grid points a side.
    pub(crate) coverage: Tile,
    pub(crate) cover_step: usize,
    /// Area within its outline, also outside the image, px².
    pub(crate) area_px: f64,
    /// Whether its absorbance was taken from an image, and has been through optics already.
    pub(crate) imaged: bool,
    /// What stains it, where its absorbance is 1.
    pub(crate) dyes: Amounts,
    /// How late light comes, radians, where its absorbance is 1.
    pub(crate) phase_rad: f64,
}

impl Piece {
    /// The share of each of the camera's pixels that its outline covers, with `n` grid points along a pixel.
    pub(crate) fn cover_of_pixels(&self, n: usize) -> Cow<'_, Tile> {
        match n / self.cover_step {
            1 => Cow::Borrowed(&self.coverage),
            finer => Cow::Owned(self.coverage.coarsened(finer)),
        }
    }
}

/// What an object absorbs.
#[derive(Debug, Clone, Default)]
pub(crate) struct Phantom {
    /// Its parts, from the outside in.
    pub(crate) pieces: Vec<Piece>,
    /// Variants that its shape shows, for the truth.
    pub(crate) traits: Vec<&'static str>,
}

/// Makes the phantoms of a run of objects.
///
/// Objects are handed over in batches because sheets are pressed side by side in SIMD lanes; the result is the same
/// for any grouping.
pub(crate) fn make(
    studio: &Studio,
    scene: &Scene,
    pools: &Pools<'_>,
    objects: &[&Object],
) -> Result<Vec<Phantom>, Cause> {
    let cells: Vec<(&Object, &crate::scene::CellBody)> = objects
        .iter()
        .filter_map(|object| match &object.body {
            Body::Cell(body) => Some((*object, &**body)),
            _ => None,
        })
        .collect();
    let mut made = cell::make(studio, scene, pools, &cells)?;
    studio.watch.time(Stage::Debris, || {
        for ((object, _), phantom) in cells.iter().zip(&mut made) {
            debris::cover(scene, pools, object, phantom);
        }
        let mut cells = made.into_iter();
        let mut phantom = |object: &&Object| {
            debris::phantom(scene, pools, object).or_else(|| cells.next()).expect("a phantom was made of every cell")
        };
        Ok(objects.iter().map(&mut phantom).collect())
    })
}

/// Absorbance of what refracts and hardly absorbs: its phase is counted by its absorbance.
pub(crate) const LEAST_ABSORBANCE: f64 = 1e-6;

/// Number of objects that are worth making together: the lanes of a batch of sheets.
pub(crate) const BATCH: usize = 16;

impl Phantom {
    /// The phantom of an object of a plot, made as if the plot were the image: cut off where the object may reach no further, then
    /// moved to where the plot lies. `n` are the grid points along a pixel.
    pub(crate) fn on_slide(mut self, object: &Object, view: View, n: usize) -> Self {
        let Some(plot) = object.plot else { return self };
        let reach_px = object.body.reach_um(view.pixel_um) / view.pixel_um + 2.0;
        let grid = |step: usize| View { pixel_um: view.pixel_um / step as f64, ..view };
        for piece in &mut self.pieces {
            for (tile, step) in [(&mut piece.absorbance, n), (&mut piece.coverage, n / piece.cover_step)] {
                let centre = grid(step).to_px(object.centre_um);
                *tile = core::mem::take(tile).within(centre, reach_px * step as f64);
                for axis in 0..2 {
                    tile.origin[axis] += plot.at_px[axis] * step as i64;
                }
            }
        }
        self
    }

    /// A phantom without parts of its own.
    pub(crate) fn whole(absorbance: Tile, coverage: Tile, area_px: f64, dyes: Amounts) -> Self {
        let piece = Piece {
            part: Part::Whole,
            absorbance,
            coverage,
            cover_step: 1,
            area_px,
            imaged: false,
            dyes,
            phase_rad: 0.0,
        };
        Self { pieces: vec![piece], traits: Vec::new() }
    }

    /// The same, through which light comes late.
    pub(crate) fn refracting(mut self, phase_rad: f64, absorbance: f64) -> Self {
        for piece in &mut self.pieces {
            piece.phase_rad = phase_rad / absorbance.max(LEAST_ABSORBANCE);
        }
        self
    }

    /// The same with something in it that other dyes stain: it counts as part of the whole.
    pub(crate) fn stained(mut self, absorbance: Tile, dyes: Amounts) -> Self {
        let coverage = Tile { origin: absorbance.origin, width: 1, values: vec![0.0] };
        self.pieces.push(Piece {
            part: Part::Whole,
            absorbance,
            coverage,
            cover_step: 1,
            area_px: 0.0,
            imaged: false,
            dyes,
            phase_rad: 0.0,
        });
        self
    }
}
