//! Signal transmission: from phantoms to the light on the sensor (Eqs. 8–14).
//!
//! The optics of the scene select one of two models: [`bright_field`], partially coherent bright field, object by
//! object; [`gaussian`], the paper's Gaussian blur of the absorbance. Both return the light of a plane in bands of
//! rows.

mod bright_field;
mod broad_band;
mod channel_lights;
mod gaussian;
mod light;
mod object_transmission;
mod overlap;
mod sensor_dust;
mod stray_light;

use optics_psf::{Border, Gaussian};
use portable_numerics::elementary::exp10_from;

use crate::error::ErrorKind;
use crate::scene::{Scene, SceneOptics, View};

use bright_field::BrightFieldPath;
pub(crate) use channel_lights::MicroscopeCache;
use gaussian::GaussianPath;
pub(crate) use light::{FocusAt, LightBuffers, Specimen, TransmissionStats, empty_light};

/// Rows per band: few enough that a band stays in the cache of one core between light and grey levels.
pub(crate) const BAND_ROWS: usize = 32;

/// Light of some rows of a plane, as fractions of full scale.
pub(crate) struct RowBand<'a> {
    pub(crate) first_row: usize,
    /// 10^(I_b − I_p) before the blur in the image plane, if that blur is a separate step; else empty.
    pub(crate) unblurred: &'a [f32],
    /// Light on the sensor, one slice per channel.
    pub(crate) blurred: &'a mut [&'a mut [f32]],
}

/// The optics of a scene, shared by all its planes.
pub(crate) enum LightPath {
    Gaussian(Box<GaussianPath>),
    BrightField(Box<BrightFieldPath>),
}

impl LightPath {
    pub(crate) fn new(specimen: Specimen<'_>, microscopes: &MicroscopeCache) -> Result<Self, ErrorKind> {
        Ok(match &specimen.scene.optics {
            SceneOptics::Gaussian { sigma_xy_um, sigma_z_um_per_um } => {
                Self::Gaussian(Box::new(GaussianPath::new(specimen, *sigma_xy_um, *sigma_z_um_per_um)?))
            }
            SceneOptics::BrightField(microscope) => {
                Self::BrightField(Box::new(BrightFieldPath::new(specimen, microscope, microscopes)?))
            }
        })
    }

    /// Computes the light that the phantoms transmit.
    pub(crate) fn transmit(
        &self,
        specimen: Specimen<'_>,
        focus: FocusAt,
        light: &mut LightBuffers,
    ) -> Result<TransmissionStats, ErrorKind> {
        match self {
            Self::Gaussian(path) => path.transmit(specimen, focus, light),
            Self::BrightField(path) => path.transmit(specimen, focus, light),
        }
    }

    /// Passes the light on the sensor to `visit`, band by band from the top.
    pub(crate) fn for_each_band(&self, view: View, light: &mut LightBuffers, mut visit: impl FnMut(RowBand<'_>)) {
        let View { width, height, .. } = view;
        light.bands.resize(light.channels.len(), Vec::new());
        let mut lit = 0;
        for first in (0..height).step_by(BAND_ROWS) {
            let end = (first + BAND_ROWS).min(height);
            let needed = (end + self.image_blur_radius_px()).min(height);
            let rows = lit..needed;
            match self {
                // 10^(I_b − I_p).
                Self::Gaussian(_) => {
                    let pixels = rows.start * width..rows.end * width;
                    exp10_from(&light.empty_log10[pixels.clone()], &mut light.channels[0][pixels]);
                }
                Self::BrightField(path) => path.illuminate(light, width, rows),
            }
            let LightBuffers { channels, bands, scratch, .. } = light;
            lit = needed;
            for (image, band) in channels.iter().zip(bands.iter_mut()) {
                band.resize((end - first) * width, 0.0);
                match self.extra_blur() {
                    Some(gaussian) => gaussian.blur_rows_into(image, width, Border::Reflect, first, band, scratch),
                    None => band.copy_from_slice(&image[first * width..end * width]),
                }
            }
            let unblurred = match self {
                Self::Gaussian(_) => &channels[0][first * width..end * width],
                Self::BrightField(_) => &[],
            };
            let mut blurred: Vec<&mut [f32]> = bands.iter_mut().map(Vec::as_mut_slice).collect();
            visit(RowBand { first_row: first, unblurred, blurred: &mut blurred });
        }
    }

    /// Returns the blur of the combined light, if any.
    fn extra_blur(&self) -> Option<&Gaussian> {
        match self {
            Self::Gaussian(path) => Some(&path.in_plane),
            Self::BrightField(path) => path.extra_blur.as_ref(),
        }
    }

    /// Returns the radius in pixels of the blur of the combined light.
    pub(crate) fn image_blur_radius_px(&self) -> usize {
        self.extra_blur().map_or(0, Gaussian::radius)
    }

    /// Returns the largest blur radius, over all planes of the scene, of an object at this depth, in pixels.
    pub(crate) fn object_blur_radius_px(&self, scene: &Scene, depth_um: f64) -> Result<usize, ErrorKind> {
        let mut widest = 0;
        for &plane_um in &scene.planes_um {
            let seen_at_um = scene.seen_at_um(plane_um, depth_um);
            widest = widest.max(match self {
                Self::Gaussian(path) => path.blur(seen_at_um - depth_um)?.as_ref().map_or(0, Gaussian::radius),
                Self::BrightField(path) => path.reach_px(depth_um, seen_at_um)?,
            });
        }
        Ok(widest)
    }
}
