//! What the user asks for: a recipe.
//!
//! A recipe says what a slide looks like and how it is imaged; what real cells are like stands in the
//! [`Model`](crate::model::Model). Lengths are in micrometres, angles in degrees, probabilities from 0 to 1,
//! absorbances decadic (A = −log₁₀ I/I₀, Eq. 11). Every number may be a distribution: see [`Number`].

pub(crate) mod camera;
mod check;
pub(crate) mod imaging;
pub(crate) mod number;
mod presets;
mod print;
mod scan;
pub(crate) mod specimen;

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use crate::debris::{
    Bacilli, BareNuclei, Bubbles, Candidas, ClueCells, Cocci, Crystals, Debris, Dirt, Dust, Fibres, Leukocytes, Mucus,
    NucleusForm, OutOfFocus, RedCells, Scratches, Smudges, SpeckForm, Speckles, Trichomonads,
};
pub use crate::error::Problem;
pub use camera::{Binning, Camera, CameraPreset, PhotonNoise, Subsampling};
pub use imaging::{Background, Field, Focus, Illumination, Imaging, Light, Mixing, Optics, Picture, Rendition};
pub use number::{Law, Number, REACH_SD};
pub use presets::Preset;
pub use print::{is_toml_table, toml_value};
pub use scan::{Deposit, Scan};
pub use specimen::{
    Acceptance, CellMix, Chromatin, Cytoplasm, DyeAmounts, Folds, Group, GroupForm, Layout, Nucleus, Restore, Seam,
    ShapeSpread, Sheet, Slide, Stain, TintMix,
};

/// The version of recipes that this crate reads and writes.
pub const RECIPE_VERSION: u32 = 1;

/// A recipe: everything that decides an image except the model, the seed and the index.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Recipe {
    /// Version of this file's format.
    pub version: u32,
    /// The image: its size and the size of its pixels.
    pub field: Field,
    /// Focal planes: one for an image, several for a focus stack.
    pub focus: Focus,
    /// The slide: how deep the cells lie.
    pub slide: Slide,
    /// Where the cells lie.
    pub layout: Layout,
    /// The cells, by the name of their class in the model.
    pub cells: BTreeMap<String, CellMix>,
    /// The cytoplasm of every cell.
    pub cytoplasm: Cytoplasm,
    /// The nucleus of every cell.
    pub nucleus: Nucleus,
    /// How evenly the stain was taken up.
    pub stain: Stain,
    /// Everything that is no epithelial cell.
    pub debris: Debris,
    /// The empty slide, as the lamp shows it.
    pub background: Background,
    /// The light: one wavelength or three colours.
    pub light: Light,
    /// How light spreads between slide and sensor.
    pub optics: Optics,
    /// The camera.
    pub camera: Camera,
    /// A whole slide.
    pub scan: Scan,
}

impl Recipe {
    /// The recipe as TOML, every field with its meaning as a comment.
    #[must_use]
    pub fn to_commented_toml(&self) -> String {
        print::commented_toml(self)
    }

    /// The recipe as plain TOML.
    #[must_use]
    pub fn to_toml(&self) -> String {
        print::plain_toml(self)
    }

    /// The recipe of a TOML text. Whether its numbers are within their ranges is not checked.
    ///
    /// # Errors
    /// If the text is not TOML, or a field is unknown or of another type.
    pub fn from_toml(text: &str) -> Result<Self, toml::de::Error> {
        toml::from_str(text)
    }

    /// Takes those sections of another recipe whose names are chosen.
    pub fn replace(&mut self, other: &Self, chosen: impl Fn(&str) -> bool) {
        macro_rules! take {
            ($($section:ident),*) => {
                $(if chosen(stringify!($section)) {
                    self.$section.clone_from(&other.$section);
                })*
            };
        }
        take!(
            field, focus, slide, layout, cells, cytoplasm, nucleus, stain, debris, background, light, optics, camera,
            scan
        );
    }

    /// The JSON schema of recipes.
    #[must_use]
    pub fn schema() -> serde_json::Value {
        schemars::schema_for!(Self).to_value()
    }

    /// Everything that is wrong with the recipe, each with the field, the value and what would be accepted.
    #[must_use]
    pub fn problems(&self) -> Vec<Problem> {
        check::problems(self)
    }
}

impl Recipe {
    /// What is legitimate and may surprise, such as a condenser wider than the objective.
    #[must_use]
    pub fn notes(&self) -> Vec<Problem> {
        check::notes(self)
    }
}

impl Default for Recipe {
    fn default() -> Self {
        Preset::Lbc.recipe()
    }
}
