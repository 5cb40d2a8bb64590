//! Transmittance and phase delay of one object for each channel.

use core::cmp::Ordering;
use std::borrow::Cow;

use dye_spectra::{Amounts, Colour, Curve, DYES};
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

/// A rectangle of camera pixels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Window {
    pub(super) origin: [i64; 2],
    pub(super) width: usize,
    pub(super) height: usize,
}

/// Transmittance and phase delay of one object, in layers from coarse to fine.
#[derive(Debug, Default)]
pub(super) struct ObjectTransmission {
    pub(super) layers: Vec<TransmissionLayer>,
    buffers: MixerBuffers,
}

/// The conversion of the absorbance of some pieces to transmittance.
enum Mixture<'a> {
    /// At one wavelength, µm.
    Wavelength(f64),
    /// All pieces have the same dyes: one number per sample is sufficient.
    Proportional(Box<Curve>),
    /// Any amounts of dyes.
    Dyes(&'a Colour),
}

/// The absorbance at one wavelength as a negative number, the total amount of dye, or the amount of each dye; empty
/// planes stand for zero.
type AmountPlanes = [Vec<f32>; DYES];

/// Working memory of [`DyeMixer`].
#[derive(Debug, Default)]
struct MixerBuffers {
    amounts: AmountPlanes,
    deviations: AmountPlanes,
    steep: SteepSamples,
}

/// Blocks of samples within which amounts vary.
#[derive(Debug, Default)]
struct SteepSamples {
    /// First sample of each block.
    blocks: Vec<usize>,
    /// Amounts above the mean of all samples, then those below.
    amounts: AmountPlanes,
    transmittance: Vec<Vec<f32>>,
}

/// Standard deviation of the absorbance within a sample up to which the transmittance of the mean is used. The error is
/// below 3e-4 of the light.
const STEEP: f32 = 0.01;

/// Pieces of an object that are sampled at the same distance.
#[derive(Debug, Default)]
pub(super) struct TransmissionLayer {
    pub(super) window: Window,
    pub(super) samples_per_pixel: usize,
    /// Transmittance, 0 to 1, of this and all coarser layers, for each channel.
    pub(super) transmittance: Vec<Vec<f32>>,
    /// Transmittance of the coarser layers alone, for each channel; empty for the first layer.
    pub(super) behind: Vec<Vec<f32>>,
    /// Phase delay of all layers, radians; empty if the object does not refract, and in all layers except the first.
    pub(super) phase_rad: Vec<f32>,
}

