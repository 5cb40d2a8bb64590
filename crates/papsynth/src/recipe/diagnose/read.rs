//! Reading the text of a recipe, and saying what is wrong with it: where, which value, what would be accepted.

use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::nearest::nearest;
use super::schema::{Schema, Section, quoted};
use crate::model::Model;
use crate::recipe::abundance::{Abundance, PER_MM2};
use crate::recipe::number::Number;
use crate::recipe::whole::{RECIPE_VERSION, Recipe};

/// Something wrong with the text of a recipe.
#[derive(Debug, Clone, PartialEq)]
pub struct Fault {
    /// The field, from the top; empty if the text is no TOML.
    pub path: Vec<String>,
    /// The bytes at fault, if known.
    pub span: Option<Range<usize>>,
    /// What is wrong.
    pub message: String,
    /// What would help.
    pub help: Option<String>,
}

type Node<'t> = Spanned<DeValue<'t>>;

/// Reads a recipe, or says everything that is wrong with its text.
///
/// # Errors
/// All faults that are found, in the order of the text: at least one.
pub fn read(text: &str) -> Result<Recipe, Vec<Fault>> {
    let whole = |span, message| vec![Fault { path: Vec::new(), span, message, help: None }];
    let table = DeTable::parse(text).map_err(|error| whole(error.span(), one_line(error.message())))?;
    if table.get_ref().is_empty() {
        let message = "it holds no setting; expected a recipe, such as `papsynth init` prints";
        return Err(whole(Some(0..0), message.to_owned()));
    }
    version(table.get_ref())?;
    let schema = Schema::new();
    let mut check = Check { schema: &schema, text, faults: Vec::new() };
    check.table(table.get_ref(), schema.root(), &mut Vec::new());
    if !check.faults.is_empty() {
        // As they stand in the text, not as their names sort.
        check.faults.sort_by_key(|fault| fault.span.as_ref().map(|span| span.start));
        return Err(check.faults);
    }
    Recipe::from_toml(text).map_err(|error| vec![type_fault(&error, table.get_ref(), &schema)])
}

/// Classes of cells that a recipe names and a model lacks.
#[must_use]
pub fn unknown_classes(recipe: &Recipe, model: &Model) -> Vec<Fault> {
    let known: Vec<&str> = model.classes.keys().map(String::as_str).collect();
    let unknown = recipe.cells.keys().filter(|class| !model.classes.contains_key(*class));
    let fault = |class: &String| Fault {
        path: vec!["cells".to_owned(), class.clone()],
        span: None,
        message: format!("cells.{class}: the model has no such class"),
        help: Some(format!("{}The model knows {}", meant(class, &known), quoted(known.iter().copied()))),
    };
    unknown.map(fault).collect()
}

/// The bytes of a field in a text, or of the nearest section around it.
pub fn find(text: &str, path: &[String]) -> Option<Range<usize>> {
    let document = DeTable::parse(text).ok()?;
    let mut table = document.get_ref();
    let mut found = None;
    for name in path {
        let Some((key, value)) = table.iter().find(|(key, _)| key.get_ref() == name) else { break };
        let DeValue::Table(inner) = value.get_ref() else { return Some(value.span()) };
        found = Some(if is_inline(text, value) { value.span() } else { key.span() });
        table = inner;
    }
    found
}

fn is_inline(text: &str, value: &Node<'_>) -> bool {
    text.get(value.span()).is_some_and(|t| t.starts_with('{'))
}

/// Another version is refused before all else: its fields may mean other things.
fn version(table: &DeTable<'_>) -> Result<(), Vec<Fault>> {
    let Some(node) = table.get("version") else { return Ok(()) };
    let DeValue::Integer(number) = node.get_ref() else { return Ok(()) };
    if number.radix() == 10 && number.as_str().parse() == Ok(RECIPE_VERSION) {
        return Ok(());
    }
    let newer = number.as_str().parse::<u64>().is_ok_and(|v| v > u64::from(RECIPE_VERSION));
    let message =
        format!("version: this recipe is of version {}; this program reads version {RECIPE_VERSION}", number.as_str());
    let help = if newer {
        "it was written for a newer papsynth, which can read it"
    } else {
        "there never was such a version; `papsynth init` prints a recipe of the present one"
    };
    let path = vec!["version".to_owned()];
    Err(vec![Fault { path, span: Some(node.span()), message, help: Some(help.to_owned()) }])
}

