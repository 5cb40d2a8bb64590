use crate::error::{Error, require};

/// How the number of photo-electrons in a pixel is drawn: g_po of Eq. 13.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum PhotonNoise {
    /// A Poisson deviate, exact at every mean.
    #[default]
    Exact,
    /// One normal deviate for shot and read noise together where the mean is `mean_e` electrons or
    /// more, exact below. Mean and variance are right; the skewness, 1/√µ, is missing: 0.007 at
    /// 17 850 electrons, 0.07 at 200.
    NormalAbove {
        /// The least mean at which the normal deviate is used, in electrons, >= 0.
        mean_e: f64,
    },
    /// None: the mean itself. Read noise remains.
    Off,
}

/// A camera that turns photo-electrons into grey levels.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraParams {
    /// Electrons that a pixel can hold, above 0, at most 1e7. Default 18 000, ours: an interline
    /// CCD with pixels of 6.45 µm. The paper's program has 255 · 70 = 17 850.
    pub full_well_e: f64,
    /// Overall system gain K in grey levels per electron (EMVA 1288), above 0. Default
    /// 255 / 17 600, ours: the converter clips just before the pixel is full. The paper's program
    /// has 1 / 70.
    pub gain_dn_per_e: f64,
    /// Grey level of a dark pixel, 0 to the highest grey level. Default 0, the paper's.
    pub offset_dn: f64,
    /// Standard deviation of the read noise in electrons, >= 0: g_g of Eq. 13. Default 8, ours: the
    /// data sheet of such a camera. The paper's program has one grey level, 70 electrons.
    pub read_noise_e: f64,
    /// Bits of the converter, 8 to 16. Default 8, the paper's.
    pub bit_depth: u32,
    /// How photo-electrons are drawn. Default exact, the paper's.
    pub photon_noise: PhotonNoise,
}

impl Default for CameraParams {
    fn default() -> Self {
        Self {
            full_well_e: 18_000.0,
            gain_dn_per_e: 255.0 / 17_600.0,
            offset_dn: 0.0,
            read_noise_e: 8.0,
            bit_depth: 8,
            photon_noise: PhotonNoise::Exact,
        }
    }
}

impl CameraParams {
    /// The camera of the authors' program: 8 bits, 70 electrons a grey level, read noise of one
    /// grey level.
    #[must_use]
    pub fn paper() -> Self {
        Self {
            full_well_e: 255.0 * 70.0,
            gain_dn_per_e: 1.0 / 70.0,
            offset_dn: 0.0,
            read_noise_e: 70.0,
            bit_depth: 8,
            photon_noise: PhotonNoise::Exact,
        }
    }

    /// The camera the paper used, a Hamamatsu ORCA-05G, with all its 12 bits. Gain and read noise
    /// are those of its chip family; the offset is ours.
    #[must_use]
    pub fn orca_05g() -> Self {
        Self { gain_dn_per_e: (4095.0 - 100.0) / 17_600.0, offset_dn: 100.0, bit_depth: 12, ..Self::default() }
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        let well = self.full_well_e;
        require("full_well_e", well, well > 0.0 && well <= 1e7, "above 0 and at most 1e7")?;
        let gain = self.gain_dn_per_e;
        require("gain_dn_per_e", gain, gain > 0.0 && gain <= 1e6, "above 0 and at most 1e6")?;
        let bits = self.bit_depth;
        require("bit_depth", f64::from(bits), (8..=16).contains(&bits), "from 8 to 16")?;
        let offset = self.offset_dn;
        let code = offset >= 0.0 && offset <= f64::from(self.max_dn());
        require("offset_dn", offset, code, "from 0 to the highest grey level")?;
        let read = self.read_noise_e;
        require("read_noise_e", read, (0.0..=1e6).contains(&read), "from 0 to 1e6")?;
        if let PhotonNoise::NormalAbove { mean_e } = self.photon_noise {
            require("photon_noise.mean_e", mean_e, mean_e >= 0.0, "0 or more")?;
        }
        Ok(())
    }

    /// The highest grey level, 2ᵇ - 1; the bit depth has been checked.
    #[expect(clippy::cast_possible_truncation, reason = "at most 16 bits")]
    pub(crate) fn max_dn(&self) -> u16 {
        ((1_u32 << self.bit_depth) - 1) as u16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_camera_is_the_papers() {
        let paper = CameraParams::paper();
        assert_eq!((paper.bit_depth, paper.offset_dn), (8, 0.0));
        assert!((paper.gain_dn_per_e * 70.0 - 1.0).abs() < 1e-15);
        assert!((paper.gain_dn_per_e * paper.read_noise_e - 1.0).abs() < 1e-15);
        assert_eq!(paper.full_well_e, 17_850.0);
        assert_eq!(paper.photon_noise, PhotonNoise::Exact);
    }

    #[test]
    fn presets_are_limited_by_the_converter() {
        for params in [CameraParams::default(), CameraParams::orca_05g()] {
            params.check().unwrap();
            let full = params.offset_dn + params.gain_dn_per_e * params.full_well_e;
            assert!(full > f64::from(params.max_dn()) + 0.5, "{full}");
        }
    }

    #[test]
    fn impossible_numbers_are_refused_by_name() {
        let good = CameraParams::default();
        let mut bad = Vec::new();
        for value in [f64::NAN, f64::INFINITY, -1.0, 1e300] {
            bad.push(("full_well_e", CameraParams { full_well_e: value, ..good.clone() }));
            bad.push(("gain_dn_per_e", CameraParams { gain_dn_per_e: value, ..good.clone() }));
            bad.push(("offset_dn", CameraParams { offset_dn: value, ..good.clone() }));
            bad.push(("read_noise_e", CameraParams { read_noise_e: value, ..good.clone() }));
        }
        for bit_depth in [0, 7, 17, u32::MAX] {
            bad.push(("bit_depth", CameraParams { bit_depth, ..good.clone() }));
        }
        for mean_e in [f64::NAN, -1.0] {
            let photon_noise = PhotonNoise::NormalAbove { mean_e };
            bad.push(("photon_noise.mean_e", CameraParams { photon_noise, ..good.clone() }));
        }
        bad.push(("full_well_e", CameraParams { full_well_e: 0.0, ..good.clone() }));
        bad.push(("gain_dn_per_e", CameraParams { gain_dn_per_e: 0.0, ..good.clone() }));
        for (field, params) in bad {
            let error = params.check().unwrap_err().to_string();
            assert!(error.starts_with(&format!("{field} is ")), "{error}");
        }
    }
}
