//! The matched recipe as TOML, with intervals as comments.

use papsynth::recipe::{CellMix, RECIPE_VERSION, Recipe, is_toml_table, toml_value};
use serde_json::Value;

use crate::fit::{Fit, Origin, ParameterFit};
use crate::parameter::Scale;
use crate::recipe::rounded_to;

/// Significant digits of values in comments.
const DIGITS: i32 = 3;

impl Fit {
    /// Returns the recipe as TOML, without default values, and with value, interval and origin of each parameter as
    /// comments. Each real field has a condition.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let json = |recipe: &Recipe| serde_json::to_value(recipe).unwrap_or_default();
        let mut out = self.heading();
        out.push_str(&format!("version = {RECIPE_VERSION}\n"));
        let (recipe, default) = (json(&self.recipe.without_conditions()), json(&Recipe::default()));
        self.table(&mut out, "", &recipe, &default);
        for (name, condition) in self.fields.iter().zip(&self.recipe.conditions) {
            // A name may hold a line break.
            let name: String = name.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
            out.push_str(&format!("\n# As in {name}\n[[conditions]]\n[conditions.numbers]\n"));
            for (path, value) in &condition.numbers {
                let value = serde_json::to_value(value).unwrap_or_default();
                out.push_str(&format!("{path:?} = {}\n", toml_value(&value)));
            }
        }
        out
    }

    fn heading(&self) -> String {
        let Self { fields, nuclei, distance, .. } = self;
        let mut out = format!(
            "# Matched to {} fields with {nuclei} nuclei. Numbers in brackets are 95 % intervals of the mean over fields.\n\
             # Distance of simulated fields from the real ones, in standard deviations between fields: {:.2} before, {:.2} after.\n\
             # Each slide has the conditions of one of the fields, with a spread around them: see the end.\n",
            fields.len(),
            distance.before,
            distance.after
        );
        if self.extended {
            out.push_str(
                "# The fields are fused from several focal planes (EDF): the initial recipe is that of a fusing scanner.\n",
            );
        }
        if self.colour {
            out.push_str(
                "# The dyes of nuclei and cytoplasm and the tints of cells have the mean colours of the fields.\n",
            );
        }
        let lost: Vec<&str> =
            self.parameters.iter().filter(|a| a.origin == Origin::NotVisible).map(|a| a.path).collect();
        if !lost.is_empty() {
            out.push_str("# Without visible influence on these fields, with the values of the initial recipe:\n");
            lost.iter().for_each(|path| out.push_str(&format!("#   {path}\n")));
        }
        out.push('\n');
        out
    }

    /// Writes the fields of a table that are fitted or differ from the default: values first, then subtables.
    fn table(&self, out: &mut String, path: &str, value: &Value, default: &Value) {
        let Some(fields) = value.as_object() else { return };
        let other_kind = fields.get("kind") != default.get("kind");
        let (tables, plain): (Vec<_>, Vec<_>) = fields
            .iter()
            .filter(|(name, _)| *name != "version" && *name != "conditions")
            .partition(|(_, v)| is_toml_table(v));
        let within = |name: &str| if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") };
        let mut lines = String::new();
        for (name, value) in plain.iter().filter(|(name, _)| *name != "kind") {
            let notes = self.notes(&within(name));
            if !notes.is_empty() || other_kind || default.get(name) != Some(value) {
                lines.push_str(&notes);
                lines.push_str(&format!("{name} = {}\n", toml_value(value)));
            }
        }
        // Without its header, an empty table would be read as the default.
        let empty = fields.is_empty() && value != default;
        if !lines.is_empty() || other_kind || empty {
            if !path.is_empty() {
                out.push_str(&format!("\n[{path}]\n"));
            }
            if let Some(kind) = fields.get("kind") {
                out.push_str(&format!("kind = {kind}\n"));
            }
            out.push_str(&lines);
        }
        for (name, value) in tables {
            let inner = within(name);
            // The default of a listed class is the default of all classes.
            let of_class = serde_json::to_value(CellMix::default()).unwrap_or_default();
            let default = if path == "cells" { &of_class } else { default.get(name).unwrap_or(&Value::Null) };
            self.table(out, &inner, value, default);
        }
    }

    /// Returns comments about the parameters of a field.
    fn notes(&self, path: &str) -> String {
        let fitted =
            self.parameters.iter().filter(|a| a.origin != Origin::NotVisible && a.fields().any(|f| is_at(&f, path)));
        fitted.map(|a| format!("# {}\n", a.note())).collect()
    }
}

