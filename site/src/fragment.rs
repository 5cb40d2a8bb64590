//! Links into the workbench of the site: the field of a command.

use std::path::Path;

use anyhow::{Context, Result, bail};
use serde_json::{Map, Value, json};

use crate::Input;

/// The page of the workbench.
const PAGE: &str = "workbench/index.html";

/// Preset of commands without one.
const DEFAULT: &str = "lbc";

/// A command `papsynth generate`, as far as the field depends on it.
struct Field<'a> {
    /// Options of the recipe, and the file.
    recipe: Vec<&'a str>,
    preset: &'a str,
    seed: &'a str,
    index: &'a str,
}

/// Returns the address of a field within the site: the page with a fragment as the page itself writes it.
///
/// `words` are those after `papsynth generate`. Paths among them start at `folder`.
pub(crate) fn address(input: &Input, folder: &Path, words: &[String]) -> Result<String> {
    let field = field(words)?;
    let recipe = |words: &[&str]| -> Result<Value> {
        let text = input.papsynth_in(folder, &[&["init"], words].concat())?;
        let table: toml::Table = text.parse().context("the output of papsynth init")?;
        Ok(serde_json::to_value(table)?)
    };
    let (mut path, mut found) = (Vec::new(), Vec::new());
    differences(&recipe(&["--preset", field.preset])?, &recipe(&field.recipe)?, &mut path, &mut found);
    let mut fragment = form_urlencoded::Serializer::new(String::new());
    fragment.extend_pairs([("p", field.preset), ("s", field.seed), ("i", field.index)]);
    if !found.is_empty() {
        fragment.append_pair("d", &Value::Array(found).to_string());
    }
    Ok(format!("{PAGE}#{}", fragment.finish()))
}

/// Returns what a field depends on.
fn field(words: &[String]) -> Result<Field<'_>> {
    let mut field = Field { recipe: Vec::new(), preset: DEFAULT, seed: "0", index: "0" };
    let mut words = words.iter().map(String::as_str);
    while let Some(word) = words.next() {
        if !word.starts_with('-') {
            field.recipe.push(word);
            continue;
        }
        // All options of the commands on the site but this one have a value.
        if word == "--quiet" {
            continue;
        }
        let value = words.next().with_context(|| format!("{word} has no value"))?;
        match word {
            "--preset" => {
                field.preset = value;
                field.recipe.extend([word, value]);
            }
            "--set" | "--with" | "--camera" => field.recipe.extend([word, value]),
            "--seed" => field.seed = value,
            "--range" => field.index = value.split("..").next().unwrap_or_default(),
            "--model" => bail!("the workbench has no models: {value}"),
            _ => (),
        }
    }
    Ok(field)
}

/// Appends paths and values in which a recipe differs from another; as `differences` of the page in recipe.js.
fn differences(base: &Value, now: &Value, path: &mut Vec<String>, found: &mut Vec<Value>) {
    match (section(base), section(now)) {
        (Some(old), Some(new)) if base["kind"] == now["kind"] && old.keys().all(|key| new.contains_key(key)) => {
            for (key, value) in new {
                path.push(key.clone());
                match old.get(key) {
                    Some(base) => differences(base, value, path, found),
                    None => found.push(json!([path, value])),
                }
                path.pop();
            }
        }
        _ if base != now => found.push(json!([path, now])),
        _ => (),
    }
}

/// Returns the fields of a value that has its own fields, unlike a distribution or a density.
fn section(value: &Value) -> Option<&Map<String, Value>> {
    const NUMBERS: [&str; 5] = ["uniform", "normal", "log_normal", "choice", "per_mm2"];
    value.as_object().filter(|table| !NUMBERS.iter().any(|name| table.contains_key(*name)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_depends_on_recipe_seed_and_index() {
        let words = shlex::split("mine.toml --set 'a={ uniform = [1, 2] }' --frames 1 --seed 7 --range 3..4 --out x");
        let words = words.unwrap();
        let field = field(&words).unwrap();
        assert_eq!(field.recipe, ["mine.toml", "--set", "a={ uniform = [1, 2] }"]);
        assert_eq!((field.preset, field.seed, field.index), ("lbc", "7", "3"));
    }

    #[test]
    fn differences_are_paths_and_values() {
        let base =
            json!({"optics": {"kind": "x", "na": 1}, "debris": {"dust": {"count": {"per_mm2": 2}}}, "cells": {}});
        let now =
            json!({"optics": {"kind": "y"}, "debris": {"dust": {"count": {"per_mm2": 3}}}, "cells": {"a": {"n": 1}}});
        let mut found = Vec::new();
        differences(&base, &now, &mut Vec::new(), &mut found);
        let expected = json!([
            [["optics"], {"kind": "y"}],
            [["debris", "dust", "count"], {"per_mm2": 3}],
            [["cells", "a"], {"n": 1}],
        ]);
        assert_eq!(Value::Array(found), expected);
    }
}
