//! What a recipe must fulfil before anything is drawn from it.

mod imaging;

use super::{Layout, Number, RECIPE_VERSION, Recipe};
use crate::debris::MOST_PHASE_RAD;
use crate::error::Problem;

struct Check {
    problems: Vec<Problem>,
}

impl Check {
    fn number(&mut self, field: &str, number: &Number, low: f64, high: f64) {
        if let Some(message) = number.problem(low, high) {
            self.problems.push(Problem { field: field.to_owned(), message });
        }
    }

    fn add(&mut self, field: &str, message: String) {
        self.problems.push(Problem { field: field.to_owned(), message });
    }

    fn numbers(&mut self, section: &str, fields: &[(&str, &Number, f64, f64)]) {
        for (name, number, low, high) in fields {
            self.number(&format!("{section}.{name}"), number, *low, *high);
        }
    }

    /// Where something is counted, what is written out must be whole; what is drawn from a range is rounded.
    fn whole(&mut self, section: &str, fields: &[(&str, &Number)]) {
        for (name, number) in fields {
            if let Some(message) = number.fraction() {
                self.problems.push(Problem { field: format!("{section}.{name}"), message });
            }
        }
    }
}

pub(super) fn notes(recipe: &Recipe) -> Vec<Problem> {
    imaging::notes(recipe)
}

pub(super) fn problems(recipe: &Recipe) -> Vec<Problem> {
    let mut check = Check { problems: Vec::new() };
    if recipe.version != RECIPE_VERSION {
        check.problems.push(Problem {
            field: "version".to_owned(),
            message: format!(
                "{} is not a version of recipes that is known here; expected {RECIPE_VERSION}",
                recipe.version
            ),
        });
    }
    imaging::check(recipe, &mut check);
    layout(recipe, &mut check);
    cells(recipe, &mut check);
    debris(recipe, &mut check);
    scan(recipe, &mut check);
    check.problems
}

fn scan(recipe: &Recipe, check: &mut Check) {
    let scan = &recipe.scan;
    let sides = [
        ("width_px", scan.width_px, 64, 1_000_000),
        ("height_px", scan.height_px, 64, 1_000_000),
        ("frame_px", scan.frame_px, 128, 8192),
    ];
    for (name, side, low, high) in sides {
        if !(low..=high).contains(&side) {
            check.add(&format!("scan.{name}"), format!("{side} is outside {low} to {high}"));
        }
    }
    if !(0.0..=1.0).contains(&scan.shading_left) {
        check.add("scan.shading_left", format!("{} is outside 0 to 1", scan.shading_left));
    }
    if !(10.0..=2000.0).contains(&scan.reach_um) {
        check.add("scan.reach_um", format!("{} is outside 10 to 2000", scan.reach_um));
    }
    let deposit = &scan.deposit;
    check.numbers(
        "scan.deposit",
        &[
            ("x_um", &deposit.x_um, -1e6, 1e6),
            ("y_um", &deposit.y_um, -1e6, 1e6),
            ("radius_um", &deposit.radius_um, 1.0, 1e6),
            ("edge_um", &deposit.edge_um, 1.0, 1e5),
            ("unevenness", &deposit.unevenness, 0.0, 1.0),
            ("patch_um", &deposit.patch_um, 50.0, 1e5),
            ("outside", &deposit.outside, 0.0, 1.0),
        ],
    );
}

fn layout(recipe: &Recipe, check: &mut Check) {
    let slide = &recipe.slide;
    check.numbers(
        "slide",
        &[
            ("depth_um", &slide.depth_um, 0.0, 1000.0),
            ("relief_um", &slide.relief_um, 1.0, 10_000.0),
            ("median_um", &slide.median_um, 0.0, 1000.0),
            ("stacking_um", &slide.stacking_um, 0.0, 100.0),
            ("spacing_um", &slide.spacing_um, 0.0, 1000.0),
        ],
    );
    if !(1..=1_000_000).contains(&slide.fields) {
        check.add("slide.fields", format!("{} is outside 1 to 1000000", slide.fields));
    }
    match &recipe.layout {
        Layout::Uniform {} | Layout::Map { .. } => {}
        Layout::Clusters { count, radius_um, outside } => {
            check.numbers(
                "layout",
                &[("count", count, 1.0, 1e4), ("radius_um", radius_um, 1.0, 1e4), ("outside", outside, 0.0, 1.0)],
            );
            check.whole("layout", &[("count", count)]);
        }
        Layout::Swath { width_um, outside } => {
            check.numbers("layout", &[("width_um", width_um, 1.0, 1e4), ("outside", outside, 0.0, 1.0)]);
        }
        Layout::Labels { smooth_um, .. } => check.number("layout.smooth_um", smooth_um, 0.0, 1000.0),
    }
}