/// Strange fields of which it is said what may have been meant.
const MOST_HELPED: usize = 64;

struct Check<'c> {
    schema: &'c Schema,
    text: &'c str,
    faults: Vec<Fault>,
}

impl Check<'_> {
    /// A fault of a field: its path stands before the message.
    fn fault(&mut self, path: &[String], span: Range<usize>, message: &str, help: Option<String>) {
        let message = format!("{}: {message}", path.join("."));
        self.faults.push(Fault { path: path.to_vec(), span: Some(span), message, help });
    }

    fn table(&mut self, table: &DeTable<'_>, section: Section<'_>, path: &mut Vec<String>) {
        let kind = match self.kind(table, section, path) {
            Ok(kind) => kind,
            Err(()) => return,
        };
        for (key, value) in table {
            let name = key.get_ref().as_ref();
            path.push(name.to_owned());
            match section.field(name, kind.as_deref()) {
                None => {
                    // Looking for what was meant takes a millisecond: of thousands of strange fields nobody reads more than the first.
                    let is_told = self.faults.len() < MOST_HELPED;
                    let help = is_told.then(|| self.unknown_help(name, section.keys(kind.as_deref())));
                    self.fault(path, key.span(), "there is no such field", help);
                }
                Some(inner) => self.value(value, inner, path),
            }
            path.pop();
        }
    }

    /// The `kind` of a table, if it has one that is known.
    fn kind(&mut self, table: &DeTable<'_>, section: Section<'_>, path: &[String]) -> Result<Option<String>, ()> {
        let kinds = section.kinds();
        let Some(node) = table.get("kind").filter(|_| !kinds.is_empty()) else { return Ok(None) };
        let (message, help) = match node.get_ref() {
            DeValue::String(kind) if kinds.contains(&kind.as_ref()) => return Ok(Some(kind.to_string())),
            DeValue::String(kind) => (format!("`{kind}` is not known"), choice_help(kind, &kinds)),
            _ => (self.type_message(node), format!("expected one of {}", quoted(kinds))),
        };
        let message = format!("{}.kind: {message}", path.join("."));
        self.faults.push(Fault { path: path.to_vec(), span: Some(node.span()), message, help: Some(help) });
        Err(())
    }

    fn value(&mut self, node: &Node<'_>, section: Section<'_>, path: &mut Vec<String>) {
        let types = section.types();
        let (own, _) = type_of(node.get_ref());
        let fits = types.is_empty() || types.contains(&own) || own == "integer" && types.contains(&"number");
        let words = section.words();
        match node.get_ref() {
            _ if !fits => self.fault(path, node.span(), &self.type_message(node), Some(help_for(section))),
            DeValue::Table(inner) if section.is_number() && is_inline(self.text, node) => {
                let before = self.faults.len();
                self.table(inner, section, path);
                if self.faults.len() == before {
                    self.distribution(node, section, path);
                }
            }
            DeValue::Table(inner) if section.is_table() => self.table(inner, section, path),
            DeValue::String(word) if !words.is_empty() && !words.contains(&word.as_ref()) => {
                let message = format!("`{}` is not known", shorten(word));
                self.fault(path, node.span(), &message, Some(choice_help(word, &words)));
            }
            _ => {}
        }
    }

    /// A distribution is read by itself: in a section with a `kind`, the reader would only name the section.
    fn distribution(&mut self, node: &Node<'_>, section: Section<'_>, path: &[String]) {
        #[derive(serde::Deserialize)]
        struct One<T> {
            #[serde(rename = "x")]
            _x: T,
        }
        const BEFORE: &str = "x = ";
        let written = self.text.get(node.span()).unwrap_or_default();
        let text = format!("{BEFORE}{written}");
        let result = if section.field(PER_MM2, None).is_some() {
            toml::from_str::<One<Abundance>>(&text).map(|_| ())
        } else {
            toml::from_str::<One<Number>>(&text).map(|_| ())
        };
        let Err(error) = result else { return };
        let inner = error.span().filter(|span| span.start >= BEFORE.len()).map_or(node.span(), |span| {
            let start = node.span().start;
            start + span.start - BEFORE.len()..start + span.end - BEFORE.len()
        });
        self.fault(path, inner, &one_line(error.message()), Some(help_for(section)));
    }

    fn unknown_help(&self, name: &str, keys: Vec<&str>) -> String {
        let homes = self.schema.homes_of(name);
        let hint = match meant(name, &keys) {
            none if none.is_empty() && !homes.is_empty() => {
                format!("it belongs into {}. ", quoted(homes.iter().map(String::as_str)))
            }
            hint => hint,
        };
        match keys.len() {
            0 => format!("{hint}No field is known here"),
            _ => format!("{hint}Known here: {}", quoted(keys)),
        }
    }

    /// A value as it was written, or its beginning, and what it is.
    fn type_message(&self, node: &Node<'_>) -> String {
        let written = self.text.get(node.span()).unwrap_or_default();
        let (_, what) = type_of(node.get_ref());
        match (written.trim().is_empty() || written.starts_with('['), node.get_ref()) {
            (true, DeValue::Table(_)) => format!("it is {what}"),
            _ => format!("{} is {what}", shorten(written)),
        }
    }
}

