//! The section of a recipe about the camera, and cameras that ship.

use super::number::{Count, Number};
use super::section::section;
use crate::words::words;
use ccd_noise::{Blooming, CameraParams, ReadNoise};

section! {
    /// How photons are counted.
    pub enum PhotonNoise {
        /// Poisson, exact at every mean.
        Exact,
        /// One normal of the summed variance where more than 400 electrons are expected (skewness below 0.05), Poisson below.
        Normal,
        /// No photon noise.
        Off,
    }
}

section! {
    /// How the sensor's pixels are joined to the picture's.
    pub enum Binning {
        /// Their charges are joined and read once, as in a CCD.
        Charge,
        /// They are read one by one and averaged, as in CMOS.
        Digital,
    }
}

section! {
    /// How much of the colour JPEG leaves out.
    pub enum Subsampling {
        /// All colour is kept.
        #[serde(rename = "4:4:4")]
        S444,
        /// Every second column of colour is kept.
        #[serde(rename = "4:2:2")]
        S422,
        /// Every second column and row of colour is kept.
        #[serde(rename = "4:2:0")]
        S420,
    }
}

section! {
    /// The camera (Eq. 13, g_po and g_g): the linear model of EMVA 1288. Numbers are those of one pixel of the sensor.
    pub struct Camera, drawn as pub SceneCamera {
        /// Side of a pixel of the sensor; `field.magnification` makes it the picture's.
        pixel_um: Number (undrawn) = 6.45, 1..=100, "µm";
        /// Bits of a grey level.
        bits: Count = 8, 8..=16;
        /// Electrons that a pixel holds, which the largest grey level stands for.
        full_well_e: Number = 32_600.0, 10..=10000000;
        /// Standard deviation of the read noise; where pixels differ, its median.
        read_noise_e: Number = 138.0, 0..=100000, "electrons";
        /// Root of the mean square of the read noises of pixels that differ, as in CMOS: from `read_noise_e` to 20 times
        /// that. 0 where all pixels are alike.
        read_noise_rms_e: Number = 0.0, 0..=100000, "electrons";
        /// Grey level of a dark pixel.
        offset_dn: Number = 0.0, 0..=4096;
        /// Glare that was taken off the picture as its black level, as a share of the light of the empty slide: what is
        /// dark keeps the noise of the glare.
        glare_subtracted: Number = 0.0, 0..=0.8;
        /// How photons are counted.
        photon_noise: PhotonNoise = PhotonNoise::Exact;
        /// Photo response non-uniformity: spread of the pixels' responses as a share of their mean.
        prnu: Number = 0.007, 0..=0.5;
        /// Dark signal non-uniformity: spread of the pixels' offsets.
        dsnu_e: Number = 2.0, 0..=100000, "electrons";
        /// Which camera of its kind it is: its fixed pattern is the same in all images.
        serial: u64 = 1, 0..=9007199254740992.0;
        /// Exposure: how long dark current is gathered. Light is what `background.level` says.
        exposure_s: Number = 0.02, 0..=1000000, "seconds";
        /// Dark current at `dark_reference_c`.
        dark_current_e_per_s: Number = 1.0, 0..=1000000, "electrons per second and pixel";
        /// Temperature for which the dark current is given.
        dark_reference_c: Number = 25.0, -200..=150, "°C";
        /// Temperature of the sensor.
        temperature_c: Number = 25.0, -200..=150, "°C";
        /// Warming that doubles the dark current.
        dark_doubling_c: Number = 8.0, 0.1..=100, "K";
        /// Share of the charge that a full pixel cannot hold and that blooms into its neighbours; the rest is drained.
        blooming: Number = 0.0, 0..=1;
        /// Share of that which stays within its column.
        blooming_vertical: Number = 0.95, 0..=1;
        /// Pixels of the sensor along the side of one of the picture.
        binning_px: Count = 1, 1..=8;
        /// How they are joined.
        binning: Binning = Binning::Charge;
        /// Quality of a JPEG through which the picture has gone, or 0 for none; 8 bits only.
        jpeg_quality: Count = 0, 0..=100;
        /// How much of the colour that leaves out.
        jpeg_subsampling: Subsampling = Subsampling::S420;
    }
}

words! {
    /// A named camera.
    pub enum CameraPreset {
        /// The paper's simulator: 8 bits, 70 electrons a grey level, read noise of one grey level.
        Paper = "paper",
        /// The paper's camera, a cooled interline CCD of 12 bits.
        Orca05g = "orca-05g",
        /// A scientific CMOS camera of 16 bits.
        Scmos = "scmos",
    }
}

impl CameraPreset {
    /// What it is, in a line.
    #[must_use]
    pub fn summary(self) -> &'static str {
        match self {
            Self::Paper => "the paper's simulator: 8 bits, 70 electrons a grey level",
            Self::Orca05g => "the paper's camera: a cooled CCD of 12 bits",
            Self::Scmos => "a scientific CMOS camera of 16 bits",
        }
    }

    /// The camera; where its numbers come from, `ccd_noise::CameraParams` says.
    #[must_use]
    pub fn camera(self) -> Camera {
        let (pixel_um, params) = match self {
            Self::Paper => (6.45, CameraParams::paper()),
            Self::Orca05g => (6.45, CameraParams::orca_05g()),
            Self::Scmos => (6.5, CameraParams::scmos()),
        };
        Camera { pixel_um: pixel_um.into(), ..Camera::of(&params) }
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
            glare_subtracted: 0.0.into(),
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
