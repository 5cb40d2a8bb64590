//! The section of a recipe about the camera, and cameras that ship.

use ccd_noise::{Blooming, CameraParams, ReadNoise};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::number::Number;

/// How photons are counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PhotonNoise {
    /// Poisson, exact at every mean.
    Exact,
    /// One normal of the summed variance where more than 400 electrons are expected (skewness below 0.05), Poisson below.
    Normal,
    /// No photon noise.
    Off,
}

/// How the sensor's pixels are joined to the picture's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Binning {
    /// Their charges are joined and read once, as in a CCD.
    Charge,
    /// They are read one by one and averaged, as in CMOS.
    Digital,
}

/// How much of the colour JPEG leaves out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Subsampling {
    /// None: 4:4:4.
    Full,
    /// Every second column: 4:2:2.
    Columns,
    /// Every second column and row: 4:2:0.
    Squares,
}

/// The camera (Eq. 13, g_po and g_g): the linear model of EMVA 1288. Numbers are those of one pixel of the sensor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Camera {
    /// Side of a pixel of the sensor, µm, 1 to 100; `field.magnification` makes it the picture's.
    pub pixel_um: Number,
    /// Bits of a grey level, 8 to 16.
    pub bits: Number,
    /// Electrons that a pixel holds, which the largest grey level stands for, 10 to 10000000.
    pub full_well_e: Number,
    /// Standard deviation of the read noise, electrons, 0 to 100000; where pixels differ, its median.
    pub read_noise_e: Number,
    /// Root of the mean square of the read noises of pixels that differ, as in CMOS: from `read_noise_e` to 20 times that. 0 where all pixels are alike.
    pub read_noise_rms_e: Number,
    /// Grey level of a dark pixel, 0 to 4096.
    pub offset_dn: Number,
    /// Glare that was taken off the picture as its black level, as a share of the light of the empty slide, 0 to 0.8: what
    /// is dark keeps the noise of the glare.
    pub glare_removed: Number,
    /// How photons are counted.
    pub photon_noise: PhotonNoise,
    /// Photo response non-uniformity: spread of the pixels' responses as a share of their mean, 0 to 0.5.
    pub prnu: Number,
    /// Dark signal non-uniformity: spread of the pixels' offsets, electrons, 0 to 100000.
    pub dsnu_e: Number,
    /// Which camera of its kind it is, 0 to 2⁵³: its fixed pattern is the same in all images.
    pub serial: u64,
    /// Exposure, seconds, 0 to 1000000: how long dark current is gathered. Light is what `background.level` says.
    pub exposure_s: Number,
    /// Dark current at `dark_reference_c`, electrons per second and pixel, 0 to 1000000.
    pub dark_current_e_per_s: Number,
    /// Temperature for which the dark current is given, °C, -200 to 150.
    pub dark_reference_c: Number,
    /// Temperature of the sensor, °C, -200 to 150.
    pub temperature_c: Number,
    /// Warming that doubles the dark current, K, 0.1 to 100.
    pub dark_doubling_c: Number,
    /// Share of the charge that a full pixel cannot hold and that blooms into its neighbours, 0 to 1; the rest is drained.
    pub blooming: Number,
    /// Share of that which stays within its column, 0 to 1.
    pub blooming_vertical: Number,
    /// Pixels of the sensor along the side of one of the picture, 1 to 8.
    pub binning_px: Number,
    /// How they are joined.
    pub binning: Binning,
    /// Quality of a JPEG through which the picture has gone, 1 to 100, or 0 for none; 8 bits only.
    pub jpeg_quality: Number,
    /// How much of the colour that leaves out.
    pub jpeg_subsampling: Subsampling,
}

impl Default for Camera {
    fn default() -> Self {
        Self {
            pixel_um: 6.45.into(),
            bits: 8.0.into(),
            full_well_e: 32_600.0.into(),
            read_noise_e: 138.0.into(),
            read_noise_rms_e: 0.0.into(),
            offset_dn: 0.0.into(),
            glare_removed: 0.0.into(),
            photon_noise: PhotonNoise::Exact,
            prnu: 0.007.into(),
            dsnu_e: 2.0.into(),
            serial: 1,
            exposure_s: 0.02.into(),
            dark_current_e_per_s: 1.0.into(),
            dark_reference_c: 25.0.into(),
            temperature_c: 25.0.into(),
            dark_doubling_c: 8.0.into(),
            blooming: 0.0.into(),
            blooming_vertical: 0.95.into(),
            binning_px: 1.0.into(),
            binning: Binning::Charge,
            jpeg_quality: 0.0.into(),
            jpeg_subsampling: Subsampling::Squares,
        }
    }
}

