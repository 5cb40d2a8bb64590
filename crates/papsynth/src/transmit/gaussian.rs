//! The paper's way: absorbances blurred by depth, added, and the light spread in the image plane (Eqs. 11–14).

use std::borrow::Cow;
use std::sync::{Mutex, MutexGuard, PoisonError};

use multiversion::multiversion;
use optics_psf::{Border, Gaussian, Method, Scratch};
use portable_numerics::elementary::exp10_from;

use super::passage::{BAND, Band, FocusAt, Light, Passage, Slide};
use crate::detect::sum_over;
use crate::error::Cause;
use crate::phantom::piece::{Phantom, Piece};
use crate::phantom::tile::{TileRef, lay};
use crate::scene::{Scene, SceneLight};
use crate::threads::{self, Threads};
use crate::truth::Mask;

/// Spread below which a Gaussian changes nothing that 16 bits could show, px.
const SHARP_PX: f64 = 0.03;

/// Share of an object's absorbance that lies beyond the ends of its blur and is left out. It errs by ten times
/// that at the worst, which is what the decimated blur may err by.
const LOST_TAIL: f64 = 1e-4;

/// The same for the spread in the image plane, which everything passes.
const LOST_TAIL_IN_PLANE: f64 = 1e-5;

/// Objects whose blurred tiles are in memory at one time, when several threads make them.
const CHUNK: usize = 64;

/// What all planes of one scene share.
pub(crate) struct GaussianPath {
    width: usize,
    height: usize,
    in_plane: Gaussian,
    /// Growth of the spread with distance from focus, px per µm.
    px_per_um: f64,
    /// Wavelength of the light, µm.
    wavelength_um: f64,
    threads: Threads,
    spare: Mutex<Spare>,
}

/// Memory for blurred tiles, which one object leaves to the next.
#[derive(Debug, Default)]
struct Spare {
    tiles: Vec<Vec<f32>>,
    scratches: Vec<Scratch>,
}

/// The absorbance of a piece as it is in a plane.
struct Blurred<'a> {
    origin: [i64; 2],
    width: usize,
    /// Nothing if the tile lies outside the image.
    values: Cow<'a, [f32]>,
    /// Mean over the mask of the piece.
    mean: f64,
    /// What its dyes absorb at this wavelength, relative to the values.
    strength: f32,
}

impl GaussianPath {
    pub(super) fn new(
        slide: Slide<'_>,
        sigma_xy_um: f64,
        sigma_z_um_per_um: f64,
        threads: Threads,
    ) -> Result<Self, Cause> {
        let view = slide.scene.view;
        let in_plane = Gaussian::truncated(sigma_xy_um / view.pixel_um, Method::Direct, LOST_TAIL_IN_PLANE)?;
        let wavelength_um = match slide.scene.light {
            SceneLight::Monochrome { wavelength_um, .. } => wavelength_um,
            SceneLight::Colour { .. } => return Err(Cause::ColourWithGaussians),
        };
        let px_per_um = sigma_z_um_per_um / view.pixel_um;
        let (width, height) = (view.width, view.height);
        Ok(Self { width, height, in_plane, px_per_um, wavelength_um, threads, spare: Mutex::default() })
    }

    /// Pixels by which the spread in the image plane reaches.
    pub(super) fn in_plane_px(&self) -> usize {
        self.in_plane.radius()
    }

    /// `light` becomes the absorbance I_p of the phantoms.
    pub(super) fn absorb(&self, slide: Slide<'_>, focus: FocusAt, light: &mut Light) -> Result<Passage, Cause> {
        let absorbance = &mut light.channels[0];
        absorbance.clear();
        absorbance.resize(self.width * self.height, 0.0);
        let mut absorbances = Vec::new();
        let indices: Vec<usize> = (0..slide.phantoms.len()).collect();
        // One thread adds a tile while it is still in the cache.
        let chunk = match self.threads {
            Threads::One => 1,
            Threads::All => CHUNK,
        };
        for chunk in indices.chunks(chunk) {
            let work =
                |&index: &usize| self.blur(slide.scene, index, &slide.phantoms[index], &slide.masks[index], focus);
            let blurred = threads::map(self.threads, chunk, work);
            // Eq. 14: I_p = Σ pᵢ ∗ G_σz, in the order of the objects whatever thread made them.
            for pieces in blurred {
                for piece in pieces? {
                    let tile = TileRef { origin: piece.origin, width: piece.width, values: &piece.values };
                    add(absorbance, self.width, tile, piece.strength);
                    absorbances.push(piece.mean * f64::from(piece.strength));
                    if let Cow::Owned(values) = piece.values {
                        self.spare().tiles.push(values);
                    }
                }
            }
        }
        Ok(Passage { absorbances: vec![absorbances], floored: 0 })
    }

