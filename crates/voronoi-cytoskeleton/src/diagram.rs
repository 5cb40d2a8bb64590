use crate::geometry::{Moments, Point};
use crate::window::Window;

/// A piece of the boundary of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Edge {
    /// Its two vertices, such that `cell` lies on the side of positive turns (from x towards y).
    pub ends: [usize; 2],
    /// The cell on that side.
    pub cell: usize,
    /// The cell on the other side; none where the edge lies on the border of the window.
    pub neighbour: Option<usize>,
}

/// The Voronoi diagram of some sites in a convex window.
///
/// Cells have the numbers of their sites. Cells, edges and vertices together fill the window: areas sum to its area, and
/// vertices − edges + cells = 1.
#[derive(Debug, Clone)]
pub struct Diagram {
    pub(crate) window: Window,
    pub(crate) sites: Vec<Point>,
    pub(crate) vertices: Vec<Point>,
    pub(crate) inner: usize,
    pub(crate) edges: Vec<Edge>,
    pub(crate) cell_ends: Vec<usize>,
    pub(crate) cell_vertices: Vec<usize>,
}

impl Diagram {
    /// The window.
    pub fn window(&self) -> &Window {
        &self.window
    }

    /// The sites, as given or as relaxed.
    pub fn sites(&self) -> &[Point] {
        &self.sites
    }

    /// The vertices: first those inside the window, in which three cells meet, then those on its border.
    pub fn vertices(&self) -> &[Point] {
        &self.vertices
    }

    /// Whether a vertex lies on the border of the window.
    pub fn is_on_border(&self, vertex: usize) -> bool {
        vertex >= self.inner
    }

    /// The edges: first those between two cells, then those on the border of the window.
    pub fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// The vertices around a cell, from x towards y.
    ///
    /// # Panics
    /// If there is no such cell.
    pub fn cell(&self, cell: usize) -> &[usize] {
        let start = cell.checked_sub(1).map_or(0, |last| self.cell_ends[last]);
        &self.cell_vertices[start..self.cell_ends[cell]]
    }

    /// The corners of a cell, from x towards y.
    ///
    /// # Panics
    /// If there is no such cell.
    pub fn corners(&self, cell: usize) -> impl DoubleEndedIterator<Item = Point> + ExactSizeIterator + Clone {
        self.cell(cell).iter().map(|&vertex| self.vertices[vertex])
    }

    /// The area of a cell.
    ///
    /// # Panics
    /// If there is no such cell.
    pub fn area(&self, cell: usize) -> f64 {
        self.moments(cell).area
    }

    /// The energy that relaxing lowers: the squared distance to the nearest site, integrated over the window.
    pub fn energy(&self) -> f64 {
        (0..self.sites.len()).map(|cell| self.moments(cell).second).sum()
    }

    pub(crate) fn moments(&self, cell: usize) -> Moments {
        Moments::of(self.corners(cell), self.sites[cell])
    }
}

#[cfg(test)]
mod tests;