/// A named camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CameraPreset {
    /// The paper's simulator: 8 bits, 70 electrons a grey level, read noise of one grey level.
    Paper,
    /// The paper's camera, a cooled interline CCD of 12 bits.
    Orca05g,
    /// A scientific CMOS camera of 16 bits.
    Scmos,
}

impl CameraPreset {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Paper, Self::Orca05g, Self::Scmos];

    /// Its name, as the command line knows it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Orca05g => "orca-05g",
            Self::Scmos => "scmos",
        }
    }

    /// What it is, in a line.
    #[must_use]
    pub fn summary(self) -> &'static str {
        match self {
            Self::Paper => "the paper's simulator: 8 bits, 70 electrons a grey level",
            Self::Orca05g => "the paper's camera: a cooled CCD of 12 bits",
            Self::Scmos => "a scientific CMOS camera of 16 bits",
        }
    }

    /// The preset of a name.
    #[must_use]
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|preset| preset.name() == name)
    }

    /// The camera; where its numbers come from, `ccd_noise::CameraParams` says.
    #[must_use]
    pub fn camera(self) -> Camera {
        let params = match self {
            Self::Paper => CameraParams::paper(),
            Self::Orca05g => CameraParams::orca_05g(),
            Self::Scmos => CameraParams::scmos(),
        };
        let pixel_um = match self {
            Self::Paper | Self::Orca05g => 6.45.into(),
            Self::Scmos => 6.5.into(),
        };
        Camera { pixel_um, ..Camera::of(&params) }
    }
}

impl Camera {
    /// The section that stands for a camera.
    #[must_use]
    pub fn of(params: &CameraParams) -> Self {
        let largest = libm::exp2(f64::from(params.bit_depth)) - 1.0;
        let (read_noise_e, read_noise_rms_e) = match params.read_noise {
            ReadNoise::Same { e } => (e, 0.0),
            ReadNoise::PerPixel { median_e, rms_e } => (median_e, rms_e),
        };
        let (blooming, blooming_vertical) = match params.blooming {
            Blooming::Off => (0.0, 0.95),
            Blooming::On { vertical, anti_blooming } => (1.0 - anti_blooming, vertical),
        };
        // To six digits: what a camera is known to, and what a recipe is read with.
        let number = |value: f64| {
            let scale = libm::pow(10.0, 6.0 - libm::ceil(libm::log10(value.abs().max(1e-300))));
            Number::Fixed(if value == 0.0 { 0.0 } else { libm::round(value * scale) / scale })
        };
        Self {
            bits: f64::from(params.bit_depth).into(),
            full_well_e: number((largest - params.offset_dn) / params.gain_dn_per_e),
            read_noise_e: number(read_noise_e),
            read_noise_rms_e: number(read_noise_rms_e),
            offset_dn: number(params.offset_dn),
            glare_removed: 0.0.into(),
            photon_noise: match params.photon_noise {
                ccd_noise::PhotonNoise::Exact => PhotonNoise::Exact,
                ccd_noise::PhotonNoise::NormalAbove { .. } => PhotonNoise::Normal,
                ccd_noise::PhotonNoise::Off => PhotonNoise::Off,
            },
            prnu: number(params.prnu),
            dsnu_e: number(params.dsnu_e),
            serial: params.serial,
            exposure_s: number(params.exposure_s),
            dark_current_e_per_s: number(params.dark_current_e_per_s),
            dark_reference_c: number(params.dark_reference_c),
            temperature_c: number(params.temperature_c),
            dark_doubling_c: number(params.dark_doubling_c),
            blooming: number(blooming),
            blooming_vertical: number(blooming_vertical),
            ..Self::default()
        }
    }
}
