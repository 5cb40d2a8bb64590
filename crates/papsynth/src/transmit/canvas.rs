//! What one object lets through of each channel's light, and how late, on its own rectangle of the slide's grid.

use dye_spectra::{Amounts, Colour, DYES};
use multiversion::multiversion;
use optics_psf::{Gaussian, Scratch};
use portable_numerics::elementary::exp10_from;

use crate::phantom::piece::{Phantom, Piece};
use crate::phantom::tile::{Tile, lay};
use crate::truth::{COVERED, Part};

/// How dyes become absorbance.
pub(super) enum Mixer {
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

#[derive(Debug, Default)]
pub(super) struct Canvas {
    /// Light that comes through, 0 to 1, channel by channel.
    pub(super) transmittance: Vec<Vec<f32>>,
    /// How late it comes, radians; empty if it does not.
    pub(super) phase_rad: Vec<f32>,
    /// Absorbance, or the amounts of dyes, on the way there.
    amounts: [Vec<f32>; DYES],
    zeros: Vec<f32>,
}

impl Window {
    /// The smallest rectangle of whole pixels, of `n` grid points a side, that holds the tiles; nothing if there are none.
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

    /// Whether it has a point in a grid of that size, or within a margin of it.
    pub(super) fn meets(self, width: usize, height: usize, margin: usize) -> bool {
        let margin = margin as i64;
        let inside = |axis: usize, length: usize, whole: usize| {
            self.origin[axis] - margin < whole as i64 && self.origin[axis] + length as i64 + margin > 0
        };
        inside(0, self.width, width) && inside(1, self.height, height)
    }
}

impl Mixer {
    pub(super) fn channels(&self) -> usize {
        match self {
            Self::Monochrome(_) => 1,
            Self::Colour(_) => 3,
        }
    }

    /// Absorbance of dyes in the middle of a channel's band.
    fn absorbance(&self, dyes: &Amounts, channel: usize) -> f64 {
        let wavelength = match self {
            Self::Monochrome(wavelength) => *wavelength,
            Self::Colour(colour) => colour.channels()[channel].wavelength_um,
        };
        dye_spectra::absorbance(dyes, wavelength)
    }

    /// The share that each piece has, over what it covers, in what the whole object absorbs of each channel's light.
    pub(super) fn shares(&self, phantom: &Phantom) -> Vec<Vec<f64>> {
        let pieces = &phantom.pieces;
        // Sums of what each piece absorbs where one of them covers.
        let within = |piece: &Piece| -> Vec<f64> {
            pieces.iter().map(|other| other.absorbance.sum_where(&piece.coverage, piece.cover_step, COVERED)).collect()
        };
        // What has no parts is all of it, whatever stains it.
        let is_all = |piece: &Piece| pieces.len() == 1 || piece.part == Part::Whole;
        let sums: Vec<Vec<f64>> =
            pieces.iter().map(|piece| if is_all(piece) { Vec::new() } else { within(piece) }).collect();
        let share = |own: usize, strengths: &[f64]| {
            let whole: f64 = sums[own].iter().zip(strengths).map(|(sum, strength)| sum * strength).sum();
            match sums[own].get(own) {
                None => 1.0,
                Some(sum) if whole > 0.0 => sum * strengths[own] / whole,
                Some(_) => 0.0,
            }
        };
        let of_channel = |channel: usize| {
            let strengths: Vec<f64> = pieces.iter().map(|piece| self.absorbance(&piece.dyes, channel)).collect();
            (0..pieces.len()).map(|own| share(own, &strengths)).collect()
        };
        (0..self.channels()).map(of_channel).collect()
    }

    /// Lets light through the pieces of an object.
    pub(super) fn compose(&self, pieces: &[Piece], window: Window, canvas: &mut Canvas) {
        let samples = window.width * window.height;
        let Canvas { transmittance, phase_rad, amounts, zeros } = canvas;
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
                    // A dye that is nowhere needs no plane.
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

/// Adds a tile, so many times as strong, to a rectangle.
#[multiversion(targets = "simd")]
pub(super) fn add(values: &mut [f32], window: Window, tile: &Tile, strength: f32) {
    lay(values, window.width, window.origin, tile, |row, tile| {
        row.iter_mut().zip(tile).for_each(|(value, tile)| *value += strength * tile);
    });
}

/// A tile that is blurred and as much larger, in memory of another one.
pub(super) fn blurred(tile: &Tile, gaussian: &Gaussian, mut values: Vec<f32>, scratch: &mut Scratch) -> Tile {
    let margin = gaussian.radius();
    let width = tile.width + 2 * margin;
    values.resize(width * (tile.height() + 2 * margin), 0.0);
    gaussian.blur_expanded_into(&tile.values, tile.width, &mut values, scratch);
    Tile { origin: tile.origin.map(|at| at - margin as i64), width, values }
}
