//! Colours of overlapping stained objects.
//!
//! Each object transmits a mean fraction of a channel's band, and the fractions of overlapping objects are multiplied.
//! This is too dark where objects absorb the same wavelengths: the first leaves less light to absorb for the second.
//! The image is therefore multiplied by the ratio of the light behind all dyes together to the product of the light
//! behind each object. The ratio is computed on camera pixels, from amounts of dye with the defocus blur of each
//! object.

use core::ops::Range;
use std::borrow::Cow;

use dye_spectra::{Amounts, Colour, Curve, DYES};
use multiversion::multiversion;
use optics_psf::{Gaussian, Method, Scratch};

use super::light::Specimen;
use super::object_transmission::{Window, add_scaled, blurred_tile, clear, proportions, total};
use crate::error::ErrorKind;
use crate::phantom::piece::{Phantom, Piece};
use crate::phantom::tile::Tile;
use crate::scene::{Scene, View};
use crate::threads;

/// Absorbance below which an object does not change the colour behind it.
const FAINT: f32 = 0.01;

/// Total amount of dye up to which an object does not overlap others. The correction is then below 1e-5.
const THIN: f32 = 1e-4;

/// Standard deviation below which blur is skipped, px.
const SHARP_PX: f64 = 0.5;

/// Fraction of a blurred amount in the truncated tails.
const LOST_TAIL: f64 = 1e-3;

/// The overlapping objects of a scene.
pub(super) struct Overlaps {
    objects: Vec<usize>,
}

/// An object that may overlap another, as it appears in a plane.
struct StainedObject<'a> {
    pieces: Vec<StainedPiece<'a>>,
}

struct StainedPiece<'a> {
    /// Absorbance of each camera pixel, blurred.
    absorbance: Cow<'a, Tile>,
    /// Amounts of dye where the absorbance is 1, and their sum.
    dyes: Amounts,
    total: f32,
    /// Light of these dyes as a function of their sum.
    curve: Curve,
}

/// Values of a part of a row.
#[derive(Debug, Default)]
struct RowBuffers {
    /// Objects that overlap each pixel.
    layers: Vec<f32>,
    /// Total amount of dye of an object.
    stain: Vec<f32>,
    /// Amounts of dye and light of an object.
    amounts: [Vec<f32>; DYES],
    transmittance: [Vec<f32>; 3],
    /// Amounts of dye of all objects, their light, and the product of the light of each object.
    totals: [Vec<f32>; DYES],
    together: [Vec<f32>; 3],
    products: [Vec<f32>; 3],
}

impl Overlaps {
    /// Collects the objects whose bounding boxes intersect.
    ///
    /// On a slide, overlaps beyond the border of a frame are unknown, so all stained objects are collected.
    pub(super) fn new(specimen: Specimen<'_>) -> Self {
        let (scene, phantoms) = (specimen.scene, specimen.phantoms);
        let all = scene.frame.is_some();
        let boxes: Vec<Option<Window>> = phantoms.iter().map(|phantom| stained_window(phantom, scene)).collect();
        // Boxes sorted by their left edges intersect only with neighbours.
        let mut order: Vec<usize> = (0..boxes.len()).filter(|&i| boxes[i].is_some()).collect();
        order.sort_by_key(|&i| boxes[i].map(|b| b.origin[0]));
        let mut meets: Vec<bool> = boxes.iter().map(|b| all && b.is_some()).collect();
        for (at, &i) in order.iter().enumerate() {
            let Some(a) = boxes[i] else { continue };
            for &j in &order[at + 1..] {
                let Some(b) = boxes[j] else { continue };
                if b.origin[0] >= a.origin[0] + a.width as i64 {
                    break;
                }
                if b.origin[1] < a.origin[1] + a.height as i64 && a.origin[1] < b.origin[1] + b.height as i64 {
                    (meets[i], meets[j]) = (true, true);
                }
            }
        }
        Self { objects: (0..boxes.len()).filter(|&i| meets[i]).collect() }
    }

