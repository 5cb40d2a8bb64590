//! Conversions of paths and cells to types of other libraries.

use crate::{DescentPath, Diagram};

impl DescentPath {
    /// Returns the points as points of `mint`. Points of other libraries convert to `[f64; 2]` with `into`.
    ///
    /// ```
    /// use mint::Point2;
    /// use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};
    /// use voronoi_cytoskeleton::{Skeleton, SkeletonParams};
    ///
    /// let outline = [Point2 { x: 20.0, y: 30.0 }, Point2 { x: 190.0, y: 90.0 }, Point2 { x: 40.0, y: 150.0 }];
    /// let skeleton = Skeleton::new(&SkeletonParams::default())?;
    /// let paths = skeleton.grow(&outline.map(Into::into), &mut Xoshiro256PlusPlus::seed_from_u64(7))?;
    /// let lines: Vec<Vec<Point2<f64>>> = paths.iter().map(|path| path.mint_points().collect()).collect();
    /// assert!(lines.iter().all(|line| line.len() >= 2));
    /// # Ok::<(), voronoi_cytoskeleton::Error>(())
    /// ```
    #[cfg(feature = "mint")]
    pub fn mint_points(&self) -> impl ExactSizeIterator<Item = mint::Point2<f64>> {
        self.points.iter().map(|&p| p.into())
    }

    /// Returns the points as points of `nalgebra`.
    #[cfg(feature = "nalgebra")]
    pub fn nalgebra_points(&self) -> impl ExactSizeIterator<Item = nalgebra::Point2<f64>> {
        self.points.iter().map(|&p| p.into())
    }
}

impl Diagram {
    /// Returns [`Diagram::corners`] as points of `mint`.
    ///
    /// # Panics
    /// If `cell` is out of range.
    #[cfg(feature = "mint")]
    pub fn mint_corners(&self, cell: usize) -> impl ExactSizeIterator<Item = mint::Point2<f64>> {
        self.corners(cell).map(Into::into)
    }

    /// Returns [`Diagram::corners`] as points of `nalgebra`.
    ///
    /// ```
    /// use nalgebra::{Point2, center};
    /// use voronoi_cytoskeleton::{Diagram, Window};
    ///
    /// let sites = [Point2::new(10.0, 20.0), Point2::new(30.0, 20.0)];
    /// let diagram = Diagram::new(&sites.map(Into::into), &Window::rectangle([0.0, 0.0], [40.0, 40.0])?)?;
    /// let corners: Vec<Point2<f64>> = diagram.nalgebra_corners(0).collect();
    /// assert_eq!(center(&corners[0], &corners[2]), sites[0]);
    /// # Ok::<(), voronoi_cytoskeleton::Error>(())
    /// ```
    ///
    /// # Panics
    /// If `cell` is out of range.
    #[cfg(feature = "nalgebra")]
    pub fn nalgebra_corners(&self, cell: usize) -> impl ExactSizeIterator<Item = nalgebra::Point2<f64>> {
        self.corners(cell).map(Into::into)
    }
}
