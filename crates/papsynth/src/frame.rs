//! What the engine makes: planes, and everything known about them.

use crate::scene::Scene;
use crate::truth::Truth;

/// One focal plane.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Plane {
    /// Its place in the stack, from 0.
    pub index: usize,
    /// Its depth, µm, positive towards the objective.
    pub depth_um: f64,
    /// Grey levels as the camera gives them, `0..=2^bits − 1`, row by row.
    pub grey: Vec<u16>,
    /// The same without any noise and before rounding: the expected grey level at each pixel.
    pub noise_free: Vec<f32>,
    /// Number of pixels at full well or at the largest grey level.
    pub saturated: usize,
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
