//! The reference of recipes, made from the JSON schema: one page per section, one anchor per field.

use std::collections::BTreeSet;

use anyhow::{Context, Result};
use serde_json::Value;

use crate::Input;
use crate::page::{Group, Heading, Page, escape};

/// Returns a page for each section, and the page that lists them.
pub(crate) fn pages(input: &Input) -> Result<Vec<Page>> {
    let schema: Value = serde_json::from_str(&input.papsynth(&["schema"])?).context("the schema of recipes")?;
    let sections = schema["properties"].as_object().context("the schema has no sections")?;
    let (mut pages, mut list) = (Vec::new(), String::new());
    let mut table = String::from("| section | |\n|---|---|\n");
    for (name, node) in sections.iter().filter(|(name, _)| *name != "version") {
        let mut section =
            Section { schema: &schema, html: String::new(), anchors: BTreeSet::new(), fields: Vec::new() };
        let node = section.resolved(node);
        section.walk(&node, name);
        let text = format!("# The section `{name}`\n\n{}\n\n{}", described(&node), section.html);
        let mut page = Page::new(format!("recipe/{name}.html"), Group::Recipe, format!("[{name}]"), text);
        page.headings = section.fields;
        table += &format!("| [`{name}`]({name}.html) | {} |\n", described(&node));
        list += &page.headings.iter().map(|field| link(name, field)).collect::<String>();
        pages.push(page);
    }
    let introduction = input.read("site/pages/recipe.md")?;
    let text =
        format!("{introduction}\n## Sections\n\n{table}\n## All fields\n\n<ul class=\"columns\">\n{list}</ul>\n");
    pages.insert(0, Page::new("recipe/index.html", Group::Recipe, "Recipes", text));
    Ok(pages)
}

fn link(section: &str, field: &Heading) -> String {
    let text = escape(&field.text);
    format!("<li><a href=\"{section}.html#{}\"><code>{text}</code></a></li>\n", field.anchor)
}

/// The page of a section.
struct Section<'a> {
    schema: &'a Value,
    html: String,
    anchors: BTreeSet<String>,
    /// Names of the fields and of parts of the section.
    fields: Vec<Heading>,
}

impl Section<'_> {
    /// Returns a schema with the definition that it refers to. Its own keywords replace those of the definition.
    fn resolved(&self, node: &Value) -> Value {
        let Some(name) = node["$ref"].as_str().and_then(|path| path.rsplit('/').next()) else { return node.clone() };
        let mut merged = self.schema["$defs"][name].clone();
        if let (Some(merged), Some(own)) = (merged.as_object_mut(), node.as_object()) {
            merged.insert("definition".to_owned(), name.into());
            let own = own.iter().filter(|(keyword, _)| *keyword != "$ref");
            merged.extend(own.map(|(keyword, value)| (keyword.clone(), value.clone())));
        }
        merged
    }

    /// Writes the fields of a section or of a part of it. `path` is its name, such as `debris.leukocytes`.
    fn walk(&mut self, node: &Value, path: &str) {
        if let Some(variants) = node["oneOf"].as_array() {
            for variant in variants {
                self.variant(variant, path);
            }
        } else if let Some(fields) = node["properties"].as_object() {
            self.all(fields, path, "");
        } else if node["items"].is_object() {
            let inner = self.resolved(&node["items"]);
            self.walk(&inner, path);
        } else if node["additionalProperties"].is_object() {
            let inner = self.resolved(&node["additionalProperties"]);
            self.html += "<p>NAME stands for the name of a class.</p>\n";
            self.walk(&inner, &format!("{path}.NAME"));
        }
    }

    /// Writes one form of a section whose other fields depend on the value of one field.
    fn variant(&mut self, variant: &Value, path: &str) {
        let Some(fields) = variant["properties"].as_object() else { return };
        let tag = fields.iter().find_map(|(name, node)| Some((name, node["const"].as_str()?)));
        let (tag, value) = tag.map_or(("", ""), |(name, value)| (name.as_str(), value));
        let title = format!("{path}.{tag} = \"{value}\"");
        let anchor = self.anchor(&format!("{path}.{tag}-{value}"), "");
        self.html += &format!("<h2 id=\"{anchor}\"><code>{}</code></h2>\n{}", escape(&title), paragraph(variant));
        self.fields.push(Heading { anchor, text: title, meaning: described(variant) });
        self.all(fields, path, value);
    }

    /// Writes fields: first the numbers and choices, then the parts.
    fn all(&mut self, fields: &serde_json::Map<String, Value>, path: &str, variant: &str) {
        let fields = fields.iter().filter(|(_, node)| node["const"].is_null());
        let fields: Vec<(String, Value)> = fields.map(|(name, node)| (name.clone(), self.resolved(node))).collect();
        let (parts, values): (Vec<_>, Vec<_>) = fields.iter().partition(|(_, node)| is_part(node));
        for (name, node) in values {
            self.field(node, &format!("{path}.{name}"), variant);
        }
        for (name, node) in parts {
            let path = format!("{path}.{name}");
            let anchor = self.anchor(&path, variant);
            self.html += &format!("<h2 id=\"{anchor}\"><code>{}</code></h2>\n{}", escape(&path), paragraph(node));
            self.fields.push(Heading { anchor, text: path.clone(), meaning: described(node) });
            self.walk(node, &path);
        }
    }

    fn field(&mut self, node: &Value, path: &str, variant: &str) {
        let anchor = self.anchor(path, variant);
        let (meaning, range) = meaning_and_range(node);
        let heading = Heading { anchor: anchor.clone(), text: path.to_owned(), meaning: meaning.clone() };
        self.fields.push(heading);
        let mut facts = vec![kind(node).to_owned()];
        facts.extend(range.map(|range| escape(&range)));
        facts.push(match node.get("default") {
            Some(value) => format!("default <code>{}</code>", escape(&toml(value))),
            None => "required".to_owned(),
        });
        self.html += &format!(
            "<section class=\"field\" id=\"{anchor}\">\n<h3><a href=\"#{anchor}\"><code>{}</code></a></h3>\n<p>{}</p>\n\
             <p class=\"facts\">{}</p>\n{}</section>\n\n",
            escape(path),
            inline(&meaning),
            facts.join(" · "),
            choices(node)
        );
    }

    /// Returns an anchor that the page does not have yet.
    fn anchor(&mut self, path: &str, variant: &str) -> String {
        let plain: String = path.chars().filter(|letter| letter.is_alphanumeric() || "._-".contains(*letter)).collect();
        let mut anchor = plain.clone();
        if self.anchors.contains(&anchor) {
            anchor = format!("{plain}-{variant}");
        }
        while !self.anchors.insert(anchor.clone()) {
            anchor.push('-');
        }
        anchor
    }
}

