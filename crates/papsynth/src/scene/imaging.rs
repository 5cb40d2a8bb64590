//! How a scene is imaged: background, light, optics, camera, their numbers drawn.

use dye_spectra::Amounts;
use serde::{Deserialize, Serialize};

use crate::recipe::imaging::{Mixing, Rendition, SceneMicroscope};
use crate::recipe::specimen::Restore;

/// Planes that are fused to one picture of extended focus.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fusion {
    /// Travel of the stage to the first plane, µm.
    pub first_um: f64,
    /// Travel between planes, µm.
    pub step_um: f64,
    /// Number of planes.
    pub planes: usize,
    /// Correlation of the noise of a pixel with that of the next in its row and in its column.
    pub noise_correlation: [f64; 2],
    /// How much more it correlates with that of the next pixel down to the right than of that down to the left, halved.
    pub noise_skew: f64,
}

impl Fusion {
    /// The plane nearest to a travel of the stage.
    #[must_use]
    pub fn nearest_um(&self, stage_um: f64) -> f64 {
        let last = self.planes.saturating_sub(1) as f64;
        let plane = libm::round((stage_um - self.first_um) / self.step_um.max(f64::MIN_POSITIVE)).clamp(0.0, last);
        self.first_um + plane * self.step_um
    }
}

/// The empty slide, its numbers drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneBackground {
    /// Light as a fraction of full scale.
    pub level: f64,
    /// How evenly the lamp lights the field.
    pub illumination: SceneIllumination,
    /// Strength of the Perlin noise, fraction of full scale.
    pub texture: f64,
    /// Size of its cells, µm.
    pub texture_um: f64,
}

/// How evenly the lamp lights the field, its numbers drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum SceneIllumination {
    /// Distance to the image's border to the power of an exponent (Eq. 8).
    Border {
        /// The exponent.
        exponent: f64,
    },
    /// A smooth bowl.
    Quadratic {
        /// Fall towards the left and right border.
        falloff_x: f64,
        /// Fall towards the upper and lower border.
        falloff_y: f64,
        /// Where its top lies, as a fraction of half the field.
        centre: [f64; 2],
    },
}

impl SceneIllumination {
    /// The same with so much of its unevenness.
    pub(crate) fn weakened(self, share: f64) -> Self {
        match self {
            Self::Border { exponent } => Self::Border { exponent: share * exponent },
            Self::Quadratic { falloff_x, falloff_y, centre } => {
                Self::Quadratic { falloff_x: share * falloff_x, falloff_y: share * falloff_y, centre }
            }
        }
    }
}

/// The light, its numbers drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum SceneLight {
    /// One interference filter.
    Monochrome {
        /// Wavelength, µm.
        wavelength_um: f64,
        /// Width of the band, µm.
        bandwidth_um: f64,
    },
    /// Three colours.
    Colour {
        /// Temperature of the lamp, K.
        lamp_k: f64,
        /// How dyes make colours.
        mixing: Mixing,
        /// How much farther from the objective red light comes to focus than green, µm of stage travel.
        chromatic_um: f64,
        /// How colours are written.
        rendition: Rendition,
    },
}

/// How light spreads, its numbers drawn.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum SceneOptics {
    /// Partially coherent bright field.
    BrightField(SceneMicroscope),
    /// The paper's Gaussians.
    Gaussian {
        /// Standard deviation in the image plane, µm.
        sigma_xy_um: f64,
        /// Growth with distance from focus, µm per µm.
        sigma_z_um_per_um: f64,
    },
}

/// What happens to nuclei whose donors were images already.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Restoration {
    /// What happens.
    pub restore: Restore,
    /// Spread of their feathered mask, µm.
    pub feather_um: f64,
}

/// Dyes of everything that is no epithelial cell, in what is stained with strength 1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneDyes {
    /// Of leukocytes, and of objects out of focus.
    pub nucleus: Amounts,
    /// Of bacteria.
    pub bacillus: Amounts,
    /// Of specks.
    pub speckle: Amounts,
}
