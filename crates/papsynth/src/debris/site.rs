//! What the phantom of one object is made with.

use super::paint::Painting;
use crate::key::{Key, Stream};
use crate::phantom::noise_fields::NoiseFields;
use crate::phantom::parametric_shape::placed;
use crate::phantom::tile::Point;
use crate::scene::imaging::SceneDyes;
use crate::scene::view::View;

/// Where an object lies, and what its phantom may use.
pub(crate) struct Site<'a> {
    pub(crate) dyes: SceneDyes,
    /// The image and its pixels.
    pub(crate) view: View,
    /// Points of the grid along the side of a pixel.
    pub(crate) oversampling: usize,
    /// The key of the object's streams, its kind and its number.
    pub(crate) key: Key,
    pub(crate) kind: &'static str,
    pub(crate) number: u64,
    pub(crate) noise_fields: &'a NoiseFields<'a>,
    /// Size of a point of the grid, µm.
    pub(crate) pixel_um: f64,
    /// Its middle.
    pub(crate) centre_um: [f64; 2],
    /// The same on the grid.
    pub(crate) centre: Point,
    /// Direction it is turned to, degrees.
    pub(crate) rotation_deg: f64,
}

impl Site<'_> {
    /// The object's own stream for a purpose.
    pub(super) fn stream(&self, purpose: &str) -> Stream {
        self.key.stream(self.kind, self.number, purpose)
    }

    /// A length in points of the grid.
    pub(super) fn px(&self, um: f64) -> f64 {
        um / self.pixel_um
    }

    /// Where a point of the object lies, given in µm from its middle before it is turned.
    pub(super) fn place(&self, point_um: Point) -> Point {
        let point = point_um.map(|um| self.px(um));
        placed(point, self.rotation_deg.to_radians(), self.centre)
    }

    /// The same for a curve.
    pub(super) fn places(&self, points_um: &[Point]) -> Vec<Point> {
        points_um.iter().map(|point| self.place(*point)).collect()
    }

    /// An empty painting that reaches so many µm beyond these points of the grid.
    pub(super) fn painting<'p>(&self, points: impl IntoIterator<Item = &'p Point>, margin_um: f64) -> Painting {
        Painting::around(points, self.px(margin_um) + 2.0)
    }
}
