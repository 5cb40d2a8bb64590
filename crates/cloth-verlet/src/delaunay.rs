//! Delaunay triangulations.

use crate::refine::index;
use crate::{Error, Point};
use spade::{DelaunayTriangulation, Point2, Triangulation};

/// Returns the triangles of the Delaunay triangulation, counter-clockwise.
pub(crate) fn delaunay(points: &[Point]) -> Result<Vec<[u32; 3]>, Error> {
    let corners = |mesh: DelaunayTriangulation<_>| {
        mesh.inner_faces().map(|face| face.vertices().map(|v| index(v.fix().index()))).collect()
    };
    triangulation(points).map(corners)
}

pub(crate) fn triangulation(points: &[Point]) -> Result<DelaunayTriangulation<Point2<f64>>, Error> {
    let vertices = points.iter().map(|p| Point2::new(p[0], p[1])).collect();
    DelaunayTriangulation::bulk_load_stable(vertices).map_err(|_| Error::Parameter {
        field: "vertices",
        value: f64::NAN,
        accepted: "a number of points that can be triangulated",
    })
}