impl ParameterFit {
    /// Returns the recipe fields of the parameter, with `*` for a class of cells.
    fn fields(&self) -> impl Iterator<Item = String> + '_ {
        let (fields, _) = self.path.split_once(':').unwrap_or((self.path, ""));
        let section = fields.split('.').next().unwrap_or_default();
        fields
            .split(", ")
            .map(move |field| if field.contains('.') { field.to_owned() } else { format!("{section}.{field}") })
    }

    /// Returns the number of the distribution: "median".
    fn what(&self) -> &str {
        self.path.split_once(": ").map_or("value", |(_, what)| what)
    }

    fn note(&self) -> String {
        let origin = match self.origin {
            Origin::Measured => "measured",
            Origin::Simulated => "simulated",
            Origin::NotVisible => "not visible",
        };
        let [value, low, high] = [self.value, self.interval[0], self.interval[1]].map(|v| rounded_to(v, DIGITS));
        let unit = if self.unit.is_empty() { String::new() } else { format!(" {}", self.unit) };
        let what = self.what();
        let spread = if self.spread > 0.0 {
            let sd = if self.parameter.prior().scale == Scale::Logarithmic { "log sd" } else { "sd" };
            format!(", {sd} between fields {}", rounded_to(self.spread, DIGITS))
        } else {
            String::new()
        };
        format!("{origin}: {what} {value}{unit} ({low} to {high}){spread}")
    }
}

/// Returns whether a path matches a field with `*` for a class.
fn is_at(field: &str, path: &str) -> bool {
    // The Gaussian optics of the paper use another field.
    let path = path.replace("sigma_xy_um", "extra_blur_um");
    let (a, b) = (field.split('.'), path.split('.'));
    a.clone().count() == b.clone().count() && a.zip(b).all(|(a, b)| a == "*" || a == b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distance::Distance;
    use crate::parameter::{PARAMETERS, Values};
    use crate::recipe::{Setting, matched};
    use papsynth::recipe::Preset;

    #[test]
    fn the_written_recipe_is_read_back() {
        for preset in Preset::ALL {
            let setting = Setting {
                base: preset.recipe(),
                size_px: [1280, 960],
                pixel_um: 0.33,
                bits: 8,
                extended: true,
                seek_pixel: false,
            };
            let values = Values::at(&[0.4; PARAMETERS.len()]);
            let mut other = Values::at(&[0.5; PARAMETERS.len()]);
            PARAMETERS.into_iter().for_each(|p| other.set_spread(p, 0.05));
            let parameters = PARAMETERS.into_iter().filter(|p| setting.seeks(*p)).map(|parameter| {
                let origin = if parameter.index() % 3 == 0 { Origin::NotVisible } else { Origin::Simulated };
                ParameterFit::new(parameter, origin, values.get(parameter))
            });
            let parameters: Vec<ParameterFit> = parameters.collect();
            let fitted =
                |p| parameters.iter().any(|a: &ParameterFit| a.parameter == p && a.origin == Origin::Simulated);
            let fit = Fit {
                recipe: matched(&setting, &values, &[values.clone(), other.clone()], fitted),
                parameters: parameters.clone(),
                distance: Distance { before: 3.0, after: 1.5 },
                statistics: Vec::new(),
                refinement: None,
                fields: vec!["a".into(), "b\nc".into()],
                nuclei: 200,
                simulated: 300,
                extended: true,
                colour: true,
            };
            let text = fit.to_toml();
            let read: Recipe = toml::from_str(&text).unwrap_or_else(|e| panic!("{preset:?}: {e}\n{text}"));
            assert_eq!(read, fit.recipe, "{preset:?}\n{text}");
            // Parameters of cells have no line in a recipe without cells.
            if fit.recipe.cells.is_empty() {
                continue;
            }
            for answer in fit.parameters.iter().filter(|a| a.origin == Origin::Simulated) {
                assert!(text.contains(&answer.note()), "{preset:?}: {}\n{text}", answer.note());
            }
        }
    }
}
