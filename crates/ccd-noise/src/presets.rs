//! Cameras to start from, each number with its source or marked as assumed.

use crate::{CameraParams, ReadNoise};

impl CameraParams {
    /// The camera of the authors' program: 8 bits, 70 electrons a grey level, read noise of one
    /// grey level, no fixed pattern and no dark current.
    ///
    /// A pixel holds 255 · 70 electrons. The program counts electrons, so that each photon is one.
    #[must_use]
    pub fn paper() -> Self {
        Self {
            quantum_efficiency: 1.0,
            full_well_e: 255.0 * 70.0,
            gain_dn_per_e: 1.0 / 70.0,
            read_noise: ReadNoise::Same { e: 70.0 },
            ..Self::default()
        }
    }

    /// The camera the paper used, a Hamamatsu ORCA-05G: an interline CCD of 1344 x 1024 pixels of 6.45 µm, with all
    /// its 12 bits.
    ///
    /// | number | source |
    /// |---|---|
    /// | well 18 000 e | the ORCA-AG, a camera with a chip of the same family; the paper's program has 17 850 |
    /// | read noise 8 e | the same camera: 7.0 e measured, 8 to 10 e in its data sheet |
    /// | gain 3995 / 17 600 | ours: the converter clips at 98 % of the well |
    /// | offset 100 | assumed |
    /// | quantum efficiency 0.65 at 570 nm | assumed |
    /// | dark current 1 e/s at 25 °C, doubling in 8 K | assumed |
    /// | PRNU 0.7 %, DSNU 2 e | assumed |
    #[must_use]
    pub fn orca_05g() -> Self {
        Self {
            quantum_efficiency: 0.65,
            dark_current_e_per_s: 1.0,
            prnu: 0.007,
            dsnu_e: 2.0,
            gain_dn_per_e: (4095.0 - 100.0) / 17_600.0,
            offset_dn: 100.0,
            bit_depth: 12,
            ..Self::default()
        }
    }

    /// A scientific CMOS camera of the class of the Hamamatsu ORCA-Flash4.0: 2048 x 2048 pixels of 6.5 µm, 16 bits, an
    /// amplifier of its own in each pixel.
    ///
    /// | number | source |
    /// |---|---|
    /// | well 30 000 e | assumed, as data sheets of this class have it |
    /// | read noise 1.0 e median, 1.6 e root mean square | the same; log-normal over the pixels: ours |
    /// | gain 65 435 / 29 340 | ours: the converter clips at 98 % of the well |
    /// | offset 100 | assumed |
    /// | quantum efficiency 0.82 | assumed, as data sheets of this class have it |
    /// | dark current 0.06 e/s, cooled to -10 °C, doubling in 8 K | the same |
    /// | PRNU 0.3 %, DSNU 0.3 e | the same |
    #[must_use]
    pub fn scmos() -> Self {
        Self {
            quantum_efficiency: 0.82,
            dark_current_e_per_s: 0.06,
            dark_reference_c: -10.0,
            temperature_c: -10.0,
            prnu: 0.003,
            dsnu_e: 0.3,
            full_well_e: 30_000.0,
            read_noise: ReadNoise::PerPixel { median_e: 1.0, rms_e: 1.6 },
            gain_dn_per_e: (65_535.0 - 100.0) / 29_340.0,
            offset_dn: 100.0,
            bit_depth: 16,
            ..Self::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Blooming, Camera, PhotonNoise};

    #[test]
    fn the_papers_camera_is_the_papers() {
        let paper = CameraParams::paper();
        assert_eq!((paper.bit_depth, paper.offset_dn), (8, 0.0));
        assert!((paper.gain_dn_per_e * 70.0 - 1.0).abs() < 1e-15);
        assert!((paper.gain_dn_per_e * paper.read_noise.rms_e() - 1.0).abs() < 1e-15);
        assert_eq!((paper.full_well_e, paper.blooming), (17_850.0, Blooming::Off));
        assert_eq!((paper.dark_e(), paper.prnu, paper.dsnu_e), (0.0, 0.0, 0.0));
        assert_eq!(paper.photon_noise, PhotonNoise::Exact);
    }

    #[test]
    fn presets_are_limited_by_the_converter() {
        for params in [CameraParams::default(), CameraParams::paper(), CameraParams::orca_05g(), CameraParams::scmos()]
        {
            assert!(params.is_limited_by_converter(), "{params:?}");
            let camera = Camera::new(&params).unwrap();
            let saturation = camera.saturation_e();
            assert!((0.97..=1.0).contains(&(saturation / params.full_well_e)), "{saturation}");
        }
    }
}
