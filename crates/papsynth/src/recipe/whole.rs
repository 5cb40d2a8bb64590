//! A recipe as a whole: its sections.

use super::camera::Camera;
use super::imaging::{Background, Field, Focus, Light, Optics};
use super::number::Number;
use super::scan::Scan;
use super::section::{Declared, Part, section};
use super::specimen::{Cells, Cytoplasm, Layout, Nucleus, Slide, Stain, default_cells};
use crate::debris::Debris;
use crate::scene::MARGIN_UM;

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

    /// Returns the size of a pixel in the object, µm: that of `field`, or that of the camera divided by the magnification.
    fn pixel_um(&self, of: impl Fn(&Number) -> f64) -> f64 {
        let magnification = of(&self.field.magnification);
        if magnification <= 0.0 {
            return of(&self.field.pixel_um);
        }
        of(&self.camera.pixel_um) * of(&self.camera.binning_px).max(1.0) / magnification
    }

    /// Returns the mean area of a field, mm².
    #[must_use]
    pub fn field_mm2(&self) -> f64 {
        let side = |pixels: &Number| pixels.mean() * self.pixel_um(Number::mean) * 1e-3;
        side(&self.field.width_px) * side(&self.field.height_px)
    }

    /// Returns the largest area in which the objects of a field are placed, mm²: the field with its margin.
    #[must_use]
    pub fn largest_populated_mm2(&self) -> f64 {
        let most = |number: &Number| number.bounds()[1];
        let pixel_um = if most(&self.field.magnification) <= 0.0 {
            most(&self.field.pixel_um)
        } else {
            let least = self.field.magnification.bounds()[0].max(f64::MIN_POSITIVE);
            most(&self.camera.pixel_um) * most(&self.camera.binning_px) / least
        };
        let side = |pixels: &Number| (most(pixels) * pixel_um + 2.0 * MARGIN_UM) * 1e-3;
        side(&self.field.width_px) * side(&self.field.height_px)
    }

    /// Returns the mean number of objects whose centre is in a field, by the key of their number: cells by class
    /// (`cells.intermediate.count`), debris by kind (`debris.leukocytes.clusters`).
    #[must_use]
    pub fn expected_counts(&self) -> Vec<(String, f64)> {
        let area_mm2 = self.field_mm2();
        let cells = self.cells.iter().map(|(class, mix)| (format!("cells.{class}.count"), &mix.count));
        let debris = self.debris.abundances().into_iter().map(|(path, abundance)| (path.to_owned(), abundance));
        cells.chain(debris).map(|(path, abundance)| (path, abundance.mean(area_mm2))).collect()
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