fn cells(recipe: &Recipe, check: &mut Check) {
    for (class, mix) in &recipe.cells {
        check.numbers(
            &format!("cells.{class}"),
            &[
                ("count", &mix.count, 0.0, 1e5),
                ("size", &mix.size, 0.1, 10.0),
                ("cytoplasm_stain", &mix.cytoplasm_stain, 0.0, 20.0),
                ("nucleus_stain", &mix.nucleus_stain, 0.0, 20.0),
            ],
        );
        check.whole(&format!("cells.{class}"), &[("count", &mix.count)]);
        check.numbers(
            &format!("cells.{class}.group"),
            &[("size", &mix.group.size, 1.0, 1000.0), ("distance", &mix.group.distance, 0.2, 3.0)],
        );
        check.whole(&format!("cells.{class}.group"), &[("size", &mix.group.size)]);
        let tints = &mix.tints;
        let weights = [
            ("cyanophilic", &tints.cyanophilic, 0.0, 1000.0),
            ("eosinophilic", &tints.eosinophilic, 0.0, 1000.0),
            ("orangeophilic", &tints.orangeophilic, 0.0, 1000.0),
        ];
        check.numbers(&format!("cells.{class}.tints"), &weights);
        if weights.iter().all(|(_, weight, ..)| weight.bounds()[1] <= 0.0) {
            check.add(&format!("cells.{class}.tints"), "no tint is left; expected one above 0".to_owned());
        }
    }
    let cytoplasm = &recipe.cytoplasm;
    check.numbers(
        "cytoplasm",
        &[
            ("excess", &cytoplasm.excess, 1.0, 2.0),
            ("corners", &cytoplasm.corners, 0.0, 1.0),
            ("notches", &cytoplasm.notches, 0.0, 20.0),
            ("tongues", &cytoplasm.tongues, 0.0, 20.0),
            ("wrinkles", &cytoplasm.wrinkles, 0.0, 100.0),
            ("wrinkle", &cytoplasm.wrinkle, 0.0, 5.0),
            ("wrinkle_um", &cytoplasm.wrinkle_um, 0.05, 5.0),
            ("endoplasm", &cytoplasm.endoplasm, 0.0, 2.0),
            ("clouds", &cytoplasm.clouds, 0.0, 2.0),
            ("clouds_um", &cytoplasm.clouds_um, 0.1, 100.0),
            ("flecks", &cytoplasm.flecks, 0.0, 5.0),
            ("flecks_threshold", &cytoplasm.flecks_threshold, 0.0, 0.999),
            ("cytoskeleton", &cytoplasm.cytoskeleton, 0.0, 2.0),
            ("grain", &cytoplasm.grain, 0.0, 2.0),
            ("wedge", &cytoplasm.wedge, 0.0, 1.0),
            ("granular", &cytoplasm.granular, 0.0, 1.0),
            ("granules", &cytoplasm.granules, 0.0, 1000.0),
            ("fray_um", &cytoplasm.fray_um, 0.0, 5.0),
            ("rim_um", &cytoplasm.rim_um, 0.0, 10.0),
            ("phase_rad", &cytoplasm.phase_rad, -MOST_PHASE_RAD, MOST_PHASE_RAD),
        ],
    );
    let folds = &cytoplasm.folds;
    check.numbers(
        "cytoplasm.folds",
        &[
            ("flap", &folds.flap, 0.0, 1.0),
            ("roll", &folds.roll, 0.0, 1.0),
            ("cigar", &folds.cigar, 0.0, 1.0),
            ("depth", &folds.depth, 0.02, 0.9),
            ("radius_um", &folds.radius_um, 0.1, 5.0),
        ],
    );
    let nucleus = &recipe.nucleus;
    check.numbers(
        "nucleus",
        &[
            ("donors", &nucleus.donors, 1.0, 64.0),
            ("patch_um", &nucleus.patch_um, 0.5, 20.0),
            ("overlap_um", &nucleus.overlap_um, 0.25, 10.0),
            ("d_max", &nucleus.d_max, 0.0, 10.0),
            ("restore_feather_um", &nucleus.restore_feather_um, 0.0, 5.0),
            ("pyknotic", &nucleus.pyknotic, 0.0, 1.0),
            ("wrinkled", &nucleus.wrinkled, 0.0, 1.0),
            ("rim", &nucleus.rim, 0.0, 2.0),
            ("dome", &nucleus.dome, 0.0, 1.0),
            ("edge_um", &nucleus.edge_um, 0.0, 3.0),
            ("clumping", &nucleus.clumping, 0.0, 1.0),
            ("wedge", &nucleus.wedge, 0.0, 1.0),
        ],
    );
    check.whole("nucleus", &[("donors", &nucleus.donors)]);
    let ([patch, _], [_, overlap]) = (nucleus.patch_um.bounds(), nucleus.overlap_um.bounds());
    if overlap > patch / 2.0 {
        check.problems.push(Problem {
            field: "nucleus.overlap_um".to_owned(),
            message: format!(
                "{} is more than half of `nucleus.patch_um` = {}; expected at most {}",
                nucleus.overlap_um,
                nucleus.patch_um,
                patch / 2.0
            ),
        });
    }
    let stain = &recipe.stain;
    check.numbers(
        "stain",
        &[
            ("slide_cytoplasm", &stain.slide_cytoplasm, 0.0, 20.0),
            ("slide_nucleus", &stain.slide_nucleus, 0.0, 20.0),
            ("field_cytoplasm", &stain.field_cytoplasm, 0.0, 20.0),
            ("field_nucleus", &stain.field_nucleus, 0.0, 20.0),
            ("field_texture", &stain.field_texture, 0.0, 20.0),
            ("slide_balance", &stain.slide_balance, 0.0, 2.0),
            ("field_balance", &stain.field_balance, 0.0, 2.0),
            ("cell_balance", &stain.cell_balance, 0.0, 2.0),
        ],
    );
    for (name, dyes) in [
        ("cyanophilic", &stain.cyanophilic),
        ("eosinophilic", &stain.eosinophilic),
        ("orangeophilic", &stain.orangeophilic),
        ("nucleus", &stain.nucleus),
        ("bacillus", &stain.bacillus),
        ("speckle", &stain.speckle),
    ] {
        for (dye, amount) in dyes.named() {
            check.number(&format!("stain.{name}.{dye}"), &Number::Fixed(amount), 0.0, 100.0);
        }
    }
}

