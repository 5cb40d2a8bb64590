/// What a microscopist knows about a bright-field microscope.
///
/// Light is scalar and comes from the condenser with the same radiance in every direction up to its
/// aperture (Köhler).
#[derive(Debug, Clone, PartialEq)]
pub struct MicroscopeParams {
    /// Numerical aperture of the objective, above 0, at most the immersion index and below the
    /// mount's. Default 0.95, the paper's.
    pub na: f64,
    /// Numerical aperture to which the condenser is opened, above 0, below the index of the mount.
    /// One above `na` is legitimate; the light outside the objective's aperture is lost. Default
    /// 0.41, ours: the aperture with which [`calibrate::focus`](crate::calibrate::focus), applied
    /// to a stage that travels in air, gives the paper's 0.25 µm of blur for each µm (Fig. 10) on
    /// average over the first four µm either side.
    pub condenser_na: f64,
    /// Wavelength in the vacuum, 0.1 to 10 µm. Default 0.57, the paper's filter.
    pub wavelength_um: f64,
    /// Width of the band of wavelengths, 0 to a half of the wavelength, µm. Default 0.01, ours: an
    /// interference filter.
    pub bandwidth_um: f64,
    /// Refractive index of the mountant, in which the object lies, 1 to 3. Default 1.515, ours.
    pub mount_index: f64,
    /// Refractive index between cover glass and objective, 1 to 3. Default 1, ours: a dry lens.
    pub immersion_index: f64,
    /// How much thicker the cover glass is than the lens was made for, −100 to 100 µm, with the
    /// lens refocused as paraxial rays need it. Default 0, ours.
    pub cover_error_um: f64,
    /// Aberrations of the objective. Default none, ours.
    pub zernike: Zernike,
    /// Side of a pixel of the camera in the plane of the object, 0.001 to 100 µm. Default 0.25,
    /// the paper's.
    pub pixel_um: f64,
    /// Samples of the rendered object along the side of a pixel, 1 to 16. Default 2, ours.
    pub oversampling: usize,
    /// Glare: the share of the light of an empty field that has lost its way and lies evenly over
    /// the picture, 0 to below 1. Default 0, ours.
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

/// Aberrations of the objective: Zernike terms over its pupil, each in waves rms, −5 to 5. All are
/// 0 by default (ours).
///
/// The polynomials are orthonormal over the unit disc (Noll's; DOI 10.1364/JOSA.66.000207), so the
/// square root of the sum of the squares is the error of the whole wavefront, σ, and the Strehl
/// ratio of a small one is exp(−(2πσ)²).
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
    /// Waves of the terms with a direction, at a point of the pupil, whose rim lies at distance 1.
    pub(crate) fn sided_waves(&self, [x, y]: [f64; 2]) -> f64 {
        let [a, b] = self.astigmatism;
        let [c, d] = self.coma;
        6_f64.sqrt() * (a * (x * x - y * y) + b * 2.0 * x * y)
            + 8_f64.sqrt() * (3.0 * (x * x + y * y) - 2.0) * (c * x + d * y)
    }

    /// The terms without direction, where the square of the distance from the centre is `r2`.
    #[inline(always)]
    pub(crate) fn round_waves(&self, r2: f64) -> f64 {
        self.defocus * 3_f64.sqrt() * (2.0 * r2 - 1.0)
            + self.spherical * 5_f64.sqrt() * (6.0 * r2 * r2 - 6.0 * r2 + 1.0)
    }

    /// Whether every direction is like every other.
    pub(crate) fn is_round(&self) -> bool {
        self.astigmatism == [0.0; 2] && self.coma == [0.0; 2]
    }
}
