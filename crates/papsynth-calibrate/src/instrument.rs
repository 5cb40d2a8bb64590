//! A microscope as its user knows it.

use optics_psf::{Microscope, MicroscopeParams};
use serde::{Deserialize, Serialize};

use crate::error::Error;

/// A microscope as its user knows it.
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
    /// Side of a pixel in the object, µm.
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
    /// Checks that the optics can compute this microscope.
    ///
    /// # Errors
    /// [`Error::Microscope`] with the field that is out of range.
    pub fn check(&self) -> Result<(), Error> {
        let condenser_na = MicroscopeParams::default().condenser_na.min(self.na);
        Microscope::new(&self.params(condenser_na)).map(drop).map_err(Error::Microscope)
    }

    /// The parameters of the optics, with this aperture of the condenser.
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
