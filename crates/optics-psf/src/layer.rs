use crate::Error;
use crate::microscope::distance;
use crate::pupil::turn;

/// What light meets at one depth: the complex amplitude √T · exp(iφ) that each sample lets through.
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    depth_um: f64,
    amplitude: Vec<[f64; 2]>,
}

impl Layer {
    /// A layer of complex amplitudes, real and imaginary part, at a depth about the focal plane when the stage has not
    /// moved, positive towards the objective.
    ///
    /// # Errors
    ///
    /// If `depth_um` is not a number from −1000 to 1000.
    pub fn new(depth_um: f64, amplitude: Vec<[f64; 2]>) -> Result<Self, Error> {
        Ok(Self { depth_um: distance("depth_um", depth_um)?, amplitude })
    }

    /// A layer of absorbance A, decadic, that does not refract: amplitudes 10^(−A/2) (Eq. 11's
    /// transmittance).
    ///
    /// # Errors
    ///
    /// As [`Layer::new`].
    pub fn absorbing(depth_um: f64, absorbance: &[f32]) -> Result<Self, Error> {
        Self::new(depth_um, absorbance.iter().map(|&a| [libm::exp10(-0.5 * f64::from(a)), 0.0]).collect())
    }

    /// A layer of absorbance A that delays light by φ radians: amplitudes 10^(−A/2) exp(iφ).
    ///
    /// # Errors
    ///
    /// As [`Layer::new`].
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn refracting(depth_um: f64, absorbance: &[f32], phase_rad: &[f32]) -> Result<Self, Error> {
        assert_eq!(absorbance.len(), phase_rad.len(), "absorbance and phase differ in size");
        let mut layer = Self::absorbing(depth_um, absorbance)?;
        for (amplitude, &phase) in layer.amplitude.iter_mut().zip(phase_rad) {
            let (cos, sin) = turn(f64::from(phase) / core::f64::consts::TAU);
            *amplitude = [amplitude[0] * cos, amplitude[0] * sin];
        }
        Ok(layer)
    }

    /// Depth about the focal plane, µm, positive towards the objective.
    #[must_use]
    pub fn depth_um(&self) -> f64 {
        self.depth_um
    }

    /// The amplitudes.
    #[must_use]
    pub fn amplitude(&self) -> &[[f64; 2]] {
        &self.amplitude
    }
}
