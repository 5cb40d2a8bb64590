use crate::diagram::Diagram;
use crate::error::{Error, require};
use crate::geometry::Point;
use crate::lloyd::relaxed_diagram;
use crate::outline::Outline;
use crate::river::{Landscape, Net, River};
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
    /// Number of springs from which rivers run: 0 or more. Fewer rivers result where springs lie on rivers that are
    /// already there, more where they branch. Default: 15 (the paper's).
    pub rivers: usize,
    /// Probability that a river branches at a vertex, where a second way leads down: 0 to 1. Default: 0.2 (the paper's).
    pub branch_probability: f64,
    /// Height of the lowest spring over the largest height: 0 to 1. Default: 0.5 (the paper's).
    pub start_above: f64,
}

impl Default for SkeletonParams {
    fn default() -> Self {
        Self { sites: 300, lloyd_passes: 2, rivers: 15, branch_probability: 0.2, start_above: 0.5 }
    }
}

/// Grows the paper's cytoskeleton (under "Cytoplasm", Fig. 7): trees of steepest descent along the edges of a relaxed
/// Voronoi diagram.
#[derive(Debug, Clone)]
pub struct Skeleton {
    params: SkeletonParams,
}

impl Skeleton {
    /// A skeleton of some parameters.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a parameter outside the range its field states.
    pub fn new(params: &SkeletonParams) -> Result<Self, Error> {
        let SkeletonParams { sites, lloyd_passes, rivers: _, branch_probability, start_above } = *params;
        require("sites", sites as f64, (1..=1_000_000).contains(&sites), "between 1 and 1000000")?;
        require("lloyd_passes", lloyd_passes as f64, lloyd_passes <= 10_000, "at most 10000")?;
        for (field, value) in [("branch_probability", branch_probability), ("start_above", start_above)] {
            require(field, value, (0.0..=1.0).contains(&value), "between 0 and 1")?;
        }
        Ok(Self { params: *params })
    }

    /// Grows a skeleton in a cell of the given outline, a closed polygon in pixels: the diagram fills the upright
    /// rectangle around it, the height of a point is its distance from the outline, and rivers end on the outline.
    ///
    /// # Errors
    /// [`Error::Coordinate`] or [`Error::Flat`] for an outline that is none.
    pub fn grow<R: Rng + ?Sized>(&self, outline: &[Point], rng: &mut R) -> Result<Vec<River>, Error> {
        let edge = Outline::new(outline)?;
        let diagram = self.diagram(&Window::around(outline)?, rng)?;
        let heights = edge.heights(diagram.vertices());
        Ok(self.run(Landscape::new(Net::of(&diagram), |point| edge.height(point), heights), rng))
    }

    /// Grows a skeleton as [`Skeleton::grow`] does, but on a piece of a torus, at a fraction of the cost: turned,
    /// mirrored and shifted at random, and scaled so that the rectangle around the outline holds as many sites as the
    /// parameters say on average. How far it is relaxed is the torus's.
    ///
    /// An outline too long for the torus to cover without repeating itself gets a diagram of its own.
    ///
    /// # Errors
    /// As [`Skeleton::grow`].
    pub fn grow_from<R: Rng + ?Sized>(
        &self,
        torus: &Torus,
        outline: &[Point],
        rng: &mut R,
    ) -> Result<Vec<River>, Error> {
        let window = Window::around(outline)?;
        let edge = Outline::new(outline)?;
        let Some(net) = torus.place(&window, self.params.sites, rng) else {
            return self.grow(outline, rng);
        };
        let heights = edge.heights(&net.vertices);
        Ok(self.run(Landscape::new(net, |point| edge.height(point), heights), rng))
    }

    /// Grows a skeleton in a window on a landscape of your own. Rivers end on the window's border, or earlier where the
    /// height falls to zero.
    ///
    /// # Errors
    /// [`Error::Sites`] if the window is so small, for its distance from the origin, that two sites become one.
    pub fn grow_on<R: Rng + ?Sized>(
        &self,
        window: &Window,
        height: impl Fn(Point) -> f64,
        rng: &mut R,
    ) -> Result<Vec<River>, Error> {
        let diagram = self.diagram(window, rng)?;
        Ok(self.rivers(&diagram, height, rng))
    }

    /// The first step alone: sites drawn uniformly in the window, and relaxed.
    ///
    /// # Errors
    /// As [`Skeleton::grow_on`].
    pub fn diagram<R: Rng + ?Sized>(&self, window: &Window, rng: &mut R) -> Result<Diagram, Error> {
        let drawn = (0..self.params.sites).map(|_| window.draw(rng)).collect();
        relaxed_diagram(drawn, window, self.params.lloyd_passes)
    }

    /// The second step alone: rivers on a diagram.
    ///
    /// Springs are vertices inside the window, drawn without return. A river follows the edge of steepest descent from
    /// each vertex to the next. Where it branches, the branch takes the other way down, and then the steepest that does not lead
    /// back into its own tree. A river that meets another tree ends there. One that ends in a pit, which a landscape
    /// that is not concave may have, is left out, and so is a branch that cannot but return to its own tree.
    pub fn rivers<R: Rng + ?Sized>(&self, diagram: &Diagram, height: impl Fn(Point) -> f64, rng: &mut R) -> Vec<River> {
        let heights = diagram.vertices().iter().map(|&point| height(point)).collect();
        self.run(Landscape::new(Net::of(diagram), height, heights), rng)
    }

    fn run<R: Rng + ?Sized>(&self, mut landscape: Landscape<impl Fn(Point) -> f64>, rng: &mut R) -> Vec<River> {
        let mut springs = landscape.springs(self.params.start_above);
        let mut rivers = Vec::new();
        for _ in 0..self.params.rivers.min(springs.len()) {
            let spring = springs.swap_remove(below(springs.len(), rng));
            let mut branches = || chance(self.params.branch_probability, rng);
            landscape.run(spring, &mut branches, &mut rivers);
        }
        rivers
    }
}

#[cfg(test)]
mod tests;
