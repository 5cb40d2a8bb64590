use crate::Border;
use crate::error::{Error, require, within};
use crate::fir::{self, Source};
use crate::kernel::{Kernel, LOST_TAIL};
use crate::pyramid::{self, Pyramid};
use crate::scratch::Scratch;

/// How a blur is computed. The kernel that is meant is the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// Every tap, in single precision: the definition, and the oracle of the others. The time
    /// grows with the width.
    Direct,
    /// Halved as often as the width allows, at all from 2.8 pixels on, blurred and doubled again.
    /// The error is below 1e-3 of the range of the image; the time hardly depends on the width.
    Decimated,
    /// Decimated where that costs less than 2e-4 of the range, which is from 3.5 pixels on; direct
    /// below.
    #[default]
    Auto,
}

/// G_σ of Eqs. 13, 14 and 16: the normal point spread function, on the lattice of the pixels.
///
/// The paper leaves its sampling open. This is the discrete normal distribution wₙ ∝ exp(-n²/2s²) with s solved for
/// ∑ n² wₙ = σ² (1e-12), at every σ ≥ 0. It is positive, sums to one, and moves continuously through a focus stack: from
/// the identity at σ = 0 to s = σ (within 1e-8) above a little more than a pixel. Taps are kept out to where less than
/// 1e-7 of the sum is lost, or as [`truncated`](Self::truncated) says; the variance is exact for those that are kept.
#[derive(Debug, Clone, PartialEq)]
pub struct Gaussian {
    sigma_px: f64,
    kernel: Kernel,
    pyramid: Option<Pyramid>,
}

impl Gaussian {
    /// A blur of standard deviation `sigma_px`, 0 to 4096 pixels, computed as [`Method::Auto`]
    /// says.
    ///
    /// # Errors
    ///
    /// If `sigma_px` is outside that range or not a number.
    pub fn new(sigma_px: f64) -> Result<Self, Error> {
        Self::truncated(sigma_px, Method::Auto, LOST_TAIL)
    }

    /// A blur whose taps reach out to where less than `lost_tail` of the sum is lost, 1e-7, as of [`new`](Self::new), to
    /// 1e-2: a quarter fewer taps at 1e-4. The sum is still one and the variance still exact. No pixel
    /// errs by more than ten times `lost_tail` of the range of the image; corners, discs and noise
    /// err by less than half of that.
    ///
    /// # Errors
    ///
    /// If `sigma_px` is not a number from 0 to 4096 or `lost_tail` outside its range.
    pub fn truncated(sigma_px: f64, method: Method, lost_tail: f64) -> Result<Self, Error> {
        // Wider than any field of view; it bounds the memory of the taps.
        within("sigma_px", sigma_px, 0.0..=4096.0, "a number from 0 to 4096")?;
        // With more of its tail lost a kernel is a Gaussian no longer.
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

    /// The standard deviation in pixels.
    #[must_use]
    pub fn sigma_px(&self) -> f64 {
        self.sigma_px
    }

    /// The distance in pixels to the last tap: beyond it lies less than 1e-7 of the sum, or
    /// what [`truncated`](Self::truncated) was given.
    #[must_use]
    pub fn radius(&self) -> usize {
        self.kernel.radius()
    }

    /// Half of the kernel along one axis: the weight at 0, at ±1 … at ±[`radius`](Self::radius).
    #[must_use]
    pub fn taps(&self) -> &[f64] {
        &self.kernel.taps
    }

    /// Blurs `image`, any values in rows of `width` pixels.
    ///
    /// # Panics
    ///
    /// If `image` is empty or not whole rows of `width`.
    #[must_use]
    pub fn blur(&self, image: &[f32], width: usize, border: Border) -> Vec<f32> {
        let mut blurred = vec![0.0; image.len()];
        self.blur_into(image, width, border, &mut blurred, &mut Scratch::new());
        blurred
    }

    /// Blurs `src`, any values in rows of `width` pixels, into `dst` of the same size.
    ///
    /// # Panics
    ///
    /// If `src` is empty or not whole rows of `width`, or `dst` is not as long as it.
    pub fn blur_into(&self, src: &[f32], width: usize, border: Border, dst: &mut [f32], scratch: &mut Scratch) {
        self.apply(src, width, border, 0, dst, scratch);
    }

    /// Blurs some rows of `src`, any values in rows of `width` pixels: those from row `first` on, as
    /// many as `dst` holds, as they are in the whole. Every tap is summed, as with
    /// [`Method::Direct`].
    ///
    /// # Panics
    ///
    /// If `src` is empty or not whole rows of `width`, or `dst` not whole rows of it or beyond the
    /// last.
    pub fn blur_rows_into(
        &self,
        src: &[f32],
        width: usize,
        border: Border,
        first: usize,
        dst: &mut [f32],
        scratch: &mut Scratch,
    ) {
        whole_rows(src, width);
        let rows = src.len() / width;
        let within = dst.len().is_multiple_of(width) && first + dst.len() / width <= rows;
        assert!(within, "{} pixels from row {first} on are no rows of the {rows} there are", dst.len());
        let source = Source { pixels: src, width, border };
        fir::blur(source, &self.kernel.half, 0, first.cast_signed(), dst, scratch);
    }

    /// Blurs an object that is alone in its `tile` and returns the larger tile it then fills, and
    /// by how many pixels that is larger on each side (the [`radius`](Self::radius)).
    ///
    /// # Panics
    ///
    /// If `tile` is empty or not whole rows of `width`.
    #[must_use]
    pub fn spread(&self, tile: &[f32], width: usize) -> (Vec<f32>, usize) {
        let around = 2 * self.radius();
        let mut wide = vec![0.0; (width + around) * (tile.len() / width.max(1) + around)];
        self.spread_into(tile, width, &mut wide, &mut Scratch::new());
        (wide, self.radius())
    }

    /// Blurs an object that is alone in its `tile` into `dst`, whose rows are
    /// `width + 2 · radius` pixels and which has `2 · radius` rows more.
    ///
    /// # Panics
    ///
    /// If `tile` is empty or not whole rows of `width`, or `dst` has another length.
    pub fn spread_into(&self, tile: &[f32], width: usize, dst: &mut [f32], scratch: &mut Scratch) {
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
        whole_rows(pixels, width);
        let expected = (width + 2 * margin) * (pixels.len() / width + 2 * margin);
        assert_eq!(dst.len(), expected, "dst has the wrong number of pixels");
        let source = Source { pixels, width, border };
        match &self.pyramid {
            Some(pyramid) => pyramid.blur(source, margin, dst, scratch),
            None => fir::blur(source, &self.kernel.half, margin, -margin.cast_signed(), dst, scratch),
        }
    }
}

fn whole_rows(pixels: &[f32], width: usize) {
    let whole = width > 0 && !pixels.is_empty() && pixels.len().is_multiple_of(width);
    assert!(whole, "{} pixels are not whole rows of {width}", pixels.len());
}

/// How far a bright-field microscope spreads light, in the plane and with depth.
#[derive(Debug, Clone, PartialEq)]
pub struct FocusParams {
    /// σ_x,y of Eq. 13, in pixels, >= 0: the blur of an edge that is in focus. Default 0.9, the
    /// paper's (0.22 µm at 0.25 µm a pixel). The diffraction of a 0.95 NA lens and the area of
    /// the pixel account for 0.64; the rest is the relay optics, the sensor and vibration.
    pub sigma_xy_px: f64,
    /// σ_z of Eq. 14 for each µm between an object and the focal plane, in pixels per µm, >= 0.
    /// Default 1, the paper's in the reading of its program: see [`FocusParams::paper`].
    pub sigma_per_um: f64,
}

impl Default for FocusParams {
    fn default() -> Self {
        Self { sigma_xy_px: 0.9, sigma_per_um: 1.0 }
    }
}

impl FocusParams {
    /// The paper's: "σ ≃ dz, where dz is the z-offset in µm" with σ in pixels of 0.25 µm, which is
    /// what the authors' program computes: a quarter of a µm of blur for each µm of depth. Partially
    /// coherent imaging gives the same for a condenser aperture of 0.6 and an object in the
    /// mountant.
    #[must_use]
    pub fn paper() -> Self {
        Self::default()
    }

