//! What is imaged, the light of one plane, and the empty slide's.

use perlin_bg::{Background, BackgroundParams, FractalParams, Illumination, BackgroundTexture};
use rand_core::Rng;

use crate::error::Cause;
use crate::phantom::Phantom;
use crate::scene::{Scene, SceneIllumination};
use crate::threads::Threads;

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

/// Memory for the light of a plane.
#[derive(Debug, Default)]
pub(crate) struct Light {
    /// I_b of Eq. 10: the logarithm of the empty slide's light, as a fraction of full scale.
    pub(super) empty_log10: Vec<f32>,
    /// Of each channel of the picture: the absorbance, or what the objects let through; then the light.
    pub(super) channels: Vec<Vec<f32>>,
    /// What the objects let through of light that is imaged by itself, and pictures of it.
    pub(super) lights: Vec<optics_psf::TransmittedLight>,
    pub(super) pictures: Vec<Vec<f32>>,
    /// Rows of the empty slide's light.
    pub(super) empty: Vec<f32>,
    pub(super) bands: Vec<Vec<f32>>,
    pub(super) scratch: optics_psf::Scratch,
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

/// The background of a scene (Eqs. 8–10), in fractions of full scale.
fn background(scene: &Scene) -> Result<Background, Cause> {
    let view = scene.view;
    let illumination = match scene.background.illumination {
        SceneIllumination::Border { exponent } => Illumination::BorderDistance { exponent },
        // A bowl whose top is off the centre, 1 − x2 (x − tx)² − …, has a tilt; the constant left over is in the level.
        SceneIllumination::Quadratic { falloff_x, falloff_y, centre } => {
            let tilt = [2.0 * falloff_x * centre[0], 2.0 * falloff_y * centre[1]];
            Illumination::Quadratic { falloff_x, falloff_y, tilt }
        }
    };
    let params = BackgroundParams {
        level: scene.background.level,
        illumination,
        texture: BackgroundTexture {
            strength: scene.background.texture,
            cell_px: (scene.background.texture_um / view.pixel_um).max(1.0),
            noise: FractalParams::default(),
            ..BackgroundTexture::default()
        },
    };
    let key = scene.key.stream("field", 0, "background").next_u64();
    let background = Background::new(&params, view.width, view.height, key)?;
    Ok(match scene.frame {
        Some(frame) => background.on_slide(frame.origin_px),
        None => background,
    })
}
