//! The output of an engine: planes and their ground truth.

use sha2::{Digest, Sha256};

use crate::scene::Scene;
use crate::truth::{Mask, Truth};

/// One focal plane.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Plane {
    /// Index in the stack, from 0.
    pub index: usize,
    /// Stage position, µm: one of [`Scene::planes_um`].
    pub stage_um: f64,
    /// Channels per pixel: 1, or 3 for red, green and blue.
    pub channels: usize,
    /// Grey levels of the camera, `0..=2^bits − 1`, row by row, channels interleaved.
    pub grey: Vec<u16>,
    /// Expected grey level of each pixel: without noise, before rounding.
    pub noise_free: Vec<f32>,
    /// Pixels at full-well capacity or at the highest converter level in at least one channel; in an EDF image, pixels
    /// with the highest grey level.
    pub saturated: Mask,
    /// Number of pixels that the optics model clipped to its minimum light, next to very dark objects.
    pub clipped_px: usize,
}

/// Scene and ground truth of an image: all output except the planes.
#[derive(Debug, Clone)]
pub struct Finished {
    /// The scene that was imaged.
    pub scene: Scene,
    /// The ground truth.
    pub truth: Truth,
    /// Noise-free image of a focus stack with every object in focus, in grey levels; empty for a single plane.
    pub all_in_focus: Vec<f32>,
}

/// One image or focus stack with its ground truth.
#[derive(Debug, Clone)]
pub struct Frame {
    /// The planes in the order of [`Scene::planes_um`]: one for an image, several for a stack.
    pub planes: Vec<Plane>,
    /// Scene and ground truth.
    pub finished: Finished,
}

/// Returns the highest grey level of a camera with this bit depth (at most 16).
#[must_use]
pub fn white_level(bits: u32) -> u16 {
    u16::MAX >> 16_u32.saturating_sub(bits.max(1)).min(15)
}

impl Plane {
    /// Returns the SHA-256 of the [grey levels](Self::grey) in hexadecimal digits: of one byte per sample, or of two
    /// for cameras with more than 8 bits, least byte first.
    #[must_use]
    pub fn sha256(&self, bits: u32) -> String {
        let bytes = if bits > u8::BITS { 2 } else { 1 };
        let mut hash = Sha256::new();
        for row in self.grey.chunks(4096) {
            hash.update(row.iter().flat_map(|level| level.to_le_bytes().into_iter().take(bytes)).collect::<Vec<_>>());
        }
        hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
    }
}

impl Finished {
    /// Returns [`all_in_focus`](Self::all_in_focus) rounded to grey levels of the camera.
    #[must_use]
    pub fn all_in_focus_levels(&self) -> Vec<u16> {
        let white = f32::from(white_level(self.scene.camera.bits));
        // The cast turns NaN into 0.
        self.all_in_focus.iter().map(|&level| (level + 0.5).clamp(0.0, white) as u16).collect()
    }
}

impl Frame {
    /// Returns one image of the frame in grey levels: the single plane, or the all-in-focus image of a stack.
    #[must_use]
    pub fn image(&self) -> Vec<u16> {
        match self.planes.as_slice() {
            [plane] => plane.grey.clone(),
            _ => self.finished.all_in_focus_levels(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grey_levels_are_hashed_as_bytes() {
        let grey: Vec<u16> = (0..10_000).map(|k| k % 251).collect();
        let plane = Plane { grey: grey.clone(), ..Plane::default() };
        let hex = |bytes: Vec<u8>| Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect::<String>();
        assert_eq!(plane.sha256(8), hex(grey.iter().map(|level| level.to_le_bytes()[0]).collect()));
        assert_eq!(plane.sha256(12), hex(grey.iter().flat_map(|level| level.to_le_bytes()).collect()));
    }
}
