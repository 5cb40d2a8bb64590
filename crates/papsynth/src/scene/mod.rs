//! The scene: a plain list of everything on a slide, drawn before any pixel is touched.
//!
//! The scene is the hinge between recipe and picture: nothing after it decides what exists.

mod cells;
mod deposit;
mod depth;
mod draw;
mod groups;
mod layout;
mod plots;
mod stain;
mod weight;

use dye_spectra::Amounts;
use serde::Serialize;

use crate::key::{Key, Stream};
use crate::recipe::{Binning, Imaging, Mixing, PhotonNoise, Rendition, Restore, Subsampling};

pub use crate::debris::{
    Bacillus, BareNucleus, Blob, Body, Bubble, Candida, Coat, Colony, Crystal, Fibre, Fleck, Grain, Growth, Kind,
    Leukocyte, RedCell, Scratch, Smudge, Speckle, Strand, Trichomonad,
};
pub(crate) use draw::FieldNumbers;
pub use draw::draw;
pub(crate) use layout::check_layout;
pub(crate) use plots::{BEYOND, PLOT_PX, Population};
pub(crate) use stain::FieldStain;
pub use weight::WeightMap;

/// One field of view: how it is imaged and what lies in it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scene {
    /// Seed and index the scene was drawn from.
    pub key: Key,
    /// Number of the slide that the field is part of.
    pub slide: u64,
    /// The image and its pixels.
    pub view: View,
    /// Travel of the stage to each focal plane, µm, in the order of the stack; larger where what is nearer to the objective
    /// is in focus.
    pub planes_um: Vec<f64>,
    /// The planes that are fused to one picture of extended focus, if it is one: `planes_um` then holds their middle.
    pub fusion: Option<Fusion>,
    /// The empty slide.
    pub background: SceneBackground,
    /// The light.
    pub light: SceneLight,
    /// How it spreads.
    pub optics: SceneOptics,
    /// What happens to nuclei whose donors were images already.
    pub restoration: Restoration,
    /// What stains everything that is no epithelial cell.
    pub dyes: SceneDyes,
    /// The camera.
    pub camera: SceneCamera,
    /// Which frame of a whole slide it is, if it is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame: Option<SlideFrame>,
    /// Every object, by id.
    pub objects: Vec<Object>,
}

/// A frame of a whole slide.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct SlideFrame {
    /// Its number on the slide.
    pub number: u32,
    /// The pixel of the slide that its first pixel is.
    pub origin_px: [i64; 2],
}

/// The square of a whole slide that an object was drawn with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Plot {
    /// Its number on the slide.
    pub number: u32,
    /// Where its first pixel lies, in pixels from that of the image.
    pub at_px: [i64; 2],
}

/// Planes that are fused to one picture of extended focus.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
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

impl SceneIllumination {
    /// The same with so much of its unevenness.
    pub(crate) fn weakened(self, share: f64) -> Self {
        match self {
            Self::Border { exponent } => Self::Border { exponent: share * exponent },
            Self::Bowl { x2, y2, top } => Self::Bowl { x2: share * x2, y2: share * y2, top },
        }
    }
}

impl Scene {
    /// The grid on which the slide is rendered: that of the image, or a finer one.
    #[must_use]
    pub fn grid(&self) -> View {
        let n = self.oversampling();
        View { width: self.view.width * n, height: self.view.height * n, pixel_um: self.view.pixel_um / n as f64 }
    }

    /// Samples of the slide along the side of a pixel.
    #[must_use]
    pub fn oversampling(&self) -> usize {
        match &self.optics {
            SceneOptics::BrightField(microscope) => microscope.oversampling,
            SceneOptics::Gaussian { .. } => 1,
        }
    }

