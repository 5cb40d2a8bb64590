//! Where each equation of the paper stands.

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use crate::arguments::Arguments;
use crate::chore::{Chore, Outcome};
use crate::workspace::Workspace;

pub(crate) const CHORE: Chore = Chore {
    name: "equations",
    usage: "",
    about: "lists the equations of the paper, each at its item, and fails if one is cited nowhere",
    details: "Read from the documentation of every item in crates/*/src: \"Eq. 4\", \"Eqs. 1, 2\", \"Eqs. 8 to 10\". Numbers after a \
              dot are the lines inside the item that compute the equation. Fields of structs are parameters and do not count, nor \
              does an equation of another source, which has its DOI before it.",
    run,
};

/// The equations that have to stand somewhere: all of them. 17 to 19 are measures of an image, and the judge's.
const EQUATIONS: std::ops::RangeInclusive<u32> = 1..=19;

/// An item that cites an equation.
#[derive(Debug, PartialEq, Eq)]
struct Citation {
    equation: u32,
    item: String,
    /// Line of the item, from 1.
    line: usize,
    place: Place,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Place {
    /// In the documentation of the item.
    Documentation,
    /// In the words at the head of a module: worth a line of the table, but not the place of an equation.
    Heading,
    /// At this line inside it.
    Inside(usize),
}

/// A line of the table: an item and the lines in it.
#[derive(Default)]
struct Row {
    documented: bool,
    inside: Vec<usize>,
}

fn run(workspace: &Workspace, arguments: Arguments) -> Result<Outcome> {
    arguments.finish()?;
    let mut table: BTreeMap<u32, BTreeMap<(String, usize, String), Row>> = BTreeMap::new();
    for package in workspace.packages.iter().filter(|package| package.folder.starts_with(workspace.root.join("crates")))
    {
        for path in sources(&package.folder.join("src"))? {
            let text = fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
            let file = workspace.shown(&path).to_string();
            for Citation { equation, item, line, place } in citations(&text) {
                let row = table.entry(equation).or_default().entry((file.clone(), line, item)).or_default();
                match place {
                    Place::Documentation => row.documented = true,
                    Place::Heading => {}
                    Place::Inside(line) => row.inside.push(line),
                }
            }
        }
    }
    let mut out = io::stdout().lock();
    for equation in EQUATIONS {
        let mut label = format!("Eq. {equation}");
        for ((file, line, item), row) in table.get(&equation).into_iter().flatten() {
            let inside: String = row.inside.iter().map(|line| format!(" · {line}")).collect();
            writeln!(out, "{label:<8} {item:<44} {file}:{line}{inside}")?;
            label.clear();
        }
    }
    let without = |wanted: fn(&Row) -> bool| -> Vec<String> {
        let found = |n: &u32| table.get(n).is_some_and(|rows| rows.values().any(wanted));
        EQUATIONS.filter(|n| !found(n)).map(|n| n.to_string()).collect()
    };
    let (nowhere, not_computed) = (without(|row| row.documented), without(|row| !row.inside.is_empty()));
    if !not_computed.is_empty() {
        writeln!(out, "No line says that it computes Eq. {}.", not_computed.join(", "))?;
    }
    if !nowhere.is_empty() {
        bail!("no item cites Eq. {}", nowhere.join(", "));
    }
    Ok(Outcome::Done)
}

/// All source files below a folder, in order, without those of tests.
fn sources(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))? {
        let path = entry?.path();
        if path.file_stem().is_some_and(|stem| stem == "tests") {
            continue;
        }
        if path.is_dir() {
            found.extend(sources(&path)?);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

/// Everything a source file cites, down to its tests.
fn citations(text: &str) -> Vec<Citation> {
    let mut found = Vec::new();
    let mut cite = |text: &str, (item, line): &(String, usize), place| {
        let citation = |equation| Citation { equation, item: item.clone(), line: *line, place };
        found.extend(numbers(text).into_iter().map(citation));
    };
    // The type or impl around this place, and the item that began last with its line.
    let (mut owner, mut item) = (String::new(), (String::new(), 0));
    let (mut documentation, mut module) = (String::new(), String::new());
    let mut in_attribute = false;
    for (line, number) in text.lines().zip(1..).take_while(|(line, _)| *line != "mod tests {") {
        let code = line.trim_start();
        if let Some(words) = code.strip_prefix("//!") {
            module = module + words + "\n";
        } else if let Some(words) = code.strip_prefix("///") {
            documentation = documentation + words + "\n";
        } else if in_attribute || code.starts_with("#[") {
            in_attribute = !code.ends_with(']');
        } else {
            if let Some((keyword, name)) = beginning(code, !documentation.is_empty()) {
                if code.len() == line.len() {
                    let owns = matches!(keyword, "struct" | "enum" | "trait" | "impl" | "mod");
                    owner = if owns { name.clone() } else { String::new() };
                    item = (if keyword == "impl" { name } else { format!("{keyword} {name}") }, number);
                } else {
                    let outer = if owner.is_empty() { keyword.to_owned() + " " } else { format!("{owner}::") };
                    item = (outer + &name, number);
                }
                cite(&documentation, &item, Place::Documentation);
            }
            if !code.is_empty() {
                documentation.clear();
            }
            if let Some((_, comment)) = code.split_once("//") {
                cite(comment, &item, Place::Inside(number));
            }
        }
    }
    cite(&module, &("(the module)".to_owned(), 1), Place::Heading);
    found
}

/// The keyword and the name of the item that begins with a line of code. A variant is seen only if it is `documented`, and has no keyword;
/// a field is no item.
fn beginning(code: &str, documented: bool) -> Option<(&'static str, String)> {
    const BEFORE: [&str; 5] = ["pub(crate) ", "pub(super) ", "pub ", "unsafe ", "async "];
    const KEYWORDS: [&str; 10] =
        ["fn", "struct", "enum", "trait", "impl", "type", "const", "static", "mod", "macro_rules!"];
    let mut words = code;
    while let Some(rest) = BEFORE.iter().find_map(|word| words.strip_prefix(word)) {
        words = rest;
    }
    words = words.strip_prefix("const ").filter(|rest| rest.starts_with("fn ")).unwrap_or(words);
    let item = KEYWORDS.iter().find_map(|keyword| Some((*keyword, words.strip_prefix(keyword)?)));
    match item.filter(|(_, rest)| rest.starts_with([' ', '<'])) {
        Some(("impl", _)) => Some(("impl", owner_of_impl(words))),
        Some((keyword, rest)) => Some((keyword, identifier(rest.trim_start()))),
        None if documented && words.starts_with(char::is_uppercase) => Some(("", identifier(words))),
        None => None,
    }
}

fn identifier(text: &str) -> String {
    text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()
}

/// The type of `impl<…> Trait for Type<…>`.
fn owner_of_impl(words: &str) -> String {
    let mut depth = 0;
    let flat: String = words
        .trim_start_matches("impl")
        .chars()
        .filter(|c| {
            depth += i32::from(*c == '<');
            let keep = depth == 0;
            depth -= i32::from(*c == '>');
            keep
        })
        .collect();
    let owner = flat.split(" for ").last().unwrap_or_default().trim_start();
    identifier(owner.rsplit("::").next().unwrap_or_default())
}

/// The numbers of all equations of the paper that a text cites, each once.
fn numbers(text: &str) -> Vec<u32> {
    let mut found = Vec::new();
    for (sign, several) in [("Eq. ", false), ("Eqs. ", true)] {
        for (place, _) in text.match_indices(sign) {
            if !belongs_to_other_source(&text[..place]) {
                list(&text[place + sign.len()..], several, &mut found);
            }
        }
    }
    found.sort_unstable();
    found.dedup();
    found
}

/// Whether a DOI stands before this place in the same clause: then the equation is one of that source.
fn belongs_to_other_source(before: &str) -> bool {
    let clause = before.rfind("doi:").map(|place| &before[place..]);
    clause.is_some_and(|clause| !clause.contains([')', ';']) && !clause.contains(". "))
}

/// Reads "4", or if `several` "1, 2 and 3", "8–10", "8 to 10".
fn list(text: &str, several: bool, found: &mut Vec<u32>) {
    let Some((first, rest)) = number(text) else {
        return;
    };
    found.push(first);
    let (mut last, mut rest) = (first, rest);
    while let Some((is_range, value, tail)) = next(rest).filter(|_| several) {
        found.extend(if is_range { last + 1 } else { value }..=value);
        (last, rest) = (value, tail);
    }
}

/// Reads what may follow a number in a list: whether it closes a range, and its value.
fn next(text: &str) -> Option<(bool, u32, &str)> {
    let text = text.trim_start();
    let after = |words: [&str; 3]| words.iter().find_map(|word| text.strip_prefix(word));
    let (is_range, rest) = match after(["–", "-", "to"]) {
        Some(rest) => (true, rest),
        None => (false, after([", and", ",", "and"])?),
    };
    let (value, tail) = number(rest)?;
    Some((is_range, value, tail))
}

fn number(text: &str) -> Option<(u32, &str)> {
    let text = text.trim_start();
    let end = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
    // Three digits are no equation of this paper; a range of them would only make a long list.
    let value = text[..end].parse().ok().filter(|value| *value < 100)?;
    Some((value, &text[end..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_in_every_way_they_are_written() {
        assert_eq!(numbers("Eq. 4: x, 7"), [4]);
        assert_eq!(numbers("Eqs. 1–3 and Eq. 11"), [1, 2, 3, 11]);
        assert_eq!(numbers("(Eqs. 13, 14, Fig. 10)"), [13, 14]);
        assert_eq!(numbers("Eqs. 8 to\n 10"), [8, 9, 10]);
        assert_eq!(numbers("of Eqs. 13, 14 and 16: the"), [13, 14, 16]);
        assert_eq!(numbers("Eqs. 6,\n7"), [6, 7]);
        assert!(numbers("an Eq. without a number").is_empty());
    }

    #[test]
    fn equations_of_other_sources_do_not_count() {
        assert!(numbers("(Macklin 2016, doi:10.1145/2994258.2994272, Eq. 5)").is_empty());
        assert_eq!(numbers("as they do (doi:10.1145/2994258.2994272). Eq. 5 of the paper"), [5]);
    }

    #[test]
    fn a_citation_is_found_at_its_item() {
        let text = "//! Eq. 1.\n\n/// Eq. 2.\n#[derive(\n    Debug\n)]\npub struct A {\n    /// c of Eq. 9.\n    pub c: f32,\n}\n\n\
                    impl<R: Rng> Trait<R> for A {\n    /// Eqs. 3, 4.\n    pub(crate) const fn go(&self) {\n        // Eq. 4: x = y\n        x(); // Eq. 3\n    }\n}\n\n\
                    /// One of them.\npub enum B {\n    /// Eq. 5.\n    Uniform {},\n}\n\n#[cfg(test)]\nmod tests {\n    // Eq. 6\n}\n";
        let found: Vec<_> = citations(text).into_iter().map(|c| (c.equation, c.item, c.line, c.place)).collect();
        let item = |equation, item: &str, line, place| (equation, item.to_owned(), line, place);
        let expected = [
            item(2, "struct A", 7, Place::Documentation),
            item(3, "A::go", 14, Place::Documentation),
            item(4, "A::go", 14, Place::Documentation),
            item(4, "A::go", 14, Place::Inside(15)),
            item(3, "A::go", 14, Place::Inside(16)),
            item(5, "B::Uniform", 23, Place::Documentation),
            item(1, "(the module)", 1, Place::Heading),
        ];
        assert_eq!(found, expected);
    }
}
