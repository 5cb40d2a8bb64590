//! Colours of overlapping stained objects.
//!
//! Each object transmits a mean fraction of a channel's band, and the fractions of overlapping objects are multiplied.
//! This is too dark where objects absorb the same wavelengths: the first leaves less light to absorb for the second.
//! The image is therefore multiplied by the ratio of the light behind all dyes together to the product of the light
//! behind each object. The ratio is computed on camera pixels, from amounts of dye with the defocus blur of each
//! object.

use dye_spectra::{Colour, DYES};
use multiversion::multiversion;
use optics_psf::{Gaussian, Method, Scratch};

use super::light::Specimen;
use super::object_transmission::{Window, add, blurred_tile};
use crate::error::ErrorKind;
use crate::phantom::piece::Phantom;
use crate::phantom::tile::{Tile, overlay};
use crate::scene::{Scene, View};
use crate::threads;

/// Absorbance below which an object does not change the colour behind it.
const FAINT: f32 = 0.01;

/// Standard deviation below which blur is skipped, px.
const SHARP_PX: f64 = 0.5;

/// Fraction of a blurred amount in the truncated tails.
const LOST_TAIL: f64 = 1e-3;

/// The overlapping objects of a scene, on camera pixels.
pub(super) struct Overlaps {
    objects: Vec<OverlappingObject>,
}

/// An object that may overlap another.
struct OverlappingObject {
    index: usize,
    /// The absorbance of each piece.
    pieces: Vec<Tile>,
}

/// Amounts of dye of an object, and their transmittance.
struct ObjectDyes {
    /// Empty for dyes that the object does not contain.
    amounts: [Tile; DYES],
    transmittance: [Tile; 3],
}

impl Overlaps {
    /// Collects the objects whose bounding boxes intersect.
    ///
    /// On a slide, overlaps beyond the border of a frame are unknown, so all stained objects are collected.
    pub(super) fn new(specimen: Specimen<'_>) -> Self {
        let (scene, phantoms) = (specimen.scene, specimen.phantoms);
        let (n, all) = (scene.oversampling(), scene.frame.is_some());
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
        let indices: Vec<usize> = (0..boxes.len()).filter(|&i| meets[i]).collect();
        let objects = threads::map(specimen.threads, &indices, |&index| OverlappingObject {
            index,
            pieces: phantoms[index].pieces.iter().map(|piece| piece.pixel_absorbance(n).into_owned()).collect(),
        });
        Self { objects }
    }

    /// Corrects three channels. `blur_px` returns the standard deviation of the defocus blur of each object.
    pub(super) fn correct(
        &self,
        colour: &Colour,
        specimen: Specimen<'_>,
        blur_px: impl Fn(usize) -> f64 + Sync + Send,
        channels: &mut [Vec<f32>],
    ) -> Result<(), ErrorKind> {
        if self.objects.len() < 2 {
            return Ok(());
        }
        let View { width, height, .. } = specimen.scene.view;
        let (pixels, frame) = (width * height, Window { origin: [0, 0], width, height });
        let mut layers = vec![0.0_f32; pixels];
        let mut totals: [Vec<f32>; DYES] = core::array::from_fn(|_| vec![0.0; pixels]);
        let mut products: [Vec<f32>; 3] = core::array::from_fn(|_| vec![1.0; pixels]);
        let object_dyes = threads::map(specimen.threads, &self.objects, |object| {
            object.dyes(colour, &specimen.phantoms[object.index], blur_px(object.index))
        });
        for dyes in object_dyes {
            let dyes = dyes?;
            for (total, amounts) in totals.iter_mut().zip(&dyes.amounts) {
                add(total, frame, amounts, 1.0);
            }
            for (product, transmittance) in products.iter_mut().zip(&dyes.transmittance) {
                multiply(product, width, transmittance);
            }
            count(&mut layers, width, &dyes.transmittance[1]);
        }
        let [h, e, l, o, n] = &totals;
        let mut together: [Vec<f32>; 3] = core::array::from_fn(|_| vec![0.0; width]);
        for y in 0..height {
            let row = y * width..(y + 1) * width;
            if layers[row.clone()].iter().all(|layers| *layers < 2.0) {
                continue;
            }
            let [r, g, b] = &mut together;
            colour.transmittance_into([h, e, l, o, n].map(|dye| &dye[row.clone()]), [r, g, b]);
            for ((channel, product), together) in channels.iter_mut().zip(&products).zip(&together) {
                scale(&mut channel[row.clone()], together, &product[row.clone()], &layers[row.clone()]);
            }
        }
        Ok(())
    }
}

impl OverlappingObject {
    fn dyes(&self, colour: &Colour, phantom: &Phantom, blur_px: f64) -> Result<ObjectDyes, ErrorKind> {
        let blurred;
        let pieces = if blur_px > SHARP_PX {
            let gaussian = Gaussian::truncated(blur_px, Method::Decimated, LOST_TAIL)?;
            let tiles =
                self.pieces.iter().map(|tile| blurred_tile(tile, &gaussian, Vec::new(), &mut Scratch::default()));
            blurred = tiles.collect::<Vec<_>>();
            &blurred
        } else {
            &self.pieces
        };
        let window =
            Window::around_tiles(pieces.iter().map(|tile| (tile, 1))).expect("overlapping objects have pixels");
        let samples = window.width * window.height;
        let blank = |samples| Tile { origin: window.origin, width: window.width, values: vec![0.0; samples] };
        let mut amounts: [Tile; DYES] = core::array::from_fn(|_| blank(0));
        for (dye, amounts) in amounts.iter_mut().enumerate() {
            for (piece, tile) in phantom.pieces.iter().zip(pieces).filter(|(piece, _)| piece.dyes[dye] > 0.0) {
                amounts.values.resize(samples, 0.0);
                add(&mut amounts.values, window, tile, piece.dyes[dye] as f32);
            }
        }
        let mut transmittance: [Tile; 3] = core::array::from_fn(|_| blank(samples));
        let [r, g, b] = &mut transmittance;
        let light = [&mut r.values[..], &mut g.values, &mut b.values];
        colour.transmittance_into(amounts.each_ref().map(|amounts| &amounts.values[..]), light);
        Ok(ObjectDyes { amounts, transmittance })
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
fn multiply(image: &mut [f32], width: usize, tile: &Tile) {
    overlay(image, width, [0, 0], tile, |row, values| row.iter_mut().zip(values).for_each(|(v, value)| *v *= value));
}

/// Adds 1 where a tile transmits less than all light.
#[multiversion(targets = "simd")]
fn count(image: &mut [f32], width: usize, tile: &Tile) {
    overlay(image, width, [0, 0], tile, |row, values| {
        row.iter_mut().zip(values).for_each(|(layers, value)| *layers += if *value < 1.0 { 1.0 } else { 0.0 });
    });
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
