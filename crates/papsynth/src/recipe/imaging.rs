//! Sections of a recipe about the microscope: field, focus, background, optics, camera.

use ccd_noise::{Blooming, CameraParams, ReadNoise};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Number;

/// The image: its size and the size of its pixels. Counts of cells and debris are those of a whole field, whatever its size.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Field {
    /// Width in pixels, 16 to 32768; drawn once a field.
    pub width_px: Number,
    /// Height in pixels, 16 to 32768; drawn once a field.
    pub height_px: Number,
    /// Size of a pixel in the object, µm, 0.05 to 4 (the paper's: 0.25). Not looked at where `magnification` is given.
    pub pixel_um: Number,
    /// Magnification between slide and sensor, relay optics included, up to 400, or 0 if `pixel_um` says it all. A pixel is then
    /// `camera.pixel_um` times `camera.binning_px`, divided by this: 6.45 µm at 40 · 0.645 are 0.25 µm.
    pub magnification: Number,
}

impl Default for Field {
    fn default() -> Self {
        Self { width_px: 1376.0.into(), height_px: 1038.0.into(), pixel_um: 0.25.into(), magnification: 0.0.into() }
    }
}

/// Focal planes. A plane is where the stage stands; what is in focus there lies deeper or higher by the ratio of the two
/// indices of refraction, if the optics know them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Focus {
    /// Number of focal planes, 1 to 1024: 1 is an image, more are a focus stack.
    pub planes: Number,
    /// Travel of the stage between planes, µm, 0.001 to 100.
    pub step_um: Number,
    /// Travel of the stage to the middle plane, µm, -100 to 100; at 0 the middle of the slide is in focus, at more what
    /// lies nearer to the objective.
    pub centre_um: Number,
    /// What becomes of the planes.
    pub picture: Picture,
    /// How much of its noise a fused picture shares with the next pixel of the row, 0 to 0.5.
    pub fused_noise_across: Number,
    /// The same with the next pixel of the column, 0 to 0.5.
    pub fused_noise_down: Number,
    /// How much more it shares with the next pixel down to the right than with that down to the left (half of the
    /// difference), -0.1 to 0.1: pictures that were turned or shifted by parts of a pixel have some.
    pub fused_noise_skew: Number,
}

/// What becomes of the planes of a focus stack.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Picture {
    /// Each is a picture.
    Planes,
    /// They are fused to one picture of extended focus: everything as the plane that shows it sharpest, with noise that
    /// neighbouring pixels share.
    Extended,
}

impl Default for Focus {
    fn default() -> Self {
        Self {
            planes: 1.0.into(),
            step_um: 0.5.into(),
            centre_um: 0.0.into(),
            picture: Picture::Planes,
            fused_noise_across: 0.2.into(),
            fused_noise_down: 0.4.into(),
            fused_noise_skew: 0.0.into(),
        }
    }
}

/// How evenly the lamp lights the field.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Illumination {
    /// The paper's: distance to the image's border to the power of an exponent (Eq. 8).
    Border {
        /// The exponent n, 0 (even) to 2; the released value is 0.02.
        #[serde(default = "defaults::exponent")]
        exponent: Number,
    },
    /// A smooth bowl, 1 − x2·x² − y2·y² over −1..1, as measured on real fields.
    Bowl {
        /// Fall towards the left and right border, as a fraction of the centre, 0 to 0.45.
        #[serde(default = "defaults::x2")]
        x2: Number,
        /// Fall towards the upper and lower border, as a fraction of the centre, 0 to 0.45.
        #[serde(default = "defaults::y2")]
        y2: Number,
        /// Where the top of the bowl lies, as a fraction of half the field to either side, 0 to 0.9.
        #[serde(default = "defaults::off_centre")]
        off_centre: Number,
    },
}

/// What the fields of an illumination, a light and of optics are where a recipe names their kind alone.
mod defaults {
    use super::{Imaging, Mixing, Number, Rendition};

    pub(super) fn wavelength_um() -> Number {
        0.57.into()
    }

    pub(super) fn bandwidth_um() -> Number {
        0.01.into()
    }

    pub(super) fn lamp_k() -> Number {
        3200.0.into()
    }

    pub(super) fn mixing() -> Mixing {
        Mixing::Spectral
    }

    pub(super) fn chromatic_um() -> Number {
        0.3.into()
    }

    pub(super) fn rendition() -> Rendition {
        Rendition::Display
    }

    pub(super) fn na() -> Number {
        0.95.into()
    }

