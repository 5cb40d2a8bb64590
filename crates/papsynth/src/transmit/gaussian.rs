//! The paper's model: absorbances blurred by depth and added, and the light blurred in the image plane (Eqs. 11–14).

use std::borrow::Cow;
use std::sync::{Mutex, MutexGuard, PoisonError};

use optics_psf::{Gaussian, Method, Scratch};

use super::light::{FocusAt, LightBuffers, Specimen, TransmissionStats};
use super::object_transmission::{Window, add, blurred_tile, clear};
use crate::detect::sum_over;
use crate::error::ErrorKind;
use crate::phantom::piece::Piece;
use crate::phantom::tile::Tile;
use crate::scene::SceneLight;
use crate::threads;

/// Standard deviation below which a Gaussian changes nothing visible in 16 bits, px.
const SHARP_PX: f64 = 0.03;

/// Fraction of the absorbance of an object in the truncated tails of its blur. The largest error is ten times this
/// value, the tolerance of the decimated blur.
const LOST_TAIL: f64 = 1e-4;

/// The same for the blur in the image plane, which affects all light.
const LOST_TAIL_IN_PLANE: f64 = 1e-5;

/// The Gaussian optics of a scene.
pub(crate) struct GaussianPath {
    frame: Window,
    pub(super) in_plane: Gaussian,
    /// Growth of the standard deviation with defocus, px per µm.
    px_per_um: f64,
    /// Wavelength of the light, µm.
    wavelength_um: f64,
    spare_buffers: Mutex<SpareBuffers>,
}

/// Buffers for blurred tiles, reused from object to object.
#[derive(Debug, Default)]
struct SpareBuffers {
    tiles: Vec<Vec<f32>>,
    scratches: Vec<Scratch>,
}

/// The absorbance of a piece in a plane.
struct Blurred<'a> {
    /// `None` if it is outside the image.
    tile: Option<Cow<'a, Tile>>,
    /// Mean over the mask of the piece.
    mean: f64,
    /// Factor of the tile: the absorbance of the dyes of the piece at this wavelength.
    strength: f32,
}

impl GaussianPath {
    pub(super) fn new(specimen: Specimen<'_>, sigma_xy_um: f64, sigma_z_um_per_um: f64) -> Result<Self, ErrorKind> {
        let view = specimen.scene.view;
        let in_plane = Gaussian::truncated(sigma_xy_um / view.pixel_um, Method::Direct, LOST_TAIL_IN_PLANE)?;
        let wavelength_um = match specimen.scene.light {
            SceneLight::Monochrome { wavelength_um, .. } => wavelength_um,
            SceneLight::Colour { .. } => return Err(ErrorKind::ColourWithGaussians),
        };
        let px_per_um = sigma_z_um_per_um / view.pixel_um;
        let frame = Window { origin: [0, 0], width: view.width, height: view.height };
        Ok(Self { frame, in_plane, px_per_um, wavelength_um, spare_buffers: Mutex::default() })
    }

    /// Adds the absorbance I_p of the phantoms to the channel of `light`.
    pub(super) fn transmit(
        &self,
        specimen: Specimen<'_>,
        focus: FocusAt,
        light: &mut LightBuffers,
    ) -> Result<TransmissionStats, ErrorKind> {
        clear(&mut light.channels[0], self.frame.width * self.frame.height);
        let mut absorbances = Vec::new();
        let blur = |index: usize| {
            specimen.work.cancellation.check()?;
            let defocus_um = match focus {
                FocusAt::Everywhere => 0.0,
                // σ grows with the distance from focus: the exact depth of the object, in every plane.
                FocusAt::Stage(plane) => {
                    let depth_um = specimen.scene.objects[index].depth_um;
                    specimen.scene.seen_at_um(plane, depth_um) - depth_um
                }
            };
            let gaussian = self.blur(defocus_um)?;
            let pieces = specimen.phantoms[index].pieces.iter();
            Ok(pieces.map(|piece| self.blur_piece(piece, gaussian.as_ref())).collect::<Vec<_>>())
        };
        // Eq. 14: I_p = Σ pᵢ ∗ G_σz, in the order of the objects.
        threads::each(specimen.work.threads, specimen.phantoms.len(), blur, |_, pieces: Result<_, ErrorKind>| {
            for piece in pieces? {
                absorbances.push(piece.mean * f64::from(piece.strength));
                let Some(tile) = piece.tile else { continue };
                add(&mut light.channels[0], self.frame, &tile, piece.strength);
                if let Cow::Owned(tile) = tile {
                    self.spare_buffers().tiles.push(tile.values);
                }
            }
            Ok::<_, ErrorKind>(())
        })?;
        Ok(TransmissionStats { absorbances: vec![absorbances], clipped_px: 0 })
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
                let values = self.spare_buffers().tiles.pop().unwrap_or_default();
                let mut scratch = self.spare_buffers().scratches.pop().unwrap_or_default();
                let tile = blurred_tile(tile, gaussian, values, &mut scratch);
                self.spare_buffers().scratches.push(scratch);
                Cow::Owned(tile)
            }
        };
        let mean = sum_over(piece.mask.runs(), &tile.values, width, origin) / (piece.mask.area() as f64).max(1.0);
        Blurred { tile: Some(tile), mean, strength }
    }

    /// Returns the blur of an object at this defocus; `None` if it is negligible.
    pub(super) fn blur(&self, defocus_um: f64) -> Result<Option<Gaussian>, ErrorKind> {
        let sigma_px = self.px_per_um * defocus_um.abs();
        let gaussian = (sigma_px > SHARP_PX).then(|| Gaussian::truncated(sigma_px, Method::Decimated, LOST_TAIL));
        Ok(gaussian.transpose()?)
    }

    fn spare_buffers(&self) -> MutexGuard<'_, SpareBuffers> {
        self.spare_buffers.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
