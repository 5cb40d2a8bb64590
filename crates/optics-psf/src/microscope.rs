use crate::error::{Error, require, within};
use crate::lens::Rules;
use crate::pupil::Pupil;
use crate::transfer::Transfer;

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

/// A bright-field microscope whose parameters are in order.
#[derive(Debug, Clone, PartialEq)]
pub struct Microscope {
    params: MicroscopeParams,
}

impl Microscope {
    /// Checks the parameters.
    ///
    /// # Errors
    ///
    /// If a number is not finite or outside the range its field states.
    pub fn new(params: &MicroscopeParams) -> Result<Self, Error> {
        let p = params;
        within("mount_index", p.mount_index, 1.0..=3.0, "a number from 1 to 3")?;
        within("immersion_index", p.immersion_index, 1.0..=3.0, "a number from 1 to 3")?;
        let below = p.na > 0.0 && p.na <= p.immersion_index && p.na < p.mount_index;
        require("na", p.na, below, "above 0, at most immersion_index and below mount_index")?;
        let below = p.condenser_na > 0.0 && p.condenser_na < p.mount_index;
        require("condenser_na", p.condenser_na, below, "above 0 and below mount_index")?;
        within("wavelength_um", p.wavelength_um, 0.1..=10.0, "a number from 0.1 to 10")?;
        let half = 0.5 * p.wavelength_um;
        within("bandwidth_um", p.bandwidth_um, 0.0..=half, "a number from 0 to half of wavelength_um")?;
        within("cover_error_um", p.cover_error_um, -100.0..=100.0, "a number from -100 to 100")?;
        let Zernike { defocus, astigmatism, coma, spherical } = p.zernike;
        for (field, value) in [
            ("zernike.defocus", defocus),
            ("zernike.astigmatism[0]", astigmatism[0]),
            ("zernike.astigmatism[1]", astigmatism[1]),
            ("zernike.coma[0]", coma[0]),
            ("zernike.coma[1]", coma[1]),
            ("zernike.spherical", spherical),
        ] {
            within(field, value, -5.0..=5.0, "a number from -5 to 5")?;
        }
        within("pixel_um", p.pixel_um, 0.001..=100.0, "a number from 0.001 to 100")?;
        within("oversampling", p.oversampling as f64, 1.0..=16.0, "a whole number from 1 to 16")?;
        let glare = (0.0..1.0).contains(&p.stray_light);
        require("stray_light", p.stray_light, glare, "0 or more and below 1")?;
        Ok(Self { params: params.clone() })
    }

    /// What it was made from.
    #[must_use]
    pub fn params(&self) -> &MicroscopeParams {
        &self.params
    }

    /// The distance between two samples of the rendered object, µm.
    #[must_use]
    pub fn pitch_um(&self) -> f64 {
        self.params.pixel_um / self.params.oversampling as f64
    }

    /// The finest detail that reaches the image to first order, cycles per µm: (NA + NAc)/λ at the
    /// blue end of the band.
    #[must_use]
    pub fn cutoff(&self) -> f64 {
        let shortest = self.params.wavelength_um - 0.5 * self.params.bandwidth_um;
        Pupil::new(&self.params, shortest, 0.0, 0.0).cutoff()
    }

    /// How the microscope transfers detail: see [`Transfer`].
    ///
    /// `depth_um` is the depth of the detail about the focal plane of the stage at rest, in the mountant, positive
    /// towards the objective; `stage_um` how far the stage was then lowered from the objective, in the immersion medium.
    /// Both blur, and they are not the same: to focus on what lies d nearer to the objective, the stage is lowered by
    /// about d / `mount_index` if the lens is dry.
    ///
    /// # Errors
    ///
    /// If a number is not finite or beyond ±1000 µm.
    pub fn transfer(&self, depth_um: f64, stage_um: f64) -> Result<Transfer, Error> {
        Ok(Transfer::new(self, distance("depth_um", depth_um)?, distance("stage_um", stage_um)?))
    }

    /// The error of the wavefront at a point of the pupil, in waves, for the middle of the band.
    /// The point is a direction: its numerical apertures along x and y, together at most `na`.
    ///
    /// W = −depth·γ_n + stage·γ_1 + Gibson and Lanni's cover glass + Zernike, with
    /// γ_n(f) = √((n/λ)² − f²), each zero in the centre; `depth_um` and `stage_um` as for
    /// [`Microscope::transfer`].
    #[must_use]
    pub fn waves(&self, direction: [f64; 2], depth_um: f64, stage_um: f64) -> f64 {
        let wavelength = self.params.wavelength_um;
        Pupil::new(&self.params, wavelength, depth_um, stage_um).waves(direction.map(|d| d / wavelength))
    }

    /// The radius of the geometric blur of a point at that depth, µm: where the rim of the
    /// condenser's cone meets the plane in focus.
    #[must_use]
    pub fn cone_radius_um(&self, depth_um: f64, stage_um: f64) -> f64 {
        Pupil::new(&self.params, self.params.wavelength_um, depth_um, stage_um).cone_radius()
    }

    /// The same with all aberrations, wherever on the condenser's disc it is widest.
    pub(crate) fn spread_um(&self, depth_um: f64, stage_um: f64) -> f64 {
        let pupil = Pupil::new(&self.params, self.params.wavelength_um, depth_um, stage_um);
        pupil.steepest(pupil.condenser).max(pupil.cone_radius())
    }

    /// How far something at that depth is from focus, µm of mountant; positive below the plane in focus.
    pub(crate) fn defocus_um(&self, depth_um: f64, stage_um: f64) -> f64 {
        stage_um * self.params.mount_index / self.params.immersion_index - depth_um
    }

    /// Wavelengths of the band, µm, and their weights, which sum to 1.
    pub(crate) fn bands(&self) -> Vec<(f64, f64)> {
        let (middle, width) = (self.params.wavelength_um, self.params.bandwidth_um);
        if width == 0.0 {
            return vec![(middle, 1.0)];
        }
        let shift = 0.5 * width / middle * (self.params.na / self.params.condenser_na).max(1.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small, and cut by the rule")]
        let nodes = 2 * (BAND_NODES[0] + BAND_NODES[1] * shift).ceil() as usize;
        let mut rules = Rules::default();
        let rule = rules.get(nodes).iter();
        rule.map(|&[x, weight]| (middle + width * (x - 0.5), weight)).collect()
    }
}

/// Pairs of wavelengths: so many, and so many more for each width of the condenser's disc by which the band shifts the
/// objective's rim. Transfer functions are then within 0.002 up to 10 µm from focus.
const BAND_NODES: [f64; 2] = [0.7, 4.0];

/// A distance from the focal plane, µm: farther away nothing of an object is left.
pub(crate) fn distance(field: &'static str, value: f64) -> Result<f64, Error> {
    within(field, value, -1000.0..=1000.0, "a number from -1000 to 1000")
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
