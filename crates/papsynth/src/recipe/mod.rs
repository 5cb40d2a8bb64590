//! What the user asks for: a recipe.
//!
//! A recipe says what a slide looks like and how it is imaged; what real cells are like stands in the
//! [`Model`](crate::model::Model). Lengths are in micrometres, angles in degrees, probabilities from 0 to 1,
//! absorbances decadic (A = −log₁₀ I/I₀, Eq. 11). Every number may be a distribution: see [`Number`].

pub(crate) mod abundance;
pub(crate) mod camera;
mod check;
pub mod diagnose;
pub(crate) mod dyes;
pub(crate) mod imaging;
pub(crate) mod number;
mod presets;
mod print;
pub(crate) mod scan;
pub(crate) mod section;
pub(crate) mod specimen;
#[cfg(test)]
mod tests;
mod whole;

pub use crate::debris::{
    Bacilli, BareNuclei, Bubbles, Candidas, ClueCells, Cocci, Crystals, Debris, Dirt, Dust, Fibres, Leukocytes, Mucus,
    NucleusForm, OutOfFocus, RedCells, Scratches, Smudges, SpeckForm, Speckles, Trichomonads,
};
pub use crate::error::Problem;
pub use abundance::Abundance;
pub use camera::{Binning, Camera, CameraPreset, PhotonNoise, Subsampling};
pub use dyes::DyeAmounts;
pub use imaging::{
    Background, Border, Colour, Field, Focus, FocusOutput, Gaussians, Illumination, Imaging, Light, Microscope, Mixing,
    Monochrome, Optics, Quadratic, Rendition,
};
pub use number::{Count, Law, Number, REACH_SD};
pub use presets::Preset;
pub use print::{is_toml_table, toml_value};
pub use scan::{Deposit, Scan};
pub use specimen::{
    Acceptance, Band, CellMix, Cells, Chromatin, Clusters, Cytoplasm, Folds, Group, GroupForm, Labels, Layout, Nucleus,
    Restore, Seam, ShapeSpread, Sheet, Slide, Stain, TintMix,
};
pub use whole::{RECIPE_VERSION, Recipe};
