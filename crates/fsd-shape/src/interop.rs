//! Conversions of outlines, masks and matrices to types of other libraries.

#[cfg(any(feature = "mint", feature = "nalgebra"))]
use crate::Descriptors;

#[cfg(any(feature = "mint", feature = "nalgebra"))]
impl Descriptors {
    /// Returns [`Descriptors::outline`] as points of `mint`. Points of other libraries convert to `[f64; 2]` with
    /// `into`.
    ///
    /// ```
    /// use fsd_shape::Descriptors;
    /// use mint::Point2;
    ///
    /// let triangle = [Point2 { x: 0.0, y: 0.0 }, Point2 { x: 6.0, y: 0.0 }, Point2 { x: 0.0, y: 6.0 }];
    /// let descriptors = Descriptors::from_outline(&triangle.map(Into::into))?;
    /// let smooth: Vec<Point2<f64>> = descriptors.mint_outline(100).collect();
    /// assert!(smooth[0].x.abs() < 1e-12);
    /// # Ok::<(), fsd_shape::Error>(())
    /// ```
    #[cfg(feature = "mint")]
    pub fn mint_outline(&self, count: usize) -> impl ExactSizeIterator<Item = mint::Point2<f64>> + use<> {
        self.outline(count).into_iter().map(Into::into)
    }

    /// Returns [`Descriptors::outline`] as points of `nalgebra`.
    ///
    /// ```
    /// # use nalgebra::Point2;
    /// let square = [Point2::new(0.0, 0.0), Point2::new(6.0, 0.0), Point2::new(6.0, 6.0), Point2::new(0.0, 6.0)];
    /// let smooth = fsd_shape::Descriptors::from_outline(&square.map(Into::into))?.nalgebra_outline(4);
    /// assert!(smooth.zip(&square).all(|(p, q)| nalgebra::distance(&p, q) < 1e-12));
    /// # Ok::<(), fsd_shape::Error>(())
    /// ```
    #[cfg(feature = "nalgebra")]
    pub fn nalgebra_outline(&self, count: usize) -> impl ExactSizeIterator<Item = nalgebra::Point2<f64>> + use<> {
        self.outline(count).into_iter().map(Into::into)
    }
}

#[cfg(feature = "nalgebra")]
impl crate::ShapeModel {
    /// Returns the covariance of the coordinates of a shape, in the order of
    /// [`ShapeStatistics::mean`](crate::ShapeStatistics::mean), without roughness.
    ///
    /// ```
    /// use fsd_shape::{ShapeModel, ShapeModelParams};
    ///
    /// // Ellipses with semi-axes of 10 and 10 to 19.
    /// let angles = || (0..64).map(|k| std::f64::consts::TAU * f64::from(k) / 64.0);
    /// let ellipse = |n| angles().map(|t: f64| [10.0 * t.cos(), (10.0 + f64::from(n)) * t.sin()]).collect();
    /// let outlines: Vec<Vec<[f64; 2]>> = (0..10).map(ellipse).collect();
    /// let model = ShapeModel::fit(&outlines, &ShapeModelParams { harmonics: 6, ..ShapeModelParams::default() })?;
    ///
    /// let covariance = model.covariance();
    /// assert_eq!(covariance.shape(), (24, 24));
    /// // Nearly all of the variance is in one direction.
    /// assert!(covariance.symmetric_eigenvalues().max() > 0.85 * covariance.trace());
    /// # Ok::<(), fsd_shape::Error>(())
    /// ```
    #[must_use]
    pub fn covariance(&self) -> nalgebra::DMatrix<f64> {
        let statistics = self.statistics();
        let size = statistics.coordinates();
        // Each column is the contribution of one normal deviate.
        let mut columns: Vec<f64> = statistics.components.iter().flat_map(|c| c.loading.iter().copied()).collect();
        for (k, &sd) in statistics.residual_sd.iter().enumerate() {
            let mut column = vec![0.0; size];
            column[k] = sd;
            if statistics.residual == crate::Residual::Steps {
                crate::steps::from_steps(&mut column);
            }
            columns.extend(column);
        }
        let columns = nalgebra::DMatrix::from_vec(size, columns.len() / size, columns);
        &columns * columns.transpose()
    }
}

/// Traces an 8-bit mask like [`trace`](crate::trace): a pixel belongs to the object if its value exceeds `level`, 0 to
/// 254.
///
/// ```
/// use image::{GrayImage, Luma};
///
/// let inside = |x: u32, y: u32| (2..6).contains(&x) && (1..4).contains(&y);
/// let mask = GrayImage::from_fn(8, 6, |x, y| Luma([if inside(x, y) { 255 } else { 0 }]));
/// let outline = fsd_shape::trace_image(&mask, 127)?;
/// assert!((fsd_shape::signed_area(&outline) - 12.0).abs() < 1.0);
/// # Ok::<(), fsd_shape::Error>(())
/// ```
///
/// # Errors
///
/// As [`trace`](crate::trace).
#[cfg(feature = "image")]
pub fn trace_image(mask: &image::GrayImage, level: u8) -> Result<Vec<crate::Point>, crate::Error> {
    let values: Vec<f32> = mask.iter().map(|&v| f32::from(v)).collect();
    crate::trace(&values, mask.width() as usize, f32::from(level) + 0.5)
}
