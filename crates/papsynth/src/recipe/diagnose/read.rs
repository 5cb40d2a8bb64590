//! Reads the text of a recipe, and reports each error with its place, its value and what is accepted.

use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::nearest::nearest;
use super::plain::plain;
use super::schema::{Schema, Section, quoted};
use crate::model::Model;
use crate::recipe::abundance::{Abundance, PER_MM2};
use crate::recipe::number::Number;
use crate::recipe::renamed;
use crate::recipe::whole::{RECIPE_VERSION, Recipe};

/// An invalid field of the text of a recipe.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldError {
    /// Names of the sections and of the key, outermost first; empty if the text is not TOML.
    pub path: Vec<String>,
    /// Bytes of the text that the message is about, if known.
    pub span: Option<Range<usize>>,
    /// What is wrong, with the path of the key.
    pub message: String,
    /// What is accepted, or what to do.
    pub help: Option<String>,
}

type Node<'t> = Spanned<DeValue<'t>>;

/// Reads a recipe.
///
/// # Errors
/// All errors of the text, in its order: at least one.
pub fn read(text: &str) -> Result<Recipe, Vec<FieldError>> {
    let whole = |span, message| vec![FieldError { path: Vec::new(), span, message, help: None }];
    let table = DeTable::parse(text).map_err(|error| whole(error.span(), one_line(&plain(error.message()))))?;
    if table.get_ref().is_empty() {
        let message = "the recipe is empty; `papsynth init` prints one to start from";
        return Err(whole(Some(0..0), message.to_owned()));
    }
    version(table.get_ref())?;
    let schema = Schema::new();
    let mut check = Check { schema: &schema, text, errors: Vec::new() };
    check.table(table.get_ref(), schema.root(), &mut Vec::new());
    if !check.errors.is_empty() {
        // In the order of the text.
        check.errors.sort_by_key(|error| error.span.as_ref().map(|span| span.start));
        return Err(check.errors);
    }
    Recipe::from_toml(text).map_err(|error| vec![type_fault(&error, table.get_ref(), &schema)])
}

/// Returns an error for each class of cells that the model does not have.
#[must_use]
pub fn unknown_classes(recipe: &Recipe, model: &Model) -> Vec<FieldError> {
    let known: Vec<&str> = model.classes.keys().map(String::as_str).collect();
    let unknown = recipe.cells.keys().filter(|class| !model.classes.contains_key(*class));
    let error = |class: &String| FieldError {
        path: vec!["cells".to_owned(), class.clone()],
        span: None,
        message: format!("cells.{class}: the model has no class `{class}`"),
        help: Some(format!("{}Classes of the model: {}", meant(class, &known), quoted(known.iter().copied()))),
    };
    unknown.map(error).collect()
}

/// Returns the bytes of a field in a text, or of the innermost section around it that the text has.
pub fn find(text: &str, path: &[String]) -> Option<Range<usize>> {
    let document = DeTable::parse(text).ok()?;
    let mut table = document.get_ref();
    let mut found = None;
    let mut names = path.iter();
    while let Some(name) = names.next() {
        let mut found_key = table.iter().find(|(key, _)| key.get_ref() == name);
        if found_key.is_none() {
            // A key may contain dots.
            let rest = [std::slice::from_ref(name), names.as_slice()].concat().join(".");
            found_key = table.iter().find(|(key, _)| *key.get_ref() == rest);
        }
        let Some((key, mut value)) = found_key else { break };
        found = Some(if is_inline(text, value) { value.span() } else { key.span() });
        if let DeValue::Array(items) = value.get_ref() {
            let item = names.next().and_then(|index| items.get(index.parse::<usize>().ok()?));
            let Some(item) = item else { return Some(value.span()) };
            (found, value) = (Some(item.span()), item);
        }
        let DeValue::Table(inner) = value.get_ref() else { return Some(value.span()) };
        table = inner;
    }
    found
}

fn is_inline(text: &str, value: &Node<'_>) -> bool {
    text.get(value.span()).is_some_and(|t| t.starts_with('{'))
}

