use crate::Border;
use crate::error::{Error, require, within};
use crate::fir::{self, Source};
use crate::kernel::{Kernel, LOST_TAIL};
use crate::pyramid::{self, Pyramid};
use crate::scratch::Scratch;

/// Method of computation. All methods approximate the same kernel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// Direct sum over all taps in single precision: the reference for the other methods. The time grows with σ.
    Direct,
    /// Downsampled as often as σ allows, from 2.8 pixels on, blurred and upsampled. The error is below 1e-3 of the
    /// image's range; the time hardly depends on σ.
    Decimated,
    /// Decimated from 3.5 pixels on, with an error below 2e-4 of the range; direct below.
    #[default]
    Auto,
}

/// The Gaussian blur G_σ of Eqs. 13, 14 and 16, on the pixel lattice.
///
/// The paper leaves the sampling open. This kernel is the discrete normal distribution wₙ ∝ exp(-n²/2s²) with s solved
/// for ∑ n² wₙ = σ² (1e-12), at every σ ≥ 0. It is positive, sums to one, and is continuous in σ: from the identity at
/// σ = 0 to s = σ (within 1e-8) above about one pixel. The taps omit less than 1e-7 of the sum, or the fraction given
/// to [`truncated`](Self::truncated); the variance of the truncated kernel is exact.
#[derive(Debug, Clone, PartialEq)]
pub struct Gaussian {
    sigma_px: f64,
    kernel: Kernel,
    pyramid: Option<Pyramid>,
}

impl Gaussian {
    /// Creates a blur of standard deviation `sigma_px`, 0 to 4096 pixels, with [`Method::Auto`].
    ///
    /// # Errors
    ///
    /// If `sigma_px` is out of range or not a number.
    pub fn new(sigma_px: f64) -> Result<Self, Error> {
        Self::truncated(sigma_px, Method::Auto, LOST_TAIL)
    }

    /// Creates a blur whose taps omit less than `lost_tail` of the sum, from 1e-7, the value of [`new`](Self::new), to
    /// 1e-2. 1e-4 saves a quarter of the taps.
    ///
    /// The sum is one and the variance exact for every value. The error of a pixel is at most ten times `lost_tail` of
    /// the image's range; for corners, discs and noise it is less than half of that.
    ///
    /// # Errors
    ///
    /// If `sigma_px` is not a number from 0 to 4096, or `lost_tail` is out of range.
    pub fn truncated(sigma_px: f64, method: Method, lost_tail: f64) -> Result<Self, Error> {
        // Wider than any field of view; limits the memory of the taps.
        within("sigma_px", sigma_px, 0.0..=4096.0, "a number from 0 to 4096")?;
        // Shorter kernels are no longer Gaussian.
        within("lost_tail", lost_tail, LOST_TAIL..=1e-2, "a number from 1e-7 to 1e-2")?;
        let kernel = Kernel::new(sigma_px, lost_tail);
        let narrowest = match method {
            Method::Direct => None,
            Method::Decimated => Some(pyramid::NARROWEST),
            Method::Auto => Some(pyramid::NARROWEST_BY_DEFAULT),
        };
        let pyramid = narrowest.and_then(|n| Pyramid::new(sigma_px, n, kernel.radius(), lost_tail));
        Ok(Self { sigma_px, kernel, pyramid })
    }

    /// Returns the standard deviation in pixels.
    #[must_use]
    pub fn sigma_px(&self) -> f64 {
        self.sigma_px
    }

    /// Returns the distance to the last tap in pixels. Less than 1e-7 of the sum, or the value given to
    /// [`truncated`](Self::truncated), lies beyond it.
    #[must_use]
    pub fn radius(&self) -> usize {
        self.kernel.radius()
    }

    /// Returns half of the kernel along one axis: the weights at 0, ±1 … ±[`radius`](Self::radius).
    #[must_use]
    pub fn taps(&self) -> &[f64] {
        &self.kernel.taps
    }

    /// Blurs `image`, in rows of `width` pixels.
    ///
    /// # Panics
    ///
    /// If `image` is empty, or its length is not a multiple of `width`.
    #[must_use]
    pub fn blur(&self, image: &[f32], width: usize, border: Border) -> Vec<f32> {
        let mut blurred = vec![0.0; image.len()];
        self.blur_into(image, width, border, &mut blurred, &mut Scratch::new());
        blurred
    }

    /// Blurs `src`, in rows of `width` pixels, into `dst` of the same size.
    ///
    /// # Panics
    ///
    /// If `src` is empty, or its length is not a multiple of `width` or differs from that of `dst`.
    pub fn blur_into(&self, src: &[f32], width: usize, border: Border, dst: &mut [f32], scratch: &mut Scratch) {
        self.apply(src, width, border, 0, dst, scratch);
    }

    /// Blurs rows of `src` into `dst`, from row `first`, as many as `dst` holds. The result equals these rows of the
    /// complete blur with [`Method::Direct`].
    ///
    /// # Panics
    ///
    /// If `src` is empty, a length is not a multiple of `width`, or the rows exceed the image.
    pub fn blur_rows_into(
        &self,
        src: &[f32],
        width: usize,
        border: Border,
        first: usize,
        dst: &mut [f32],
        scratch: &mut Scratch,
    ) {
        assert_rows(src, width);
        let rows = src.len() / width;
        let within = dst.len().is_multiple_of(width) && first + dst.len() / width <= rows;
        assert!(within, "{} pixels from row {first} exceed the {rows} rows of the image", dst.len());
        let source = Source { pixels: src, width, border };
        fir::blur(source, &self.kernel.half, 0, first.cast_signed(), dst, scratch);
    }

