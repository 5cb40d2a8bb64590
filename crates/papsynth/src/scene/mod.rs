//! The scene: a plain list of everything on a slide, drawn before any pixel is touched.
//!
//! The scene is the hinge between recipe and picture: nothing after it decides what exists.

mod cells;
mod debris;
mod depth;
mod draw;
mod layout;
mod weight;

use serde::Serialize;

use crate::key::Key;
use crate::recipe::{PhotonNoise, Restore};

pub(crate) use cells::unknown_class;
pub use draw::draw;
pub(crate) use layout::check_layout;
pub use weight::WeightMap;

/// What kind of thing an object is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// An epithelial cell: cytoplasm and nucleus.
    Cell,
    /// A white blood cell.
    Leukocyte,
    /// A rod-shaped bacterium.
    Bacillus,
    /// A speck of dust or stain.
    Speckle,
    /// An object far outside the depth of the slide.
    OutOfFocus,
}

impl Kind {
    /// All kinds, in the order in which their objects are numbered.
    pub const ALL: [Self; 5] = [Self::Cell, Self::Leukocyte, Self::Bacillus, Self::Speckle, Self::OutOfFocus];

    /// The name of the kind, which is also the class of what has no class of its own.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Cell => "cell",
            Self::Leukocyte => "leukocyte",
            Self::Bacillus => "bacillus",
            Self::Speckle => "speckle",
            Self::OutOfFocus => "out-of-focus",
        }
    }
}

/// One field of view: how it is imaged and what lies in it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scene {
    /// Seed and index the scene was drawn from.
    pub key: Key,
    /// The image and its pixels.
    pub view: View,
    /// Depths of the focal planes, µm, in the order of the stack.
    pub planes_um: Vec<f64>,
    /// The empty slide.
    pub background: SceneBackground,
    /// The spread of light.
    pub optics: SceneOptics,
    /// The camera.
    pub camera: SceneCamera,
    /// Every object, by id.
    pub objects: Vec<Object>,
}

/// The image and its pixels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct View {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Size of a pixel, µm.
    pub pixel_um: f64,
}

impl View {
    /// Micrometres to pixels: pixel centres lie at whole numbers, the image's corner at −½.
    #[must_use]
    pub fn to_px(&self, point_um: [f64; 2]) -> [f64; 2] {
        [point_um[0] / self.pixel_um - 0.5, point_um[1] / self.pixel_um - 0.5]
    }

    /// Width and height in micrometres.
    #[must_use]
    pub fn size_um(&self) -> [f64; 2] {
        [self.width as f64 * self.pixel_um, self.height as f64 * self.pixel_um]
    }
}

/// The empty slide, its numbers drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
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
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
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

/// The spread of light, its numbers drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SceneOptics {
    /// Standard deviation in the image plane, µm.
    pub sigma_xy_um: f64,
    /// Growth with distance from focus, µm per µm.
    pub sigma_z_um_per_um: f64,
    /// What happens to nuclei whose donors were images already.
    pub restore: Restore,
    /// Feathering of that, µm.
    pub restore_feather_um: f64,
}

/// The camera, its numbers drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SceneCamera {
    /// Bits of a grey level.
    pub bits: u32,
    /// Electrons that the largest grey level stands for.
    pub full_well_e: f64,
    /// Read noise, electrons.
    pub read_noise_e: f64,
    /// Grey level of a dark pixel.
    pub offset_dn: f64,
    /// How photons are counted.
    pub photon_noise: PhotonNoise,
}

/// One thing on the slide.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Object {
    /// Id within the image, from 1.
    pub id: u32,
    /// Its number within its kind, from 0: what its streams are named by.
    pub number: u64,
    /// The cluster it was placed with, from 1; 0 if alone.
    pub cluster: u32,
    /// Place of its middle, µm from the image's upper left corner.
    pub centre_um: [f64; 2],
    /// Depth, µm, positive towards the objective.
    pub depth_um: f64,
    /// Direction it is turned to, degrees.
    pub rotation_deg: f64,
    /// Category of the Bethesda system, of a cell whose class has one; else empty.
    pub bethesda: String,
    /// What it is.
    pub body: Body,
}

