//! The imaging of a scene: background, light, optics and camera, with drawn numbers.

use dye_spectra::Amounts;
use serde::{Deserialize, Serialize};

use crate::recipe::imaging::{Mixing, Rendition, SceneMicroscope};
use crate::recipe::specimen::Restore;

/// Planes that are fused to an EDF image.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fusion {
    /// Position of the stage at the first plane, µm.
    pub first_um: f64,
    /// Distance between planes, µm.
    pub step_um: f64,
    /// Number of planes.
    pub planes: usize,
    /// Correlation of the noise of neighbouring pixels of a row, and of a column.
    pub noise_correlation: [f64; 2],
    /// Half the difference of the correlations of the noise along the diagonals: down right minus down left.
    pub noise_skew: f64,
    /// Factor by which the image was reduced from the pixels of the sensor by linear interpolation.
    #[serde(default = "one")]
    pub reduction: f64,
    /// Difference between the responses of even columns of the sensor and the mean, as a fraction of the mean, in the
    /// last row.
    #[serde(default)]
    pub column_pattern: f64,
}

fn one() -> f64 {
    1.0
}

impl Fusion {
    /// Returns the position of the plane nearest to a position of the stage, µm.
    #[must_use]
    pub fn nearest_um(&self, stage_um: f64) -> f64 {
        let last = self.planes.saturating_sub(1) as f64;
        let plane = libm::round((stage_um - self.first_um) / self.step_um.max(f64::MIN_POSITIVE)).clamp(0.0, last);
        self.first_um + plane * self.step_um
    }
}

/// The light of the empty slide, with drawn numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneBackground {
    /// Light as a fraction of full scale.
    pub level: f64,
    /// Illumination of the field.
    pub illumination: SceneIllumination,
    /// Amplitude of the Perlin noise, as a fraction of full scale.
    pub texture: f64,
    /// Cell size of the Perlin noise, µm.
    pub texture_um: f64,
}

/// Illumination of the field, with drawn numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum SceneIllumination {
    /// A power of the distance to the image border (Eq. 8).
    Border {
        /// The exponent.
        exponent: f64,
    },
    /// A quadratic falloff.
    Quadratic {
        /// Falloff at the left and right border.
        falloff_x: f64,
        /// Falloff at the upper and lower border.
        falloff_y: f64,
        /// Place of the maximum, as a fraction of half the field.
        centre: [f64; 2],
    },
}

impl SceneIllumination {
    /// Returns the illumination with a fraction of its falloff.
    pub(crate) fn weakened(self, share: f64) -> Self {
        match self {
            Self::Border { exponent } => Self::Border { exponent: share * exponent },
            Self::Quadratic { falloff_x, falloff_y, centre } => {
                Self::Quadratic { falloff_x: share * falloff_x, falloff_y: share * falloff_y, centre }
            }
        }
    }
}

/// The light, with drawn numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum SceneLight {
    /// One filter.
    Monochrome {
        /// Wavelength, µm.
        wavelength_um: f64,
        /// Bandwidth, µm.
        bandwidth_um: f64,
        /// Coefficient of variation of the stains' absorption over the wavelengths.
        absorption_variation: f64,
    },
    /// Colour.
    Colour {
        /// Colour temperature of the lamp, K.
        lamp_k: f64,
        /// Colour model of the dyes.
        mixing: Mixing,
        /// Distance of the focus of red light beyond that of green light, µm of stage travel.
        chromatic_um: f64,
        /// Colour rendition.
        rendition: Rendition,
    },
}

/// The optics, with drawn numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum SceneOptics {
    /// Partially coherent bright field.
    BrightField(SceneMicroscope),
    /// The paper's Gaussian blur.
    Gaussian {
        /// Standard deviation in focus, µm.
        sigma_xy_um: f64,
        /// Increase with distance from focus, µm per µm.
        sigma_z_um_per_um: f64,
    },
}

/// Restoration of nuclei whose donors are images.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Restoration {
    /// Method.
    pub restore: Restore,
    /// Standard deviation of the feathered mask, µm.
    pub feather_um: f64,
}

/// Dyes of debris at staining strength 1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneDyes {
    /// Dyes of leukocytes, and of objects out of focus.
    pub nucleus: Amounts,
    /// Dyes of bacteria.
    pub bacillus: Amounts,
    /// Dyes of specks.
    pub speckle: Amounts,
}