/// Refuses other versions of recipes before any key is checked: their keys may have other meanings.
fn version(table: &DeTable<'_>) -> Result<(), Vec<FieldError>> {
    let Some(node) = table.get("version") else { return Ok(()) };
    let DeValue::Integer(number) = node.get_ref() else { return Ok(()) };
    if number.radix() == 10 && number.as_str().parse() == Ok(RECIPE_VERSION) {
        return Ok(());
    }
    let newer = number.as_str().parse::<u64>().is_ok_and(|v| v > u64::from(RECIPE_VERSION));
    let message =
        format!("version: version {} is not supported: this program reads version {RECIPE_VERSION}", number.as_str());
    let help = if newer {
        "use a newer version of papsynth"
    } else {
        "this version does not exist; `papsynth init` prints a recipe of the current version"
    };
    let path = vec!["version".to_owned()];
    Err(vec![FieldError { path, span: Some(node.span()), message, help: Some(help.to_owned()) }])
}

/// Largest number of unknown keys with a suggestion.
const MOST_HELPED: usize = 64;

/// Length of the path of the numbers of a condition: `conditions`, its index, `numbers`.
const CONDITION_NUMBERS: usize = 3;

struct Check<'c> {
    schema: &'c Schema,
    text: &'c str,
    errors: Vec<FieldError>,
}

impl Check<'_> {
    /// Adds an error of a field, whose path is put before the message.
    fn add(&mut self, path: &[String], span: Range<usize>, message: &str, help: Option<String>) {
        let message = format!("{}: {message}", path.join("."));
        self.errors.push(FieldError { path: path.to_vec(), span: Some(span), message, help });
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
                    let mut message = format!("unknown key `{}`", path.join("."));
                    let renamed = renamed::key(path);
                    if let Some(present) = renamed {
                        message.push_str(&format!(": it is now `{present}`"));
                    }
                    // A suggestion takes a millisecond, too long for thousands of keys.
                    let is_helped = renamed.is_none() && self.errors.len() < MOST_HELPED;
                    let help = is_helped.then(|| match path.split_at_checked(CONDITION_NUMBERS) {
                        Some(([first, .., last], rest)) if first == "conditions" && last == "numbers" => {
                            format!("write the path as one key in quotes: \"{}\"", rest.join("."))
                        }
                        _ => self.unknown_help(name, section.keys(kind.as_deref())),
                    });
                    self.errors.push(FieldError { path: path.clone(), span: Some(key.span()), message, help });
                }
                Some(inner) => self.value(value, inner, path),
            }
            path.pop();
        }
    }

    /// Returns the `kind` of a table, if it has a valid one.
    fn kind(&mut self, table: &DeTable<'_>, section: Section<'_>, path: &[String]) -> Result<Option<String>, ()> {
        let kinds = section.kinds();
        let Some(node) = table.get("kind").filter(|_| !kinds.is_empty()) else { return Ok(None) };
        let (message, help) = match node.get_ref() {
            DeValue::String(kind) if kinds.contains(&kind.as_ref()) => return Ok(Some(kind.to_string())),
            DeValue::String(kind) => {
                let path = [path, &["kind".to_owned()]].concat();
                (unknown_value(&path, kind), choice_help(kind, &kinds))
            }
            other => (type_message("a string", other), format!("expected one of {}", quoted(kinds))),
        };
        let message = format!("{}.kind: {message}", path.join("."));
        self.errors.push(FieldError { path: path.to_vec(), span: Some(node.span()), message, help: Some(help) });
        Err(())
    }

    fn value(&mut self, node: &Node<'_>, section: Section<'_>, path: &mut Vec<String>) {
        let types = section.types();
        let (own, _) = type_of(node.get_ref());
        let fits = types.is_empty() || types.contains(&own) || own == "integer" && types.contains(&"number");
        let words = section.words();
        match node.get_ref() {
            _ if !fits => self.add(
                path,
                node.span(),
                &type_message(section.expected_type(), node.get_ref()),
                Some(help_for(section)),
            ),
            DeValue::Table(inner) if section.is_number() && is_inline(self.text, node) => {
                let before = self.errors.len();
                self.table(inner, section, path);
                if self.errors.len() == before {
                    self.distribution(node, section, path);
                }
            }
            DeValue::Table(inner) if section.is_table() => self.table(inner, section, path),
            DeValue::Array(items) => {
                let Some(section) = section.items() else { return };
                for (index, item) in items.iter().enumerate() {
                    path.push(index.to_string());
                    self.value(item, section, path);
                    path.pop();
                }
            }
            DeValue::String(word) if !words.is_empty() && !words.contains(&word.as_ref()) => {
                let message = unknown_value(path, word);
                self.add(path, node.span(), &message, Some(choice_help(word, &words)));
            }
            _ => {}
        }
    }

    /// Reads a distribution alone, because the error of a section with a `kind` would not have the place of the
    /// distribution.
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
        self.add(path, inner, &one_line(&plain(error.message())), Some(help_for(section)));
    }

    fn unknown_help(&self, name: &str, keys: Vec<&str>) -> String {
        let homes = self.schema.homes_of(name);
        let hint = match meant(name, &keys) {
            none if none.is_empty() && !homes.is_empty() => {
                format!("it is a key of {}. ", quoted(homes.iter().map(String::as_str)))
            }
            hint => hint,
        };
        match keys.len() {
            0 => format!("{hint}This section has no keys"),
            _ => format!("{hint}Keys of this section: {}", quoted(keys)),
        }
    }
}

