//! Colours where stained things lie over each other.
//!
//! Of each object the mean light of a channel's band is filtered, and the means of several objects are multiplied. That
//! is too dark where they absorb the same wavelengths: the first leaves less to absorb for the second. What is wrong is
//! the ratio of the light behind all dyes together to the product of the lights behind each object's, and by that the
//! picture is multiplied. It is computed on the camera's pixels from amounts of dye blurred as far as each object is
//! out of focus.

use dye_spectra::{Colour, DYES};
use multiversion::multiversion;
use optics_psf::{Gaussian, Method, Scratch};

use super::canvas::{Window, add, blurred};
use super::light::Slide;
use crate::error::Cause;
use crate::phantom::piece::Phantom;
use crate::phantom::tile::{Tile, lay};
use crate::scene::{Scene, View};
use crate::threads;

/// Absorbance below which an object changes no colour behind it.
const FAINT: f32 = 0.01;

/// Blur that is not worth the while, px.
const SHARP_PX: f64 = 0.5;

/// Share of a blurred amount that is left out.
const LOST_TAIL: f64 = 1e-3;

/// What overlaps in a scene: for each object that meets another its pieces' absorbances, on the camera's pixels.
pub(super) struct Overlaps {
    objects: Vec<Overlapping>,
}

struct Overlapping {
    index: usize,
    /// The absorbance of each piece.
    pieces: Vec<Tile>,
}

/// An object's amounts of dye, and what they let through.
struct Stained {
    /// Without pixels where there is none of a dye.
    amounts: [Tile; DYES],
    transmittance: [Tile; 3],
}

impl Overlaps {
    /// Of objects whose boxes meet another's or, since what overlaps beyond the border of a frame is not known in it, of all that
    /// are stained.
    pub(super) fn new(slide: Slide<'_>) -> Self {
        let (scene, phantoms) = (slide.scene, slide.phantoms);
        let (n, all) = (scene.oversampling(), scene.frame.is_some());
        let boxes: Vec<Option<Window>> = phantoms.iter().map(|phantom| stained(phantom, scene)).collect();
        // Sorted by their left edges, only neighbours can meet.
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
        let objects = threads::map(slide.threads, &indices, |&index| Overlapping {
            index,
            pieces: phantoms[index].pieces.iter().map(|piece| piece.absorbance.coarsened(n)).collect(),
        });
        Self { objects }
    }

    /// Corrects three channels. `blur_px` says how widely each object is blurred, as a standard deviation.
    pub(super) fn correct(
        &self,
        colour: &Colour,
        slide: Slide<'_>,
        blur_px: impl Fn(usize) -> f64 + Sync + Send,
        channels: &mut [Vec<f32>],
    ) -> Result<(), Cause> {
        if self.objects.len() < 2 {
            return Ok(());
        }
        let View { width, height, .. } = slide.scene.view;
        let (pixels, whole) = (width * height, Window { origin: [0, 0], width, height });
        let mut layers = vec![0.0_f32; pixels];
        let mut totals: [Vec<f32>; DYES] = core::array::from_fn(|_| vec![0.0; pixels]);
        let mut products: [Vec<f32>; 3] = core::array::from_fn(|_| vec![1.0; pixels]);
        let stained = threads::map(slide.threads, &self.objects, |object| {
            object.stain(colour, &slide.phantoms[object.index], blur_px(object.index))
        });
        for stained in stained {
            let stained = stained?;
            for (total, amounts) in totals.iter_mut().zip(&stained.amounts) {
                add(total, whole, amounts, 1.0);
            }
            for (product, transmittance) in products.iter_mut().zip(&stained.transmittance) {
                multiply(product, width, transmittance);
            }
            count(&mut layers, width, &stained.transmittance[1]);
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

impl Overlapping {
    fn stain(&self, colour: &Colour, phantom: &Phantom, blur_px: f64) -> Result<Stained, Cause> {
        let spread;
        let pieces = if blur_px > SHARP_PX {
            let gaussian = Gaussian::truncated(blur_px, Method::Decimated, LOST_TAIL)?;
            let tiles = self.pieces.iter().map(|tile| blurred(tile, &gaussian, Vec::new(), &mut Scratch::default()));
            spread = tiles.collect::<Vec<_>>();
            &spread
        } else {
            &self.pieces
        };
        let window = Window::around(pieces.iter(), 1).expect("what overlaps has pixels");
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
        Ok(Stained { amounts, transmittance })
    }
}

/// The camera's pixels over which an object is stained enough to matter.
fn stained(phantom: &Phantom, scene: &Scene) -> Option<Window> {
    let (grid, n) = (scene.grid(), scene.oversampling());
    let strong = phantom.pieces.iter().filter(|piece| {
        let dyes: f64 = piece.dyes[..DYES - 1].iter().sum();
        piece.absorbance.values.iter().any(|value| value * dyes as f32 > FAINT)
    });
    let window = Window::around(strong.map(|piece| &piece.absorbance), n)?;
    (scene.frame.is_some() || window.meets(grid.width, grid.height, 0)).then_some(Window {
        origin: window.origin.map(|at| at / n as i64),
        width: window.width / n,
        height: window.height / n,
    })
}

#[multiversion(targets = "simd")]
fn multiply(image: &mut [f32], width: usize, tile: &Tile) {
    lay(image, width, [0, 0], tile, |row, values| row.iter_mut().zip(values).for_each(|(v, value)| *v *= value));
}

/// Counts what is not empty.
#[multiversion(targets = "simd")]
fn count(image: &mut [f32], width: usize, tile: &Tile) {
    lay(image, width, [0, 0], tile, |row, values| {
        row.iter_mut().zip(values).for_each(|(layers, value)| *layers += if *value < 1.0 { 1.0 } else { 0.0 });
    });
}

/// Light below which ratios of lights mean nothing: what is as dark is left as it is.
const DARK: f32 = 1e-3;

/// Multiplies by the ratio of what dyes let through together to what they would one by one, where there are several.
#[multiversion(targets = "simd")]
fn scale(channel: &mut [f32], together: &[f32], product: &[f32], layers: &[f32]) {
    for (((light, together), product), layers) in channel.iter_mut().zip(together).zip(product).zip(layers) {
        let ratio = (together + DARK) / (product + DARK);
        *light *= if *layers >= 2.0 { ratio } else { 1.0 };
    }
}