    /// Corrects three channels. `blur_px` returns the standard deviation of the defocus blur of each object.
    pub(super) fn correct(
        &self,
        colour: &Colour,
        specimen: Specimen<'_>,
        blur_px: impl Fn(usize) -> f64 + Sync + Send,
        channels: &mut [Vec<f32>],
    ) -> Result<(), ErrorKind> {
        let [r, g, b] = channels else { return Ok(()) };
        if self.objects.len() < 2 {
            return Ok(());
        }
        let n = specimen.scene.oversampling();
        let objects = threads::map(specimen.work.threads, &self.objects, |&index| {
            StainedObject::new(colour, &specimen.phantoms[index], n, blur_px(index))
        });
        let objects = objects.into_iter().collect::<Result<Vec<_>, ErrorKind>>()?;
        correct_overlaps(colour, &objects, specimen.scene.view.width, [r, g, b]);
        Ok(())
    }
}

impl<'a> StainedPiece<'a> {
    fn new(colour: &Colour, absorbance: Cow<'a, Tile>, dyes: Amounts) -> Result<Self, ErrorKind> {
        Ok(Self { absorbance, dyes, total: total(&dyes) as f32, curve: colour.curve(&proportions(&dyes))? })
    }

    /// Returns the absorbance in a row of the image.
    fn values(&self, y: usize) -> Option<&[f32]> {
        let row = usize::try_from(y as i64 - self.absorbance.origin[1]).ok()?;
        self.absorbance.values.chunks_exact(self.absorbance.width).nth(row)
    }
}

impl<'a> StainedObject<'a> {
    /// A camera pixel has `n` grid points along each axis.
    fn new(colour: &Colour, phantom: &'a Phantom, n: usize, blur_px: f64) -> Result<Self, ErrorKind> {
        let blur = || Gaussian::truncated(blur_px, Method::Decimated, LOST_TAIL);
        let gaussian = (blur_px > SHARP_PX).then(blur).transpose()?;
        let mut scratch = Scratch::default();
        let piece = |piece: &'a Piece| {
            let sharp = piece.pixel_absorbance(n);
            let absorbance = match &gaussian {
                Some(gaussian) => Cow::Owned(blurred_tile(&sharp, gaussian, Vec::new(), &mut scratch)),
                None => sharp,
            };
            StainedPiece::new(colour, absorbance, piece.dyes)
        };
        Ok(Self { pieces: phantom.pieces.iter().map(piece).collect::<Result<_, ErrorKind>>()? })
    }

    /// Returns the pieces in a row of the image, with the range of their columns in the image and their absorbance.
    fn row(&self, y: usize, width: usize) -> impl Iterator<Item = (&StainedPiece<'a>, Range<usize>, &[f32])> + Clone {
        self.pieces.iter().filter_map(move |piece| {
            let (values, tile) = (piece.values(y)?, &*piece.absorbance);
            let left = tile.origin[0].max(0);
            let right = (tile.origin[0] + tile.width as i64).min(width as i64);
            (left < right).then(|| {
                let own = |at: i64| (at - tile.origin[0]) as usize;
                (piece, left as usize..right as usize, &values[own(left)..own(right)])
            })
        })
    }
}

