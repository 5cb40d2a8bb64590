use crate::diagram::Diagram;
use crate::error::{Error, require};
use crate::geometry::Point;
use crate::lloyd::relaxed_diagram;
use crate::outline::Outline;
use crate::path::{DescentPath, Graph, HeightField};
use crate::torus::Torus;
use crate::window::Window;
use portable_numerics::random::{below, chance};
use rand_core::Rng;

/// Parameters of [`Skeleton`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SkeletonParams {
    /// Number of sites in the window: 1 to 1 000 000. Default: 300 (the paper's: its released program).
    pub sites: usize,
    /// Passes of Lloyd's algorithm: 0 to 10 000. Default: 2 (the paper's).
    pub lloyd_passes: usize,
    /// Number of start vertices of paths: 0 or more. There are fewer paths if start vertices are on previous paths, and
    /// more if paths branch. Default: 15 (the paper's).
    pub paths: usize,
    /// Probability that a path branches at a vertex with a second descending edge: 0 to 1. Default: 0.2 (the paper's).
    pub branch_probability: f64,
    /// Minimum height of a start vertex relative to the largest height: 0 to 1. Default: 0.5 (the paper's).
    pub start_above: f64,
}

impl Default for SkeletonParams {
    fn default() -> Self {
        Self { sites: 300, lloyd_passes: 2, paths: 15, branch_probability: 0.2, start_above: 0.5 }
    }
}

/// Generates the paper's cytoskeleton ("Cytoplasm", Fig. 7): trees of steepest descent along the edges of a relaxed
/// Voronoi diagram.
#[derive(Debug, Clone)]
pub struct Skeleton {
    params: SkeletonParams,
}

impl Skeleton {
    /// Creates a generator with these parameters.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a parameter that is out of range.
    pub fn new(params: &SkeletonParams) -> Result<Self, Error> {
        let SkeletonParams { sites, lloyd_passes, paths: _, branch_probability, start_above } = *params;
        require("sites", sites as f64, (1..=1_000_000).contains(&sites), "between 1 and 1000000")?;
        require("lloyd_passes", lloyd_passes as f64, lloyd_passes <= 10_000, "at most 10000")?;
        for (field, value) in [("branch_probability", branch_probability), ("start_above", start_above)] {
            require(field, value, (0.0..=1.0).contains(&value), "between 0 and 1")?;
        }
        Ok(Self { params: *params })
    }

    /// Grows a skeleton in the outline of a cell, a closed polygon in pixels. The diagram fills its bounding box, the
    /// height of a point is its distance from the outline, and paths end on the outline.
    ///
    /// # Errors
    /// [`Error::Coordinate`] or [`Error::Flat`] for an invalid outline.
    pub fn grow<R: Rng + ?Sized>(&self, outline: &[Point], rng: &mut R) -> Result<Vec<DescentPath>, Error> {
        let edge = Outline::new(outline)?;
        let diagram = self.diagram(&Window::around(outline)?, rng)?;
        let heights = edge.heights(diagram.vertices());
        Ok(self.run(HeightField::new(Graph::of(&diagram), |point| edge.height(point), heights), rng))
    }

    /// Grows a skeleton like [`Skeleton::grow`], but on a part of a torus, in a fraction of the time. The part is
    /// rotated, mirrored and shifted at random, and scaled so that the bounding box of the outline contains
    /// [`SkeletonParams::sites`] sites on average. The relaxation is that of the torus.
    ///
    /// A new diagram is computed for an outline too long for the torus.
    ///
    /// # Errors
    /// As [`Skeleton::grow`].
    pub fn grow_from<R: Rng + ?Sized>(
        &self,
        torus: &Torus,
        outline: &[Point],
        rng: &mut R,
    ) -> Result<Vec<DescentPath>, Error> {
        let window = Window::around(outline)?;
        let edge = Outline::new(outline)?;
        let Some(graph) = torus.place(&window, self.params.sites, rng) else {
            return self.grow(outline, rng);
        };
        let heights = edge.heights(&graph.vertices);
        Ok(self.run(HeightField::new(graph, |point| edge.height(point), heights), rng))
    }

    /// Grows a skeleton in a window with a given height function. Paths end on the border of the window, or where the
    /// height falls to 0.
    ///
    /// # Errors
    /// [`Error::Sites`] if sites coincide because the window is too small for its distance from the origin.
    pub fn grow_on<R: Rng + ?Sized>(
        &self,
        window: &Window,
        height: impl Fn(Point) -> f64,
        rng: &mut R,
    ) -> Result<Vec<DescentPath>, Error> {
        let diagram = self.diagram(window, rng)?;
        Ok(self.paths(&diagram, height, rng))
    }

    /// Computes only the diagram: uniform random sites in the window, relaxed.
    ///
    /// # Errors
    /// As [`Skeleton::grow_on`].
    pub fn diagram<R: Rng + ?Sized>(&self, window: &Window, rng: &mut R) -> Result<Diagram, Error> {
        let drawn = (0..self.params.sites).map(|_| window.draw(rng)).collect();
        relaxed_diagram(drawn, window, self.params.lloyd_passes)
    }

    /// Computes only the paths on a diagram.
    ///
    /// Start vertices are drawn without replacement from the vertices inside the window. A path follows the edge of
    /// steepest descent from each vertex to the next. A branch takes the other descending edge, and then the steepest
    /// that does not lead back into its own tree. A path that reaches another tree ends there. A path that ends in a
    /// local minimum, or can only return to its own tree, is discarded.
    pub fn paths<R: Rng + ?Sized>(
        &self,
        diagram: &Diagram,
        height: impl Fn(Point) -> f64,
        rng: &mut R,
    ) -> Vec<DescentPath> {
        let heights = diagram.vertices().iter().map(|&point| height(point)).collect();
        self.run(HeightField::new(Graph::of(diagram), height, heights), rng)
    }

    fn run<R: Rng + ?Sized>(&self, mut field: HeightField<impl Fn(Point) -> f64>, rng: &mut R) -> Vec<DescentPath> {
        let mut start_vertices = field.start_vertices(self.params.start_above);
        let mut paths = Vec::new();
        for _ in 0..self.params.paths.min(start_vertices.len()) {
            let start_vertex = start_vertices.swap_remove(below(start_vertices.len(), rng));
            let mut branches = || chance(self.params.branch_probability, rng);
            field.run(start_vertex, &mut branches, &mut paths);
        }
        paths
    }
}

#[cfg(test)]
mod tests;