/// What reading the fields found wrong, beyond keys, words and types.
fn type_fault(error: &toml::de::Error, table: &DeTable<'_>, schema: &Schema) -> Fault {
    let span = error.span();
    let mut path = Vec::new();
    if let Some(span) = &span {
        path_to(table, span, &mut path);
    }
    let message = one_line(error.message());
    let message = if path.is_empty() { message } else { format!("{}: {message}", path.join(".")) };
    let help = schema.at(&path).filter(|_| !path.is_empty()).map(help_for);
    Fault { path, span, message, help }
}

/// The innermost field whose key or value covers a span.
fn path_to(table: &DeTable<'_>, span: &Range<usize>, path: &mut Vec<String>) {
    let covers = |outer: Range<usize>| outer.start <= span.start && span.end <= outer.end;
    for (key, value) in table {
        if covers(key.span()) || covers(value.span()) {
            path.push(key.get_ref().to_string());
            if let DeValue::Table(inner) = value.get_ref() {
                path_to(inner, span, path);
            }
            return;
        }
        if let DeValue::Table(inner) = value.get_ref() {
            // Dotted keys and `[a.b]` make tables whose own span is their header's alone.
            path.push(key.get_ref().to_string());
            let before = path.len();
            path_to(inner, span, path);
            if path.len() > before {
                return;
            }
            path.pop();
        }
    }
}

/// What would be accepted, and what the field means.
fn help_for(section: Section<'_>) -> String {
    let expected = format!("expected {}", section.expected());
    match section.meaning() {
        Some(meaning) => format!("{expected}. The field: {}", one_line(meaning)),
        None => expected,
    }
}

fn choice_help(word: &str, choices: &[&str]) -> String {
    format!("{}Expected one of {}", meant(word, choices), quoted(choices.iter().copied()))
}

/// What may have been meant by a misspelt word, if any is near.
fn meant(word: &str, choices: &[&str]) -> String {
    nearest(word, choices.iter().copied()).map_or_else(String::new, |near| format!("did you mean `{near}`? "))
}

/// The type of a value in the schema, and in words.
fn type_of(value: &DeValue<'_>) -> (&'static str, &'static str) {
    match value {
        DeValue::Integer(_) => ("integer", "a whole number"),
        DeValue::Float(_) => ("number", "a number"),
        DeValue::Boolean(_) => ("boolean", "a truth value"),
        DeValue::Array(_) => ("array", "a list"),
        DeValue::Table(_) => ("object", "a table"),
        DeValue::String(_) => ("string", "a text"),
        // No field is one.
        DeValue::Datetime(_) => ("date", "a date"),
    }
}

/// The beginning of a value that may be as long as the file.
fn shorten(text: &str) -> String {
    /// Longest value that a message repeats.
    const LONGEST: usize = 60;
    let line = text.lines().next().unwrap_or_default();
    if line.chars().count() <= LONGEST && line.len() == text.len() {
        return line.to_owned();
    }
    line.chars().take(LONGEST).chain("…".chars()).collect()
}