/// Returns a message about a value of a wrong type.
fn type_message(expected: &str, found: &DeValue<'_>) -> String {
    format!("expected {expected}, found {}", type_of(found).1)
}

/// Returns a message about a value that is not an accepted word.
fn unknown_value(path: &[String], word: &str) -> String {
    match renamed::value(path, word) {
        Some(present) => format!("unknown value \"{word}\": it is now \"{present}\""),
        None => format!("unknown value \"{}\"", shorten(word)),
    }
}

/// Converts an error of the TOML reader, which finds what the check of keys, words and types does not.
fn type_fault(error: &toml::de::Error, table: &DeTable<'_>, schema: &Schema) -> FieldError {
    let span = error.span();
    let mut path = Vec::new();
    if let Some(span) = &span {
        path_to(table, span, &mut path);
    }
    let message = one_line(&plain(error.message()));
    let message = if path.is_empty() { message } else { format!("{}: {message}", path.join(".")) };
    let help = schema.at(&path).filter(|_| !path.is_empty()).map(help_for);
    FieldError { path, span, message, help }
}

/// Appends the path of the innermost field whose key or value covers a span.
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
            // The span of a table of dotted keys or `[a.b]` is that of its header.
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

/// Returns what is accepted, and the documentation of the field.
fn help_for(section: Section<'_>) -> String {
    let expected = format!("expected {}", section.expected());
    match section.meaning() {
        Some(meaning) => format!("{expected}. {}", one_line(meaning)),
        None => expected,
    }
}

fn choice_help(word: &str, choices: &[&str]) -> String {
    format!("{}Expected one of {}", meant(word, choices), quoted(choices.iter().copied()))
}

/// Returns a suggestion for a misspelt word, if a choice is similar.
fn meant(word: &str, choices: &[&str]) -> String {
    nearest(word, choices.iter().copied()).map_or_else(String::new, |near| format!("did you mean `{near}`? "))
}

/// Returns the type of a value in the schema, and its name in TOML with an article.
fn type_of(value: &DeValue<'_>) -> (&'static str, &'static str) {
    match value {
        DeValue::Integer(_) => ("integer", "an integer"),
        DeValue::Float(_) => ("number", "a float"),
        DeValue::Boolean(_) => ("boolean", "a boolean"),
        DeValue::Array(_) => ("array", "an array"),
        DeValue::Table(_) => ("object", "a table"),
        DeValue::String(_) => ("string", "a string"),
        DeValue::Datetime(_) => ("date", "a date-time"),
    }
}

/// Returns the beginning of a value, which may be as long as the file.
fn shorten(text: &str) -> String {
    /// Largest number of characters of a value in a message.
    const LONGEST: usize = 60;
    let line = text.lines().next().unwrap_or_default();
    if line.chars().count() <= LONGEST && line.len() == text.len() {
        return line.to_owned();
    }
    line.chars().take(LONGEST).chain("…".chars()).collect()
}

/// Shortens a message that repeats a long value, such as a list: keeps its beginning and its end.
pub fn middle_left_out(text: &str) -> String {
    /// Characters kept of each.
    const KEPT: usize = 300;
    let count = text.chars().count();
    if count <= 2 * KEPT {
        return text.to_owned();
    }
    let (begin, end): (String, String) = (text.chars().take(KEPT).collect(), text.chars().skip(count - KEPT).collect());
    format!("{begin} … {end}")
}

