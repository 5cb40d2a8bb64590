//! Recipes.
//!
//! A recipe describes a slide and how it is imaged. The statistics of cells are in the [`Model`](crate::model::Model).
//! Lengths are in micrometres, angles in degrees, probabilities from 0 to 1, absorbances decadic (A = −log₁₀ I/I₀, Eq.
//! 11). Every number may be a distribution: see [`Number`]. Counts may be densities: see [`Abundance`].

pub(crate) mod abundance;
pub(crate) mod camera;
mod check;
pub(crate) mod conditions;
pub mod diagnose;
pub(crate) mod dyes;
pub(crate) mod imaging;
pub(crate) mod number;
mod presets;
mod print;
mod renamed;
pub(crate) mod scan;
pub(crate) mod section;
pub(crate) mod specimen;
#[cfg(test)]
mod tests;
mod whole;
mod widen;

pub use crate::debris::{
    Bacilli, BareNuclei, Bubbles, Candidas, ClueCells, Cocci, Crystals, Debris, Dirt, Dust, Fibres, Leukocytes, Mucus,
    NucleusForm, OutOfFocus, RedCells, Scratches, Smudges, SpeckForm, Speckles, Trichomonads,
};
pub use crate::error::InvalidField;
pub use abundance::Abundance;
pub use camera::{Binning, CameraPreset, CameraSection, PhotonNoise, Subsampling};
pub use conditions::{Condition, Conditions, Numbers};
pub use dyes::DyeAmounts;
pub use imaging::{
    Background, Border, Colour, Field, Focus, FocusOutput, Gaussians, Illumination, Imaging, LightSection, Microscope,
    Mixing, Monochrome, Optics, Quadratic, Rendition,
};
pub use number::{Count, Distribution, Number, REACH_SD};
pub use presets::Preset;
pub use print::{is_toml_table, toml_value};
pub use scan::{Deposit, Scan};
pub use specimen::{
    Acceptance, Band, CellMix, Cells, Chromatin, Clusters, Cytoplasm, Folds, Group, GroupForm, Labels, Layout, Nucleus,
    Restore, Seam, ShapeSpread, Sheet, SlideSection, Stain, TintMix,
};
pub use whole::{RECIPE_VERSION, Recipe};
