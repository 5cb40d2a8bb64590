//! The image of a scene and its pixels.

use serde::{Deserialize, Serialize};

/// The image and its pixels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct View {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Size of a pixel, µm.
    pub pixel_um: f64,
}

impl View {
    /// Micrometres to pixels: pixel centres lie at whole numbers, the image's corner at −½.
    #[must_use]
    pub fn to_px(&self, point_um: [f64; 2]) -> [f64; 2] {
        [point_um[0] / self.pixel_um - 0.5, point_um[1] / self.pixel_um - 0.5]
    }

    /// Width and height in micrometres.
    #[must_use]
    pub fn size_um(&self) -> [f64; 2] {
        [self.width as f64 * self.pixel_um, self.height as f64 * self.pixel_um]
    }
}
