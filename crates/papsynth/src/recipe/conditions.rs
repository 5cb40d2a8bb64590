//! Conditions of slides: numbers of a recipe that differ together between slides.

use std::borrow::Cow;
use std::collections::BTreeMap;

use super::abundance::Abundance;
use super::number::Number;
use super::section::{Bounds, Declared, Part, Value, section, within};
use super::whole::Recipe;
use crate::error::InvalidField;
use crate::key::Key;
use crate::random;

section! {
    /// Conditions of some slides: values of numbers of the recipe.
    pub struct Condition {
        /// Weight: the fraction of slides with these conditions is the weight over the sum of all weights.
        weight: f64 = 1.0, 0..=1000000;
        /// Values by the path of the number, as in `"stain.field_nucleus" = 1.2`. They replace those of the recipe,
        /// and may be distributions.
        numbers: Numbers;
    }
}

/// Values of numbers, by their path in the recipe.
pub type Numbers = BTreeMap<String, Abundance>;

impl Part for Numbers {}

/// The conditions of slides.
pub type Conditions = Vec<Condition>;

impl Part for Conditions {
    fn list<'a>(&'a self, path: &str, bounds: Option<Bounds>, found: &mut Vec<Declared<'a>>) {
        for (index, condition) in self.iter().enumerate() {
            condition.list(&within(path, &index.to_string()), bounds, found);
        }
    }
}

