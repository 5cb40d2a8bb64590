//! Nucleus restoration (Eqs. 15–16): what was imaged once is not blurred again.

use core::ops::Range;
use std::borrow::Cow;

use optics_psf::{Border, Gaussian, Scratch};

use crate::error::Cause;
use crate::phantom::piece::Phantom;
use crate::phantom::tile::{Tile, lay};
use crate::recipe::Restore;
use crate::scene::Scene;
use crate::transmit::BAND;
use crate::truth::COVERED;

/// C′ = C ∗ G_σ, C being 1 on nuclei whose texture was taken from images and 0 elsewhere (Eq. 16).
pub(crate) struct Feathered {
    /// Where it is not 0: pixels of one row, in order.
    spans: Vec<Range<usize>>,
    /// Where the shares of each span start.
    starts: Vec<usize>,
    /// What it is there.
    shares: Vec<f32>,
}

impl Feathered {
    /// Nothing if there are no such nuclei, or none is to be restored.
    pub(crate) fn new(scene: &Scene, phantoms: &[Phantom]) -> Result<Option<Self>, Cause> {
        let (view, n) = (scene.view, scene.oversampling());
        if scene.restoration.restore == Restore::Off {
            return Ok(None);
        }
        let pieces = phantoms.iter().flat_map(|p| &p.pieces).filter(|piece| piece.imaged);
        let imaged: Vec<Cow<'_, Tile>> = pieces.map(|piece| piece.cover_of_pixels(n)).collect();
        if imaged.is_empty() {
            return Ok(None);
        }
        let feather = Gaussian::new(scene.restoration.feather_um / view.pixel_um)?;
        let mut feathered = Self { spans: Vec::new(), starts: Vec::new(), shares: Vec::new() };
        let (mut slab, mut shares, mut scratch) = (Vec::new(), Vec::new(), Scratch::default());
        for first in (0..view.height).step_by(BAND) {
            let end = (first + BAND).min(view.height);
            // The rows that these rows' blur reaches.
            let from = first.saturating_sub(feather.radius());
            let to = (end + feather.radius()).min(view.height);
            let near = |tile: &&Cow<'_, Tile>| {
                tile.origin[1] < to as i64 && tile.origin[1] + tile.height() as i64 > from as i64
            };
            let mut near = imaged.iter().filter(near).peekable();
            if near.peek().is_none() {
                continue;
            }
            slab.clear();
            slab.resize((to - from) * view.width, 0.0);
            for tile in near {
                lay(&mut slab, view.width, [0, from as i64], tile, |row, shares| {
                    row.iter_mut().zip(shares).filter(|(_, s)| **s >= COVERED).for_each(|(pixel, _)| *pixel = 1.0);
                });
            }
            shares.resize((end - first) * view.width, 0.0);
            // Eq. 16: C ∗ G_σ.
            feather.blur_rows_into(&slab, view.width, Border::Reflect, first - from, &mut shares, &mut scratch);
            for (y, row) in (first..).zip(shares.chunks_exact(view.width)) {
                feathered.add_row(y * view.width, row);
            }
        }
        Ok(Some(feathered))
    }

    /// Keeps what of a row is not 0. Its first pixel is pixel `at` of the image.
    fn add_row(&mut self, mut at: usize, row: &[f32]) {
        for run in row.chunk_by(|a, b| (*a == 0.0) == (*b == 0.0)) {
            if run[0] != 0.0 {
                self.spans.push(at..at + run.len());
                self.starts.push(self.shares.len());
                self.shares.extend_from_slice(run);
            }
            at += run.len();
        }
    }

    /// Where rows of the image that start at pixel `first` are to be restored, counted from there, and how much.
    pub(crate) fn within(&self, first: usize, pixels: usize) -> impl Iterator<Item = (Range<usize>, &[f32])> {
        let from = self.spans.partition_point(|span| span.start < first);
        let here = self.spans[from..].iter().zip(&self.starts[from..]);
        here.take_while(move |(span, _)| span.start < first + pixels)
            .map(move |(span, &start)| (span.start - first..span.end - first, &self.shares[start..start + span.len()]))
    }
}

/// Eq. 15 on transmitted light: I′ = I_sharp · C′ + I_spread · (1 − C′).
///
/// # Differences from the paper
/// Eq. 15 as printed mixes the phantom image I_p, an absorbance, with the intensity I_f. What is restored here is the
/// light 10^(I_b − I_p) before the spread in the image plane, in the same unit as what it replaces.
pub(crate) fn restore(spread: &mut [f32], sharp: &[f32], feathered: &[f32]) {
    for ((spread, sharp), share) in spread.iter_mut().zip(sharp).zip(feathered) {
        // Eq. 15: I C′ + I_f (1 − C′).
        *spread += share * (sharp - *spread);
    }
}
