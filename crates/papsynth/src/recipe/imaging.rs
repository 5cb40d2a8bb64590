//! Sections of a recipe about the microscope: field, focus, background, optics, camera.

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
    /// Size of a pixel in the object, µm, 0.05 to 4 (the paper's: 0.25).
    pub pixel_um: Number,
}

impl Default for Field {
    fn default() -> Self {
        Self { width_px: 1376.0.into(), height_px: 1038.0.into(), pixel_um: 0.25.into() }
    }
}

/// Focal planes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Focus {
    /// Number of focal planes, 1 to 1024: 1 is an image, more are a focus stack.
    pub planes: Number,
    /// Distance between planes, µm, 0.001 to 100.
    pub step_um: Number,
    /// Depth of the middle plane, µm, -1000 to 1000; 0 is the middle of the slide, positive towards the objective.
    pub centre_um: Number,
}

impl Default for Focus {
    fn default() -> Self {
        Self { planes: 1.0.into(), step_um: 0.5.into(), centre_um: 0.0.into() }
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

/// What the fields of an illumination are where a recipe names its kind alone.
mod defaults {
    use super::Number;

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
            scatter: Number::uniform(0.004, 0.012),
            scatter_um: 60.0.into(),
        }
    }
}

/// The spread of light: the paper's Gaussians (Eqs. 13, 14, Fig. 10).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Optics {
    /// Standard deviation of the spread in the image plane, µm, 0 to 20 (the paper's: 0.9 px of 0.25 µm).
    pub sigma_xy_um: Number,
    /// Growth of the spread with distance from focus, µm per µm, 0 to 10. The paper's calibration is 0.25, that is
    /// one pixel of 0.25 µm per µm; its sentence read as "µm per µm" would be 1.
    pub sigma_z_um_per_um: Number,
}

impl Default for Optics {
    fn default() -> Self {
        Self { sigma_xy_um: 0.225.into(), sigma_z_um_per_um: 0.25.into() }
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

/// The camera (Eq. 13, g_po and g_g).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Camera {
    /// Bits of a grey level, 8 to 16.
    pub bits: Number,
    /// Electrons that a pixel holds, which the largest grey level stands for, 10 to 10000000.
    pub full_well_e: Number,
    /// Standard deviation of the read noise, electrons, 0 to 100000.
    pub read_noise_e: Number,
    /// Grey level of a dark pixel, 0 to 4096.
    pub offset_dn: Number,
    /// How photons are counted.
    pub photon_noise: PhotonNoise,
}

impl Default for Camera {
    fn default() -> Self {
        Self {
            bits: 8.0.into(),
            full_well_e: 17_600.0.into(),
            read_noise_e: 8.0.into(),
            offset_dn: 0.0.into(),
            photon_noise: PhotonNoise::Exact,
        }
    }
}
