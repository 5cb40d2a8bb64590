//! Tests that each number of a recipe is declared once, and that all else is generated.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::*;

/// Minimum number of declared numbers: fewer mean that a section is not listed.
const LEAST: usize = 235;

/// Returns recipes that together have every form of every section.
fn recipes() -> [Recipe; 3] {
    let mut paper = Preset::Paper2015.recipe();
    paper.layout = Layout::Band(Band::default());
    let colour = Recipe {
        light: LightSection::Colour(Colour::default()),
        layout: Layout::Labels(Labels { path: "labels.png".to_owned(), ..Labels::default() }),
        ..Recipe::default()
    };
    [Recipe::default(), paper, colour]
}

/// Returns the recipe with another value at a path, if the type of the field accepts it.
fn with(recipe: &Recipe, path: &str, value: f64) -> Option<Recipe> {
    let mut whole = serde_json::to_value(recipe).unwrap();
    let place = whole.pointer_mut(&format!("/{}", path.replace('.', "/"))).unwrap();
    *place = if value.fract() == 0.0 { json!(value as i64) } else { json!(value) };
    serde_json::from_value(whole).ok()
}

/// Returns the schemas of a field, one for each form of its section.
fn schemas_of<'s>(root: &'s Value, path: &str) -> Vec<&'s Value> {
    let resolve = |schema: &'s Value| match schema.get("$ref").and_then(Value::as_str) {
        Some(name) => root.pointer(name.trim_start_matches('#')).unwrap(),
        None => schema,
    };
    path.split('.').fold(vec![root], |found, name| {
        let forms = found.into_iter().map(resolve).flat_map(|schema| {
            let others = schema.get("oneOf").and_then(Value::as_array).into_iter().flatten();
            std::iter::once(schema).chain(others)
        });
        let named = |form: &'s Value| {
            form.get("properties").and_then(|fields| fields.get(name)).or_else(|| form.get("additionalProperties"))
        };
        forms.filter_map(named).filter(|schema| schema.is_object()).collect()
    })
}

/// Appends the names of all fields with bounds in the schema.
fn bounded<'s>(schema: &'s Value, found: &mut BTreeSet<&'s str>) {
    for (name, inner) in schema.as_object().into_iter().flatten() {
        if name == "properties" {
            let fields = inner.as_object().into_iter().flatten();
            found.extend(fields.filter(|(_, field)| field.get("maximum").is_some()).map(|(name, _)| name.as_str()));
        }
        bounded(inner, found);
    }
    schema.as_array().into_iter().flatten().for_each(|inner| bounded(inner, found));
}

#[test]
fn schema_text_and_check_follow_from_a_declaration() {
    let schema = Recipe::schema();
    let mut seen = BTreeSet::new();
    for recipe in recipes() {
        let text: toml::Table = toml::from_str(&recipe.to_commented_toml()).unwrap();
        for number in recipe.numbers() {
            let (path, section::Bounds { low, high, whole }) = (&number.path, number.bounds);
            if !seen.insert(path.clone()) {
                continue;
            }
            let says = |schema: &&Value| {
                let bound = |name: &str| schema.get(name).and_then(Value::as_f64);
                let about = schema.get("description").and_then(Value::as_str).unwrap_or_default();
                bound("minimum") == Some(low)
                    && bound("maximum") == Some(high)
                    && about.contains(&format!("From {low} to {high}"))
            };
            assert!(schemas_of(&schema, path).iter().any(says), "{path} in the schema");
            let mut names = path.split('.');
            let first = text.get(names.next().unwrap());
            assert!(names.try_fold(first.unwrap(), |table, name| table.get(name)).is_some(), "{path} in the text");

            let is_integer = matches!(number.value, section::Value::Whole(_));
            let step = |bound: f64| if whole || is_integer { 1.0 } else { 1e-9 * bound.abs().max(1.0) };
            // Beyond 2⁵³ the next representable integer is two larger.
            let above = (high + step(high)).max(high.next_up());
            for (value, fits) in [(low - step(low), false), (above, false), (low, true), (high, true)] {
                let Some(changed) = with(&recipe, path, value) else {
                    assert!(!fits, "{path} cannot be {value}");
                    continue;
                };
                let is_reported =
                    changed.problems().iter().any(|p| p.field == *path && p.message.contains("is out of range"));
                assert_eq!(is_reported, !fits, "{path} = {value}");
            }
            let half = with(&recipe, path, low + 0.5);
            let is_reported = half.is_none_or(|r| r.problems().iter().any(|p| p.message.contains("is not an integer")));
            assert_eq!(is_reported, whole || is_integer, "{path} and a half");
        }
    }
    assert!(seen.len() >= LEAST, "{} numbers", seen.len());
    let mut fields = BTreeSet::new();
    bounded(&schema, &mut fields);
    let names = seen.iter().filter_map(|path| path.split('.').next_back());
    // The weight of a condition, which is in a list, has a test of its own.
    assert_eq!(fields, names.chain(["weight"]).collect(), "no other has bounds");
}

/// Appends the sources of the crate without their tests.
fn sources(folder: &Path, found: &mut Vec<(PathBuf, String)>) {
    for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if entry.is_dir() {
            sources(&entry, found);
        } else if !entry.ends_with("tests.rs") {
            let text = fs::read_to_string(&entry).unwrap();
            let code = text.split("#[cfg(test)]").next().unwrap_or_default().to_owned();
            found.push((entry, code));
        }
    }
}

#[test]
fn a_number_is_declared_in_one_place() {
    let mut files = Vec::new();
    sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &mut files);
    for (file, code) in &files {
        if file.ends_with("recipe/check.rs") {
            let is_range = |line: &&str| {
                let ends = line.split_once(" to ");
                let digit = |c: Option<char>| c.is_some_and(|c| c.is_ascii_digit());
                line.contains("..=") || ends.is_some_and(|(a, b)| digit(a.chars().last()) && digit(b.chars().next()))
            };
            assert_eq!(code.lines().find(is_range), None, "a range in {}", file.display());
            continue;
        }
        // Errors of other stages contain the field that they are about.
        // Scenes have wider ranges of their own.
        let is_scene_check = file.ends_with("scene/check.rs");
        if is_scene_check || !["scene", "debris"].iter().any(|stage| file.iter().any(|part| part == *stage)) {
            continue;
        }
        for number in recipes().iter().flat_map(Recipe::numbers) {
            let is_named = code.contains(&format!("\"{}\"", number.path));
            assert!(!is_named, "{} repeats `{}`", file.display(), number.path);
        }
    }
}
