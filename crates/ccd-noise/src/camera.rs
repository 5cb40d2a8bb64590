use rand_core::Rng;

use crate::bloom::spread;
use crate::chain::{Chain, Marker, expose_row, gather_row, mean_row, read_row};
use crate::exposure::{Exposure, SaturatedRun};
use crate::field::{NoiseField, assert_rows, rows};
use crate::{Blooming, CameraParams, Error, PhotonNoise};

/// A camera: converts photo-electrons to grey levels (Eq. 13 without its optics).
///
/// This is the linear model of EMVA 1288. For a pixel with a mean of µ photo-electrons:
///
/// N = min(Poisson(µ·(1 + PRNU·g) + i_d·t), full well)
/// y = ⌊K·(N + DSNU·d + σ_d·n) + offset + ½⌋, clipped to 0 … 2ᵇ - 1
///
/// g and d are standard normal deviates fixed per pixel. n is a standard normal deviate per pixel and frame. i_d·t is
/// the dark current times the exposure time. The temporal variance of y is K²σ_d² + 1/12 + K·(mean of y - mean dark y);
/// here σ_d includes the shot noise of the dark current.
///
/// # Differences from the paper
///
/// The paper leaves out fixed pattern, dark current, saturation and quantisation. The paper's program adds both noises
/// to grey levels, which is equivalent to [`CameraParams::paper`].
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    params: CameraParams,
    chain: Chain,
}

/// Variance of the rounding to integer grey levels.
pub(crate) const ROUNDING: f64 = 1.0 / 12.0;

impl Camera {
    /// Creates a camera from validated parameters.
    ///
    /// # Errors
    ///
    /// If a field is out of range.
    pub fn new(params: &CameraParams) -> Result<Self, Error> {
        params.check()?;
        Ok(Self { params: params.clone(), chain: Chain::new(params) })
    }

    /// Returns the parameters of the camera.
    #[must_use]
    pub fn params(&self) -> &CameraParams {
        &self.params
    }

    /// Returns the number of electrons per grey level, 1 / K.
    #[must_use]
    pub fn electrons_per_dn(&self) -> f64 {
        1.0 / self.params.gain_dn_per_e
    }

    /// Returns the highest grey level, 2ᵇ - 1.
    #[must_use]
    pub fn max_dn(&self) -> u16 {
        self.params.max_dn()
    }

    /// Returns the mean number of photo-electrons for a mean number of photons per pixel: η·µ_p.
    #[must_use]
    pub fn electrons_from_photons(&self, photons: f64) -> f64 {
        self.params.quantum_efficiency * photons
    }

    /// Returns the saturation capacity µ_e.sat of EMVA 1288: the mean number of photo-electrons at which an average
    /// pixel saturates. Dark current is subtracted.
    ///
    /// A pixel saturates at its full-well capacity ([`CameraParams::full_well_e`]) or at the highest grey level,
    /// whichever comes first. The saturation capacity is therefore at most the full-well capacity, and usually lower.
    /// [`Saturation::Reached`](crate::calibrate::Saturation::Reached) is the measured value, at the maximum of the
    /// temporal variance; it is a few per cent lower.
    #[must_use]
    pub fn saturation_capacity_e(&self) -> f64 {
        let converter = (f64::from(self.max_dn()) - self.params.offset_dn) / self.params.gain_dn_per_e;
        converter.min(self.params.full_well_e) - self.params.dark_e()
    }

    /// Returns the expected grey level for a mean number of photo-electrons, including offset and mean dark current.
    /// Ignores saturation.
    #[must_use]
    pub fn expected_dn(&self, electrons: f64) -> f64 {
        self.params.offset_dn + self.params.gain_dn_per_e * (electrons + self.params.dark_e())
    }

    /// Returns the temporal noise σ_y: the standard deviation over time of the grey level of a pixel, for a mean number
    /// of photo-electrons µ. Ignores saturation.
    ///
    /// σ² = K²·(σ_d² + i_d·t + µ) + 1/12. The shot noise i_d·t + µ is left out if [`CameraParams::photon_noise`] is
    /// off.
    #[must_use]
    pub fn temporal_noise_dn(&self, electrons: f64) -> f64 {
        let shot = match self.params.photon_noise {
            PhotonNoise::Off => 0.0,
            PhotonNoise::Exact | PhotonNoise::NormalAbove { .. } => electrons + self.params.dark_e(),
        };
        let (gain, read) = (self.params.gain_dn_per_e, self.params.read_noise.rms_e());
        (gain * gain * (read * read + shot) + ROUNDING).sqrt()
    }

    /// Returns the spatial nonuniformity s_y: the standard deviation over pixels of their temporal mean grey levels,
    /// for a uniform mean number of photo-electrons µ.
    ///
    /// s² = K²·(DSNU² + PRNU²·µ²).
    #[must_use]
    pub fn nonuniformity_dn(&self, electrons: f64) -> f64 {
        let (response, offset) = (self.params.prnu * electrons, self.params.dsnu_e);
        self.params.gain_dn_per_e * (response * response + offset * offset).sqrt()
    }

    /// Returns whether a frame must be exposed as a whole: with blooming, charge crosses rows.
    #[must_use]
    pub fn needs_whole_frame(&self) -> bool {
        self.params.blooming != Blooming::Off
    }

