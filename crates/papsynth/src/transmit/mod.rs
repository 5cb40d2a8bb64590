//! Signal transmission: from phantoms to the light on the sensor (Eqs. 8–14).
//!
//! Two ways lead there, as the scene's optics say: [`bright_field`], partially coherent bright field, object by object;
//! [`gaussian`], the paper's Gaussians on the absorbance. Both give the light of a plane in bands of rows.

mod bright_field;
mod canvas;
mod gaussian;
mod lights;
mod overlap;

use optics_psf::{Border, Gaussian};
use perlin_bg::{Background, BackgroundParams, FractalParams, Illumination, Scatter};
use portable_numerics::elementary::exp10_from;
use rand_core::Rng;

use crate::error::Cause;
use crate::phantom::Phantom;
use crate::scene::{Scene, SceneIllumination, SceneOptics, View};
use crate::threads::Threads;

use bright_field::BrightFieldPath;
use canvas::clear;
use gaussian::GaussianPath;
pub(crate) use lights::Lenses;

/// Rows that go from light to grey levels together: few enough to stay in the cache of one core.
pub(crate) const BAND: usize = 32;

/// Which plane is in focus.
#[derive(Debug, Clone, Copy)]
pub(crate) enum FocusAt {
    /// The stage stands here, µm.
    Stage(f64),
    /// Every object its own: the all-in-focus image.
    Everywhere,
}

/// What is imaged: a scene and its phantoms; and by how many threads.
#[derive(Clone, Copy)]
pub(crate) struct Slide<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) phantoms: &'a [Phantom],
    pub(crate) threads: Threads,
}

/// Rows of the light of one channel of a plane, as fractions of full scale.
pub(crate) struct Band<'a> {
    /// The first row.
    pub(crate) first: usize,
    /// 10^(I_b − I_p) before the spread in the image plane, where that spread is a step of its own; else empty.
    pub(crate) sharp: &'a [f32],
    /// The same after it, channel by channel.
    pub(crate) spread: &'a mut [&'a mut [f32]],
}

/// Memory for the light of a plane.
#[derive(Debug, Default)]
pub(crate) struct Light {
    /// I_b of Eq. 10: the logarithm of the empty slide's light, as a fraction of full scale.
    empty_log10: Vec<f32>,
    /// Of each channel of the picture: the absorbance, or what the objects let through; then the light.
    channels: Vec<Vec<f32>>,
    /// What the objects let through of light that is imaged by itself, and pictures of it.
    lights: Vec<optics_psf::Light>,
    pictures: Vec<Vec<f32>>,
    /// Rows of the empty slide's light.
    empty: Vec<f32>,
    bands: Vec<Vec<f32>>,
    scratch: optics_psf::Scratch,
}

/// What is known of a plane once light has come through the objects.
#[derive(Debug, Default)]
pub(crate) struct Passage {
    /// Of each piece of each phantom, in their order, for each channel: its mean absorbance over its mask.
    pub(crate) absorbances: Vec<Vec<f64>>,
    /// Pixels where optics would have given less light than there can be, and a least one was put in its place.
    pub(crate) floored: usize,
}

impl Light {
    /// Puts in the light of a scene's empty slide.
    pub(crate) fn prepare(&mut self, scene: &Scene) -> Result<(), Cause> {
        let view = scene.view;
        self.empty_log10.resize(view.width * view.height, 0.0);
        background(scene)?.log10_into(&mut self.empty_log10, view.width, [0, 0]);
        self.channels.resize(scene.channels(), Vec::new());
        Ok(())
    }
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

/// The background of a scene (Eqs. 8–10), in fractions of full scale.
fn background(scene: &Scene) -> Result<Background, Cause> {
    let view = scene.view;
    let illumination = match scene.background.illumination {
        SceneIllumination::Border { exponent } => Illumination::BorderDistance { exponent },
        // A bowl whose top is off the centre, 1 − x2 (x − tx)² − …, has a tilt; the constant left over is in the level.
        SceneIllumination::Bowl { x2, y2, top } => {
            Illumination::Bowl { x2, y2, tilt: [2.0 * x2 * top[0], 2.0 * y2 * top[1]] }
        }
    };
    let params = BackgroundParams {
        level: scene.background.level,
        illumination,
        scatter: Scatter {
            strength: scene.background.scatter,
            cell_px: (scene.background.scatter_um / view.pixel_um).max(1.0),
            noise: FractalParams::default(),
            ..Scatter::default()
        },
    };
    let key = scene.key.stream("field", 0, "background").next_u64();
    let background = Background::new(&params, view.width, view.height, key)?;
    Ok(match scene.frame {
        Some(frame) => background.on_slide(frame.origin_px),
        None => background,
    })
}