    /// Turns the absorbance into light, 10^(I_b − I_p), and spreads it in the image plane.
    pub(super) fn spread(&self, light: &mut Light, mut visit: impl FnMut(Band<'_>)) {
        let Light { empty_log10, channels, bands, scratch, .. } = light;
        let (width, height) = (self.width, self.height);
        bands.resize(1, Vec::new());
        let (whole, band) = (&mut channels[0], &mut bands[0]);
        let mut lit = 0;
        for first in (0..height).step_by(BAND) {
            let end = (first + BAND).min(height);
            let needed = (end + self.in_plane.radius()).min(height);
            let rows = lit * width..needed * width;
            exp10_from(&empty_log10[rows.clone()], &mut whole[rows]);
            lit = needed;
            band.resize((end - first) * width, 0.0);
            self.in_plane.blur_rows_into(whole, width, Border::Reflect, first, band, scratch);
            visit(Band { first, sharp: &whole[first * width..end * width], spread: &mut [band] });
        }
    }

    /// The absorbance of an object's pieces in a plane.
    fn blur<'a>(
        &self,
        scene: &Scene,
        index: usize,
        phantom: &'a Phantom,
        masks: &[Mask],
        focus: FocusAt,
    ) -> Result<Vec<Blurred<'a>>, Cause> {
        let sigma_px = match focus {
            FocusAt::Everywhere => 0.0,
            // σ grows with the distance from focus: the object's own depth, exactly, in every plane.
            FocusAt::Stage(plane) => {
                let depth_um = scene.objects[index].depth_um;
                self.px_per_um * (scene.seen_at_um(plane, depth_um) - depth_um).abs()
            }
        };
        let gaussian = blur(sigma_px)?;
        Ok(phantom
            .pieces
            .iter()
            .zip(masks)
            .map(|(piece, mask)| self.blur_piece(piece, mask, gaussian.as_ref()))
            .collect())
    }

    fn blur_piece<'a>(&self, piece: &'a Piece, mask: &Mask, gaussian: Option<&Gaussian>) -> Blurred<'a> {
        let tile = &piece.absorbance;
        let strength = dye_spectra::absorbance(&piece.dyes, self.wavelength_um) as f32;
        let margin = gaussian.map_or(0, Gaussian::radius);
        let origin = tile.origin.map(|at| at - margin as i64);
        let (width, height) = (tile.width + 2 * margin, tile.height() + 2 * margin);
        if !self.meets(origin, width, height) {
            return Blurred { origin, width, values: Cow::Borrowed(&[]), mean: 0.0, strength };
        }
        let values = match gaussian {
            None => Cow::Borrowed(&tile.values[..]),
            Some(gaussian) => {
                let mut values = self.spare().tiles.pop().unwrap_or_default();
                let mut scratch = self.spare().scratches.pop().unwrap_or_default();
                values.resize(width * height, 0.0);
                gaussian.spread_into(&tile.values, tile.width, &mut values, &mut scratch);
                self.spare().scratches.push(scratch);
                Cow::Owned(values)
            }
        };
        let mean = sum_over(mask.runs(), &values, width, origin) / (mask.area() as f64).max(1.0);
        Blurred { origin, width, values, mean, strength }
    }

    /// Whether a tile has a pixel in the image.
    fn meets(&self, origin: [i64; 2], width: usize, height: usize) -> bool {
        let frame = [self.width, self.height];
        let inside = |axis: usize, length: usize| origin[axis] < frame[axis] as i64 && origin[axis] + length as i64 > 0;
        inside(0, width) && inside(1, height)
    }

    fn spare(&self) -> MutexGuard<'_, Spare> {
        self.spare.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The blur of an object out of focus, if it is any.
fn blur(sigma_px: f64) -> Result<Option<Gaussian>, Cause> {
    let gaussian = (sigma_px > SHARP_PX).then(|| Gaussian::truncated(sigma_px, Method::Decimated, LOST_TAIL));
    Ok(gaussian.transpose()?)
}

/// Pixels by which an object is spread that is blurred by so many.
pub(super) fn reach_px(sigma_px: f64) -> Result<usize, Cause> {
    Ok(blur(sigma_px)?.as_ref().map_or(0, Gaussian::radius))
}

#[multiversion(targets = "simd")]
fn add(image: &mut [f32], width: usize, tile: TileRef<'_>, strength: f32) {
    lay(image, width, 0, tile, |row, values| {
        row.iter_mut().zip(values).for_each(|(pixel, value)| *pixel += strength * value);
    });
}
