//! Conversions of meshes to types of other libraries.

use crate::Sheet;

impl Sheet {
    /// Returns [`Sheet::vertices`] as points of `mint`. Points of other libraries convert to `[f64; 2]` with `into`.
    ///
    /// ```
    /// use cloth_verlet::{Cloth, ClothParams};
    /// use mint::{Point2, Point3, Vector3};
    /// use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};
    ///
    /// let outline = [Point2 { x: 1.0, y: 1.0 }, Point2 { x: 60.0, y: 5.0 }, Point2 { x: 30.0, y: 55.0 }];
    /// let cloth = Cloth::new(&ClothParams { vertices: 100, ..ClothParams::default() })?;
    /// let sheet = cloth.crumple(&outline.map(Into::into), &mut Xoshiro256PlusPlus::seed_from_u64(7))?;
    /// let positions: Vec<Point3<f64>> = sheet.mint_vertices().collect();
    /// let normals: Vec<Vector3<f64>> = sheet.mint_normals().collect();
    /// let indices: Vec<u32> = sheet.triangles().concat();
    /// assert!(indices.iter().all(|&i| (i as usize) < positions.len()) && normals.len() == positions.len());
    /// # Ok::<(), cloth_verlet::Error>(())
    /// ```
    #[cfg(feature = "mint")]
    pub fn mint_vertices(&self) -> impl ExactSizeIterator<Item = mint::Point3<f64>> {
        self.vertices().iter().map(|&v| v.into())
    }

    /// Returns [`Sheet::normals`] as vectors of `mint`.
    #[cfg(feature = "mint")]
    pub fn mint_normals(&self) -> impl ExactSizeIterator<Item = mint::Vector3<f64>> + use<> {
        self.normals().into_iter().map(Into::into)
    }

    /// Returns [`Sheet::vertices`] as points of `nalgebra`.
    ///
    /// ```
    /// # use cloth_verlet::{Cloth, ClothParams};
    /// # use nalgebra::{Point2, Point3, Vector3};
    /// # use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};
    /// let outline = [Point2::new(1.0, 1.0), Point2::new(60.0, 5.0), Point2::new(30.0, 55.0)].map(Into::into);
    /// let sheet = Cloth::new(&ClothParams::default())?.crumple(&outline, &mut Xoshiro256PlusPlus::seed_from_u64(7))?;
    /// let top = sheet.nalgebra_vertices().max_by(|p, q| p.z.total_cmp(&q.z));
    /// assert!(top.is_some_and(|p: Point3<f64>| p.z > 0.0));
    /// let steepest = sheet.nalgebra_normals().map(|n: Vector3<f64>| n.z.abs()).fold(1.0, f64::min);
    /// assert!(steepest < 0.9);
    /// # Ok::<(), cloth_verlet::Error>(())
    /// ```
    #[cfg(feature = "nalgebra")]
    pub fn nalgebra_vertices(&self) -> impl ExactSizeIterator<Item = nalgebra::Point3<f64>> {
        self.vertices().iter().map(|&v| v.into())
    }

    /// Returns [`Sheet::normals`] as vectors of `nalgebra`.
    #[cfg(feature = "nalgebra")]
    pub fn nalgebra_normals(&self) -> impl ExactSizeIterator<Item = nalgebra::Vector3<f64>> + use<> {
        self.normals().into_iter().map(Into::into)
    }
}
