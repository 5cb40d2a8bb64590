//! The inputs for drawing the phantom of one object.

use super::canvas::ObjectCanvas;
use crate::key::{Key, Stream};
use crate::phantom::noise_fields::NoiseFields;
use crate::phantom::parametric_shape::placed;
use crate::phantom::tile::Point;
use crate::scene::imaging::SceneDyes;
use crate::scene::view::View;

/// The position of an object and the inputs for drawing its phantom.
pub(crate) struct ObjectContext<'a> {
    pub(crate) dyes: SceneDyes,
    /// The image and its pixels.
    pub(crate) view: View,
    /// Grid points per pixel and axis.
    pub(crate) oversampling: usize,
    /// Key of the object's random streams.
    pub(crate) key: Key,
    /// Name of the kind.
    pub(crate) kind: &'static str,
    /// Number of the object within its kind.
    pub(crate) number: u64,
    pub(crate) noise_fields: &'a NoiseFields<'a>,
    /// Grid spacing, µm.
    pub(crate) pixel_um: f64,
    /// Centre, µm.
    pub(crate) centre_um: [f64; 2],
    /// Centre in grid points.
    pub(crate) centre: Point,
    /// Rotation, degrees.
    pub(crate) rotation_deg: f64,
}

impl ObjectContext<'_> {
    /// Returns the random stream of the object for a purpose.
    pub(super) fn stream(&self, purpose: &str) -> Stream {
        self.key.stream(self.kind, self.number, purpose)
    }

    /// Converts a length from µm to grid points.
    pub(super) fn px(&self, um: f64) -> f64 {
        um / self.pixel_um
    }

    /// Converts a point of the object, in µm from its centre before rotation, to grid points.
    pub(super) fn to_grid(&self, point_um: Point) -> Point {
        let point = point_um.map(|um| self.px(um));
        placed(point, self.rotation_deg.to_radians(), self.centre)
    }

    /// Converts the points of a curve.
    pub(super) fn curve_to_grid(&self, points_um: &[Point]) -> Vec<Point> {
        points_um.iter().map(|point| self.to_grid(*point)).collect()
    }

    /// Creates an empty canvas around points of the grid, with a margin in µm.
    pub(super) fn canvas<'p>(&self, points: impl IntoIterator<Item = &'p Point>, margin_um: f64) -> ObjectCanvas {
        ObjectCanvas::around(points, self.px(margin_um) + 2.0)
    }
}
