//! What an engine gives: planes, and what is known about them.

use crate::scene::Scene;
use crate::truth::{Mask, Truth};

/// One focal plane.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Plane {
    /// Its place in the stack, from 0.
    pub index: usize,
    /// Travel of the stage to it, µm: one of [`Scene::planes_um`].
    pub stage_um: f64,
    /// Channels of a pixel: 1, or 3 for red, green and blue.
    pub channels: usize,
    /// Grey levels as the camera gives them, `0..=2^bits − 1`, row by row, the channels of a pixel side by side.
    pub grey: Vec<u16>,
    /// The same without any noise and before rounding: the expected grey level at each pixel.
    pub noise_free: Vec<f32>,
    /// Pixels at full well, or whose converter is at its highest level, in some channel.
    pub saturated: Mask,
    /// Number of places, in pixels, where the model of the optics would have given less light than there can be and a least
    /// one was put in its place: beside very dark things.
    pub floored: usize,
}

/// Everything about an image except its planes.
#[derive(Debug, Clone)]
pub struct Finished {
    /// What the image was made from.
    pub scene: Scene,
    /// What is known of it.
    pub truth: Truth,
    /// The noise-free image of a focus stack with every object in focus, in grey levels; empty for a single plane.
    pub all_in_focus: Vec<f32>,
}

/// One image or focus stack, whole.
#[derive(Debug, Clone)]
pub struct Frame {
    /// The planes in the order of [`Scene::planes_um`]: one for an image, several for a stack.
    pub planes: Vec<Plane>,
    /// Everything else.
    pub finished: Finished,
}

/// The largest grey level of a camera with so many bits, at most 16.
#[must_use]
pub fn white_level(bits: u32) -> u16 {
    u16::MAX >> 16_u32.saturating_sub(bits.max(1)).min(15)
}

impl Finished {
    /// [`all_in_focus`](Self::all_in_focus) as a camera without noise would give it.
    #[must_use]
    pub fn sharp(&self) -> Vec<u16> {
        let white = f32::from(white_level(self.scene.camera.bits));
        // NaN becomes 0.
        self.all_in_focus.iter().map(|&level| (level + 0.5).clamp(0.0, white) as u16).collect()
    }
}

impl Frame {
    /// The image that shows it in one plane, in grey levels: its only one or, of a stack, the one with everything in focus.
    #[must_use]
    pub fn picture(&self) -> Vec<u16> {
        match self.planes.as_slice() {
            [plane] => plane.grey.clone(),
            _ => self.finished.sharp(),
        }
    }
}
