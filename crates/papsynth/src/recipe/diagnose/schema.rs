//! What a recipe may hold, looked up in its JSON schema: the keys of a section, the words of a field, its meaning.

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
    /// As it stands where the part is named, with the meaning it has there.
    named: &'s Value,
}

impl Default for Schema {
    fn default() -> Self {
        Self::new()
    }
}

impl Schema {
    /// That of this version.
    #[must_use]
    pub fn new() -> Self {
        Self { root: Recipe::schema() }
    }

    /// The whole recipe.
    pub fn root(&self) -> Section<'_> {
        Section { root: &self.root, named: &self.root }
    }

    /// The part that a dotted path leads to.
    pub fn at(&self, path: &[String]) -> Option<Section<'_>> {
        path.iter().try_fold(self.root(), |section, name| section.field(name, None))
    }

    /// The sections that know a key of this name, as dotted paths.
    pub fn homes_of(&self, key: &str) -> Vec<String> {
        /// Sections lie three deep: `debris.bacilli.clusters`.
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
    /// The schema behind a reference.
    fn schema(self) -> &'s Value {
        let pointer = self.named.get("$ref").and_then(Value::as_str).map(|r| r.trim_start_matches('#'));
        pointer.and_then(|p| self.root.pointer(p)).unwrap_or(self.named)
    }

    /// The schema itself and, where it has them, its alternatives.
    fn alternatives(self) -> impl Iterator<Item = Self> {
        let schema = self.schema();
        let of = move |name: &str| schema.get(name).and_then(Value::as_array).into_iter().flatten();
        let others = of("oneOf").chain(of("anyOf")).map(move |named| Self { root: self.root, named });
        std::iter::once(Self { root: self.root, named: schema }).chain(others)
    }

    fn properties(self) -> Option<&'s Map<String, Value>> {
        self.named.get("properties").and_then(Value::as_object)
    }

    /// Whether it is one of the alternatives that a table's `kind` leaves.
    fn agrees(self, kind: Option<&str>) -> bool {
        let own = self.named.pointer("/properties/kind/const").and_then(Value::as_str);
        kind.is_none() || own.is_none() || own == kind
    }

    /// Every key it knows, of all its alternatives.
    fn fields(self) -> impl Iterator<Item = (&'s str, Self)> {
        let properties = self.alternatives().filter_map(Self::properties).flatten();
        properties.map(move |(name, named)| (name.as_str(), Self { root: self.root, named }))
    }

    /// The keys it knows when its `kind` is this one.
    pub fn keys(self, kind: Option<&str>) -> Vec<&'s str> {
        let fitting = self.alternatives().filter(|a| a.agrees(kind)).filter_map(Self::properties);
        let mut keys: Vec<_> = fitting.flat_map(Map::keys).map(String::as_str).collect();
        keys.sort_unstable();
        keys.dedup();
        keys
    }

    /// What a key of it may hold, if it knows the key or takes any.
    pub fn field(self, name: &str, kind: Option<&str>) -> Option<Self> {
        let fitting = || self.alternatives().filter(|a| a.agrees(kind));
        let known = fitting().find_map(|a| a.properties()?.get(name));
        let any = || fitting().find_map(|a| a.named.get("additionalProperties")).filter(|s| s.is_object());
        known.or_else(any).map(|named| Self { root: self.root, named })
    }

    /// Whether it is a table whose keys can be checked.
    pub fn is_table(self) -> bool {
        self.alternatives().any(|a| a.properties().is_some() || a.named.get("additionalProperties").is_some())
    }

    /// The kinds of table it may be, where it has a `kind`.
    pub fn kinds(self) -> Vec<&'s str> {
        self.alternatives().filter_map(|a| a.named.pointer("/properties/kind/const")?.as_str()).collect()
    }

    /// The words it may be, where it is one of a few.
    pub fn words(self) -> Vec<&'s str> {
        let lists = self.alternatives().filter_map(|a| a.named.get("enum")?.as_array()).flatten();
        let single = self.alternatives().filter_map(|a| a.named.get("const"));
        single.chain(lists).filter_map(Value::as_str).collect()
    }

    /// The words that it may be, or the kinds of table, each with what it means.
    pub fn choices(self) -> impl Iterator<Item = (&'s str, &'s str)> {
        self.alternatives().filter_map(|a| {
            let word = a.named.get("const").or_else(|| a.named.pointer("/properties/kind/const"))?;
            Some((word.as_str()?, a.meaning().unwrap_or_default()))
        })
    }

    /// The JSON types it may have; empty if it does not say.
    pub fn types(self) -> Vec<&'s str> {
        self.alternatives().filter_map(|a| a.named.get("type")?.as_str()).collect()
    }

    /// Whether it is a number or a distribution.
    pub fn is_number(self) -> bool {
        self.types().contains(&"number")
    }

    /// What it means, in the words of its documentation.
    pub fn meaning(self) -> Option<&'s str> {
        let text = |value: &'s Value| value.get("description").and_then(Value::as_str);
        text(self.named).or_else(|| text(self.schema()))
    }

    /// What would be accepted, in a few words.
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
                Some("integer") => "a whole number".to_owned(),
                Some("string") => "a text in quotes".to_owned(),
                Some("object") if self.keys(None).is_empty() => "a table".to_owned(),
                Some("object") => format!("a table of {}", quoted(self.keys(None))),
                other => other.unwrap_or("something else").to_owned(),
            }
        }
    }
}

/// Names in backticks, separated by commas.
pub fn quoted<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    names.into_iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}
