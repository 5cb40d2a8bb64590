//! What an object absorbs when it is in focus, part by part.

use std::borrow::Cow;

use dye_spectra::Amounts;

use super::tile::Tile;
use crate::truth::{Mask, Part, Trait};

/// Absorbance of what refracts and hardly absorbs: its phase is counted by its absorbance.
pub(crate) const LEAST_ABSORBANCE: f64 = 1e-6;

/// A part of an object, in its own tile.
#[derive(Debug, Clone)]
pub(crate) struct Piece {
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
    /// Its complete mask in the image, once that is known, and the number of pixels it would have without the image's border.
    pub(crate) mask: Mask,
    pub(crate) covered: u64,
}

impl Piece {
    /// One that is no part of anything else, and does not refract.
    pub(super) fn whole(absorbance: Tile, coverage: Tile, area_px: f64, dyes: Amounts) -> Self {
        Self {
            part: Part::Whole,
            absorbance,
            coverage,
            cover_step: 1,
            area_px,
            imaged: false,
            dyes,
            phase_rad: 0.0,
            mask: Mask::default(),
            covered: 0,
        }
    }

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
    pub(crate) traits: Vec<Trait>,
}

impl Phantom {
    /// A phantom without parts of its own.
    pub(crate) fn whole(absorbance: Tile, coverage: Tile, area_px: f64, dyes: Amounts) -> Self {
        Self { pieces: vec![Piece::whole(absorbance, coverage, area_px, dyes)], traits: Vec::new() }
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
        self.pieces.push(Piece::whole(absorbance, coverage, 0.0, dyes));
        self
    }
}
