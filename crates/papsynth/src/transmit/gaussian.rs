//! The paper's way: absorbances blurred by depth, added, and the light spread in the image plane (Eqs. 11–14).

use std::borrow::Cow;
use std::sync::{Mutex, MutexGuard, PoisonError};

use optics_psf::{Gaussian, Method, Scratch};

use super::canvas::{Window, add, blurred};
use super::light::{FocusAt, Light, Passage, Slide};
use crate::detect::sum_over;
use crate::error::Cause;
use crate::phantom::piece::Piece;
use crate::phantom::tile::Tile;
use crate::scene::SceneLight;
use crate::threads;

/// Spread below which a Gaussian changes nothing that 16 bits could show, px.
const SHARP_PX: f64 = 0.03;

/// Share of an object's absorbance that lies beyond the ends of its blur and is left out. It errs by ten times
/// that at the worst, which is what the decimated blur may err by.
const LOST_TAIL: f64 = 1e-4;

/// The same for the spread in the image plane, which everything passes.
const LOST_TAIL_IN_PLANE: f64 = 1e-5;

/// What all planes of one scene share.
pub(crate) struct GaussianPath {
    frame: Window,
    pub(super) in_plane: Gaussian,
    /// Growth of the spread with distance from focus, px per µm.
    px_per_um: f64,
    /// Wavelength of the light, µm.
    wavelength_um: f64,
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
    /// Nothing if it lies outside the image.
    tile: Option<Cow<'a, Tile>>,
    /// Mean over the mask of the piece.
    mean: f64,
    /// What its dyes absorb at this wavelength, relative to the tile.
    strength: f32,
}

impl GaussianPath {
    pub(super) fn new(slide: Slide<'_>, sigma_xy_um: f64, sigma_z_um_per_um: f64) -> Result<Self, Cause> {
        let view = slide.scene.view;
        let in_plane = Gaussian::truncated(sigma_xy_um / view.pixel_um, Method::Direct, LOST_TAIL_IN_PLANE)?;
        let wavelength_um = match slide.scene.light {
            SceneLight::Monochrome { wavelength_um, .. } => wavelength_um,
            SceneLight::Colour { .. } => return Err(Cause::ColourWithGaussians),
        };
        let px_per_um = sigma_z_um_per_um / view.pixel_um;
        let frame = Window { origin: [0, 0], width: view.width, height: view.height };
        Ok(Self { frame, in_plane, px_per_um, wavelength_um, spare: Mutex::default() })
    }

    /// The channel of `light` becomes the absorbance I_p of the phantoms.
    pub(super) fn pass(&self, slide: Slide<'_>, focus: FocusAt, light: &mut Light) -> Result<Passage, Cause> {
        let mut absorbances = Vec::new();
        let blur = |index: usize| {
            let off_um = match focus {
                FocusAt::Everywhere => 0.0,
                // σ grows with the distance from focus: the object's own depth, exactly, in every plane.
                FocusAt::Stage(plane) => {
                    let depth_um = slide.scene.objects[index].depth_um;
                    slide.scene.seen_at_um(plane, depth_um) - depth_um
                }
            };
            let gaussian = self.blur(off_um)?;
            let pieces = slide.phantoms[index].pieces.iter();
            Ok(pieces.map(|piece| self.blur_piece(piece, gaussian.as_ref())).collect::<Vec<_>>())
        };
        // Eq. 14: I_p = Σ pᵢ ∗ G_σz, in the order of the objects whatever thread made them.
        threads::each(slide.threads, slide.phantoms.len(), blur, |_, pieces: Result<_, Cause>| {
            for piece in pieces? {
                absorbances.push(piece.mean * f64::from(piece.strength));
                let Some(tile) = piece.tile else { continue };
                add(&mut light.channels[0], self.frame, &tile, piece.strength);
                if let Cow::Owned(tile) = tile {
                    self.spare().tiles.push(tile.values);
                }
            }
            Ok::<_, Cause>(())
        })?;
        Ok(Passage { absorbances: vec![absorbances], floored: 0 })
    }

    fn blur_piece<'a>(&self, piece: &'a Piece, gaussian: Option<&Gaussian>) -> Blurred<'a> {
        let tile = &piece.absorbance;
        let strength = dye_spectra::absorbance(&piece.dyes, self.wavelength_um) as f32;
        let margin = gaussian.map_or(0, Gaussian::radius);
        let origin = tile.origin.map(|at| at - margin as i64);
        let (width, height) = (tile.width + 2 * margin, tile.height() + 2 * margin);
        if !(Window { origin, width, height }).meets(self.frame.width, self.frame.height, 0) {
            return Blurred { tile: None, mean: 0.0, strength };
        }
        let tile = match gaussian {
            None => Cow::Borrowed(tile),
            Some(gaussian) => {
                let values = self.spare().tiles.pop().unwrap_or_default();
                let mut scratch = self.spare().scratches.pop().unwrap_or_default();
                let tile = blurred(tile, gaussian, values, &mut scratch);
                self.spare().scratches.push(scratch);
                Cow::Owned(tile)
            }
        };
        let mean = sum_over(piece.mask.runs(), &tile.values, width, origin) / (piece.mask.area() as f64).max(1.0);
        Blurred { tile: Some(tile), mean, strength }
    }

    /// The blur of an object so far from focus, if it is any.
    pub(super) fn blur(&self, off_um: f64) -> Result<Option<Gaussian>, Cause> {
        let sigma_px = self.px_per_um * off_um.abs();
        let gaussian = (sigma_px > SHARP_PX).then(|| Gaussian::truncated(sigma_px, Method::Decimated, LOST_TAIL));
        Ok(gaussian.transpose()?)
    }

    fn spare(&self) -> MutexGuard<'_, Spare> {
        self.spare.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
