//! Checks of a recipe: the range of each number, and the relations between numbers.

use super::camera::CameraSection;
use super::imaging::{FocusOutput, Imaging, LightSection, Optics};
use super::number::Number;
use super::section::Declared;
use super::whole::{RECIPE_VERSION, Recipe};
use crate::error::InvalidField;

/// Most pixels that one plane may have: 2³⁰, a gigapixel.
const MAX_PIXELS: f64 = 1_073_741_824.0;

impl Recipe {
    /// Returns all invalid fields, each with its value and what is accepted.
    #[must_use]
    pub fn problems(&self) -> Vec<InvalidField> {
        let numbers = self.numbers();
        let mut check = Check { numbers: &numbers, problems: Vec::new() };
        if self.version != RECIPE_VERSION {
            let message =
                format!("version {} is not supported: this program reads version {RECIPE_VERSION}", self.version);
            check.add("version", message);
        }
        for number in &numbers {
            number.problems().for_each(|message| check.add(&number.path, message));
        }
        field(self, &mut check);
        background(self, &mut check);
        light(self, &mut check);
        optics(self, &mut check);
        detector(&self.camera, &mut check);
        specimen(self, &mut check);
        let mut problems = check.problems;
        if !self.conditions.is_empty() {
            problems.extend(self.problems_of_conditions());
        }
        problems
    }

    /// Returns fields that are valid and unusual, such as a condenser aperture above that of the objective.
    #[must_use]
    pub fn notes(&self) -> Vec<InvalidField> {
        let Optics::BrightField(microscope) = &self.optics else { return Vec::new() };
        let (na, condenser_na) = (&microscope.na, &microscope.condenser_na);
        let ([least, _], [_, widest]) = (na.bounds(), condenser_na.bounds());
        if widest <= least {
            return Vec::new();
        }
        let lost = 100.0 * (1.0 - (least / widest) * (least / widest));
        let message = format!(
            "{condenser_na} is above `optics.na` = {na}: up to {lost:.0} % of the light passes outside the objective"
        );
        vec![InvalidField { field: "optics.condenser_na".to_owned(), message }]
    }
}

struct Check<'a> {
    numbers: &'a [Declared<'a>],
    problems: Vec<InvalidField>,
}

impl Check<'_> {
    fn add(&mut self, field: &str, message: String) {
        self.problems.push(InvalidField { field: field.to_owned(), message });
    }

    /// Returns the declared range of a number.
    fn range(&self, path: &str) -> [f64; 2] {
        let declared = self.numbers.iter().find(|number| number.path == path);
        declared.map_or([f64::NEG_INFINITY, f64::INFINITY], |number| [number.bounds.low, number.bounds.high])
    }
}

fn field(recipe: &Recipe, check: &mut Check<'_>) {
    let Recipe { field, focus, .. } = recipe;
    magnified(recipe, check);
    let [_, width] = field.width_px.bounds();
    let [_, height] = field.height_px.bounds();
    if width * height > MAX_PIXELS {
        let message = format!("{width} x {height} pixels; expected at most {MAX_PIXELS} pixels");
        check.add("field.width_px", message);
    }
    let exact = matches!(&recipe.optics, Optics::BrightField(microscope) if microscope.imaging == Imaging::Abbe);
    if focus.output == FocusOutput::Edf && exact {
        let message = "\"edf\" needs `optics.imaging` = \"product\"; expected that, or \"planes\" here";
        check.add("focus.output", message.to_owned());
    }
}

/// Checks the pixel size that the magnification gives.
fn magnified(recipe: &Recipe, check: &mut Check<'_>) {
    let [least, most] = recipe.field.magnification.bounds();
    if most <= 0.0 {
        return;
    }
    let ([finest, coarsest], [_, strongest]) = (check.range("field.pixel_um"), check.range("field.magnification"));
    let [smallest, largest] = recipe.camera.pixel_um.bounds();
    let [few, many] = recipe.camera.binning_px.bounds();
    if least <= 0.0 || smallest * few / most < finest || largest * many / least > coarsest {
        let message = format!(
            "{} gives a pixel size outside {finest} to {coarsest} µm with `camera.pixel_um` = {}; expected 0, or {} to {}",
            recipe.field.magnification,
            recipe.camera.pixel_um,
            largest * many / coarsest,
            (smallest * few / finest).min(strongest)
        );
        check.add("field.magnification", message);
    }
}

/// Eq. 10 takes the logarithm of H − c·I_pe, which must stay above zero.
fn background(recipe: &Recipe, check: &mut Check<'_>) {
    let background = &recipe.background;
    let ([level, _], [_, texture]) = (background.level.bounds(), background.texture.bounds());
    if texture >= level {
        let message = format!(
            "{} is not below `background.level` = {}; expected less than {level}",
            background.texture, background.level
        );
        check.add("background.texture", message);
    }
}

fn light(recipe: &Recipe, check: &mut Check<'_>) {
    if let (LightSection::Colour(_), Optics::Gaussian(_)) = (&recipe.light, &recipe.optics) {
        let message = "colour needs bright-field optics; expected `kind = \"monochrome\"`, or `kind = \"bright-field\"` under \
                       [optics]";
        check.add("light.kind", message.to_owned());
    }
}

