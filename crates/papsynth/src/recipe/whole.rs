//! The recipe and its sections.

use super::camera::CameraSection;
use super::conditions::Conditions;
use super::imaging::{Background, Field, Focus, LightSection, Optics};
use super::number::Number;
use super::scan::Scan;
use super::section::{Declared, Part, section};
use super::specimen::{Cells, Cytoplasm, Layout, Nucleus, SlideSection, Stain, default_cells};
use crate::debris::Debris;
use crate::scene::MARGIN_UM;

/// The recipe version that this crate reads and writes.
pub const RECIPE_VERSION: u32 = 1;

section! {
    /// A recipe. Together with a model, a seed and an index it determines an image.
    pub struct Recipe {
        /// Version of the recipe format.
        version: u32 = RECIPE_VERSION;
        /// Image: its size and its pixel size.
        field: Field;
        /// Focal planes: one for an image, several for a focus stack.
        focus: Focus;
        /// Slide: depth and spacing of the cells.
        slide: SlideSection;
        /// Layout of the cells.
        layout: Layout;
        /// Cells, by the name of their class in the model.
        cells: Cells = default_cells();
        /// Cytoplasm of all cells.
        cytoplasm: Cytoplasm;
        /// Nuclei of all cells.
        nucleus: Nucleus;
        /// Stain: its strength, its variation and its dyes.
        stain: Stain;
        /// Debris: everything except epithelial cells.
        debris: Debris;
        /// Background: the light of the empty slide.
        background: Background;
        /// Light: monochrome or colour.
        light: LightSection;
        /// Optics between slide and sensor.
        optics: Optics;
        /// Camera.
        camera: CameraSection;
        /// Whole slides.
        scan: Scan;
        /// Conditions of slides: numbers that differ together between slides, such as stain and light. One entry is
        /// drawn for each slide (`slide.fields_per_slide`). Without entries, all slides have the numbers of the recipe.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        conditions: Conditions = Vec::new();
    }
}

impl Recipe {
    /// Returns every declared number, in the order of the sections.
    pub(crate) fn numbers(&self) -> Vec<Declared<'_>> {
        let mut found = Vec::new();
        self.list("", None, &mut found);
        found
    }

    /// Returns the size of a pixel in the object, µm: that of `field`, or that of the camera divided by the
    /// magnification.
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
        let counts = |recipe: &Self| -> Vec<(String, f64)> {
            let cells = recipe.cells.iter().map(|(class, mix)| (format!("cells.{class}.count"), &mix.count));
            let debris = recipe.debris.abundances().into_iter().map(|(path, abundance)| (path.to_owned(), abundance));
            cells.chain(debris).map(|(path, abundance)| (path, abundance.mean(area_mm2))).collect()
        };
        let sum: f64 = self.conditions.iter().map(|condition| condition.weight).sum();
        if sum <= 0.0 {
            return counts(self);
        }
        let mut means: Vec<(String, f64)> = Vec::new();
        for (index, condition) in self.conditions.iter().enumerate() {
            let part = condition.weight / sum;
            for (at, (path, mean)) in counts(&self.with_condition(index)).into_iter().enumerate() {
                match means.get_mut(at) {
                    Some((_, sum)) => *sum += part * mean,
                    None => means.push((path, part * mean)),
                }
            }
        }
        means
    }

    /// Reads a recipe from TOML. Ranges are not checked: see [`Recipe::problems`].
    ///
    /// # Errors
    /// If the text is not TOML, or a field is unknown or of another type.
    pub fn from_toml(text: &str) -> Result<Self, toml::de::Error> {
        toml::from_str(text)
    }

    /// Replaces the sections whose names are `chosen` by those of another recipe.
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
            scan, conditions
        );
    }

    /// Returns the JSON schema of recipes. The bounds of a number apply to a plain value, and to a distribution after
    /// its `min` and `max`.
    #[must_use]
    pub fn schema() -> serde_json::Value {
        schemars::schema_for!(Self).to_value()
    }
}
