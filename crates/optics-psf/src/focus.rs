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
pub struct DepthOfFocus {
    sigma_xy_px: f64,
    sigma_per_um: f64,
}

impl DepthOfFocus {
    /// Checks the parameters.
    ///
    /// # Errors
    ///
    /// If a field is negative or not a finite number.
    pub fn new(params: &FocusParams) -> Result<Self, Error> {
        let accepted = "0 or more";
        let (xy, per_um) = (params.sigma_xy_px, params.sigma_per_um);
        Ok(Self {
            sigma_xy_px: require("sigma_xy_px", xy, xy >= 0.0, accepted)?,
            sigma_per_um: require("sigma_per_um", per_um, per_um >= 0.0, accepted)?,
        })
    }

    /// σ_z in pixels of an object `depth_um` from the focal plane, on either side (Eq. 14).
    #[must_use]
    pub fn sigma_px(&self, depth_um: f64) -> f64 {
        // "Impulse response": σ = k·|dz|
        self.sigma_per_um * depth_um.abs()
    }

    /// σ_x,y in pixels, the same for every depth (Eq. 13).
    #[must_use]
    pub fn sigma_xy_px(&self) -> f64 {
        self.sigma_xy_px
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_the_papers() {
        let paper = FocusParams::paper();
        assert_eq!((paper.sigma_xy_px, paper.sigma_per_um), (0.9, 1.0));
        assert_eq!(paper, FocusParams::default());
        let other = FocusParams::paper_in_micrometres();
        assert_eq!((other.sigma_xy_px, other.sigma_per_um), (0.9, 4.0));
    }

    #[test]
    fn blur_is_linear_in_depth_and_even() {
        let focus = DepthOfFocus::new(&FocusParams::paper_in_micrometres()).unwrap();
        assert_eq!(focus.sigma_px(0.0), 0.0);
        assert_eq!(focus.sigma_px(1.5), 6.0);
        assert_eq!(focus.sigma_px(-1.5), 6.0);
        assert_eq!(focus.sigma_xy_px(), 0.9);
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
