//! Lookups in the JSON schema of recipes: the keys of a section, the words and the documentation of a field.

use serde_json::{Map, Value};

use crate::recipe::abundance::PER_MM2;
use crate::recipe::whole::Recipe;

/// The schema of recipes.
pub struct Schema {
    root: Value,
}

/// The schema of one part of a recipe.
#[derive(Clone, Copy)]
pub struct Section<'s> {
    root: &'s Value,
    /// The schema at the reference to the part, with the documentation there.
    named: &'s Value,
}

impl Default for Schema {
    fn default() -> Self {
        Self::new()
    }
}

impl Schema {
    /// Returns the schema of this version.
    #[must_use]
    pub fn new() -> Self {
        Self { root: Recipe::schema() }
    }

    /// Returns the schema of the complete recipe.
    pub fn root(&self) -> Section<'_> {
        Section { root: &self.root, named: &self.root }
    }

    /// Returns the part at a path.
    pub fn at(&self, path: &[String]) -> Option<Section<'_>> {
        path.iter().try_fold(self.root(), |section, name| section.field(name, None))
    }

    /// Returns the dotted paths of the sections that have a key of this name.
    pub fn homes_of(&self, key: &str) -> Vec<String> {
        /// Largest depth of sections: `debris.bacilli.clusters` has 3.
        const DEEPEST: usize = 4;
        let mut found = Vec::new();
        let mut open = vec![(Vec::new(), self.root())];
        while let Some((path, section)) = open.pop() {
            for (name, inner) in section.fields() {
                if name == key && !path.is_empty() {
                    found.push(path.join("."));
                }
                if path.len() < DEEPEST && !inner.is_number() {
                    open.push(([path.as_slice(), &[name.to_owned()]].concat(), inner));
                }
            }
        }
        found.sort();
        found.dedup();
        found
    }
}

impl<'s> Section<'s> {
    /// Returns the referenced schema.
    fn schema(self) -> &'s Value {
        let pointer = self.named.get("$ref").and_then(Value::as_str).map(|r| r.trim_start_matches('#'));
        pointer.and_then(|p| self.root.pointer(p)).unwrap_or(self.named)
    }

    /// Returns the schema and its alternatives.
    fn alternatives(self) -> impl Iterator<Item = Self> {
        let schema = self.schema();
        let of = move |name: &str| schema.get(name).and_then(Value::as_array).into_iter().flatten();
        let others = of("oneOf").chain(of("anyOf")).map(move |named| Self { root: self.root, named });
        std::iter::once(Self { root: self.root, named: schema }).chain(others)
    }

    fn properties(self) -> Option<&'s Map<String, Value>> {
        self.named.get("properties").and_then(Value::as_object)
    }

    /// Returns whether the alternative agrees with the `kind` of a table.
    fn agrees(self, kind: Option<&str>) -> bool {
        let own = self.named.pointer("/properties/kind/const").and_then(Value::as_str);
        kind.is_none() || own.is_none() || own == kind
    }

    /// Returns the keys of all alternatives.
    fn fields(self) -> impl Iterator<Item = (&'s str, Self)> {
        let properties = self.alternatives().filter_map(Self::properties).flatten();
        properties.map(move |(name, named)| (name.as_str(), Self { root: self.root, named }))
    }

    /// Returns the keys of a table of this `kind`.
    pub fn keys(self, kind: Option<&str>) -> Vec<&'s str> {
        let fitting = self.alternatives().filter(|a| a.agrees(kind)).filter_map(Self::properties);
        let mut keys: Vec<_> = fitting.flat_map(Map::keys).map(String::as_str).collect();
        keys.sort_unstable();
        keys.dedup();
        keys
    }

    /// Returns the schema of a key, if the section has the key or accepts any key.
    pub fn field(self, name: &str, kind: Option<&str>) -> Option<Self> {
        let fitting = || self.alternatives().filter(|a| a.agrees(kind));
        let known = fitting().find_map(|a| a.properties()?.get(name));
        let any = || fitting().find_map(|a| a.named.get("additionalProperties")).filter(|s| s.is_object());
        known.or_else(any).map(|named| Self { root: self.root, named })
    }

    /// Returns the schema of the items of a list.
    pub fn items(self) -> Option<Self> {
        let named = self.alternatives().find_map(|a| a.named.get("items")).filter(|items| items.is_object())?;
        Some(Self { root: self.root, named })
    }

    /// Returns whether it is a table whose keys can be checked.
    pub fn is_table(self) -> bool {
        self.alternatives().any(|a| a.properties().is_some() || a.named.get("additionalProperties").is_some())
    }

    /// Returns the accepted values of `kind`.
    pub fn kinds(self) -> Vec<&'s str> {
        self.alternatives().filter_map(|a| a.named.pointer("/properties/kind/const")?.as_str()).collect()
    }

    /// Returns the accepted words.
    pub fn words(self) -> Vec<&'s str> {
        let lists = self.alternatives().filter_map(|a| a.named.get("enum")?.as_array()).flatten();
        let single = self.alternatives().filter_map(|a| a.named.get("const"));
        single.chain(lists).filter_map(Value::as_str).collect()
    }

    /// Returns the accepted words or kinds, each with its documentation.
    pub fn choices(self) -> impl Iterator<Item = (&'s str, &'s str)> {
        self.alternatives().filter_map(|a| {
            let word = a.named.get("const").or_else(|| a.named.pointer("/properties/kind/const"))?;
            Some((word.as_str()?, a.meaning().unwrap_or_default()))
        })
    }

    /// Returns the accepted JSON types; empty if the schema has none.
    pub fn types(self) -> Vec<&'s str> {
        self.alternatives().filter_map(|a| a.named.get("type")?.as_str()).collect()
    }

    /// Returns whether it is a number or a distribution.
    pub fn is_number(self) -> bool {
        self.types().contains(&"number")
    }

    /// Returns the documentation.
    pub fn meaning(self) -> Option<&'s str> {
        let text = |value: &'s Value| value.get("description").and_then(Value::as_str);
        text(self.named).or_else(|| text(self.schema()))
    }

    /// Returns the type that is accepted, with an article.
    pub fn expected_type(self) -> &'static str {
        match self.types().first().copied() {
            _ if self.is_number() => "a number",
            _ if !self.words().is_empty() => "a string",
            _ if self.is_table() => "a table",
            Some("integer") => "an integer",
            Some("string") => "a string",
            Some("boolean") => "a boolean",
            Some("array") => "an array",
            _ => "another type",
        }
    }

    /// Returns what is accepted, in a few words.
    pub fn expected(self) -> String {
        let words = self.words();
        if self.field(PER_MM2, None).is_some() {
            "a count, or a density such as { per_mm2 = 180 }; either may be a distribution such as { uniform = [1, 2] }"
                .to_owned()
        } else if self.is_number() {
            "a number, or a distribution such as { uniform = [1, 2] }".to_owned()
        } else if !words.is_empty() {
            format!("one of {}", quoted(words))
        } else if !self.kinds().is_empty() {
            format!("a table whose `kind` is one of {}", quoted(self.kinds()))
        } else {
            match self.types().first().copied() {
                Some("integer") => "an integer".to_owned(),
                Some("string") => "a string".to_owned(),
                Some("array") => "an array".to_owned(),
                Some("object") if self.keys(None).is_empty() => "a table".to_owned(),
                Some("object") => format!("a table of {}", quoted(self.keys(None))),
                other => other.unwrap_or("something else").to_owned(),
            }
        }
    }
}

/// Returns names in backticks, separated by commas.
pub fn quoted<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    names.into_iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}
