//! Recipes as TOML, with the documentation of the fields in the schema as comments.

use std::collections::BTreeMap;

use serde_json::Value;

use super::abundance::PER_MM2;
use super::diagnose::{Schema, Section};
use super::whole::Recipe;

const COMMENT_WIDTH: usize = 110;

/// The end of a commented recipe without conditions.
const CONDITIONS: &str = r#"
# Conditions of slides: numbers that differ together between slides. One entry is drawn for each slide, with the
# probability of its weight. Example:
# [[conditions]]
# weight = 1.0
# [conditions.numbers]
# "stain.field_nucleus" = 1.2
# "background.level" = { normal = [0.85, 0.01] }
"#;

impl Recipe {
    /// Returns the recipe as TOML, with the documentation of each field as a comment.
    ///
    /// # Panics
    /// Never: every recipe can be written as JSON.
    #[must_use]
    pub fn to_commented_toml(&self) -> String {
        let value = serde_json::to_value(self).expect("every recipe can be written as JSON");
        let mut out = String::from(
            "# A recipe of papsynth. Lengths are in micrometres, angles in degrees, absorbances decadic.\n\
             # Every number may be a distribution: { uniform = [low, high] }, { normal = [mean, sd] },\n\
             # { log_normal = [median, sd of the logarithm] } or { choice = [a, b, c] }, each with optional `min` and `max`.\n\
             # Counts are per field, or per mm² if written as { per_mm2 = 180 } or { per_mm2 = { uniform = [90, 270] } }.\n\n",
        );
        table(&mut out, "", &value, Schema::new().root());
        if self.conditions.is_empty() {
            out.push_str(CONDITIONS);
        }
        out
    }

    /// Returns the recipe as TOML without comments.
    ///
    /// # Panics
    /// Never: every recipe can be written as TOML.
    #[must_use]
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("every recipe can be written as TOML")
    }
}

/// Writes the fields of a table: values first, then tables.
fn table(out: &mut String, path: &str, value: &Value, section: Section<'_>) {
    let Some(fields) = value.as_object() else { return };
    let kind = fields.get("kind").and_then(Value::as_str);
    let is_list = |value: &Value| value.as_array().is_some_and(|items| items.iter().any(Value::is_object));
    let (tables, plain): (Vec<_>, Vec<_>) =
        fields.iter().partition(|(_, value)| is_toml_table(value) || is_list(value));
    for (name, value) in plain {
        match (name.as_str(), section.field(name, kind)) {
            ("kind", _) => choices(out, section),
            (_, Some(field)) => {
                comment(out, field.meaning().unwrap_or_default());
                choices(out, field);
            }
            (_, None) => {}
        }
        out.push_str(&format!("{} = {}\n", key(name), toml_value(value)));
    }
    for (name, value) in tables {
        let Some(field) = section.field(name, kind) else { continue };
        let inner = if path.is_empty() { key(name) } else { format!("{path}.{}", key(name)) };
        if let (Some(items), Some(field)) = (value.as_array(), field.items()) {
            out.push('\n');
            comment(out, field.meaning().unwrap_or_default());
            for item in items {
                out.push_str(&format!("[[{inner}]]\n"));
                table(out, &inner, item, field);
            }
            continue;
        }
        out.push('\n');
        comment(out, field.meaning().unwrap_or_default());
        out.push_str(&format!("[{inner}]\n"));
        table(out, &inner, value, field);
    }
}

/// Writes the words that a field accepts, or the kinds of a table, as comments.
fn choices(out: &mut String, section: Section<'_>) {
    for (word, meaning) in section.choices() {
        comment(out, &format!("  {word}: {meaning}"));
    }
}

/// Returns the key of a field in TOML, in quotes if necessary.
fn key(name: &str) -> String {
    let line = toml::to_string(&BTreeMap::from([(name, 0)])).expect("every name can be a key of TOML");
    line.strip_suffix(" = 0\n").unwrap_or(name).to_owned()
}

/// Returns whether a value of a recipe, as JSON, has its own `[table]` in TOML. Distributions and densities do not:
/// they are written on one line.
#[must_use]
pub fn is_toml_table(value: &Value) -> bool {
    const INLINE: [&str; 5] = ["uniform", "normal", "log_normal", "choice", PER_MM2];
    value.as_object().is_some_and(|map| !INLINE.iter().any(|name| map.contains_key(*name)))
}

/// Returns a value of a recipe, given as JSON, on one line of TOML.
#[must_use]
pub fn toml_value(value: &Value) -> String {
    match value {
        Value::Object(map) => {
            let inner: Vec<String> = map.iter().map(|(k, v)| format!("{} = {}", key(k), toml_value(v))).collect();
            format!("{{ {} }}", inner.join(", "))
        }
        Value::Array(items) => format!("[{}]", items.iter().map(toml_value).collect::<Vec<_>>().join(", ")),
        Value::String(text) => toml::Value::String(text.clone()).to_string(),
        other => other.to_string(),
    }
}

fn comment(out: &mut String, text: &str) {
    for paragraph in text.lines() {
        let indent = if paragraph.starts_with("  ") { "#   " } else { "# " };
        let mut line = String::from(indent);
        for word in paragraph.split_whitespace() {
            if line.chars().count() + word.chars().count() > COMMENT_WIDTH {
                out.push_str(line.trim_end());
                out.push('\n');
                line = String::from(if indent.len() > 2 { "#     " } else { "# " });
            }
            line.push_str(word);
            line.push(' ');
        }
        if line.trim_end() != "#" {
            out.push_str(line.trim_end());
            out.push('\n');
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_of_any_name_are_read_back() {
        for name in ["", "clue cell", "a.b", "say \"so\"", "line\nbreak", "#", "zellkern-größe"] {
            let mut recipe = Recipe::default();
            let cells = recipe.cells.values().next().unwrap().clone();
            recipe.cells.insert(name.to_owned(), cells);
            let again: Recipe =
                toml::from_str(&recipe.to_commented_toml()).unwrap_or_else(|e| panic!("{name:?}: {}", e.message()));
            assert_eq!(again.cells, recipe.cells, "{name:?}");
        }
    }

    #[test]
    fn every_field_has_its_meaning_above_it() {
        let text = Recipe::default().to_commented_toml();
        let mut commented = false;
        for line in text.lines() {
            let is_field = line.contains(" = ") && !line.starts_with('#');
            assert!(!is_field || commented, "no comment above `{line}`\n{text}");
            commented = line.starts_with('#');
        }
    }
}