/// A number of a recipe that can be changed.
pub(crate) enum NumberMut<'a> {
    Real(&'a mut Number),
    Abundance(&'a mut Abundance),
}

/// Beginnings of the paths of numbers that all images of a data set share.
const SHARED: [&str; 10] = [
    "field.",
    "scan.",
    "focus.planes",
    "camera.bits",
    "camera.pixel_um",
    "camera.binning_px",
    "nucleus.donors",
    "nucleus.patch_um",
    "nucleus.overlap_um",
    "nucleus.d_max",
];

impl Recipe {
    /// Returns the recipe with the values of one of its conditions, and without conditions. Values that do not fit are
    /// left out: see [`Recipe::problems`].
    ///
    /// # Panics
    /// If there is no such condition.
    #[must_use]
    pub fn with_condition(&self, index: usize) -> Self {
        let mut recipe = self.without_conditions();
        for (path, value) in &self.conditions[index].numbers {
            // Invalid paths are reported by `problems`.
            let _ = recipe.set(path, value);
        }
        recipe
    }

    /// Returns the recipe without conditions.
    #[must_use]
    pub fn without_conditions(&self) -> Self {
        let mut recipe = Self { version: self.version, ..Self::default() };
        // There may be thousands of conditions, which need not be copied.
        recipe.replace(self, |section| section != "conditions");
        recipe
    }

    /// Removes numbers from all conditions, so that those of the recipe hold: all whose path is `changed`.
    pub fn clear_conditions(&mut self, changed: impl Fn(&str) -> bool) {
        for condition in &mut self.conditions {
            condition.numbers.retain(|path, _| !changed(path));
        }
    }

    /// Returns the numbers that differ from those of another recipe, as those of a condition of the other recipe. Other
    /// differences are ignored.
    #[must_use]
    pub fn numbers_unlike(&self, other: &Self) -> Numbers {
        let of_other = other.numbers();
        let differ = |number: &Declared<'_>| {
            let same = of_other.iter().find(|o| o.path == number.path);
            same.is_some_and(|same| same.value != number.value)
        };
        let abundance = |value: Value<'_>| match value {
            Value::Real(number) => Some(Abundance::PerField(number.into_owned())),
            Value::Density(number) => Some(Abundance::PerMm2(number.clone())),
            Value::Whole(_) => None,
        };
        let changed = self.numbers().into_iter().filter(differ);
        changed.filter_map(|number| Some((number.path, abundance(number.value)?))).collect()
    }

    /// Sets a number that may differ between slides.
    fn set(&mut self, path: &str, value: &Abundance) -> Result<(), String> {
        if SHARED.iter().any(|shared| path.starts_with(shared)) {
            return Err("all images of a recipe share this number; expected another number".to_owned());
        }
        match (self.number_mut(path), value) {
            (Some(NumberMut::Real(number)), Abundance::PerField(value)) => number.clone_from(value),
            (Some(NumberMut::Abundance(abundance)), value) => abundance.clone_from(value),
            (Some(NumberMut::Real(_)), value) => return Err(format!("{value} is a density; expected a number")),
            (None, _) => return Err("the recipe has no number of this path".to_owned()),
        }
        Ok(())
    }

    /// Returns the index of the condition of a slide; `None` if the recipe has no conditions.
    ///
    /// Conditions are evenly spread: among any consecutive slides, each is about as frequent as its weight says. The
    /// slides are points of an additive recurrence with the golden ratio, from a random point on (Kuipers and
    /// Niederreiter, *Uniform Distribution of Sequences*, 1974, section 2.3).
    #[must_use]
    pub fn condition_of_slide(&self, seed: u64, slide: u64) -> Option<usize> {
        /// (√5 − 1)/2, times 2⁶⁴.
        const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;
        let first = random::uniform(&mut Key { seed, index: 0 }.stream("slides", 0, "conditions"));
        let moved = (slide.wrapping_mul(GOLDEN) >> 11) as f64 / (1_u64 << 53) as f64;
        let sum: f64 = self.conditions.iter().map(|condition| condition.weight).sum();
        let mut rest = sum * (first + moved).fract();
        let weights = self.conditions.iter().enumerate().filter(|(_, condition)| condition.weight > 0.0);
        let mut found = None;
        for (index, condition) in weights {
            found = Some(index);
            rest -= condition.weight;
            if rest < 0.0 {
                break;
            }
        }
        found
    }

    /// Returns the recipe under one of its conditions, if any.
    pub(crate) fn under(&self, condition: Option<usize>) -> Cow<'_, Self> {
        match condition {
            Some(index) => Cow::Owned(self.with_condition(index)),
            None => Cow::Borrowed(self),
        }
    }

    /// Returns the recipe of each condition; the recipe itself if there are no conditions.
    pub fn each_condition(&self) -> impl Iterator<Item = Cow<'_, Self>> {
        let alone = self.conditions.is_empty().then_some(Cow::Borrowed(self));
        alone.into_iter().chain((0..self.conditions.len()).map(|index| Cow::Owned(self.with_condition(index))))
    }

    /// Returns the invalid fields of all conditions.
    pub(super) fn problems_of_conditions(&self) -> Vec<InvalidField> {
        let mut problems = Vec::new();
        let mut add = |field: String, message: String| problems.push(InvalidField { field, message });
        let plain = self.without_conditions();
        let known = plain.problems();
        for (index, Condition { numbers, .. }) in self.conditions.iter().enumerate() {
            let at = format!("conditions.{index}");
            let mut recipe = plain.clone();
            for (path, value) in numbers {
                if let Err(message) = recipe.set(path, value) {
                    add(format!("{at}.numbers.{path}"), message);
                }
            }
            for problem in recipe.problems().into_iter().filter(|problem| !known.contains(problem)) {
                add(format!("{at}.numbers.{}", problem.field), problem.message);
            }
        }
        if !self.conditions.is_empty() && self.conditions.iter().all(|condition| condition.weight <= 0.0) {
            add("conditions".to_owned(), "all weights are 0; expected at least one above 0".to_owned());
        }
        problems
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Model;
    use crate::scene;

    const TEXT: &str = r#"
        slide.fields_per_slide = 3
        [[conditions]]
        weight = 3
        [conditions.numbers]
        "stain.field_nucleus" = 0.8
        "cells.intermediate.count" = { per_mm2 = 20 }
        [[conditions]]
        [conditions.numbers]
        "stain.field_nucleus" = { log_normal = [1.3, 0.05] }
        "background.level" = 0.8
    "#;

    fn recipe() -> Recipe {
        Recipe::from_toml(TEXT).unwrap()
    }

    #[test]
    fn a_field_is_that_of_the_recipe_with_the_values_of_its_condition() {
        let (recipe, model) = (recipe(), Model::builtin());
        assert_eq!(recipe.problems(), []);
        for index in 0..9 {
            let key = Key { seed: 5, index };
            let mut found = scene::draw(&recipe, &model, None, key).unwrap();
            let condition = found.condition.take().unwrap();
            assert_eq!(Some(condition), recipe.condition_of_slide(5, index / 3));
            assert_eq!(found, scene::draw(&recipe.with_condition(condition), &model, None, key).unwrap());
        }
    }

    #[test]
    fn numbers_unlike_those_of_another_recipe_make_a_condition() {
        let recipe = recipe();
        let base = recipe.without_conditions();
        for (index, condition) in recipe.conditions.iter().enumerate() {
            assert_eq!(recipe.with_condition(index).numbers_unlike(&base), condition.numbers);
        }
        assert_eq!(base.numbers_unlike(&base), Numbers::new());
    }

    #[test]
    fn conditions_are_as_frequent_as_their_weights() {
        let recipe = recipe();
        for seed in 0..20 {
            for slides in [0..8, 5..45, 900..1300, u64::MAX - 401..u64::MAX - 1] {
                let expected = (slides.end - slides.start) / 4;
                let second = slides.filter(|slide| recipe.condition_of_slide(seed, *slide) == Some(1)).count() as u64;
                assert!(second.abs_diff(expected) <= 2, "{second}, not {expected}");
            }
        }
        assert_eq!(Recipe::default().condition_of_slide(1, 0), None);
    }

    #[test]
    fn invalid_conditions_are_reported_with_their_place() {
        let mut recipe = recipe();
        for (path, value) in [
            ("stain.field_nucleus", Abundance::from(-1.0)),
            ("background.texture", 0.4.into()),
            ("background.level", 0.3.into()),
            ("field.width_px", 100.0.into()),
            ("stain.violet", 1.0.into()),
            ("slide.depth_um", Abundance::per_mm2(3.0)),
            ("cells.giant.count", 1.0.into()),
        ] {
            recipe.conditions[1].numbers.insert(path.to_owned(), value);
        }
        recipe.conditions[0].weight = -1.0;
        let text: Vec<String> = recipe.problems().iter().map(ToString::to_string).collect();
        for beginning in [
            "conditions.0.weight: -1 is out of range",
            "conditions.1.numbers.stain.field_nucleus: -1 is out of range",
            "conditions.1.numbers.background.texture: 0.4 is not below `background.level`",
            "conditions.1.numbers.field.width_px: all images of a recipe share this number",
            "conditions.1.numbers.stain.violet: the recipe has no number of this path",
            "conditions.1.numbers.slide.depth_um: { per_mm2 = 3 } is a density",
            "conditions.1.numbers.cells.giant.count: the recipe has no number of this path",
        ] {
            assert!(text.iter().any(|line| line.starts_with(beginning)), "{beginning}: {text:#?}");
        }
        assert_eq!(text.len(), 7, "{text:#?}");
        recipe.conditions.truncate(1);
        recipe.conditions[0].weight = 0.0;
        assert!(recipe.problems()[0].to_string().starts_with("conditions: all weights are 0"));
    }

    #[test]
    fn errors_in_the_text_of_a_condition_have_their_place() {
        use super::super::diagnose::{find, read};
        let unquoted = TEXT.replacen("\"stain.field_nucleus\"", "stain.field_nucleus", 1);
        let errors = read(&unquoted).unwrap_err();
        assert_eq!(errors.len(), 1, "{errors:?}");
        let help = errors[0].help.as_deref();
        assert_eq!(help, Some("write the path as one key in quotes: \"stain.field_nucleus\""));
        let path = ["conditions", "1", "numbers", "background", "level"].map(str::to_owned);
        assert_eq!(&TEXT[find(TEXT, &path).unwrap()], "0.8");
        let errors = read(&TEXT.replace("weight = 3", "weight = \"3\"")).unwrap_err();
        assert!(errors[0].message.starts_with("conditions.0.weight: expected a number"), "{errors:?}");
    }

    #[test]
    fn conditions_are_written_and_read_back() {
        let recipe = recipe();
        assert_eq!(Recipe::from_toml(&recipe.to_toml()).unwrap(), recipe);
        let text = recipe.to_commented_toml();
        assert_eq!(super::super::diagnose::read(&text).unwrap(), recipe, "{text}");
    }
}
