//! The size of a field, and the numbers that belong to a whole one.

use serde::{Deserialize, Serialize};

use crate::key::{Key, Stream};
use crate::random;
use crate::recipe::number::Number;

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

/// Draws numbers that belong to a whole field, each from a stream named after its place in the recipe: giving one of
/// them a distribution changes none of the others.
pub(crate) struct FieldNumbers {
    pub(crate) key: Key,
}

impl FieldNumbers {
    pub(super) fn stream(&self, path: &str) -> Stream {
        self.key.stream("field", 0, path)
    }

    pub(crate) fn draw(&self, (path, number): (&str, &Number)) -> f64 {
        number.draw(&mut self.stream(path))
    }

    pub(crate) fn count(&self, (path, number): (&str, &Number)) -> usize {
        number.draw_count(&mut self.stream(path))
    }

    /// A whole number that is as large as `wanted` in the mean, drawn for what stands at a path.
    pub(crate) fn whole(&self, path: &str, wanted: f64) -> u64 {
        let further = random::chance(wanted - wanted.floor(), &mut self.key.stream("field", 1, path));
        wanted as u64 + u64::from(further)
    }
}