    /// The grid that cytoplasm is made on: the camera's pixels where these are fine enough for wrinkles, else the slide's
    /// grid.
    pub(crate) fn sheet_grid(&self) -> View {
        /// A Gaussian crest of σ that is sampled every p changes by 2·exp(−2π²σ²/p²) with where it falls: not at all at σ = .34 µm, that of
        /// the default's middle; by a twentieth at σ = .11 µm, its narrowest, and p = .25 µm, by a quarter at .33 µm.
        const COARSEST_UM: f64 = 0.35;
        if self.view.pixel_um <= COARSEST_UM { self.view } else { self.grid() }
    }

    /// The depth that is in focus at a travel of the stage, µm. Light bends at the cover glass: with a dry lens the focus
    /// goes 1.5 times as deep as the stage.
    #[must_use]
    pub fn in_focus_um(&self, plane_um: f64) -> f64 {
        match &self.optics {
            SceneOptics::BrightField(microscope) => plane_um * microscope.mount_index / microscope.immersion_index,
            SceneOptics::Gaussian { .. } => plane_um,
        }
    }

    /// Travel of the stage at which an object of a depth is seen in a plane: the plane's own or, where planes were fused, that
    /// of the one which shows the object sharpest.
    #[must_use]
    pub fn seen_at_um(&self, plane_um: f64, depth_um: f64) -> f64 {
        // Depth and travel are proportional.
        self.fusion.map_or(plane_um, |fusion| fusion.nearest_um(depth_um / self.in_focus_um(1.0)))
    }

    /// The stream of a purpose of one object.
    pub(crate) fn stream(&self, kind: &str, object: &Object, purpose: &str) -> Stream {
        let key = object.plot.map_or(self.key, |plot| self.key.plot(plot.number));
        key.stream(kind, object.number, purpose)
    }

    /// The key of what belongs to the whole image.
    pub(crate) fn own_key(&self) -> Key {
        self.frame.map_or(self.key, |frame| self.key.frame(frame.number))
    }

    /// Place of an object's middle, µm from the image's upper left corner.
    #[must_use]
    pub fn place_um(&self, object: &Object) -> [f64; 2] {
        let corner = object.plot.map_or([0; 2], |plot| plot.at_px);
        [0, 1].map(|axis| object.centre_um[axis] + corner[axis] as f64 * self.view.pixel_um)
    }

    /// Channels of the image: 1 or 3.
    #[must_use]
    pub fn channels(&self) -> usize {
        match self.light {
            SceneLight::Monochrome { .. } => 1,
            SceneLight::Colour { .. } => 3,
        }
    }
}

/// The light, its numbers drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
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
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
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
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
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
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Restoration {
    /// What happens.
    pub restore: Restore,
    /// Spread of their feathered mask, µm.
    pub feather_um: f64,
}

/// Dyes of everything that is no epithelial cell, in what is stained with strength 1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SceneDyes {
    /// Of leukocytes, and of objects out of focus.
    pub nucleus: Amounts,
    /// Of bacteria.
    pub bacillus: Amounts,
    /// Of specks.
    pub speckle: Amounts,
}

/// The tint that a cytoplasm has taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Tint {
    /// Blue-green.
    Cyanophilic,
    /// Pink.
    Eosinophilic,
    /// Orange.
    Orangeophilic,
}

impl Tint {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Cyanophilic, Self::Eosinophilic, Self::Orangeophilic];

    /// What an object says that is tinted so, or nothing where it is not tinted, if there is such a tint.
    #[must_use]
    pub fn name_of(text: &str) -> Option<&'static str> {
        Self::ALL.into_iter().map(Self::name).chain([""]).find(|name| *name == text)
    }

    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Cyanophilic => "cyanophilic",
            Self::Eosinophilic => "eosinophilic",
            Self::Orangeophilic => "orangeophilic",
        }
    }
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