    pub(super) fn condenser_na() -> Number {
        0.41.into()
    }

    pub(super) fn mount_index() -> Number {
        1.515.into()
    }

    pub(super) fn immersion_index() -> Number {
        1.0.into()
    }

    pub(super) fn nothing() -> Number {
        0.0.into()
    }

    pub(super) fn extra_blur_um() -> Number {
        0.16.into()
    }

    pub(super) fn stray_light() -> Number {
        Number::uniform(0.01, 0.04)
    }

    pub(super) fn oversampling() -> Number {
        2.0.into()
    }

    pub(super) fn slab_um() -> Number {
        0.25.into()
    }

    pub(super) fn imaging() -> Imaging {
        Imaging::Product
    }

    pub(super) fn directions() -> Number {
        64.0.into()
    }

    pub(super) fn sigma_xy_um() -> Number {
        0.225.into()
    }

    pub(super) fn sigma_z_um_per_um() -> Number {
        0.25.into()
    }

    pub(super) fn exponent() -> Number {
        0.02.into()
    }

    pub(super) fn x2() -> Number {
        Number::uniform(0.01, 0.055)
    }

    pub(super) fn y2() -> Number {
        Number::uniform(0.0, 0.025)
    }

    pub(super) fn off_centre() -> Number {
        Number::uniform(0.0, 0.25)
    }
}

/// The empty slide, as the lamp shows it (Eqs. 8–10).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Background {
    /// Light of the empty slide as a fraction of the camera's largest grey level, 0.01 to 1 (b of Eq. 8).
    pub level: Number,
    /// How evenly the lamp lights the field.
    pub illumination: Illumination,
    /// Strength of Perlin noise in the light, as a fraction of the largest grey level, 0 to 0.5 (c_pe of Eq. 9).
    pub scatter: Number,
    /// Size of the cells of that noise, µm, 1 to 10000.
    pub scatter_um: Number,
}

impl Default for Background {
    fn default() -> Self {
        Self {
            level: Number::normal(0.90, 0.015),
            illumination: Illumination::Bowl {
                x2: defaults::x2(),
                y2: defaults::y2(),
                off_centre: defaults::off_centre(),
            },
            scatter: Number::uniform(0.015, 0.045),
            scatter_um: 60.0.into(),
        }
    }
}

/// The light: one wavelength or three colours.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Light {
    /// A grey image in the light of one interference filter.
    Monochrome {
        /// Wavelength, µm, 0.4 to 0.7 (the paper's: 0.57, where nuclei stand out most).
        #[serde(default = "defaults::wavelength_um")]
        wavelength_um: Number,
        /// Width of the filter's band, µm, 0 to 0.1.
        #[serde(default = "defaults::bandwidth_um")]
        bandwidth_um: Number,
    },
    /// A colour image: halogen lamp, colour camera, white balance on the empty slide.
    Colour {
        /// Temperature of the lamp, K, 2000 to 10000.
        #[serde(default = "defaults::lamp_k")]
        lamp_k: Number,
        /// How dyes make colours.
        #[serde(default = "defaults::mixing")]
        mixing: Mixing,
        /// How much farther from the objective red light (0.65 µm) comes to focus than green (0.55 µm), in µm of stage
        /// travel, -10 to 10; what an apochromat leaves is below one.
        #[serde(default = "defaults::chromatic_um")]
        chromatic_um: Number,
        /// How the camera's colours are written.
        #[serde(default = "defaults::rendition")]
        rendition: Rendition,
    },
}

impl Default for Light {
    fn default() -> Self {
        Self::Monochrome { wavelength_um: defaults::wavelength_um(), bandwidth_um: defaults::bandwidth_um() }
    }
}

/// How dyes make colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Mixing {
    /// Beer and Lambert's law at sixteen wavelengths, averaged over the band of each channel.
    Spectral,
    /// One absorbance for each dye and channel: faster; dark stains turn out too dark.
    ThreeVectors,
    /// Sixteen wavelengths, each imaged by itself: the reference for the others, and several times as slow.
    PerWavelength,
}

/// How the camera's colours are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Rendition {
    /// The three channels of the sensor, balanced and in proportion to the light: for measuring.
    Raw,
    /// The same three channels, balanced, under the tone curve of sRGB: what most microscope cameras save.
    Display,
    /// Colours as an eye would see them: sRGB primaries and tone curve.
    Srgb,
}