/// What an object is, its numbers drawn.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Body {
    /// An epithelial cell.
    Cell(Box<CellBody>),
    /// A white blood cell.
    Leukocyte {
        /// Radius of the nucleus, µm.
        radius_um: f64,
        /// Number of lobes of the nucleus.
        lobes: usize,
        /// Range of the radial perturbation (α of Eq. 7).
        alpha: f64,
        /// Range of the angular perturbation (β of Eq. 7).
        beta: f64,
        /// Absorbance of the nucleus.
        absorbance: f64,
        /// Absorbance of the cytoplasm round it.
        halo: f64,
    },
    /// A rod-shaped bacterium.
    Bacillus {
        /// Length, µm.
        length_um: f64,
        /// Width, µm.
        width_um: f64,
        /// Bend between its ends, degrees.
        bend_deg: f64,
        /// Absorbance.
        absorbance: f64,
    },
    /// A speck of dust or stain.
    Speckle {
        /// How often it was grown by a pixel.
        dilations: usize,
        /// Absorbance.
        absorbance: f64,
    },
    /// An object far outside the depth of the slide.
    OutOfFocus {
        /// Radius, µm.
        radius_um: f64,
        /// Range of the radial perturbation (α of Eq. 7).
        alpha: f64,
        /// Range of the angular perturbation (β of Eq. 7).
        beta: f64,
        /// Absorbance.
        absorbance: f64,
    },
}

impl Body {
    /// The kind of the object.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match self {
            Self::Cell(_) => Kind::Cell,
            Self::Leukocyte { .. } => Kind::Leukocyte,
            Self::Bacillus { .. } => Kind::Bacillus,
            Self::Speckle { .. } => Kind::Speckle,
            Self::OutOfFocus { .. } => Kind::OutOfFocus,
        }
    }
}

/// An epithelial cell, its numbers drawn.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CellBody {
    /// Class in the model.
    pub class: String,
    /// Radius of the cell (of the circle of its first descriptor), µm.
    pub radius_um: f64,
    /// Mean absorbance of its cytoplasm.
    pub cytoplasm_absorbance: f64,
    /// Strengths of the cytoplasm's detail.
    pub detail: CellDetail,
    /// The part that lies doubled back.
    pub fold: Option<Fold>,
    /// Its nucleus.
    pub nucleus: NucleusBody,
}

/// Strengths of the detail of a cell's cytoplasm, relative to its absorbance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CellDetail {
    /// Area of the flat sheet relative to the cell's.
    pub excess: f64,
    /// Low-frequency Gaussian noise.
    pub clouds: f64,
    /// Its smoothing, µm.
    pub clouds_um: f64,
    /// Thresholded Brownian flecks.
    pub flecks: f64,
    /// Share of the cell the flecks leave free.
    pub flecks_threshold: f64,
    /// The cytoskeleton.
    pub cytoskeleton: f64,
    /// Fine grain.
    pub grain: f64,
    /// Granules per 100 µm²; 0 if the cell has none.
    pub granules: f64,
    /// Roughness of the rim, µm.
    pub fray_um: f64,
}

/// A part of a cell that lies doubled back on it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Fold {
    /// What becomes of the part beyond the crease.
    pub form: FoldForm,
    /// Direction from the cell's middle to the crease, degrees.
    pub direction_deg: f64,
    /// Distance of the crease from the rim, as a fraction of the radius.
    pub depth: f64,
    /// Radius of the bend, µm.
    pub radius_um: f64,
}

/// What becomes of the part of a cell beyond a crease.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FoldForm {
    /// It lies flat on the cell.
    Flap,
    /// It is rolled up.
    Roll,
    /// Both sides are folded to the middle.
    Cigar,
}

/// The nucleus of a cell, its numbers drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct NucleusBody {
    /// Radius (of the circle of its first descriptor), µm.
    pub radius_um: f64,
    /// Where it lies, as a fraction of the cell's radius from its middle.
    pub off_centre: [f64; 2],
    /// Direction of its long axis against the cell's, degrees.
    pub rotation_deg: f64,
    /// Mean absorbance above the cytoplasm.
    pub absorbance: f64,
    /// Standard deviation of the absorbance inside.
    pub texture: f64,
    /// Absorbance of the rim relative to the nucleus.
    pub rim: f64,
    /// Small, dark, without structure.
    pub pyknotic: bool,
    /// Strength of wrinkles, 0 if it has none.
    pub wrinkle: f64,
}
