//! Inputs and buffers of the optics, and the light of the empty slide.

use perlin_bg::{Background, BackgroundParams, BackgroundTexture, FractalParams, Illumination};
use rand_core::Rng;

use super::bright_field::SpareBuffers;
use super::sensor_dust;
use super::stray_light::Absorbed;
use crate::error::ErrorKind;
use crate::phantom::Phantom;
use crate::render::Work;
use crate::scene::{Scene, SceneIllumination};

/// The plane in focus.
#[derive(Debug, Clone, Copy)]
pub(crate) enum FocusAt {
    /// The plane at this stage position, µm.
    Stage(f64),
    /// The plane of each object: the all-in-focus image.
    Everywhere,
}

/// A scene with its phantoms, and how it is imaged.
#[derive(Clone, Copy)]
pub(crate) struct Specimen<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) phantoms: &'a [Phantom],
    pub(crate) work: &'a Work,
}

/// Buffers for the light of a plane.
#[derive(Debug, Default)]
pub(crate) struct LightBuffers {
    /// I_b of Eq. 10: the logarithm of the empty slide's light, as a fraction of full scale.
    pub(super) empty_log10: Vec<f32>,
    /// For each channel: first the absorbance or the transmitted fraction, then the light.
    pub(super) channels: Vec<Vec<f32>>,
    /// Transmitted fraction of each light of a group.
    pub(super) lights: Vec<optics_psf::TransmittedLight>,
    /// Image of each light of a group.
    pub(super) images: Vec<Vec<f32>>,
    /// Buffers for single objects.
    pub(super) spare: SpareBuffers,
    /// Rows of the light of the empty slide.
    pub(super) empty: Vec<f32>,
    /// Absorbed fractions of each channel, spread by stray light.
    pub(super) absorbed: Vec<Absorbed>,
    pub(super) bands: Vec<Vec<f32>>,
    pub(super) scratch: optics_psf::Scratch,
}

/// Statistics of the transmission through the objects of a plane.
#[derive(Debug, Clone, Default)]
pub(crate) struct TransmissionStats {
    /// For each channel, the mean absorbance over its mask of each piece of each phantom, in order.
    pub(crate) absorbances: Vec<Vec<f64>>,
    /// Number of pixels that the optics model clipped to its minimum light.
    pub(crate) clipped_px: usize,
}

impl LightBuffers {
    /// Computes the light of the empty slide of a scene.
    pub(crate) fn prepare(&mut self, scene: &Scene) -> Result<(), ErrorKind> {
        let mut empty_log10 = std::mem::take(&mut self.empty_log10);
        empty_light(scene, &mut empty_log10)?;
        self.empty_log10 = empty_log10;
        self.finish_empty(scene);
        Ok(())
    }

    /// Uses the [`empty_light`] of a scene that was computed before.
    pub(crate) fn prepare_from(&mut self, scene: &Scene, empty_log10: &[f32]) {
        self.empty_log10.clear();
        self.empty_log10.extend_from_slice(empty_log10);
        self.finish_empty(scene);
    }

    fn finish_empty(&mut self, scene: &Scene) {
        sensor_dust::add(&mut self.empty_log10, scene.view.width, &scene.camera);
        self.channels.resize(scene.channels(), Vec::new());
    }

    /// Returns the transmitted fraction in each channel, after [`LightPath::transmit`](super::LightPath::transmit).
    pub(crate) fn transmitted(&self) -> &[Vec<f32>] {
        &self.channels
    }

    /// Replaces the transmitted fraction in each channel.
    pub(crate) fn set_transmitted(&mut self, channels: &[Vec<f32>]) {
        self.channels.resize(channels.len(), Vec::new());
        for (own, channel) in self.channels.iter_mut().zip(channels) {
            own.clear();
            own.extend_from_slice(channel);
        }
    }
}

/// Writes the logarithm of the light of the empty slide without dust on the sensor (Eq. 10).
pub(crate) fn empty_light(scene: &Scene, empty_log10: &mut Vec<f32>) -> Result<(), ErrorKind> {
    let view = scene.view;
    empty_log10.resize(view.width * view.height, 0.0);
    background(scene)?.log10_into(empty_log10, view.width, [0, 0]);
    Ok(())
}

/// Returns the background of a scene (Eqs. 8–10), in fractions of full scale.
fn background(scene: &Scene) -> Result<Background, ErrorKind> {
    let view = scene.view;
    let illumination = match scene.background.illumination {
        SceneIllumination::Border { exponent } => Illumination::BorderDistance { exponent },
        // 1 − x2 (x − tx)² − … with its maximum off the centre is a tilted parabola; its constant is part of the level.
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
