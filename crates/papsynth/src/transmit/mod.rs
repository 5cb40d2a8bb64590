//! Signal transmission: from phantoms to the light on the sensor (Eqs. 8–14).
//!
//! Two ways lead there, as the scene's optics say: [`bright_field`], partially coherent bright field, object by object;
//! [`gaussian`], the paper's Gaussians on the absorbance. Both give the light of a plane in bands of rows.

mod abbe;
mod bright_field;
mod canvas;
mod gaussian;
mod lenses;
mod lights;
mod overlap;

use perlin_bg::{Background, BackgroundParams, FractalParams, Illumination, Scatter};
use rand_core::Rng;

use crate::phantom::Phantom;
use crate::scene::{Scene, SceneIllumination, SceneOptics};
use crate::threads::Threads;
use crate::truth::Mask;

use bright_field::BrightFieldPath;
use gaussian::GaussianPath;
pub(crate) use lenses::Lenses;

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

/// What is imaged: a scene, its phantoms, and the complete masks of their pieces.
#[derive(Clone, Copy)]
pub(crate) struct Slide<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) phantoms: &'a [Phantom],
    pub(crate) masks: &'a [Vec<Mask>],
}

/// What all planes of one scene share.
pub(crate) enum LightPath {
    Gaussian(Box<GaussianPath>),
    BrightField(Box<BrightFieldPath>),
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

impl LightPath {
    /// Prepares the path, and the empty slide's light in `light`.
    pub(crate) fn new(slide: Slide<'_>, lenses: &Lenses, threads: Threads, light: &mut Light) -> Result<Self, String> {
        let view = slide.scene.view;
        light.empty_log10.resize(view.width * view.height, 0.0);
        background(slide.scene)?.log10_into(&mut light.empty_log10, view.width, [0, 0]);
        light.channels.resize(slide.scene.channels(), Vec::new());
        Ok(match &slide.scene.optics {
            SceneOptics::Gaussian { sigma_xy_um, sigma_z_um_per_um } => {
                Self::Gaussian(Box::new(GaussianPath::new(slide, *sigma_xy_um, *sigma_z_um_per_um, threads)?))
            }
            SceneOptics::BrightField(microscope) => {
                Self::BrightField(Box::new(BrightFieldPath::new(slide, microscope, lenses, threads)?))
            }
        })
    }

    /// Lets light through the phantoms.
    pub(crate) fn pass(&self, slide: Slide<'_>, focus: FocusAt, light: &mut Light) -> Result<Passage, String> {
        match self {
            Self::Gaussian(path) => path.absorb(slide, focus, light),
            Self::BrightField(path) => path.pass(slide, focus, light),
        }
    }

    /// Gives the light, band by band from the top.
    pub(crate) fn spread(&self, light: &mut Light, visit: impl FnMut(Band<'_>)) {
        match self {
            Self::Gaussian(path) => path.spread(light, visit),
            Self::BrightField(path) => path.spread(light, visit),
        }
    }
}

/// The background of a scene (Eqs. 8–10), in fractions of full scale.
fn background(scene: &Scene) -> Result<Background, String> {
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
    Background::new(&params, view.width, view.height, key).map_err(|e| format!("background: {e}"))
}
