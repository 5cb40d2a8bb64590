//! Signal transmission: from phantoms to the light on the sensor (Eqs. 8–14).
//!
//! Two ways lead there, as the scene's optics say: [`bright_field`], partially coherent bright field, object by object;
//! [`gaussian`], the paper's Gaussians on the absorbance. Both give the light of a plane in bands of rows.

mod bright_field;
mod canvas;
mod gaussian;
mod light;
mod lights;
mod overlap;

use optics_psf::{Border, Gaussian};
use portable_numerics::elementary::exp10_from;

use crate::error::Cause;
use crate::scene::{Scene, SceneOptics, View};

use bright_field::BrightFieldPath;
use canvas::clear;
use gaussian::GaussianPath;
pub(crate) use light::{FocusAt, Light, Passage, Slide};
pub(crate) use lights::Lenses;

/// Rows that go from light to grey levels together: few enough to stay in the cache of one core.
pub(crate) const BAND: usize = 32;

/// Rows of the light of one channel of a plane, as fractions of full scale.
pub(crate) struct Band<'a> {
    /// The first row.
    pub(crate) first: usize,
    /// 10^(I_b − I_p) before the spread in the image plane, where that spread is a step of its own; else empty.
    pub(crate) sharp: &'a [f32],
    /// The same after it, channel by channel.
    pub(crate) spread: &'a mut [&'a mut [f32]],
}

/// What all planes of one scene share.
pub(crate) enum LightPath {
    Gaussian(Box<GaussianPath>),
    BrightField(Box<BrightFieldPath>),
}

impl LightPath {
    pub(crate) fn new(slide: Slide<'_>, lenses: &Lenses) -> Result<Self, Cause> {
        Ok(match &slide.scene.optics {
            SceneOptics::Gaussian { sigma_xy_um, sigma_z_um_per_um } => {
                Self::Gaussian(Box::new(GaussianPath::new(slide, *sigma_xy_um, *sigma_z_um_per_um)?))
            }
            SceneOptics::BrightField(microscope) => {
                Self::BrightField(Box::new(BrightFieldPath::new(slide, microscope, lenses)?))
            }
        })
    }

    /// Lets light through the phantoms.
    pub(crate) fn pass(&self, slide: Slide<'_>, focus: FocusAt, light: &mut Light) -> Result<Passage, Cause> {
        let View { width, height, .. } = slide.scene.view;
        light.channels.iter_mut().for_each(|channel| clear(channel, width * height));
        match self {
            Self::Gaussian(path) => path.pass(slide, focus, light),
            Self::BrightField(path) => path.pass(slide, focus, light),
        }
    }

    /// Gives the light, band by band from the top.
    pub(crate) fn spread(&self, view: View, light: &mut Light, mut visit: impl FnMut(Band<'_>)) {
        let View { width, height, .. } = view;
        light.bands.resize(light.channels.len(), Vec::new());
        let mut lit = 0;
        for first in (0..height).step_by(BAND) {
            let end = (first + BAND).min(height);
            let needed = (end + self.picture_reach_px()).min(height);
            let rows = lit * width..needed * width;
            match self {
                // 10^(I_b − I_p).
                Self::Gaussian(_) => exp10_from(&light.empty_log10[rows.clone()], &mut light.channels[0][rows]),
                Self::BrightField(path) => path.illuminate(light, rows),
            }
            let Light { channels, bands, scratch, .. } = light;
            lit = needed;
            for (whole, band) in channels.iter().zip(bands.iter_mut()) {
                band.resize((end - first) * width, 0.0);
                match self.further() {
                    Some(gaussian) => gaussian.blur_rows_into(whole, width, Border::Reflect, first, band, scratch),
                    None => band.copy_from_slice(&whole[first * width..end * width]),
                }
            }
            let sharp = match self {
                Self::Gaussian(_) => &channels[0][first * width..end * width],
                Self::BrightField(_) => &[],
            };
            let mut spread: Vec<&mut [f32]> = bands.iter_mut().map(Vec::as_mut_slice).collect();
            visit(Band { first, sharp, spread: &mut spread });
        }
    }

    /// The spread of the finished light, if there is any.
    fn further(&self) -> Option<&Gaussian> {
        match self {
            Self::Gaussian(path) => Some(&path.in_plane),
            Self::BrightField(path) => path.further.as_ref(),
        }
    }

    /// Pixels round a picture that light reaches it from.
    pub(crate) fn picture_reach_px(&self) -> usize {
        self.further().map_or(0, Gaussian::radius)
    }

    /// Pixels by which an object of that depth is spread in some plane of its scene.
    pub(crate) fn object_reach_px(&self, scene: &Scene, depth_um: f64) -> Result<usize, Cause> {
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