/// Returns whether a field is a part of a section, with fields of its own.
fn is_part(node: &Value) -> bool {
    let has_fields = node["properties"].is_object();
    let is_number = matches!(node["definition"].as_str(), Some("Number" | "Abundance"));
    let has_forms =
        node["oneOf"].as_array().is_some_and(|forms| forms.iter().any(|form| form["properties"].is_object()));
    !is_number && (has_fields || has_forms)
}

fn kind(node: &Value) -> &'static str {
    match (node["definition"].as_str(), node["type"].as_str()) {
        (Some("Number"), _) => "number or distribution",
        (Some("Abundance"), _) => "number or distribution, or a density per mm²",
        _ if node["oneOf"].is_array() || node["enum"].is_array() => "choice",
        (_, Some("integer")) => "whole number",
        (_, Some("number")) => "number",
        (_, Some("string")) => "text",
        (_, Some("array")) => "list",
        (_, Some("object")) => "table",
        _ => "value",
    }
}

/// Separates the last sentence of a description if it states range and unit.
fn meaning_and_range(node: &Value) -> (String, Option<String>) {
    let text = node["description"].as_str().unwrap_or_default();
    match text.rsplit_once('\n').filter(|(_, last)| last.starts_with("From ")) {
        Some((meaning, last)) => (one_line(meaning), Some(last.trim_end_matches('.').replacen("From", "from", 1))),
        None => (one_line(text), None),
    }
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn described(node: &Value) -> String {
    one_line(node["description"].as_str().unwrap_or_default())
}

fn paragraph(node: &Value) -> String {
    let text = described(node);
    if text.is_empty() { text } else { format!("<p>{}</p>\n", inline(&text)) }
}

/// Returns the HTML of a line with code between backticks.
fn inline(text: &str) -> String {
    let parts = text.split('`').enumerate().map(|(at, part)| match at % 2 {
        0 => escape(part),
        _ => format!("<code>{}</code>", escape(part)),
    });
    parts.collect()
}

fn choices(node: &Value) -> String {
    let mut rows = String::new();
    for form in node["oneOf"].as_array().into_iter().flatten() {
        if let Some(value) = form["const"].as_str() {
            rows += &format!("<dt><code>\"{}\"</code></dt><dd>{}</dd>\n", escape(value), inline(&described(form)));
        }
    }
    for value in node["enum"].as_array().into_iter().flatten().chain(
        node["oneOf"].as_array().into_iter().flatten().flat_map(|form| form["enum"].as_array().into_iter().flatten()),
    ) {
        rows += &format!("<dt><code>{}</code></dt><dd></dd>\n", escape(&toml(value)));
    }
    if rows.is_empty() { rows } else { format!("<dl>\n{rows}</dl>\n") }
}

/// Returns a value as TOML on one line.
fn toml(value: &Value) -> String {
    match value {
        Value::Null => "none".to_owned(),
        Value::Number(number) => number.as_f64().map_or_else(|| number.to_string(), |number| number.to_string()),
        Value::Array(values) => format!("[{}]", values.iter().map(toml).collect::<Vec<_>>().join(", ")),
        Value::Object(fields) => {
            let fields = fields.iter().map(|(name, value)| format!("{name} = {}", toml(value)));
            format!("{{ {} }}", fields.collect::<Vec<_>>().join(", "))
        }
        Value::String(_) | Value::Bool(_) => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn ranges_are_separated_from_meanings() {
        let node = json!({ "description": "Size of\na grain.\nFrom 0 to 2 µm." });
        assert_eq!(meaning_and_range(&node), ("Size of a grain.".to_owned(), Some("from 0 to 2 µm".to_owned())));
    }

    #[test]
    fn values_are_toml() {
        assert_eq!(toml(&json!({ "uniform": [1.0, 2.5] })), "{ uniform = [1, 2.5] }");
        assert_eq!(toml(&json!("planes")), "\"planes\"");
    }
}
