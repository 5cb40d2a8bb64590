use crate::error::{Error, require};

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
