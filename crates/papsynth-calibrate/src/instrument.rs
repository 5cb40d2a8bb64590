//! The known parameters of a microscope.

use optics_psf::{Microscope, MicroscopeParams};
use serde::{Deserialize, Serialize};

use crate::error::Error;

/// The known parameters of a microscope.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Instrument {
    /// Numerical aperture of the objective.
    pub na: f64,
    /// Wavelength of the light, µm.
    pub wavelength_um: f64,
    /// Refractive index of the mountant.
    pub mount_index: f64,
    /// Refractive index between cover glass and objective.
    pub immersion_index: f64,
    /// Size of a pixel in the object, µm.
    pub pixel_um: f64,
}

impl Default for Instrument {
    fn default() -> Self {
        let MicroscopeParams { na, wavelength_um, mount_index, immersion_index, pixel_um, .. } =
            MicroscopeParams::default();
        Self { na, wavelength_um, mount_index, immersion_index, pixel_um }
    }
}

impl Instrument {
    /// Checks the ranges of the parameters.
    ///
    /// # Errors
    /// [`Error::Microscope`] with the field that is out of range.
    pub fn check(&self) -> Result<(), Error> {
        let condenser_na = MicroscopeParams::default().condenser_na.min(self.na);
        Microscope::new(&self.params(condenser_na)).map(drop).map_err(Error::Microscope)
    }

    /// Returns the parameters of the optics for an aperture of the condenser.
    #[must_use]
    pub fn params(&self, condenser_na: f64) -> MicroscopeParams {
        let Self { na, wavelength_um, mount_index, immersion_index, pixel_um } = *self;
        MicroscopeParams {
            na,
            condenser_na,
            wavelength_um,
            mount_index,
            immersion_index,
            pixel_um,
            ..MicroscopeParams::default()
        }
    }
}
