//! A recipe as a whole: its sections.

use super::camera::Camera;
use super::imaging::{Background, Field, Focus, Light, Optics};
use super::scan::Scan;
use super::section::{Declared, Part, section};
use super::specimen::{Cells, Cytoplasm, Layout, Nucleus, Slide, Stain, default_cells};
use crate::debris::Debris;

/// The version of recipes that this crate reads and writes.
pub const RECIPE_VERSION: u32 = 1;

section! {
    /// A recipe: everything that decides an image except the model, the seed and the index.
    pub struct Recipe {
        /// Version of this file's format.
        version: u32 = RECIPE_VERSION;
        /// The image: its size and the size of its pixels.
        field: Field;
        /// Focal planes: one for an image, several for a focus stack.
        focus: Focus;
        /// The slide: how deep the cells lie.
        slide: Slide;
        /// Where the cells lie.
        layout: Layout;
        /// The cells, by the name of their class in the model.
        cells: Cells = default_cells();
        /// The cytoplasm of every cell.
        cytoplasm: Cytoplasm;
        /// The nucleus of every cell.
        nucleus: Nucleus;
        /// How evenly the stain was taken up.
        stain: Stain;
        /// Everything that is no epithelial cell.
        debris: Debris;
        /// The empty slide, as the lamp shows it.
        background: Background;
        /// The light: one wavelength or three colours.
        light: Light;
        /// How light spreads between slide and sensor.
        optics: Optics;
        /// The camera.
        camera: Camera;
        /// A whole slide.
        scan: Scan;
    }
}

impl Recipe {
    /// Every declared number, in the order of the sections.
    pub(crate) fn numbers(&self) -> Vec<Declared<'_>> {
        let mut found = Vec::new();
        self.list("", None, &mut found);
        found
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

    /// The JSON schema of recipes. A bound of a number is that of a plain value: a distribution may reach beyond it where
    /// its `min` and `max` do not.
    #[must_use]
    pub fn schema() -> serde_json::Value {
        schemars::schema_for!(Self).to_value()
    }
}
