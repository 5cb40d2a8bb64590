//! Transmittance and phase delay of one object for each channel, on a rectangle of the slide's grid.

use dye_spectra::{Amounts, Colour, DYES};
use multiversion::multiversion;
use optics_psf::{Gaussian, Scratch};
use portable_numerics::elementary::exp10_from;

use crate::phantom::piece::{Phantom, Piece};
use crate::phantom::tile::{Tile, overlay};
use crate::truth::{COVERED, Part};

/// The conversion of dye amounts to absorbance.
pub(super) enum DyeMixer {
    /// At one wavelength, µm.
    Monochrome(f64),
    /// Over the bands of three channels.
    Colour(Box<Colour>),
}

/// A rectangle of the slide's grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Window {
    pub(super) origin: [i64; 2],
    pub(super) width: usize,
    pub(super) height: usize,
}

/// Transmittance and phase delay of one object on a [`Window`].
#[derive(Debug, Default)]
pub(super) struct ObjectTransmission {
    /// Transmittance, 0 to 1, for each channel.
    pub(super) transmittance: Vec<Vec<f32>>,
    /// Phase delay, radians; empty if the object does not refract.
    pub(super) phase_rad: Vec<f32>,
    /// Buffers for the absorbance or the amounts of dyes.
    amounts: [Vec<f32>; DYES],
    zeros: Vec<f32>,
}

impl Window {
    /// Returns the smallest rectangle of complete pixels (`n` x `n` grid points) around the tiles; `None` without
    /// tiles.
    pub(super) fn around<'a>(tiles: impl Iterator<Item = &'a Tile>, n: usize) -> Option<Self> {
        let n = n as i64;
        let (mut low, mut high) = ([i64::MAX; 2], [i64::MIN; 2]);
        for tile in tiles {
            for (axis, length) in [tile.width, tile.height()].into_iter().enumerate() {
                low[axis] = low[axis].min(tile.origin[axis].div_euclid(n) * n);
                high[axis] = high[axis].max((tile.origin[axis] + length as i64 + n - 1).div_euclid(n) * n);
            }
        }
        let side = |axis: usize| usize::try_from(high[axis].checked_sub(low[axis])?).ok().filter(|side| *side > 0);
        Some(Self { origin: low, width: side(0)?, height: side(1)? })
    }

    /// Whether the rectangle intersects a grid of this size extended by a margin.
    pub(super) fn meets(self, width: usize, height: usize, margin: usize) -> bool {
        let margin = margin as i64;
        let inside = |axis: usize, length: usize, size: usize| {
            self.origin[axis] - margin < size as i64 && self.origin[axis] + length as i64 + margin > 0
        };
        inside(0, self.width, width) && inside(1, self.height, height)
    }
}

impl DyeMixer {
    pub(super) fn channels(&self) -> usize {
        match self {
            Self::Monochrome(_) => 1,
            Self::Colour(_) => 3,
        }
    }

    /// Returns the absorbance of dyes at the centre wavelength of a channel.
    fn absorbance(&self, dyes: &Amounts, channel: usize) -> f64 {
        let wavelength = match self {
            Self::Monochrome(wavelength) => *wavelength,
            Self::Colour(colour) => colour.channels()[channel].wavelength_um,
        };
        dye_spectra::absorbance(dyes, wavelength)
    }

