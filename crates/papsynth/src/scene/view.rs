//! The size of a field, and numbers drawn once per field.

use serde::{Deserialize, Serialize};

use crate::key::{Key, Stream};
use crate::random;
use crate::recipe::abundance::Abundance;
use crate::recipe::number::Number;

/// The image and its pixels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct View {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Pixel size, µm.
    pub pixel_um: f64,
}

impl View {
    /// Converts micrometres to pixels. Pixel centres have integer coordinates, the corner of the image is at −½.
    #[must_use]
    pub fn to_px(&self, point_um: [f64; 2]) -> [f64; 2] {
        [point_um[0] / self.pixel_um - 0.5, point_um[1] / self.pixel_um - 0.5]
    }

    /// Returns the grid with `n` points per pixel and axis.
    pub(crate) fn finer(self, n: usize) -> Self {
        Self { width: self.width * n, height: self.height * n, pixel_um: self.pixel_um / n as f64 }
    }

    /// Returns width and height, µm.
    #[must_use]
    pub fn size_um(&self) -> [f64; 2] {
        [self.width as f64 * self.pixel_um, self.height as f64 * self.pixel_um]
    }
}

/// A rectangle of the slide, µm from the upper left corner of the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Region {
    pub(crate) low_um: [f64; 2],
    pub(crate) size_um: [f64; 2],
}

impl Region {
    /// Returns the rectangle that an image shows.
    pub(crate) fn of(view: View) -> Self {
        Self { low_um: [0.0; 2], size_um: view.size_um() }
    }

    /// Returns the rectangle with a margin on each side, by axis.
    pub(crate) fn with_margin(self, margin_um: [f64; 2]) -> Self {
        let [low_um, size_um] = [
            [0, 1].map(|axis| self.low_um[axis] - margin_um[axis]),
            [0, 1].map(|axis| self.size_um[axis] + 2.0 * margin_um[axis]),
        ];
        Self { low_um, size_um }
    }

    pub(crate) fn area_mm2(&self) -> f64 {
        self.size_um[0] * self.size_um[1] * 1e-6
    }

    /// Returns the place at these fractions of width and height.
    pub(crate) fn at(&self, fractions: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| self.low_um[axis] + fractions[axis] * self.size_um[axis])
    }

    /// Returns whether a circle touches the rectangle.
    pub(crate) fn touches(&self, centre_um: [f64; 2], radius_um: f64) -> bool {
        (0..2).all(|axis| {
            let at = centre_um[axis] - self.low_um[axis];
            at > -radius_um && at < self.size_um[axis] + radius_um
        })
    }
}

/// Draws the numbers of a field, each from the stream with its path in the recipe: a change of one number does not
/// change the others.
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

    /// Draws the number of objects of a field: a count as it is, a density times an area, mm².
    pub(crate) fn number_of(&self, (path, abundance): (&str, &Abundance), area_mm2: f64) -> u64 {
        match abundance {
            Abundance::PerField(count) => self.count((path, count)) as u64,
            Abundance::PerMm2(_) => self.number_on_slide((path, abundance), [area_mm2, 1.0], 1.0),
        }
    }

    /// Draws the number of objects of a part of a slide, whose area is given in mm² and in fields, times a factor.
    pub(crate) fn number_on_slide(
        &self,
        (path, abundance): (&str, &Abundance),
        [area_mm2, fields]: [f64; 2],
        factor: f64,
    ) -> u64 {
        self.whole(path, abundance.draw(area_mm2, fields, &mut self.stream(path)) * factor)
    }

    /// Rounds `wanted` up or down at random, so that the mean is `wanted`.
    pub(crate) fn whole(&self, path: &str, wanted: f64) -> u64 {
        let further = random::chance(wanted - wanted.floor(), &mut self.key.stream("field", 1, path));
        wanted as u64 + u64::from(further)
    }
}