/// How light spreads between slide and sensor.
#[expect(clippy::large_enum_variant, reason = "one a recipe")]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Optics {
    /// Partially coherent bright field: what every slab transmits, filtered by the weak-object transfer function.
    BrightField {
        /// Numerical aperture of the objective, 0.05 to 1.6, at most `immersion_index` and below `mount_index`.
        #[serde(default = "defaults::na")]
        na: Number,
        /// Numerical aperture to which the condenser is opened, 0.05 to 1.6 and below `mount_index`; what exceeds `na` is
        /// lost light. 0.41 gives 0.25 µm of blur for each µm of stage travel, the paper's Fig. 10.
        #[serde(default = "defaults::condenser_na")]
        condenser_na: Number,
        /// Refractive index of the mountant in which the cells lie, 1 to 2.
        #[serde(default = "defaults::mount_index")]
        mount_index: Number,
        /// Refractive index between cover glass and objective, 1 to 2: 1 for a dry lens.
        #[serde(default = "defaults::immersion_index")]
        immersion_index: Number,
        /// How much thicker the cover glass is than the lens was made for, µm, -50 to 50.
        #[serde(default = "defaults::nothing")]
        cover_error_um: Number,
        /// Spherical aberration of the objective, waves (root mean square), -1 to 1.
        #[serde(default = "defaults::nothing")]
        spherical: Number,
        /// Coma along the rows, waves (root mean square), -1 to 1.
        #[serde(default = "defaults::nothing")]
        coma: Number,
        /// Astigmatism between rows and columns, waves (root mean square), -1 to 1.
        #[serde(default = "defaults::nothing")]
        astigmatism: Number,
        /// Standard deviation of further spread, µm, 0 to 10: relay optics, charge diffusion, vibration. 0.16 makes edges as wide as
        /// the paper measured them, 0.9 px.
        #[serde(default = "defaults::extra_blur_um")]
        extra_blur_um: Number,
        /// Share of an empty field's light that lies evenly over the picture, 0 to 0.5: glare.
        #[serde(default = "defaults::stray_light")]
        stray_light: Number,
        /// Samples of the slide along the side of a pixel, 1 to 4.
        #[serde(default = "defaults::oversampling")]
        oversampling: Number,
        /// How light is followed through the slide.
        #[serde(default = "defaults::imaging")]
        imaging: Imaging,
        /// Thickness of the slabs between which `abbe` carries light, µm, 0.1 to 10; `product` knows every depth.
        #[serde(default = "defaults::slab_um")]
        slab_um: Number,
        /// Directions of light that `abbe` follows, 1 to 65536.
        #[serde(default = "defaults::directions")]
        directions: Number,
    },
    /// The paper's: Gaussians on the absorbance (Eqs. 13, 14, Fig. 10).
    Gaussian {
        /// Standard deviation of the spread in the image plane, µm, 0 to 20 (the paper's: 0.9 px of 0.25 µm).
        #[serde(default = "defaults::sigma_xy_um")]
        sigma_xy_um: Number,
        /// Growth of the spread with distance from focus, µm per µm, 0 to 10. The paper's calibration is 0.25, that is
        /// one pixel of 0.25 µm per µm; its sentence read as "µm per µm" would be 1.
        #[serde(default = "defaults::sigma_z_um_per_um")]
        sigma_z_um_per_um: Number,
    },
}

/// How light is followed through the slide.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Imaging {
    /// The product over all objects of what each transmits, filtered by the weak-object transfer function: right to
    /// one or two per cent of the contrast.
    Product,
    /// Abbe's integration over the source, light carried from slab to slab: the reference, thousands of times as slow and for
    /// small fields.
    Abbe,
}

impl Default for Optics {
    fn default() -> Self {
        Self::BrightField {
            na: defaults::na(),
            condenser_na: defaults::condenser_na(),
            mount_index: defaults::mount_index(),
            immersion_index: defaults::immersion_index(),
            cover_error_um: defaults::nothing(),
            spherical: defaults::nothing(),
            coma: defaults::nothing(),
            astigmatism: defaults::nothing(),
            extra_blur_um: defaults::extra_blur_um(),
            stray_light: defaults::stray_light(),
            oversampling: defaults::oversampling(),
            slab_um: defaults::slab_um(),
            imaging: defaults::imaging(),
            directions: defaults::directions(),
        }
    }
}

impl Optics {
    /// The paper's Gaussians.
    #[must_use]
    pub fn gaussian() -> Self {
        Self::Gaussian { sigma_xy_um: defaults::sigma_xy_um(), sigma_z_um_per_um: defaults::sigma_z_um_per_um() }
    }
}

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