fn optics(recipe: &Recipe, check: &mut Check<'_>) {
    let Optics::BrightField(microscope) = &recipe.optics else { return };
    let [na, condenser] = [("optics.na", &microscope.na), ("optics.condenser_na", &microscope.condenser_na)];
    let mount = ("optics.mount_index", &microscope.mount_index);
    no_more_than(check, na, ("optics.immersion_index", &microscope.immersion_index), false);
    no_more_than(check, na, mount, true);
    no_more_than(check, condenser, mount, true);
}

/// Checks that the refractive index of a medium allows an aperture.
fn no_more_than(check: &mut Check<'_>, (field, na): (&str, &Number), (medium, index): (&str, &Number), strictly: bool) {
    let ([_, largest], [least, _]) = (na.bounds(), index.bounds());
    if largest > least || (strictly && largest == least) {
        let (than, up_to) = if strictly { ("at or above", "less than") } else { ("above", "at most") };
        check.add(field, format!("{na} is {than} `{medium}` = {index}; expected {up_to} {least}"));
    }
}

fn detector(camera: &CameraSection, check: &mut Check<'_>) {
    let ([median, most], [least, rms]) = (camera.read_noise_e.bounds(), camera.read_noise_rms_e.bounds());
    if rms > 0.0 && (median <= 0.0 || least < most || rms > 20.0 * median) {
        let message = format!(
            "{} does not fit `camera.read_noise_e` = {}; expected 0, or {most} to {}",
            camera.read_noise_rms_e,
            camera.read_noise_e,
            20.0 * median
        );
        check.add("camera.read_noise_rms_e", message);
    }
    if camera.jpeg_quality.bounds()[1] > 0.0 && camera.bits.bounds()[1] > 8.0 {
        let message =
            format!("{} needs 8 bits, `camera.bits` = {}; expected 0, or 8 bits", camera.jpeg_quality, camera.bits);
        check.add("camera.jpeg_quality", message);
    }
    let [bits, _] = camera.bits.bounds();
    let [_, offset] = camera.offset_dn.bounds();
    // An offset of half the range leaves too few grey levels.
    if offset >= libm::exp2(bits) / 2.0 {
        let message = format!(
            "{} is not below half the {bits}-bit range; expected less than {}",
            camera.offset_dn,
            libm::exp2(bits) / 2.0
        );
        check.add("camera.offset_dn", message);
    }
}

fn specimen(recipe: &Recipe, check: &mut Check<'_>) {
    for (class, mix) in &recipe.cells {
        let tints = &mix.tints;
        let weights = [&tints.cyanophilic, &tints.eosinophilic, &tints.orangeophilic];
        if weights.iter().all(|weight| weight.bounds()[1] <= 0.0) {
            check.add(&format!("cells.{class}.tints"), "all tints are 0; expected at least one above 0".to_owned());
        }
    }
    let nucleus = &recipe.nucleus;
    let ([patch, _], [_, overlap]) = (nucleus.patch_um.bounds(), nucleus.overlap_um.bounds());
    if overlap > patch / 2.0 {
        let message = format!(
            "{} is above half of `nucleus.patch_um` = {}; expected at most {}",
            nucleus.overlap_um,
            nucleus.patch_um,
            patch / 2.0
        );
        check.add("nucleus.overlap_um", message);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recipe::imaging::Gaussians;
    use crate::recipe::number::Distribution;

    #[test]
    fn an_invalid_field_is_reported_with_its_value_and_what_is_accepted() {
        let mut recipe = Recipe::default();
        let gaussians = Gaussians { sigma_xy_um: Number::Fixed(f64::NAN), ..Gaussians::default() };
        recipe.optics = Optics::Gaussian(gaussians);
        recipe.field.width_px = Number::Fixed(-3.0);
        recipe.background.texture = Number::Fixed(0.95);
        recipe.nucleus.overlap_um = Number::Fixed(1.5);
        let text: Vec<String> = recipe.problems().iter().map(ToString::to_string).collect();
        assert_eq!(text.len(), 5, "{text:?}");
        assert!(text[0].starts_with("field.width_px: -3 is out of range: expected 16 to 32768"), "{text:?}");
        assert!(text.iter().any(|t| t.starts_with("optics.sigma_xy_um: NaN")), "{text:?}");
        assert!(text.iter().any(|t| t.contains("above half of `nucleus.patch_um`")), "{text:?}");
    }

    #[test]
    fn counts_must_be_integers() {
        let mut recipe = Recipe::default();
        recipe.camera.bits = Number::Fixed(8.5);
        recipe.field.width_px = Number::Drawn {
            distribution: Distribution::Choice(vec![100.0, 100.5]),
            min: f64::NEG_INFINITY,
            max: f64::INFINITY,
        };
        recipe.debris.speckles.count = Number::uniform(0.5, 2.5).into();
        let text: Vec<String> = recipe.problems().iter().map(ToString::to_string).collect();
        assert_eq!(text, ["field.width_px: 100.5 is not an integer", "camera.bits: 8.5 is not an integer"]);
    }

    #[test]
    fn a_huge_image_and_an_unknown_version_are_refused() {
        let mut recipe = Recipe { version: 99, ..Recipe::default() };
        recipe.field.width_px = Number::Fixed(32_768.0);
        recipe.field.height_px = Number::Fixed(32_769.0 - 1.0);
        assert_eq!(recipe.problems().len(), 1, "{:?}", recipe.problems());
        recipe.field.height_px = Number::Fixed(32_769.0);
        assert_eq!(recipe.problems().len(), 3);
    }
}