/// One thing on the slide.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Object {
    /// Id within the image, from 1.
    pub id: u32,
    /// Its number within its kind, from 0: what its streams are named by.
    pub number: u64,
    /// The cluster it was placed with, from 1; 0 if alone.
    pub cluster: u32,
    /// The square of the slide it was drawn with, of an object on a whole slide.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plot: Option<Plot>,
    /// Place of its middle, µm from the upper left corner of the image, or of its plot.
    pub centre_um: [f64; 2],
    /// Depth, µm, positive towards the objective.
    pub depth_um: f64,
    /// Direction it is turned to, degrees.
    pub rotation_deg: f64,
    /// Category of the Bethesda system, of a cell whose class has one; else empty.
    pub bethesda: String,
    /// The bacteria that cover it, if it is a clue cell.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coat: Option<Coat>,
    /// What it is.
    pub body: Body,
}

/// An epithelial cell, its numbers drawn.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CellBody {
    /// Class in the model.
    pub class: String,
    /// Radius of the cell (of the circle of its first descriptor), µm.
    pub radius_um: f64,
    /// Mean absorbance of its cytoplasm: the strength of its stain.
    pub cytoplasm_absorbance: f64,
    /// The tint of its cytoplasm.
    pub tint: Tint,
    /// Dyes of its cytoplasm where it is stained with strength 1.
    pub dyes: Amounts,
    /// How late light comes through its flat sheet, radians.
    pub phase_rad: f64,
    /// Strengths of the cytoplasm's detail.
    pub detail: CellDetail,
    /// The cleared space round its nucleus.
    pub halo: Option<Halo>,
    /// The part that lies doubled back.
    pub fold: Option<Fold>,
    /// Its nucleus.
    pub nucleus: NucleusBody,
}

impl CellBody {
    /// How far it may reach from its middle, µm.
    pub(crate) fn reach_um(&self) -> f64 {
        /// In radii; of cells of the default model hardly one in a thousand reaches 1.75.
        const REACH: f64 = 1.9;
        REACH * self.radius_um
    }
}

/// Strengths of the detail of a cell's cytoplasm, relative to its absorbance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CellDetail {
    /// Area of the flat sheet relative to the cell's.
    pub excess: f64,
    /// How nearly straight its sides run between its corners, 0 to 1.
    pub corners: f64,
    /// Notches in its rim.
    pub notches: usize,
    /// Tongues that stand out of it.
    pub tongues: usize,
    /// Wrinkles.
    pub wrinkles: usize,
    /// Thickness that they add, relative to the flat sheet.
    pub wrinkle: f64,
    /// Their width, µm.
    pub wrinkle_um: f64,
    /// How much denser and more granular the cytoplasm is round the nucleus.
    pub endoplasm: f64,
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
    /// Distance over which it thins out towards its rim, µm.
    pub rim_um: f64,
    /// By how much it is thicker to the right and below, relative to its thickness, a radius away.
    pub wedge: [f64; 2],
}

/// The cleared space round the nucleus of a koilocyte.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Halo {
    /// Its radius, µm.
    pub radius_um: f64,
    /// Share of the cytoplasm that is missing there.
    pub clearing: f64,
    /// How much denser the cytoplasm is at its edge.
    pub rim: f64,
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
    /// Mean absorbance above the cytoplasm: the strength of its stain.
    pub absorbance: f64,
    /// Its dyes where it is stained with strength 1.
    pub dyes: Amounts,
    /// Standard deviation of the absorbance inside.
    pub texture: f64,
    /// Absorbance of the rim relative to the nucleus.
    pub rim: f64,
    /// Share of its thickness that is domed: 0 of a plate, 1 of an ellipsoid.
    pub dome: f64,
    /// Standard deviation of the fall of its thickness about its outline, µm.
    pub edge_um: f64,
    /// Part of the variance of its chromatin that is coarse.
    pub clumping: f64,
    /// How much thicker it is at its rim than in its middle, to the right and below.
    pub wedge: [f64; 2],
    /// Small, dark, without structure.
    pub pyknotic: bool,
    /// Strength of wrinkles, 0 if it has none.
    pub wrinkle: f64,
    /// Nucleoli.
    pub nucleoli: usize,
}