impl Window {
    /// Returns the smallest rectangle around pieces; `None` without pieces. A camera pixel has `n` grid points along
    /// each axis.
    pub(super) fn around<'a>(pieces: impl Iterator<Item = &'a Piece>, n: usize) -> Option<Self> {
        Self::around_tiles(pieces.map(|piece| (&piece.absorbance, n / piece.step)))
    }

    /// Returns the smallest rectangle around tiles, given with their samples per pixel and axis; `None` without tiles.
    pub(super) fn around_tiles<'a>(tiles: impl Iterator<Item = (&'a Tile, usize)>) -> Option<Self> {
        let (mut low, mut high) = ([i64::MAX; 2], [i64::MIN; 2]);
        for (tile, samples) in tiles {
            let samples = samples as i64;
            for (axis, length) in [tile.width, tile.height()].into_iter().enumerate() {
                low[axis] = low[axis].min(tile.origin[axis].div_euclid(samples));
                high[axis] = high[axis].max((tile.origin[axis] + length as i64 + samples - 1).div_euclid(samples));
            }
        }
        let side = |axis: usize| usize::try_from(high[axis].checked_sub(low[axis])?).ok().filter(|side| *side > 0);
        Some(Self { origin: low, width: side(0)?, height: side(1)? })
    }

    /// Whether the rectangle intersects an image of this size extended by a margin.
    pub(super) fn meets(self, width: usize, height: usize, margin: usize) -> bool {
        let margin = margin as i64;
        let inside = |axis: usize, length: usize, size: usize| {
            self.origin[axis] - margin < size as i64 && self.origin[axis] + length as i64 + margin > 0
        };
        inside(0, self.width, width) && inside(1, self.height, height)
    }

    /// Returns the part inside an image of this size extended by a margin. The rectangle must intersect it.
    pub(super) fn cropped(self, width: usize, height: usize, margin: usize) -> Self {
        let margin = margin as i64;
        let mut part = self;
        for (axis, (side, size)) in [&mut part.width, &mut part.height].into_iter().zip([width, height]).enumerate() {
            let low = self.origin[axis].max(-margin);
            let high = (self.origin[axis] + *side as i64).min(size as i64 + margin);
            part.origin[axis] = low;
            *side = usize::try_from(high - low).unwrap_or(0);
        }
        part
    }

    /// Returns the smallest rectangle around this and another one.
    pub(super) fn with(self, other: Self) -> Self {
        let mut sides = [0; 2];
        let ends = [[self.width, other.width], [self.height, other.height]];
        let origin = [0, 1].map(|axis| self.origin[axis].min(other.origin[axis]));
        for (axis, (side, [own, others])) in sides.iter_mut().zip(ends).enumerate() {
            let end = (self.origin[axis] + own as i64).max(other.origin[axis] + others as i64);
            *side = usize::try_from(end - origin[axis]).unwrap_or(0);
        }
        Self { origin, width: sides[0], height: sides[1] }
    }

    /// Returns the same rectangle in samples, `samples` per pixel and axis.
    pub(super) fn sampled(self, samples: usize) -> Self {
        Self {
            origin: self.origin.map(|at| at * samples as i64),
            width: self.width * samples,
            height: self.height * samples,
        }
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
    /// covers. A camera pixel has `n` grid points along each axis.
    pub(super) fn fractions(&self, phantom: &Phantom, n: usize) -> Vec<Vec<f64>> {
        let pieces = &phantom.pieces;
        if pieces.len() == 1 {
            return vec![vec![1.0]; self.channels()];
        }
        let absorbances: Vec<_> = pieces.iter().map(|piece| piece.pixel_absorbance(n)).collect();
        // Sums of the absorbance of each piece over the area of one piece.
        let within = |piece: &Piece| -> Vec<f64> {
            let coverage = piece.pixel_coverage(n);
            absorbances.iter().map(|absorbance| absorbance.sum_where(&coverage, COVERED)).collect()
        };
        // An object without parts contributes its complete absorbance.
        let is_all = |piece: &Piece| piece.part == Part::Whole;
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

    /// Computes the transmittance and phase delay of an object in a window, layer by layer. A camera pixel has `n` grid
    /// points along each axis.
    pub(super) fn compose(&self, pieces: &[Piece], window: Window, n: usize, transmission: &mut ObjectTransmission) {
        let ObjectTransmission { layers, buffers } = transmission;
        let mut steps: Vec<usize> = pieces.iter().map(|piece| piece.step).collect();
        steps.sort_unstable_by(|a, b| b.cmp(a));
        steps.dedup();
        layers.resize_with(steps.len(), TransmissionLayer::default);
        for (index, (layer, &step)) in layers.iter_mut().zip(&steps).enumerate() {
            let own = || pieces.iter().filter(|piece| piece.step == step);
            layer.samples_per_pixel = n / step;
            // The first layer holds the phase delay of all pieces.
            layer.window = if index == 0 { window } else { Window::around(own(), n).unwrap_or(window) };
            layer.behind.clear();
            layer.phase_rad.clear();
            let on = layer.window.sampled(layer.samples_per_pixel);
            if index > 0 {
                let coarser = |least: usize| pieces.iter().filter(move |piece| piece.step >= least);
                let tiles: Vec<_> = coarser(step).map(|piece| (piece, resampled(piece, step, on))).collect();
                self.transmittance(&tiles, on, &mut layer.transmittance, &mut buffers.amounts);
                let tiles: Vec<_> = tiles.into_iter().filter(|(piece, _)| piece.step > step).collect();
                self.transmittance(&tiles, on, &mut layer.behind, &mut buffers.amounts);
                continue;
            }
            let tiles = self.coarsest(&own().collect::<Vec<_>>(), on, layer, buffers);
            let finer = pieces.iter().filter(|piece| piece.step < step && piece.phase_rad != 0.0);
            let finer: Vec<_> = finer.map(|piece| (piece, resampled(piece, step, on))).collect();
            for (piece, tile) in tiles.iter().chain(&finer).filter(|(piece, _)| piece.phase_rad != 0.0) {
                layer.phase_rad.resize(on.width * on.height, 0.0);
                add(&mut layer.phase_rad, on, tile, piece.phase_rad as f32);
            }
        }
    }

    /// Computes the transmittance of the pieces of the first layer, and returns their mean absorbance in each sample.
    fn coarsest<'a>(
        &self,
        pieces: &[&'a Piece],
        window: Window,
        layer: &mut TransmissionLayer,
        buffers: &mut MixerBuffers,
    ) -> Vec<(&'a Piece, Cow<'a, Tile>)> {
        let own = || pieces.iter().copied();
        let step = own().map(|piece| piece.step).max().unwrap_or(1);
        let MixerBuffers { amounts, deviations, steep } = buffers;
        if step == 1 {
            let tiles: Vec<_> = own().map(|piece| (piece, Cow::Borrowed(&piece.absorbance))).collect();
            self.transmittance(&tiles, window, &mut layer.transmittance, amounts);
            return tiles;
        }
        let moments = own().map(|piece| {
            let [mean, deviation] = piece.absorbance.moments_within_pixels(step);
            ((piece, Cow::Owned(mean)), (piece, Cow::Owned(deviation)))
        });
        let (means, of_deviations): (Vec<_>, Vec<_>) = moments.unzip();
        let mixture = self.mixture(own());
        mixture.amounts(&means, window, amounts);
        mixture.transmit(amounts, window.width * window.height, &mut layer.transmittance);
        mixture.amounts(&of_deviations, window, deviations);
        // T(A) is not linear: the mean of its values at the mean ± the deviation of A approximates that of a sample.
        steep.find(amounts, deviations);
        mixture.transmit(&steep.amounts, steep.len(), &mut steep.transmittance);
        for (transmittance, found) in layer.transmittance.iter_mut().zip(&steep.transmittance) {
            steep.replace(transmittance, found);
        }
        means
    }

    /// Computes the transmittance of tiles of the same sampling in each channel.
    fn transmittance(
        &self,
        tiles: &[(&Piece, Cow<'_, Tile>)],
        window: Window,
        transmittance: &mut Vec<Vec<f32>>,
        amounts: &mut AmountPlanes,
    ) {
        let mixture = self.mixture(tiles.iter().map(|(piece, _)| *piece));
        mixture.amounts(tiles, window, amounts);
        mixture.transmit(amounts, window.width * window.height, transmittance);
    }

    /// Returns how the absorbance of these pieces becomes transmittance.
    fn mixture<'p>(&self, mut pieces: impl Iterator<Item = &'p Piece>) -> Mixture<'_> {
        match self {
            Self::Monochrome(wavelength) => Mixture::Wavelength(*wavelength),
            Self::Colour(colour) => {
                let dyes = pieces.next().map(|first| first.dyes).filter(|dyes| pieces.all(|piece| piece.dyes == *dyes));
                let curve = dyes.and_then(|dyes| colour.curve(&proportions(&dyes)).ok());
                curve.map_or(Mixture::Dyes(colour), |curve| Mixture::Proportional(Box::new(curve)))
            }
        }
    }

    /// Computes the transmittance in each channel and the phase delay of an object on a window of the grid.
    pub(super) fn compose_on_grid(&self, pieces: &[Piece], window: Window) -> TransmissionLayer {
        let mut layer = TransmissionLayer { window, ..TransmissionLayer::default() };
        let tiles: Vec<_> = pieces.iter().map(|piece| (piece, resampled(piece, 1, window))).collect();
        self.transmittance(&tiles, window, &mut layer.transmittance, &mut Default::default());
        for (piece, tile) in tiles.iter().filter(|(piece, _)| piece.phase_rad != 0.0) {
            layer.phase_rad.resize(window.width * window.height, 0.0);
            add(&mut layer.phase_rad, window, tile, piece.phase_rad as f32);
        }
        layer
    }
}

/// Returns the sum of the amounts of all dyes.
pub(super) fn total(dyes: &Amounts) -> f64 {
    dyes.iter().sum()
}

/// Returns the amounts of dyes relative to their sum.
pub(super) fn proportions(dyes: &Amounts) -> Amounts {
    dyes.map(|amount| amount / total(dyes).max(f64::MIN_POSITIVE))
}

impl Mixture<'_> {
    /// Adds the amounts of tiles of the same sampling.
    fn amounts(&self, tiles: &[(&Piece, Cow<'_, Tile>)], window: Window, amounts: &mut AmountPlanes) {
        for (number, amount) in amounts.iter_mut().enumerate() {
            let strength = |piece: &Piece| match (self, number) {
                (Self::Wavelength(wavelength), 0) => -dye_spectra::absorbance(&piece.dyes, *wavelength),
                (Self::Proportional(_), 0) => total(&piece.dyes),
                (Self::Wavelength(_) | Self::Proportional(_), _) => 0.0,
                (Self::Dyes(_), dye) => piece.dyes[dye],
            };
            amount.clear();
            // A dye without amounts needs no plane.
            if number == 0 || tiles.iter().any(|(piece, _)| strength(piece) != 0.0) {
                amount.resize(window.width * window.height, 0.0);
            }
            for (piece, tile) in tiles.iter().filter(|(piece, _)| strength(piece) != 0.0) {
                add(amount, window, tile, strength(piece) as f32);
            }
        }
    }

    /// Computes the transmittance of amounts in each channel.
    fn transmit(&self, amounts: &AmountPlanes, samples: usize, transmittance: &mut Vec<Vec<f32>>) {
        let channels = if matches!(self, Self::Wavelength(_)) { 1 } else { 3 };
        transmittance.resize(channels, Vec::new());
        transmittance.iter_mut().for_each(|channel| channel.resize(samples, 0.0));
        match (self, &mut transmittance[..]) {
            // Beer and Lambert: T = 10^(−A).
            (Self::Wavelength(_), [transmittance]) => {
                transmittance.fill(0.0);
                exp10_from(&amounts[0], transmittance);
            }
            (Self::Proportional(curve), [r, g, b]) => curve.transmittance_into(&amounts[0], [r, g, b]),
            (Self::Dyes(colour), [r, g, b]) => {
                colour.transmittance_into(amounts.each_ref().map(|plane| &plane[..]), [r, g, b]);
            }
            _ => {}
        }
    }
}

impl SteepSamples {
    /// Finds the blocks with a sample in which the sum of deviations is large, and collects their amounts.
    fn find(&mut self, amounts: &AmountPlanes, deviations: &AmountPlanes) {
        let Self { blocks, amounts: own, .. } = self;
        find_steep(deviations, blocks);
        for ((own, amounts), deviations) in own.iter_mut().zip(amounts).zip(deviations) {
            own.clear();
            if amounts.is_empty() {
                continue;
            }
            for sign in [1.0, -1.0] {
                for &first in &*blocks {
                    let (at, amounts) = (own.len(), block_at(amounts, first));
                    own.extend_from_slice(amounts);
                    if !deviations.is_empty() {
                        add_scaled(&mut own[at..], block_at(deviations, first), sign);
                    }
                }
            }
        }
    }

    /// Replaces the transmittance in the blocks by the mean above and below the mean amount.
    fn replace(&self, transmittance: &mut [f32], found: &[f32]) {
        let (mut above, mut below) = found.split_at(found.len() / 2);
        for &first in &self.blocks {
            let to = &mut transmittance[first..];
            let length = to.len().min(BLOCK);
            set_mean(&mut to[..length], &above[..length], &below[..length]);
            (above, below) = (&above[length..], &below[length..]);
        }
    }

    /// Returns the number of collected amounts.
    fn len(&self) -> usize {
        self.amounts[0].len()
    }
}

/// Samples that are compared together.
const BLOCK: usize = 16;

/// Returns the samples of a block; the last one may be shorter.
fn block_at(plane: &[f32], first: usize) -> &[f32] {
    &plane[first..plane.len().min(first + BLOCK)]
}

/// Writes the first sample of every block that contains a large sum of deviations.
#[multiversion(targets = "simd")]
fn find_steep(deviations: &AmountPlanes, blocks: &mut Vec<usize>) {
    blocks.clear();
    let samples = deviations.iter().map(Vec::len).max().unwrap_or(0);
    for first in (0..samples).step_by(BLOCK) {
        let mut sums = [0.0_f32; BLOCK];
        for plane in deviations.iter().filter(|plane| !plane.is_empty()) {
            let block = &plane[first..];
            if let Some(block) = block.first_chunk::<BLOCK>() {
                sums.iter_mut().zip(block).for_each(|(sum, deviation)| *sum += deviation.abs());
            } else {
                sums.iter_mut().zip(block).for_each(|(sum, deviation)| *sum += deviation.abs());
            }
        }
        if sums.iter().fold(false, |steep, sum| steep | (*sum > STEEP)) {
            blocks.push(first);
        }
    }
}

#[multiversion(targets = "simd")]
fn set_mean(to: &mut [f32], above: &[f32], below: &[f32]) {
    to.iter_mut().zip(above.iter().zip(below)).for_each(|(to, (above, below))| *to = 0.5 * (above + below));
}

#[multiversion(targets = "simd")]
pub(super) fn add_scaled(values: &mut [f32], others: &[f32], factor: f32) {
    values.iter_mut().zip(others).for_each(|(value, other)| *value += factor * other);
}

/// Returns the absorbance of a piece sampled at another distance, at least in a window.
fn resampled(piece: &Piece, step: usize, window: Window) -> Cow<'_, Tile> {
    let tile = &piece.absorbance;
    match piece.step.cmp(&step) {
        Ordering::Equal => Cow::Borrowed(tile),
        Ordering::Less => Cow::Owned(tile.coarsened(step / piece.step)),
        Ordering::Greater => {
            let factor = piece.step / step;
            // Interpolation needs neighbours.
            let low = window.origin.map(|at| at.div_euclid(factor as i64) - NEIGHBOURS);
            let side = |length: usize| length.div_ceil(factor) + 2 * NEIGHBOURS.unsigned_abs() as usize + 1;
            let part = tile.part(low, side(window.width), side(window.height));
            Cow::Owned(part.refined(factor))
        }
    }
}

/// Samples around a window that interpolation uses.
const NEIGHBOURS: i64 = 3;

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_are_cropped_and_joined() {
        let window = |origin: [i64; 2], width, height| Window { origin, width, height };
        assert_eq!(window([-20, 30], 60, 50).cropped(100, 70, 8), window([-8, 30], 48, 48));
        assert_eq!(window([90, -3], 10, 5).cropped(100, 70, 8), window([90, -3], 10, 5));
        assert_eq!(window([-400, -400], 900, 900).cropped(100, 70, 0), window([0, 0], 100, 70));
        assert_eq!(window([1, 2], 3, 4).with(window([-5, 3], 7, 2)), window([-5, 2], 9, 4));
    }
}
