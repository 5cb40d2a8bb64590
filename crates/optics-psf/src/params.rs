/// Parameters of a bright-field microscope.
///
/// The model is scalar. The condenser emits the same radiance in every direction up to its aperture (Köhler
/// illumination).
#[derive(Debug, Clone, PartialEq)]
pub struct MicroscopeParams {
    /// Numerical aperture of the objective, above 0, at most the immersion index, below the index of the mountant.
    /// Default 0.95, the paper's.
    pub na: f64,
    /// Numerical aperture of the condenser, above 0, below the index of the mountant. It may exceed `na`; light outside
    /// of the objective's aperture is lost. Default 0.41, ours: with it, [`calibrate::focus`](crate::calibrate::focus)
    /// measures the paper's 0.25 µm of blur per µm (Fig. 10), for a stage that moves in air, averaged over the first
    /// four µm on each side.
    pub condenser_na: f64,
    /// Vacuum wavelength, 0.1 to 10 µm. Default 0.57, the paper's filter.
    pub wavelength_um: f64,
    /// Width of the wavelength band, 0 to half of the wavelength, in µm. Default 0.01, ours: an interference filter.
    pub bandwidth_um: f64,
    /// Refractive index of the mountant around the object, 1 to 3. Default 1.515, ours.
    pub mount_index: f64,
    /// Refractive index between cover glass and objective, 1 to 3. Default 1, ours: a dry lens.
    pub immersion_index: f64,
    /// Excess thickness of the cover glass over the design value, −100 to 100 µm, after paraxial refocusing. Default 0,
    /// ours.
    pub cover_error_um: f64,
    /// Aberrations of the objective. Default none, ours.
    pub zernike: Zernike,
    /// Size of a camera pixel in the object plane, 0.001 to 100 µm. Default 0.25, the paper's.
    pub pixel_um: f64,
    /// Object samples per pixel side, 1 to 16. Default 2, ours.
    pub oversampling: usize,
    /// Glare: uniform stray light, as a fraction of the light of an empty field, 0 to below 1. Default 0, ours.
    pub stray_light: f64,
}

impl Default for MicroscopeParams {
    fn default() -> Self {
        Self {
            na: 0.95,
            condenser_na: 0.41,
            wavelength_um: 0.57,
            bandwidth_um: 0.01,
            mount_index: 1.515,
            immersion_index: 1.0,
            cover_error_um: 0.0,
            zernike: Zernike::default(),
            pixel_um: 0.25,
            oversampling: 2,
            stray_light: 0.0,
        }
    }
}

/// Aberrations of the objective: Zernike terms over its pupil, in waves rms, −5 to 5. All defaults are 0 (ours).
///
/// The polynomials are orthonormal over the unit disc (Noll's; DOI 10.1364/JOSA.66.000207). The root of the sum of
/// squares is the wavefront error σ; the Strehl ratio for small errors is exp(−(2πσ)²).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Zernike {
    /// √3 (2ρ² − 1).
    pub defocus: f64,
    /// √6 ρ² cos 2θ and √6 ρ² sin 2θ.
    pub astigmatism: [f64; 2],
    /// √8 (3ρ³ − 2ρ) cos θ and √8 (3ρ³ − 2ρ) sin θ.
    pub coma: [f64; 2],
    /// √5 (6ρ⁴ − 6ρ² + 1).
    pub spherical: f64,
}

impl Zernike {
    /// Returns the waves of coma and astigmatism at a point of the pupil; the rim is at distance 1.
    pub(crate) fn asymmetric_waves(&self, [x, y]: [f64; 2]) -> f64 {
        let [a, b] = self.astigmatism;
        let [c, d] = self.coma;
        6_f64.sqrt() * (a * (x * x - y * y) + b * 2.0 * x * y)
            + 8_f64.sqrt() * (3.0 * (x * x + y * y) - 2.0) * (c * x + d * y)
    }

    /// Returns the waves of the rotationally symmetric terms, at the squared distance `r2` from the centre.
    #[inline(always)]
    pub(crate) fn round_waves(&self, r2: f64) -> f64 {
        self.defocus * 3_f64.sqrt() * (2.0 * r2 - 1.0)
            + self.spherical * 5_f64.sqrt() * (6.0 * r2 * r2 - 6.0 * r2 + 1.0)
    }

    /// Returns whether all terms are rotationally symmetric.
    pub(crate) fn is_round(&self) -> bool {
        self.astigmatism == [0.0; 2] && self.coma == [0.0; 2]
    }
}