    /// Blurs an isolated object in its `tile`. Returns the enlarged tile, and its margin on each side in pixels, the
    /// [`radius`](Self::radius).
    ///
    /// # Panics
    ///
    /// If `tile` is empty, or its length is not a multiple of `width`.
    #[must_use]
    pub fn blur_expanded(&self, tile: &[f32], width: usize) -> (Vec<f32>, usize) {
        let around = 2 * self.radius();
        let mut wide = vec![0.0; (width + around) * (tile.len() / width.max(1) + around)];
        self.blur_expanded_into(tile, width, &mut wide, &mut Scratch::new());
        (wide, self.radius())
    }

    /// Blurs an isolated object in its `tile` into `dst`, which has `2 · radius` more columns and rows.
    ///
    /// # Panics
    ///
    /// If `tile` is empty, its length is not a multiple of `width`, or `dst` has another length.
    pub fn blur_expanded_into(&self, tile: &[f32], width: usize, dst: &mut [f32], scratch: &mut Scratch) {
        self.apply(tile, width, Border::Zero, self.radius(), dst, scratch);
    }

    fn apply(
        &self,
        pixels: &[f32],
        width: usize,
        border: Border,
        margin: usize,
        dst: &mut [f32],
        scratch: &mut Scratch,
    ) {
        assert_rows(pixels, width);
        let expected = (width + 2 * margin) * (pixels.len() / width + 2 * margin);
        assert_eq!(dst.len(), expected, "`dst` has the wrong number of pixels");
        let source = Source { pixels, width, border };
        match &self.pyramid {
            Some(pyramid) => pyramid.blur(source, margin, dst, scratch),
            None => fir::blur(source, &self.kernel.half, margin, -margin.cast_signed(), dst, scratch),
        }
    }
}

fn assert_rows(pixels: &[f32], width: usize) {
    let whole = width > 0 && !pixels.is_empty() && pixels.len().is_multiple_of(width);
    assert!(whole, "{} pixels are not a multiple of the width, {width}", pixels.len());
}

/// Gaussian blur of a bright-field microscope, in the image plane and with defocus.
#[derive(Debug, Clone, PartialEq)]
pub struct FocusParams {
    /// σ_x,y of Eq. 13, in pixels, >= 0: the blur of an edge in focus. Default 0.9, the paper's (0.22 µm at 0.25 µm per
    /// pixel). Diffraction of a 0.95 NA lens and the pixel area account for 0.64; the rest is relay optics, sensor and
    /// vibration.
    pub sigma_xy_px: f64,
    /// σ_z of Eq. 14 per µm of distance between object and focal plane, in pixels per µm, >= 0. Default 1, the paper's
    /// value as its program reads it: see [`FocusParams::paper`].
    pub sigma_per_um: f64,
}

impl Default for FocusParams {
    fn default() -> Self {
        Self { sigma_xy_px: 0.9, sigma_per_um: 1.0 }
    }
}

impl FocusParams {
    /// Returns the paper's values: "σ ≃ dz, where dz is the z-offset in µm" with σ in pixels of 0.25 µm, as the
    /// authors' program computes it. That is a quarter of a µm of blur per µm of depth. Partially coherent imaging
    /// gives the same for a condenser aperture of 0.6 and an object in the mountant.
    #[must_use]
    pub fn paper() -> Self {
        Self::default()
    }

    /// Returns the paper's values with σ read in µm: four pixels of 0.25 µm per µm. No condenser aperture reaches this;
    /// for comparison.
    #[must_use]
    pub fn paper_in_micrometres() -> Self {
        Self { sigma_per_um: 4.0, ..Self::paper() }
    }
}

/// The depth of focus: the paper's "Impulse response", Fig. 10.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthOfFocus(FocusParams);

impl DepthOfFocus {
    /// Creates the model from validated parameters.
    ///
    /// # Errors
    ///
    /// If a field is negative or not finite.
    pub fn new(params: &FocusParams) -> Result<Self, Error> {
        for (field, value) in [("sigma_xy_px", params.sigma_xy_px), ("sigma_per_um", params.sigma_per_um)] {
            require(field, value, value >= 0.0, "at least 0")?;
        }
        Ok(Self(params.clone()))
    }

    /// Returns σ_z in pixels of an object at distance `depth_um` from the focal plane, on either side (Eq. 14).
    #[must_use]
    pub fn sigma_px(&self, depth_um: f64) -> f64 {
        // "Impulse response": σ = k·|dz|
        self.0.sigma_per_um * depth_um.abs()
    }

    /// Returns σ_x,y in pixels, the same at every depth (Eq. 13).
    #[must_use]
    pub fn sigma_xy_px(&self) -> f64 {
        self.0.sigma_xy_px
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blur_is_linear_in_depth_and_symmetric() {
        for (params, per_um) in [(FocusParams::paper(), 1.0), (FocusParams::paper_in_micrometres(), 4.0)] {
            let focus = DepthOfFocus::new(&params).unwrap();
            assert_eq!([0.0, 1.5, -1.5].map(|z| focus.sigma_px(z)), [0.0, 1.5 * per_um, 1.5 * per_um]);
            assert_eq!(focus.sigma_xy_px(), 0.9);
        }
    }

    #[test]
    fn out_of_range_values_are_rejected_by_field() {
        for bad in [-0.1, f64::NAN, f64::INFINITY] {
            let xy = FocusParams { sigma_xy_px: bad, ..FocusParams::default() };
            let z = FocusParams { sigma_per_um: bad, ..FocusParams::default() };
            assert!(DepthOfFocus::new(&xy).unwrap_err().to_string().contains("sigma_xy_px"));
            assert!(DepthOfFocus::new(&z).unwrap_err().to_string().contains("sigma_per_um"));
        }
    }
}