/// Multiplies light by the ratio of joint to separate transmittance where several objects overlap.
fn correct_overlaps(colour: &Colour, objects: &[StainedObject<'_>], width: usize, channels: [&mut [f32]; 3]) {
    let [r, g, b] = channels.map(|channel| channel.chunks_exact_mut(width));
    let mut buffers = RowBuffers::default();
    for (y, ((r, g), b)) in r.zip(g).zip(b).enumerate() {
        let here: Vec<&StainedObject<'_>> =
            objects.iter().filter(|object| object.row(y, width).next().is_some()).collect();
        if here.len() < 2 {
            continue;
        }
        buffers.count_layers(&here, y, width);
        let mut channels = [r, g, b];
        for span in spans(&buffers.layers) {
            buffers.collect(colour, &here, y, width, span.clone());
            let layers = &buffers.layers[span.clone()];
            let ratios = buffers.together.iter().zip(&buffers.products);
            for (channel, (together, product)) in channels.iter_mut().zip(ratios) {
                scale(&mut channel[span.clone()], together, product, layers);
            }
        }
    }
}

impl RowBuffers {
    /// Counts the objects that overlap each pixel of a row.
    fn count_layers(&mut self, objects: &[&StainedObject<'_>], y: usize, width: usize) {
        clear(&mut self.layers, width);
        for object in objects {
            let columns = |all: Range<usize>, (_, own, _): (_, Range<usize>, _)| {
                if all.is_empty() { own } else { all.start.min(own.start)..all.end.max(own.end) }
            };
            let columns = object.row(y, width).fold(0..0, columns);
            clear(&mut self.stain, columns.len());
            for (piece, own, values) in object.row(y, width) {
                let stain = &mut self.stain[own.start - columns.start..own.end - columns.start];
                add_scaled(stain, values, piece.total);
            }
            count(&mut self.layers[columns], &self.stain);
        }
    }

    /// Computes the light of some pixels of a row behind all objects together, and the product of the light behind each
    /// object.
    fn collect(&mut self, colour: &Colour, objects: &[&StainedObject<'_>], y: usize, width: usize, span: Range<usize>) {
        let Self { stain, amounts, transmittance, totals, together, products, .. } = self;
        totals.iter_mut().for_each(|total| clear(total, span.len()));
        for product in products.iter_mut() {
            product.clear();
            product.resize(span.len(), 1.0);
        }
        for object in objects {
            // The pieces in the span, with their place in it.
            let pieces = object.row(y, width).filter_map(|(piece, own, values)| {
                let (first, end) = (own.start.max(span.start), own.end.min(span.end));
                let values = values.get(first.checked_sub(own.start)?..end.checked_sub(own.start)?)?;
                let is_stained = values.iter().any(|value| *value > 0.0);
                is_stained.then(|| (piece, first - span.start..end - span.start, values))
            });
            for (piece, place, values) in pieces.clone() {
                for (total, dye) in totals.iter_mut().zip(piece.dyes).filter(|(_, dye)| *dye > 0.0) {
                    add_scaled(&mut total[place.clone()], values, dye as f32);
                }
            }
            // The method depends on the object and the row, not on the span, which may end at the border of the image.
            if object.pieces.iter().filter(|piece| piece.values(y).is_some()).count() == 1 {
                for (piece, place, values) in pieces {
                    clear(stain, values.len());
                    add_scaled(stain, values, piece.total);
                    resize(transmittance, values.len());
                    piece.curve.transmittance_into(stain, transmittance.each_mut().map(|channel| &mut channel[..]));
                    multiply_each(products, place, transmittance);
                }
                continue;
            }
            amounts.iter_mut().for_each(|amount| clear(amount, span.len()));
            for (piece, place, values) in pieces {
                for (amount, dye) in amounts.iter_mut().zip(piece.dyes).filter(|(_, dye)| *dye > 0.0) {
                    add_scaled(&mut amount[place.clone()], values, dye as f32);
                }
            }
            resize(transmittance, span.len());
            light_of(colour, amounts, transmittance);
            multiply_each(products, 0..span.len(), transmittance);
        }
        resize(together, span.len());
        light_of(colour, totals, together);
    }
}

/// Returns the ranges of pixels with several layers. Short gaps are included.
fn spans(layers: &[f32]) -> Vec<Range<usize>> {
    const GAP: usize = 32;
    let mut spans: Vec<Range<usize>> = Vec::new();
    for (x, _) in layers.iter().enumerate().filter(|(_, layers)| **layers >= 2.0) {
        match spans.last_mut() {
            Some(last) if x < last.end + GAP => last.end = x + 1,
            _ => spans.push(x..x + 1),
        }
    }
    spans
}

fn resize(channels: &mut [Vec<f32>; 3], length: usize) {
    channels.iter_mut().for_each(|channel| channel.resize(length, 0.0));
}

fn light_of(colour: &Colour, amounts: &[Vec<f32>; DYES], light: &mut [Vec<f32>; 3]) {
    let amounts = amounts.each_ref().map(|amount| &amount[..]);
    colour.transmittance_into(amounts, light.each_mut().map(|channel| &mut channel[..]));
}

fn multiply_each(products: &mut [Vec<f32>; 3], place: Range<usize>, factors: &[Vec<f32>; 3]) {
    for (product, factor) in products.iter_mut().zip(factors) {
        multiply(&mut product[place.clone()], factor);
    }
}

/// Returns the camera pixels over which the stain of an object is not negligible.
fn stained_window(phantom: &Phantom, scene: &Scene) -> Option<Window> {
    let View { width, height, .. } = scene.view;
    let strong = phantom.pieces.iter().filter(|piece| {
        let dyes: f64 = piece.dyes[..DYES - 1].iter().sum();
        piece.absorbance.values.iter().any(|value| value * dyes as f32 > FAINT)
    });
    let window = Window::around(strong, scene.oversampling())?;
    (scene.frame.is_some() || window.meets(width, height, 0)).then_some(window)
}

#[multiversion(targets = "simd")]
fn multiply(values: &mut [f32], factors: &[f32]) {
    values.iter_mut().zip(factors).for_each(|(value, factor)| *value *= factor);
}

/// Adds 1 where an object is not negligible.
#[multiversion(targets = "simd")]
fn count(layers: &mut [f32], stain: &[f32]) {
    layers.iter_mut().zip(stain).for_each(|(layers, stain)| *layers += if *stain > THIN { 1.0 } else { 0.0 });
}

/// Light added to both terms of the ratio, so that very dark pixels are unchanged.
const DARK: f32 = 1e-3;

/// Multiplies light by the ratio of joint to separate transmittance where several objects overlap.
#[multiversion(targets = "simd")]
fn scale(channel: &mut [f32], together: &[f32], product: &[f32], layers: &[f32]) {
    for (((light, together), product), layers) in channel.iter_mut().zip(together).zip(product).zip(layers) {
        let ratio = (together + DARK) / (product + DARK);
        *light *= if *layers >= 2.0 { ratio } else { 1.0 };
    }
}

#[cfg(test)]
mod tests {
    use rand_core::{Rng, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;
    use crate::recipe::Mixing;

    #[test]
    fn light_behind_overlapping_objects_is_that_of_all_dyes_together() {
        let colour = crate::detect::colour(3200.0, Mixing::Spectral).unwrap();
        let (width, height) = (90, 40);
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(0x0E51);
        let mut number = || (rng.next_u32() >> 8) as f32 / 16_777_216.0;
        // Single objects, and one with a second piece; two of them extend beyond the image.
        let boxes: [&[[i64; 4]]; 4] =
            [&[[-7, -3, 50, 30]], &[[30, 10, 40, 25], [40, 15, 12, 9]], &[[35, 5, 80, 20]], &[[0, 36, 20, 9]]];
        let objects = boxes.map(|boxes| {
            let piece = |&[x, y, columns, rows]: &[i64; 4]| {
                let values = (0..columns * rows).map(|_| (number() - 0.3).max(0.0)).collect();
                let absorbance = Cow::Owned(Tile { origin: [x, y], width: columns as usize, values });
                let dyes: Amounts = core::array::from_fn(|_| f64::from((number() - 0.5).max(0.0)));
                StainedPiece::new(&colour, absorbance, dyes).unwrap()
            };
            StainedObject { pieces: boxes.iter().map(piece).collect() }
        });
        let mut channels = [(); 3].map(|()| vec![0.5_f32; width * height]);
        correct_overlaps(&colour, &objects, width, channels.each_mut().map(|channel| &mut channel[..]));
        let mut corrected = 0;
        for (i, (x, y)) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).enumerate() {
            let amounts: Vec<Amounts> = objects
                .iter()
                .map(|object| {
                    let mut sum = [0.0; DYES];
                    for piece in &object.pieces {
                        let tile = &*piece.absorbance;
                        let [u, v] = [x as i64 - tile.origin[0], y as i64 - tile.origin[1]];
                        if (0..tile.width as i64).contains(&u) && (0..tile.height() as i64).contains(&v) {
                            let value = f64::from(tile.values[v as usize * tile.width + u as usize]);
                            sum.iter_mut().zip(piece.dyes).for_each(|(sum, dye)| *sum += value * dye);
                        }
                    }
                    sum
                })
                .collect();
            let all: Amounts = core::array::from_fn(|dye| amounts.iter().map(|amounts| amounts[dye]).sum());
            let layers = amounts.iter().filter(|amounts| amounts.iter().sum::<f64>() > f64::from(THIN)).count();
            corrected += usize::from(layers > 1);
            for (c, channel) in channels.iter().enumerate() {
                let product: f64 = amounts.iter().map(|amounts| colour.transmittance(amounts)[c]).product();
                let dark = f64::from(DARK);
                let ratio = (colour.transmittance(&all)[c] + dark) / (product + dark);
                let expected = 0.5 * if layers > 1 { ratio } else { 1.0 };
                assert!((f64::from(channel[i]) - expected).abs() < 1e-4, "{x} {y} {c}: {} {expected}", channel[i]);
            }
        }
        assert!(corrected > 300, "{corrected}");
    }

    #[test]
    fn spans_contain_all_pixels_with_several_layers() {
        let mut layers = vec![1.0; 200];
        for x in [0, 3, 40, 72, 199] {
            layers[x] = 2.0;
        }
        assert_eq!(spans(&layers), [0..4, 40..73, 199..200]);
        assert_eq!(spans(&[0.0; 9]), []);
    }
}