/// A message that repeats a value of any length, such as a list: its beginning and its end, where it says what would be accepted.
pub fn middle_left_out(text: &str) -> String {
    /// Characters of either.
    const KEPT: usize = 300;
    let count = text.chars().count();
    if count <= 2 * KEPT {
        return text.to_owned();
    }
    let (begin, end): (String, String) = (text.chars().take(KEPT).collect(), text.chars().skip(count - KEPT).collect());
    format!("{begin} … {end}")
}

fn one_line(text: &str) -> String {
    /// Longest message of the reader that is passed on: it may repeat a text of any length.
    const LONGEST: usize = 400;
    text.split_whitespace().collect::<Vec<_>>().join(" ").chars().take(LONGEST).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The one fault of a text, as its message, the text it points at, and its help.
    fn fault(text: &str) -> (String, String, String) {
        let faults = read(text).expect_err(text);
        assert_eq!(faults.len(), 1, "{faults:?}");
        let Fault { span, message, help, .. } = faults.into_iter().next().unwrap();
        let at = span.map(|s| text[s.start..s.end].to_owned()).unwrap_or_default();
        (message, at, help.unwrap_or_default())
    }

    #[test]
    fn misspelt_keys_get_the_nearest_name() {
        let (message, at, help) = fault("[field]\nwidht_px = 96\n");
        assert_eq!((message.as_str(), at.as_str()), ("field.widht_px: there is no such field", "widht_px"));
        assert!(help.contains("did you mean `width_px`?"), "{help}");
        let (_, at, help) = fault("[optic]\nsigma_xy_um = 1\n");
        assert_eq!(at, "optic");
        assert!(help.contains("did you mean `optics`?"), "{help}");
        let (_, _, help) = fault("[field]\nsigma_xy_um = 1\n");
        assert!(help.starts_with("it belongs into `optics`. Known here: `height_px`, `magnification`"), "{help}");
        // Any class is a key of `cells`.
        let (message, ..) = fault("[cells.whatever]\ncount = 3\nnumber = 4\n");
        assert_eq!(message, "cells.whatever.number: there is no such field");
        let (message, _, help) = fault("field = { width_px = { unifrom = [1, 2] } }");
        assert!(message.starts_with("field.width_px.unifrom"), "{message}");
        assert!(help.contains("did you mean `uniform`?"), "{help}");
    }

    #[test]
    fn all_unknown_keys_are_named_at_once() {
        let faults = read("a = 1\n[field]\nb = 2\n[camera]\nc = 3\nbits = 8\n").unwrap_err();
        let paths: Vec<String> = faults.iter().map(|fault| fault.path.join(".")).collect();
        assert_eq!(paths, ["a", "field.b", "camera.c"]);
    }

    #[test]
    fn wrong_types_name_the_value_and_what_is_expected() {
        let (message, at, help) = fault("[field]\nwidth_px = \"wide\"\n");
        assert_eq!((message.as_str(), at.as_str()), ("field.width_px: \"wide\" is a text", "\"wide\""));
        assert!(help.starts_with("expected a number, or a distribution"), "{help}");
        assert!(help.contains("16 to 32768"), "{help}");
        assert!(fault("[field]\nwidth_px = true\n").0.ends_with("is a truth value"));
        assert!(fault("[field]\nwidth_px = [1, 2]\n").0.ends_with("is a list"));
        assert!(fault("field = 3\n").2.contains("a table of `height_px`"));
        assert!(fault("[cytoplasm]\nsheet = 3\n").2.contains("one of `xpbd`"));
        assert!(fault("[[field]]\nwidth_px = 3\n").0.starts_with("field: "));
        assert!(fault("version = [1]\n").0.starts_with("version: "));
    }

    #[test]
    fn words_and_kinds_are_checked() {
        assert!(fault("[cytoplasm]\nsheet = \"xpdb\"\n").2.contains("did you mean `xpbd`?"));
        let (message, at, help) = fault("[layout]\nkind = \"swaths\"\nwidth_um = 3\n");
        assert_eq!((message.as_str(), at.as_str()), ("layout.kind: `swaths` is not known", "\"swaths\""));
        assert!(help.contains("did you mean `swath`?"), "{help}");
        let (message, ..) = fault("[layout]\nkind = \"uniform\"\nradius_um = 3\n");
        assert!(message.starts_with("layout.radius_um: "), "{message}");
        assert!(fault("[layout]\nkind = \"swath\"\ncount = 3\n").2.ends_with("here: `kind`, `outside`, `width_um`"));
        assert!(fault("[layout]\nkind = 7\n").0.starts_with("layout.kind: 7 is a whole number"));
        assert!(fault("[layout]\ncount = 7\n").0.contains("layout: "));
        assert!(fault("[layout]\nkind = \"labels\"\nsmooth_um = 7\n").0.contains("missing field `path`"));
    }

    #[test]
    fn what_is_no_toml_is_pointed_at() {
        assert_eq!(fault("[field]\nwidth_px = = 3\n").1, "=");
        assert!(fault("[field]\nwidth_px = 3\nwidth_px = 4\n").0.contains("duplicate"));
        assert!(fault("").0.contains("holds no setting"));
        assert!(fault("# only a comment\n").0.contains("holds no setting"));
        let deep = format!("a = {}{}", "[".repeat(100_000), "]".repeat(100_000));
        assert!(!read(&deep).unwrap_err().is_empty());
        let dotted = format!("{}a = 1", "a.".repeat(100_000));
        assert!(!read(&dotted).unwrap_err().is_empty());
        let (message, at, _) = fault("[field]\nwidth_px = 1e400\n");
        assert_eq!(at, "1e400", "{message}");
    }

    #[test]
    fn another_version_is_refused_before_all_else() {
        let (message, at, help) = fault("version = 2\nnew_field = 1\n");
        assert_eq!(at, "2");
        assert!(message.contains("version 2") && help.contains("newer"), "{message} {help}");
        assert!(fault("version = 0\n").2.contains("never was"));
        assert!(fault("version = -1\n").2.contains("never was"));
    }

    #[test]
    fn fields_are_found_in_a_text() {
        let text = "[field]\nwidth_px = 3\n[nucleus]\npatch_um = 1\n[cells]\na = { count = 4 }\n[cells.b]\nsize = 2\n";
        let at = |dotted: &str| {
            let path: Vec<String> = dotted.split('.').map(str::to_owned).collect();
            find(text, &path).map(|span| &text[span])
        };
        assert_eq!(at("field.width_px"), Some("3"));
        assert_eq!(at("nucleus.overlap_um"), Some("nucleus"));
        assert_eq!(at("cells.a.count"), Some("4"));
        assert_eq!(at("cells.a.size"), Some("{ count = 4 }"));
        assert_eq!(at("cells.b.size"), Some("2"));
        assert_eq!(at("cells.c.size"), Some("cells"));
        assert_eq!(at("camera.bits"), None);
    }

    #[test]
    fn the_path_of_a_span_is_found_in_every_form_of_table() {
        let text = "optics.sigma_xy_um = 5\nfield = { width_px = 6 }\n[cells.a]\ncount = 7\n";
        let table = DeTable::parse(text).unwrap();
        for (digit, expected) in [("5", "optics.sigma_xy_um"), ("6", "field.width_px"), ("7", "cells.a.count")] {
            let start = text.find(digit).unwrap();
            let mut path = Vec::new();
            path_to(table.get_ref(), &(start..start + 1), &mut path);
            assert_eq!(path.join("."), expected);
        }
    }

    /// A sound recipe with a part of it replaced.
    fn damaged(start: usize, length: usize, by: &str) -> String {
        let text = Recipe::default().to_toml();
        let start = start % text.len();
        let end = (start + length).min(text.len());
        format!("{}{by}{}", &text[..start], &text[end..])
    }

    proptest::proptest! {
        /// Whatever the text: an answer, no panic, and places that lie in the text.
        #[test]
        fn any_damage_is_read_or_refused(start in 0_usize..100_000, length in 0_usize..40, by in "\\PC{0,20}") {
            let text = damaged(start, length, &by);
            for fault in read(&text).err().into_iter().flatten() {
                if let Some(span) = fault.span {
                    proptest::prop_assert!(text.get(span.clone()).is_some(), "{:?}", span);
                }
                let _ = find(&text, &fault.path);
            }
        }

        #[test]
        fn any_text_is_read_or_refused(text in "[\\PC\n]{0,200}") {
            let _ = read(&text);
        }
    }
}