fn one_line(text: &str) -> String {
    /// Largest number of characters of a message of the TOML reader, which may repeat a long value.
    const LONGEST: usize = 400;
    text.split_whitespace().collect::<Vec<_>>().join(" ").chars().take(LONGEST).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the one error of a text: its message, the text of its span, and its help.
    fn fault(text: &str) -> (String, String, String) {
        let faults = read(text).expect_err(text);
        assert_eq!(faults.len(), 1, "{faults:?}");
        let FieldError { span, message, help, .. } = faults.into_iter().next().unwrap();
        let at = span.map(|s| text[s.start..s.end].to_owned()).unwrap_or_default();
        (message, at, help.unwrap_or_default())
    }

    #[test]
    fn misspelt_keys_get_the_nearest_name() {
        let (message, at, help) = fault("[field]\nwidht_px = 96\n");
        assert_eq!((message.as_str(), at.as_str()), ("unknown key `field.widht_px`", "widht_px"));
        assert!(help.contains("did you mean `width_px`?"), "{help}");
        let (_, at, help) = fault("[optic]\nsigma_xy_um = 1\n");
        assert_eq!(at, "optic");
        assert!(help.contains("did you mean `optics`?"), "{help}");
        let (_, _, help) = fault("[field]\nsigma_xy_um = 1\n");
        assert!(
            help.starts_with("it is a key of `optics`. Keys of this section: `height_px`, `magnification`"),
            "{help}"
        );
        // Any class is a key of `cells`.
        let (message, ..) = fault("[cells.whatever]\ncount = 3\nnumber = 4\n");
        assert_eq!(message, "unknown key `cells.whatever.number`");
        let (message, _, help) = fault("field = { width_px = { unifrom = [1, 2] } }");
        assert!(message.starts_with("unknown key `field.width_px.unifrom`"), "{message}");
        assert!(help.contains("did you mean `uniform`?"), "{help}");
    }

    #[test]
    fn all_unknown_keys_are_reported_at_once() {
        let faults = read("a = 1\n[field]\nb = 2\n[camera]\nc = 3\nbits = 8\n").unwrap_err();
        let paths: Vec<String> = faults.iter().map(|fault| fault.path.join(".")).collect();
        assert_eq!(paths, ["a", "field.b", "camera.c"]);
    }

    #[test]
    fn wrong_types_name_the_value_and_what_is_expected() {
        let (message, at, help) = fault("[field]\nwidth_px = \"wide\"\n");
        assert_eq!((message.as_str(), at.as_str()), ("field.width_px: expected a number, found a string", "\"wide\""));
        assert!(help.starts_with("expected a number, or a distribution"), "{help}");
        assert!(help.contains("16 to 32768"), "{help}");
        assert!(fault("[field]\nwidth_px = true\n").0.ends_with("found a boolean"));
        assert!(fault("[field]\nwidth_px = [1, 2]\n").0.ends_with("found an array"));
        assert!(fault("field = 3\n").2.contains("a table of `height_px`"));
        assert!(fault("[cytoplasm]\nsheet = 3\n").2.contains("one of `xpbd`"));
        assert!(fault("[[field]]\nwidth_px = 3\n").0.starts_with("field: "));
        assert!(fault("version = [1]\n").0.starts_with("version: "));
    }

    #[test]
    fn words_and_kinds_are_checked() {
        assert!(fault("[cytoplasm]\nsheet = \"xpdb\"\n").2.contains("did you mean `xpbd`?"));
        let (message, at, help) = fault("[layout]\nkind = \"bands\"\nwidth_um = 3\n");
        assert_eq!((message.as_str(), at.as_str()), ("layout.kind: unknown value \"bands\"", "\"bands\""));
        assert!(help.contains("did you mean `band`?"), "{help}");
        let (message, ..) = fault("[layout]\nkind = \"uniform\"\nradius_um = 3\n");
        assert!(message.starts_with("unknown key `layout.radius_um`"), "{message}");
        assert!(fault("[layout]\nkind = \"band\"\ncount = 3\n").2.ends_with("section: `kind`, `outside`, `width_um`"));
        assert!(fault("[layout]\nkind = 7\n").0.starts_with("layout.kind: expected a string, found an integer"));
        assert!(fault("[layout]\ncount = 7\n").0.contains("layout: "));
        assert!(fault("[layout]\nkind = \"labels\"\nsmooth_um = 7\n").0.contains("missing field `path`"));
    }

    #[test]
    fn former_names_are_answered_with_the_present_ones() {
        let (message, at, help) = fault("[focus]\npicture = \"edf\"\n");
        assert_eq!(
            (message.as_str(), at.as_str()),
            ("unknown key `focus.picture`: it is now `focus.output`", "picture")
        );
        assert_eq!(help, "");
        let (message, ..) = fault("[cytoplasm.folds]\ncigar = 0\n");
        assert_eq!(message, "unknown key `cytoplasm.folds.cigar`: it is now `cytoplasm.folds.folded_over`");
        let (message, ..) = fault("[focus]\noutput = \"extended\"\n");
        assert_eq!(message, "focus.output: unknown value \"extended\": it is now \"edf\"");
        let (message, ..) = fault("[layout]\nkind = \"map\"\npath = \"a.png\"\n");
        assert_eq!(message, "layout.kind: unknown value \"map\": it is now \"density-map\"");
        let (message, ..) = fault("[cells.any.group]\nform = \"heap\"\n");
        assert_eq!(message, "cells.any.group.form: unknown value \"heap\": it is now \"aggregate\"");
    }

    #[test]
    fn densities_are_checked() {
        assert!(read("[cells.a]\ncount = { per_mm2 = { uniform = [9, 12] } }\n").is_ok());
        assert!(read("[cells.a]\ncount.per_mm2 = 12\n").is_ok());
        let (message, at, _) = fault("[cells.a]\ncount = { per_mm2 = \"many\" }\n");
        assert_eq!(
            (message.as_str(), at.as_str()),
            ("cells.a.count.per_mm2: expected a number, found a string", "\"many\"")
        );
        let (message, _, help) = fault("[cells.a]\ncount = { per_mm = 3 }\n");
        assert!(message == "unknown key `cells.a.count.per_mm`" && help.contains("did you mean `per_mm2`?"), "{help}");
        assert!(
            fault("[cells.a]\ncount = { per_mm2 = 3, min = 2 }\n").0.contains("takes the distribution as its value")
        );
        assert!(fault("[cells.a]\nsize = { per_mm2 = 3 }\n").0.starts_with("unknown key `cells.a.size.per_mm2`"));
    }

    #[test]
    fn errors_of_toml_have_a_place() {
        assert_eq!(fault("[field]\nwidth_px = = 3\n").1, "=");
        assert!(fault("[field]\nwidth_px = 3\nwidth_px = 4\n").0.contains("duplicate"));
        assert!(fault("").0.contains("the recipe is empty"));
        assert!(fault("# only a comment\n").0.contains("the recipe is empty"));
        let deep = format!("a = {}{}", "[".repeat(100_000), "]".repeat(100_000));
        assert!(!read(&deep).unwrap_err().is_empty());
        let dotted = format!("{}a = 1", "a.".repeat(100_000));
        assert!(!read(&dotted).unwrap_err().is_empty());
        let (message, at, _) = fault("[field]\nwidth_px = 1e400\n");
        assert_eq!(at, "1e400", "{message}");
    }

    #[test]
    fn other_versions_are_refused_before_keys_are_checked() {
        let (message, at, help) = fault("version = 2\nnew_field = 1\n");
        assert_eq!(at, "2");
        assert!(message.contains("version 2") && help.contains("newer"), "{message} {help}");
        assert!(fault("version = 0\n").2.contains("does not exist"));
        assert!(fault("version = -1\n").2.contains("does not exist"));
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

    /// Returns a valid recipe with a part of its text replaced.
    fn damaged(start: usize, length: usize, by: &str) -> String {
        let text = Recipe::default().to_toml();
        let start = start % text.len();
        let end = (start + length).min(text.len());
        format!("{}{by}{}", &text[..start], &text[end..])
    }

    proptest::proptest! {
        /// Any text gives a recipe or errors whose places are in the text, and no panic.
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