    /// Exposes a frame, and returns the number of saturated pixels: pixels at full-well capacity or at the highest grey
    /// level.
    ///
    /// `electrons` are mean photo-electrons in rows of `width` pixels; negative values and NaN count as 0. The grey
    /// levels are written to `out`. The noise key is one 64-bit word from `rng`.
    ///
    /// # Panics
    ///
    /// If the length of `electrons` is not a multiple of `width`, or differs from the length of `out`.
    pub fn expose_into<R: Rng + ?Sized>(&self, electrons: &[f32], width: usize, out: &mut [u16], rng: &mut R) -> usize {
        self.expose(electrons, width, None, rng.next_u64(), out, None).saturated
    }

    /// Exposes a frame with the noise of `key`, and appends the runs of saturated pixels to `saturated`, in row order.
    ///
    /// Without [blooming](Blooming::On) the grey levels equal those of [`expose_window`](Self::expose_window). Blooming
    /// moves whole electrons.
    ///
    /// # Panics
    ///
    /// If the length of `electrons` is not a multiple of `width`, or differs from the length of `out`.
    pub fn expose_frame(
        &self,
        electrons: &[f32],
        width: usize,
        key: u64,
        out: &mut [u16],
        saturated: &mut Vec<SaturatedRun>,
    ) -> Exposure {
        self.expose(electrons, width, None, key, out, Some(saturated))
    }

    /// Exposes a window of a frame, and returns the number of saturated pixels. `origin` [x, y] is the position of the
    /// window's first pixel in the frame.
    ///
    /// The grey levels equal those of the complete frame with the same `key`. The window ignores
    /// [blooming](Self::needs_whole_frame): excess charge is lost. See [`expose_into`](Self::expose_into) for
    /// `electrons` and `out`.
    ///
    /// # Panics
    ///
    /// If the length of `electrons` is not a multiple of `width`, or differs from the length of `out`.
    pub fn expose_window(&self, electrons: &[f32], width: usize, origin: [u32; 2], key: u64, out: &mut [u16]) -> usize {
        self.expose(electrons, width, Some(origin), key, out, None).saturated
    }

    /// Exposes a window as [`expose_window`](Self::expose_window) does, and appends the runs of saturated pixels to
    /// `saturated`, in row order.
    ///
    /// # Panics
    ///
    /// If the length of `electrons` is not a multiple of `width`, or differs from the length of `out`.
    pub fn expose_window_marking(
        &self,
        electrons: &[f32],
        width: usize,
        origin: [u32; 2],
        key: u64,
        out: &mut [u16],
        saturated: &mut Vec<SaturatedRun>,
    ) -> usize {
        self.expose(electrons, width, Some(origin), key, out, Some(saturated)).saturated
    }

    /// Writes the noise-free grey levels, before rounding, to `out`: offset, mean dark current and light, clipped to 0
    /// … 2ᵇ - 1. The fixed pattern is left out.
    ///
    /// # Panics
    ///
    /// If `out` and `electrons` differ in length.
    pub fn mean_dn_into(&self, electrons: &[f32], out: &mut [f32]) {
        assert_eq!(out.len(), electrons.len(), "`out` and `electrons` must have the same length");
        mean_row(&self.chain, electrons, out);
    }

    /// Exposes a window at `origin`, without blooming, or the complete frame if `origin` is `None`.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`full_well_e` is at most 1e7")]
    fn expose(
        &self,
        electrons: &[f32],
        width: usize,
        origin: Option<[u32; 2]>,
        key: u64,
        out: &mut [u16],
        mut runs: Option<&mut Vec<SaturatedRun>>,
    ) -> Exposure {
        assert_rows(electrons.len(), width);
        assert_eq!(out.len(), electrons.len(), "`out` and `electrons` must have the same length");
        let (field, chain) = (NoiseField::new(key), &self.chain);
        let pattern = |y| chain.pattern.as_ref().map(|pattern| pattern.row(y));
        let (light, mut exposure) = (electrons.chunks_exact(width), Exposure::default());
        if let (Blooming::On { vertical, anti_blooming }, None) = (self.params.blooming, origin) {
            let full_well = chain.full_well as u32;
            let mut charge = vec![0; electrons.len()];
            for (y, (electrons, charge)) in (0..).zip(light.zip(charge.chunks_exact_mut(width))) {
                gather_row(chain, &field.row(y), pattern(y).as_ref(), electrons, charge);
            }
            exposure = spread(&mut charge, width, full_well, vertical, anti_blooming);
            for (y, (charge, out)) in (0..).zip(charge.chunks_exact(width).zip(out.chunks_exact_mut(width))) {
                let marker = &mut Marker { y, runs: runs.as_deref_mut() };
                let pattern = pattern(y);
                exposure.saturated += read_row(chain, &field.row(y), pattern.as_ref(), full_well, charge, out, marker);
            }
        } else {
            let origin = origin.unwrap_or_default();
            for (y, (electrons, out)) in rows(origin).zip(light.zip(out.chunks_exact_mut(width))) {
                let marker = &mut Marker { y, runs: runs.as_deref_mut() };
                let pattern = pattern(y);
                exposure.saturated +=
                    expose_row(chain, &field.row(y), pattern.as_ref(), origin[0], electrons, out, marker);
            }
        }
        exposure
    }
}
