//! The camera section of a recipe, and the built-in cameras.

use super::number::{Count, Number};
use super::section::section;
use crate::words::words;
use ccd_noise::{Blooming, CameraParams, ReadNoise};

section! {
    /// Model of photon noise.
    pub enum PhotonNoise {
        /// Poisson distribution, exact at every mean.
        Exact,
        /// Normal distribution above a mean of 400 electrons (skewness below 0.05), Poisson distribution below.
        Normal,
        /// No photon noise.
        Off,
    }
}

section! {
    /// Binning mode.
    pub enum Binning {
        /// Charges are summed and read once, as in a CCD.
        Charge,
        /// Pixels are read separately and averaged, as in CMOS.
        Digital,
    }
}

section! {
    /// Chroma subsampling of a JPEG.
    pub enum Subsampling {
        /// Full colour resolution.
        #[serde(rename = "4:4:4")]
        S444,
        /// Half the columns of colour.
        #[serde(rename = "4:2:2")]
        S422,
        /// Half the columns and half the rows of colour.
        #[serde(rename = "4:2:0")]
        S420,
    }
}

section! {
    /// Camera (Eq. 13, g_po and g_g): the linear model of EMVA 1288. Values apply to one pixel of the sensor.
    pub struct CameraSection, drawn as pub SceneCamera {
        /// Pixel size of the sensor. Used if `field.magnification` is given.
        pixel_um: Number (undrawn) = 6.45, 1..=100, "µm";
        /// Bit depth of grey levels.
        bits: Count = 8, 8..=16;
        /// Signal, above the offset, at the largest grey level. Sets the gain. The full-well capacity is slightly
        /// larger.
        full_well_e: Number = 32_600.0, 10..=10000000;
        /// Standard deviation of the read noise. If pixels differ, its median over pixels.
        read_noise_e: Number = 138.0, 0..=100000, "electrons";
        /// Root mean square over pixels of the read noise, for pixels that differ, as in CMOS: 0 (all pixels equal), or
        /// 1 to 20 times `read_noise_e`.
        read_noise_rms_e: Number = 0.0, 0..=100000, "electrons";
        /// Grey level of a dark pixel.
        offset_dn: Number = 0.0, 0..=4096;
        /// Fraction of the light of the empty slide that is glare and was subtracted from the image as its black level.
        /// The noise of the glare remains.
        glare_subtracted: Number = 0.0, 0..=0.8;
        /// Model of photon noise.
        photon_noise: PhotonNoise = PhotonNoise::Exact;
        /// Photo response non-uniformity: standard deviation of the pixels' responses, relative to their mean.
        prnu: Number = 0.007, 0..=0.5;
        /// Dark signal non-uniformity: standard deviation of the pixels' offsets.
        dsnu_e: Number = 2.0, 0..=100000, "electrons";
        /// Number of specks of dust on or in front of the sensor per million pixels of the image. All images of the
        /// same size have the same specks.
        sensor_dust: Number = 0.0, 0..=10000;
        /// Serial number of the camera, the seed of its fixed-pattern noise and of the dust on its sensor. All images
        /// have the same pattern.
        serial: u64 = 1, 0..=9007199254740992.0;
        /// Exposure time, over which dark current accumulates. The light is given by `background.level`.
        exposure_s: Number = 0.02, 0..=1000000, "seconds";
        /// Dark current at the temperature `dark_reference_c`.
        dark_current_e_per_s: Number = 1.0, 0..=1000000, "electrons per second and pixel";
        /// Reference temperature of the dark current.
        dark_reference_c: Number = 25.0, -200..=150, "°C";
        /// Temperature of the sensor.
        temperature_c: Number = 25.0, -200..=150, "°C";
        /// Temperature difference that doubles the dark current.
        dark_doubling_c: Number = 8.0, 0.1..=100, "K";
        /// Fraction of excess charge that blooms into neighbouring pixels. The rest is drained.
        blooming: Number = 0.0, 0..=1;
        /// Fraction of the blooming charge that stays in its column.
        blooming_vertical: Number = 0.95, 0..=1;
        /// Binning factor: number of sensor pixels per image pixel in x and in y.
        binning_px: Count = 1, 1..=8;
        /// Binning mode.
        binning: Binning = Binning::Charge;
        /// JPEG quality, or 0 for no JPEG compression. For 8 bits only.
        jpeg_quality: Count = 0, 0..=100;
        /// Chroma subsampling of the JPEG.
        jpeg_subsampling: Subsampling = Subsampling::S420;
    }
}

words! {
    /// A built-in camera.
    pub enum CameraPreset {
        /// The paper's simulator: 8 bits, 70 electrons per grey level, read noise of one grey level.
        Paper = "paper",
        /// The paper's camera, a cooled interline CCD of 12 bits.
        Orca05g = "orca-05g",
        /// A scientific CMOS camera of 16 bits.
        Scmos = "scmos",
    }
}

impl CameraPreset {
    /// Returns a description in one line.
    #[must_use]
    pub fn summary(self) -> &'static str {
        match self {
            Self::Paper => "the paper's simulator: 8 bits, 70 electrons per grey level",
            Self::Orca05g => "the paper's camera: a cooled CCD of 12 bits",
            Self::Scmos => "a scientific CMOS camera of 16 bits",
        }
    }

    /// Returns the camera. The sources of its values are documented in `ccd_noise::CameraParams`.
    #[must_use]
    pub fn camera(self) -> CameraSection {
        let (pixel_um, params) = match self {
            Self::Paper => (6.45, CameraParams::paper()),
            Self::Orca05g => (6.45, CameraParams::orca_05g()),
            Self::Scmos => (6.5, CameraParams::scmos()),
        };
        CameraSection { pixel_um: pixel_um.into(), ..CameraSection::of(&params) }
    }
}

impl CameraSection {
    /// Returns the section of a recipe that describes a camera.
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
        // Recipes give values to six digits.
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
