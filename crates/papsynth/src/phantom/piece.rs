//! The in-focus absorbance of an object and its parts.

use std::borrow::Cow;

use dye_spectra::Amounts;

use super::tile::Tile;
use crate::truth::{Mask, Part, Trait};

/// Minimum absorbance of refracting objects: phase delay is stored per absorbance.
pub(crate) const MIN_ABSORBANCE: f64 = 1e-6;

/// A part of an object.
#[derive(Debug, Clone)]
pub(crate) struct Piece {
    pub(crate) part: Part,
    /// Distance of the samples of both tiles, in grid points. The origins of the tiles are in samples, too.
    pub(crate) step: usize,
    /// In-focus decadic absorbance along the light path, at the centres of samples.
    pub(crate) absorbance: Tile,
    /// Fraction of each sample that the in-focus outline covers.
    pub(crate) coverage: Tile,
    /// Area within the outline, including the part outside the image, px².
    pub(crate) area_px: f64,
    /// Whether the absorbance comes from a microscope image, which is already blurred.
    pub(crate) imaged: bool,
    /// Amounts of dye where the absorbance is 1.
    pub(crate) dyes: Amounts,
    /// Phase delay where the absorbance is 1, radians.
    pub(crate) phase_rad: f64,
    /// Complete mask in the image; empty until computed.
    pub(crate) mask: Mask,
    /// Number of mask pixels inside and outside the image.
    pub(crate) covered: u64,
}

impl Piece {
    /// Creates a non-refracting piece that is a complete object.
    pub(super) fn whole(absorbance: Tile, coverage: Tile, area_px: f64, dyes: Amounts) -> Self {
        Self {
            part: Part::Whole,
            step: 1,
            absorbance,
            coverage,
            area_px,
            imaged: false,
            dyes,
            phase_rad: 0.0,
            mask: Mask::default(),
            covered: 0,
        }
    }

    /// Returns the fraction of each camera pixel that the outline covers, for `n` grid points per pixel and axis.
    pub(crate) fn pixel_coverage(&self, n: usize) -> Cow<'_, Tile> {
        coarsened(&self.coverage, n / self.step)
    }

    /// Returns the mean absorbance of each camera pixel, for `n` grid points per pixel and axis.
    pub(crate) fn pixel_absorbance(&self, n: usize) -> Cow<'_, Tile> {
        coarsened(&self.absorbance, n / self.step)
    }
}

fn coarsened(tile: &Tile, factor: usize) -> Cow<'_, Tile> {
    if factor == 1 { Cow::Borrowed(tile) } else { Cow::Owned(tile.coarsened(factor)) }
}

/// The in-focus absorbance of an object.
#[derive(Debug, Clone, Default)]
pub(crate) struct Phantom {
    /// Parts, from the outside in.
    pub(crate) pieces: Vec<Piece>,
    /// Variants of the shape, for the ground truth.
    pub(crate) traits: Vec<Trait>,
}

impl Phantom {
    /// Creates a phantom of an object without parts.
    pub(crate) fn whole(absorbance: Tile, coverage: Tile, area_px: f64, dyes: Amounts) -> Self {
        Self { pieces: vec![Piece::whole(absorbance, coverage, area_px, dyes)], traits: Vec::new() }
    }

    /// Sets the phase delay where the absorbance is `absorbance`.
    pub(crate) fn with_phase(mut self, phase_rad: f64, absorbance: f64) -> Self {
        for piece in &mut self.pieces {
            piece.phase_rad = phase_rad / absorbance.max(MIN_ABSORBANCE);
        }
        self
    }

    /// Adds an inclusion with other dyes. It belongs to the complete object.
    pub(crate) fn with_inclusion(mut self, absorbance: Tile, dyes: Amounts) -> Self {
        let coverage = Tile { origin: absorbance.origin, width: 1, values: vec![0.0] };
        self.pieces.push(Piece::whole(absorbance, coverage, 0.0, dyes));
        self
    }
}
