use rand_core::Rng;

use crate::bloom::spread;
use crate::chain::{Chain, Marker, expose_row, gather_row, mean_row, read_row};
use crate::exposure::{Exposure, SaturatedRun};
use crate::field::{NoiseField, rows, whole_rows};
use crate::{Blooming, CameraParams, Error, PhotonNoise};

/// A camera: photo-electrons in, grey levels out (Eq. 13 without its optics).
///
/// The linear model of EMVA 1288. Per pixel, with µ its mean number of photo-electrons:
///
/// N = min(Poisson(µ·(1 + PRNU·g) + i_d·t), full well)
/// y = ⌊K·(N + DSNU·d + σ_d·n) + offset + ½⌋, clipped to 0 … 2ᵇ - 1
///
/// where g and d are standard normal deviates that belong to the pixel, n one that belongs to pixel and frame, and i_d·t
/// the dark current in the time of exposure. The variance of y in time is K²σ_d² + 1/12 + K·(mean of y - mean of y in the
/// dark), with the dark current's shot noise in σ_d.
///
/// # Differences from the paper
///
/// Fixed pattern, dark current, saturation and rounding stand here, which the paper leaves out; the paper's
/// program adds both noises to grey levels, which is the same with [`CameraParams::paper`].
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    params: CameraParams,
    chain: Chain,
}

/// Variance of rounding to whole grey levels.
pub(crate) const ROUNDING: f64 = 1.0 / 12.0;

impl Camera {
    /// Checks the parameters.
    ///
    /// # Errors
    ///
    /// If a field lies outside its range.
    pub fn new(params: &CameraParams) -> Result<Self, Error> {
        params.check()?;
        Ok(Self { params: params.clone(), chain: Chain::new(params) })
    }

    /// The parameters it was made from.
    #[must_use]
    pub fn params(&self) -> &CameraParams {
        &self.params
    }

    /// Electrons that make one grey level, 1 / K.
    #[must_use]
    pub fn electrons_per_dn(&self) -> f64 {
        1.0 / self.params.gain_dn_per_e
    }

    /// The highest grey level, 2ᵇ - 1.
    #[must_use]
    pub fn max_dn(&self) -> u16 {
        self.params.max_dn()
    }

    /// Mean photo-electrons of this many photons on a pixel: η·µ_p.
    #[must_use]
    pub fn electrons_from_photons(&self, photons: f64) -> f64 {
        self.params.quantum_efficiency * photons
    }

    /// Mean photo-electrons at which an average pixel saturates: it is full, or the converter at its highest level.
    #[must_use]
    pub fn saturation_e(&self) -> f64 {
        let converter = (f64::from(self.max_dn()) - self.params.offset_dn) / self.params.gain_dn_per_e;
        converter.min(self.params.full_well_e) - self.params.dark_e()
    }

    /// The grey level expected from this many photo-electrons, offset and mean dark current included, as if there were
    /// no saturation.
    #[must_use]
    pub fn expected_dn(&self, electrons: f64) -> f64 {
        self.params.offset_dn + self.params.gain_dn_per_e * (electrons + self.params.dark_e())
    }

    /// Standard deviation in time of the grey level of a pixel that expects this many photo-electrons, as if there were
    /// no saturation: σ² = K²·(σ_d² + i_d·t + µ) + 1/12, where the light µ and the dark current have shot noise only if
    /// [`CameraParams::photon_noise`] is on.
    #[must_use]
    pub fn noise_dn(&self, electrons: f64) -> f64 {
        let shot = match self.params.photon_noise {
            PhotonNoise::Off => 0.0,
            PhotonNoise::Exact | PhotonNoise::NormalAbove { .. } => electrons + self.params.dark_e(),
        };
        let (gain, read) = (self.params.gain_dn_per_e, self.params.read_noise.rms_e());
        (gain * gain * (read * read + shot) + ROUNDING).sqrt()
    }

    /// Standard deviation over the pixels of their mean grey levels, where all expect this many photo-electrons:
    /// s² = K²·(DSNU² + PRNU²·µ²).
    #[must_use]
    pub fn pattern_dn(&self, electrons: f64) -> f64 {
        let (response, offset) = (self.params.prnu * electrons, self.params.dsnu_e);
        self.params.gain_dn_per_e * (response * response + offset * offset).sqrt()
    }

    /// Whether a frame must be exposed as a whole, as charge crosses its rows: blooming is on.
    #[must_use]
    pub fn needs_whole_frame(&self) -> bool {
        self.params.blooming != Blooming::Off
    }

    /// Exposes a frame: `electrons` are mean photo-electrons, >= 0 (anything else counts as
    /// 0), in rows of `width` pixels; `out` becomes the grey levels. The noise takes one 64-bit key from `rng`. Returns
    /// the number of saturated pixels, whether the pixel was full or the converter at its highest level.
    ///
    /// # Panics
    ///
    /// If `electrons` is not whole rows of `width`, or `out` not as long as it.
    pub fn expose_into<R: Rng + ?Sized>(&self, electrons: &[f32], width: usize, out: &mut [u16], rng: &mut R) -> usize {
        self.expose(electrons, width, None, rng.next_u64(), out, None).saturated
    }

    /// Exposes a frame under a `key`, and adds to `saturated` which of its pixels were, row by row.
    ///
    /// It is the window of the whole frame, but with [blooming](Blooming::On) of whole electrons.
    ///
    /// # Panics
    ///
    /// If `electrons` is not whole rows of `width`, or `out` not as long as it.
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

    /// Exposes a window of a frame whose first pixel lies at `origin` [x, y] of it: the same grey
    /// levels as the whole frame has there, under the same `key`. Otherwise as
    /// [`expose_into`](Self::expose_into), but that [blooming](Self::needs_whole_frame) is left out: what a pixel cannot
    /// hold is lost.
    ///
    /// # Panics
    ///
    /// If `electrons` is not whole rows of `width`, or `out` not as long as it.
    pub fn expose_window(&self, electrons: &[f32], width: usize, origin: [u32; 2], key: u64, out: &mut [u16]) -> usize {
        self.expose(electrons, width, Some(origin), key, out, None).saturated
    }

    /// As [`expose_window`](Self::expose_window), and adds to `saturated` which pixels of the frame were, row by row.
    ///
    /// # Panics
    ///
    /// If `electrons` is not whole rows of `width`, or `out` not as long as it.
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

    /// The grey levels without noise and before rounding, within 0 … 2ᵇ - 1: the offset, the mean dark current and the
    /// light. There is no fixed pattern in them either: it is noise to whoever wants to know the light.
    ///
    /// # Panics
    ///
    /// If `out` is not as long as `electrons`.
    pub fn mean_dn_into(&self, electrons: &[f32], out: &mut [f32]) {
        assert_eq!(out.len(), electrons.len(), "out has the wrong number of pixels");
        mean_row(&self.chain, electrons, out);
    }

    /// A window, in which no charge crosses rows, or without `origin` the whole frame.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a full well is at most 1e7")]
    fn expose(
        &self,
        electrons: &[f32],
        width: usize,
        origin: Option<[u32; 2]>,
        key: u64,
        out: &mut [u16],
        mut runs: Option<&mut Vec<SaturatedRun>>,
    ) -> Exposure {
        whole_rows(electrons.len(), width);
        assert_eq!(out.len(), electrons.len(), "out has the wrong number of pixels");
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