    /// Returns, for each channel and piece, the fraction of the object's absorbance that the piece contributes where it
    /// covers.
    pub(super) fn fractions(&self, phantom: &Phantom) -> Vec<Vec<f64>> {
        let pieces = &phantom.pieces;
        // Sums of the absorbance of each piece over the area of one piece.
        let within = |piece: &Piece| -> Vec<f64> {
            pieces
                .iter()
                .map(|other| other.absorbance.sum_where(&piece.coverage, piece.coverage_step, COVERED))
                .collect()
        };
        // An object without parts contributes its complete absorbance.
        let is_all = |piece: &Piece| pieces.len() == 1 || piece.part == Part::Whole;
        let sums: Vec<Vec<f64>> =
            pieces.iter().map(|piece| if is_all(piece) { Vec::new() } else { within(piece) }).collect();
        let fraction = |own: usize, strengths: &[f64]| {
            let total: f64 = sums[own].iter().zip(strengths).map(|(sum, strength)| sum * strength).sum();
            match sums[own].get(own) {
                None => 1.0,
                Some(sum) if total > 0.0 => sum * strengths[own] / total,
                Some(_) => 0.0,
            }
        };
        let of_channel = |channel: usize| {
            let strengths: Vec<f64> = pieces.iter().map(|piece| self.absorbance(&piece.dyes, channel)).collect();
            (0..pieces.len()).map(|own| fraction(own, &strengths)).collect()
        };
        (0..self.channels()).map(of_channel).collect()
    }

    /// Computes the transmittance and phase delay of the pieces of an object.
    pub(super) fn compose(&self, pieces: &[Piece], window: Window, transmission: &mut ObjectTransmission) {
        let samples = window.width * window.height;
        let ObjectTransmission { transmittance, phase_rad, amounts, zeros } = transmission;
        transmittance.resize(self.channels(), Vec::new());
        match self {
            Self::Monochrome(wavelength) => {
                let [absorbance, ..] = amounts;
                clear(absorbance, samples);
                for piece in pieces {
                    let strength = dye_spectra::absorbance(&piece.dyes, *wavelength) as f32;
                    add(absorbance, window, &piece.absorbance, strength);
                }
                clear(zeros, samples);
                // Beer and Lambert: T = 10^(−A).
                exp10_from(zeros, absorbance);
                core::mem::swap(absorbance, &mut transmittance[0]);
            }
            Self::Colour(colour) => {
                for (dye, amount) in amounts.iter_mut().enumerate() {
                    amount.clear();
                    // A dye without amounts needs no plane.
                    if pieces.iter().any(|piece| piece.dyes[dye] > 0.0) {
                        amount.resize(samples, 0.0);
                    }
                    for piece in pieces.iter().filter(|piece| piece.dyes[dye] > 0.0) {
                        add(amount, window, &piece.absorbance, piece.dyes[dye] as f32);
                    }
                }
                for channel in transmittance.iter_mut() {
                    channel.resize(samples, 0.0);
                }
                let [r, g, b] = &mut transmittance[..] else { return };
                let [h, e, l, o, n] = &*amounts;
                colour.transmittance_into([h, e, l, o, n], [r, g, b]);
            }
        }
        phase_rad.clear();
        if pieces.iter().any(|piece| piece.phase_rad != 0.0) {
            phase_rad.resize(samples, 0.0);
            for piece in pieces.iter().filter(|piece| piece.phase_rad != 0.0) {
                add(phase_rad, window, &piece.absorbance, piece.phase_rad as f32);
            }
        }
    }
}

pub(super) fn clear(values: &mut Vec<f32>, samples: usize) {
    values.clear();
    values.resize(samples, 0.0);
}

/// Adds `strength` times a tile to a rectangle.
#[multiversion(targets = "simd")]
pub(super) fn add(values: &mut [f32], window: Window, tile: &Tile, strength: f32) {
    overlay(values, window.width, window.origin, tile, |row, tile| {
        row.iter_mut().zip(tile).for_each(|(value, tile)| *value += strength * tile);
    });
}

/// Returns a blurred tile, enlarged by the blur radius; `values` is a buffer for it.
pub(super) fn blurred_tile(tile: &Tile, gaussian: &Gaussian, mut values: Vec<f32>, scratch: &mut Scratch) -> Tile {
    let margin = gaussian.radius();
    let width = tile.width + 2 * margin;
    values.resize(width * (tile.height() + 2 * margin), 0.0);
    gaussian.blur_expanded_into(&tile.values, tile.width, &mut values, scratch);
    Tile { origin: tile.origin.map(|at| at - margin as i64), width, values }
}
