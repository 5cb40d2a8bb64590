//! What all optics work on: a slide, the light of a plane, and what is known once light has come through.

use crate::phantom::piece::Phantom;
use crate::scene::field::Scene;
use crate::truth::Mask;

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
    pub(super) empty_log10: Vec<f32>,
    /// Of each channel of the picture: the absorbance, or what the objects let through; then the light.
    pub(super) channels: Vec<Vec<f32>>,
    /// What the objects let through of light that is imaged by itself, and pictures of it.
    pub(super) lights: Vec<optics_psf::Light>,
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