    /// The paper's words read with σ in µm: four pixels of 0.25 µm for each µm. No setting of the
    /// condenser reaches that; it is here to compare with.
    #[must_use]
    pub fn paper_in_micrometres() -> Self {
        Self { sigma_per_um: 4.0, ..Self::paper() }
    }
}

/// The depth of focus: the paper's "Impulse response", Fig. 10.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthOfFocus(FocusParams);

impl DepthOfFocus {
    /// Checks the parameters.
    ///
    /// # Errors
    ///
    /// If a field is negative or not a finite number.
    pub fn new(params: &FocusParams) -> Result<Self, Error> {
        for (field, value) in [("sigma_xy_px", params.sigma_xy_px), ("sigma_per_um", params.sigma_per_um)] {
            require(field, value, value >= 0.0, "0 or more")?;
        }
        Ok(Self(params.clone()))
    }

    /// σ_z in pixels of an object `depth_um` from the focal plane, on either side (Eq. 14).
    #[must_use]
    pub fn sigma_px(&self, depth_um: f64) -> f64 {
        // "Impulse response": σ = k·|dz|
        self.0.sigma_per_um * depth_um.abs()
    }

    /// σ_x,y in pixels, the same for every depth (Eq. 13).
    #[must_use]
    pub fn sigma_xy_px(&self) -> f64 {
        self.0.sigma_xy_px
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blur_is_linear_in_depth_and_even() {
        for (params, per_um) in [(FocusParams::paper(), 1.0), (FocusParams::paper_in_micrometres(), 4.0)] {
            let focus = DepthOfFocus::new(&params).unwrap();
            assert_eq!([0.0, 1.5, -1.5].map(|z| focus.sigma_px(z)), [0.0, 1.5 * per_um, 1.5 * per_um]);
            assert_eq!(focus.sigma_xy_px(), 0.9);
        }
    }

    #[test]
    fn impossible_numbers_are_refused_by_name() {
        for bad in [-0.1, f64::NAN, f64::INFINITY] {
            let xy = FocusParams { sigma_xy_px: bad, ..FocusParams::default() };
            let z = FocusParams { sigma_per_um: bad, ..FocusParams::default() };
            assert!(DepthOfFocus::new(&xy).unwrap_err().to_string().contains("sigma_xy_px"));
            assert!(DepthOfFocus::new(&z).unwrap_err().to_string().contains("sigma_per_um"));
        }
    }
}
