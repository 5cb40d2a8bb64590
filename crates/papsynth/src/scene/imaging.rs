//! How a scene is imaged: background, light, optics, camera, their numbers drawn.

use dye_spectra::Amounts;
use serde::{Deserialize, Serialize};

use crate::recipe::camera::{Binning, PhotonNoise, Subsampling};
use crate::recipe::imaging::{Imaging, Mixing, Rendition};
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
    pub scatter: f64,
    /// Size of its cells, µm.
    pub scatter_um: f64,
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
    Bowl {
        /// Fall towards the left and right border.
        x2: f64,
        /// Fall towards the upper and lower border.
        y2: f64,
        /// Where its top lies, as a fraction of half the field.
        top: [f64; 2],
    },
}

impl SceneIllumination {
    /// The same with so much of its unevenness.
    pub(crate) fn weakened(self, share: f64) -> Self {
        match self {
            Self::Border { exponent } => Self::Border { exponent: share * exponent },
            Self::Bowl { x2, y2, top } => Self::Bowl { x2: share * x2, y2: share * y2, top },
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

/// A bright-field microscope, its numbers drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneMicroscope {
    /// Numerical aperture of the objective.
    pub na: f64,
    /// Numerical aperture of the condenser.
    pub condenser_na: f64,
    /// Refractive index of the mountant.
    pub mount_index: f64,
    /// Refractive index between cover glass and objective.
    pub immersion_index: f64,
    /// How much too thick the cover glass is, µm.
    pub cover_error_um: f64,
    /// Spherical aberration, waves.
    pub spherical: f64,
    /// Coma along the rows, waves.
    pub coma: f64,
    /// Astigmatism between rows and columns, waves.
    pub astigmatism: f64,
    /// Standard deviation of further spread, µm.
    pub extra_blur_um: f64,
    /// Share of an empty field's light that lies evenly over the picture.
    pub stray_light: f64,
    /// Samples of the slide along the side of a pixel.
    pub oversampling: usize,
    /// Thickness of the slabs between which Abbe's way carries light, µm.
    pub slab_um: f64,
    /// How light is followed through the slabs.
    pub imaging: Imaging,
    /// Directions of light that Abbe's way follows.
    pub directions: usize,
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

/// The camera, its numbers drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneCamera {
    /// Bits of a grey level.
    pub bits: u32,
    /// Electrons that the largest grey level stands for.
    pub full_well_e: f64,
    /// Read noise, electrons.
    pub read_noise_e: f64,
    /// Root of its mean square where pixels differ, else 0.
    pub read_noise_rms_e: f64,
    /// Grey level of a dark pixel.
    pub offset_dn: f64,
    /// Glare that was taken off, as a share of the light of the empty slide.
    pub glare_removed: f64,
    /// How photons are counted.
    pub photon_noise: PhotonNoise,
    /// Spread of the pixels' responses.
    pub prnu: f64,
    /// Spread of the pixels' offsets, electrons.
    pub dsnu_e: f64,
    /// Which camera of its kind it is.
    pub serial: u64,
    /// Exposure, seconds.
    pub exposure_s: f64,
    /// Dark current, electrons per second.
    pub dark_current_e_per_s: f64,
    /// Temperature for which it is given, °C.
    pub dark_reference_c: f64,
    /// Temperature of the sensor, °C.
    pub temperature_c: f64,
    /// Warming that doubles the dark current, K.
    pub dark_doubling_c: f64,
    /// Share of the charge too much that blooms.
    pub blooming: f64,
    /// Share of that which stays within its column.
    pub blooming_vertical: f64,
    /// Pixels of the sensor along the side of one of the picture.
    pub binning_px: usize,
    /// How they are joined.
    pub binning: Binning,
    /// Quality of the JPEG, or 0.
    pub jpeg_quality: u32,
    /// How much of the colour it leaves out.
    pub jpeg_subsampling: Subsampling,
}