fn debris(recipe: &Recipe, check: &mut Check) {
    recipe.debris.check(&mut |section, field, message| check.add(&format!("debris.{section}.{field}"), message));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recipe::Law;

    #[test]
    fn a_bad_field_is_named_with_its_value_and_what_would_do() {
        let mut recipe = Recipe::default();
        recipe.optics =
            crate::recipe::Optics::Gaussian { sigma_xy_um: Number::Fixed(f64::NAN), sigma_z_um_per_um: 0.25.into() };
        recipe.field.width_px = Number::Fixed(-3.0);
        recipe.background.scatter = Number::Fixed(0.95);
        recipe.nucleus.overlap_um = Number::Fixed(1.5);
        let text: Vec<String> = recipe.problems().iter().map(ToString::to_string).collect();
        assert_eq!(text.len(), 5, "{text:?}");
        assert!(text[0].starts_with("field.width_px: -3 is outside 16 to 32768"), "{text:?}");
        assert!(text.iter().any(|t| t.starts_with("optics.sigma_xy_um: NaN")), "{text:?}");
        assert!(text.iter().any(|t| t.contains("more than half of `nucleus.patch_um`")), "{text:?}");
    }

    #[test]
    fn what_is_counted_must_be_whole() {
        let mut recipe = Recipe::default();
        recipe.camera.bits = Number::Fixed(8.5);
        recipe.field.width_px =
            Number::Drawn { law: Law::Choice(vec![100.0, 100.5]), min: f64::NEG_INFINITY, max: f64::INFINITY };
        recipe.debris.speckles.count = Number::uniform(0.5, 2.5);
        let text: Vec<String> = recipe.problems().iter().map(ToString::to_string).collect();
        assert_eq!(text, ["field.width_px: 100.5 is not a whole number", "camera.bits: 8.5 is not a whole number"]);
    }

    #[test]
    fn a_huge_image_and_a_strange_version_are_refused() {
        let mut recipe = Recipe { version: 99, ..Recipe::default() };
        recipe.field.width_px = Number::Fixed(32_768.0);
        recipe.field.height_px = Number::Fixed(32_769.0 - 1.0);
        assert_eq!(recipe.problems().len(), 1, "{:?}", recipe.problems());
        recipe.field.height_px = Number::Fixed(32_769.0);
        assert_eq!(recipe.problems().len(), 3);
    }
}
