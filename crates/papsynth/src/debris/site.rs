//! What the phantom of one object is made with.

use crate::debris::paint::Painting;
use crate::key::Stream;
use crate::phantom::Pools;
use crate::phantom::tile::Point;
use crate::phantom::wobble::placed;
use crate::scene::{Object, Scene};

/// Where an object lies, and what its phantom may use.
pub(super) struct Site<'a> {
    pub(super) scene: &'a Scene,
    pub(super) object: &'a Object,
    pub(super) pools: &'a Pools<'a>,
    /// Size of a point of the grid, µm.
    pub(super) pixel_um: f64,
    /// Its middle on the grid.
    pub(super) centre: Point,
}

impl<'a> Site<'a> {
    pub(super) fn new(scene: &'a Scene, pools: &'a Pools<'a>, object: &'a Object) -> Self {
        let grid = scene.grid();
        Self { scene, object, pools, pixel_um: grid.pixel_um, centre: grid.to_px(object.centre_um) }
    }

    /// The object's own stream for a purpose.
    pub(super) fn stream(&self, purpose: &str) -> Stream {
        self.scene.stream(self.object.body.kind().name(), self.object, purpose)
    }

    /// A length in points of the grid.
    pub(super) fn px(&self, um: f64) -> f64 {
        um / self.pixel_um
    }

    /// Where a point of the object lies, given in µm from its middle before it is turned.
    pub(super) fn place(&self, point_um: Point) -> Point {
        let point = point_um.map(|um| self.px(um));
        placed(point, self.object.rotation_deg.to_radians(), self.centre)
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
