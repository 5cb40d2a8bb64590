//! Lists the citations of the paper's equations.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};

use crate::shell;
use crate::workspace::Workspace;

/// The equations of the paper, which must all be cited. 17 to 19 are image measures, in papsynth-judge.
const EQUATIONS: std::ops::RangeInclusive<u32> = 1..=19;

/// A line that cites an equation, itself or in the documentation above it.
#[derive(Debug, PartialEq, Eq)]
struct Citation {
    equation: u32,
    /// Line number, from 1.
    line: usize,
    text: String,
    is: Cited,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Cited {
    /// In the documentation of an item.
    AtItem,
    /// In a comment at the code that computes it.
    InCode,
    /// At a field, or in the documentation of a module; does not count.
    Elsewhere,
}

pub(crate) fn run(workspace: &Workspace) -> Result<()> {
    let mut table: BTreeMap<u32, Vec<(PathBuf, Citation)>> = BTreeMap::new();
    let crates = workspace.root.join("crates");
    let mut files = Vec::new();
    for package in workspace.packages.iter().filter(|package| package.folder().starts_with(&crates)) {
        sources(&package.folder().join("src"), &mut files)?;
    }
    for path in files {
        for citation in citations(&shell::read(&path)?) {
            table.entry(citation.equation).or_default().push((path.clone(), citation));
        }
    }
    for (equation, citations) in table.iter().filter(|(equation, _)| EQUATIONS.contains(equation)) {
        for (path, Citation { line, text, .. }) in citations {
            println!("Eq. {equation:<4} {}:{line}  {text}", workspace.shown(path));
        }
    }
    let without = |kind: Cited| {
        let is_cited =
            |n: &u32| table.get(n).is_some_and(|found| found.iter().any(|(_, citation)| citation.is == kind));
        EQUATIONS.filter(|n| !is_cited(n)).map(|n| n.to_string()).collect::<Vec<_>>()
    };
    let (not_in_code, not_cited) = (without(Cited::InCode), without(Cited::AtItem));
    if !not_in_code.is_empty() {
        println!("No comment in code cites Eq. {}.", not_in_code.join(", "));
    }
    ensure!(not_cited.is_empty(), "no item cites Eq. {}", not_cited.join(", "));
    Ok(())
}

/// Adds all source files below a folder, in order, except tests.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) -> Result<()> {
    let entries = folder.read_dir().with_context(|| format!("cannot read {}", folder.display()))?;
    let paths: BTreeSet<PathBuf> = entries.map(|entry| Ok(entry?.path())).collect::<Result<_>>()?;
    for path in paths.into_iter().filter(|path| path.file_stem().is_some_and(|stem| stem != "tests")) {
        if path.is_dir() {
            sources(&path, found)?;
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
    Ok(())
}

/// Returns the citations of a source file, except those of its tests.
fn citations(text: &str) -> Vec<Citation> {
    let mut found = Vec::new();
    let mut documentation = String::new();
    let mut in_attribute = false;
    for (code, line) in text.lines().take_while(|line| *line != "mod tests {").map(str::trim).zip(1..) {
        let mut cite = |words: &str, is: Cited| {
            let citation = |equation| Citation { equation, line, text: code.to_owned(), is };
            found.extend(numbers(words).into_iter().map(citation));
        };
        if let Some(words) = code.strip_prefix("///") {
            documentation = documentation + words + "\n";
        } else if in_attribute || code.starts_with("#[") {
            in_attribute = !code.ends_with(']');
        } else if let Some(words) = code.strip_prefix("//!") {
            cite(words, Cited::Elsewhere);
        } else {
            cite(&documentation, if is_item(code) { Cited::AtItem } else { Cited::Elsewhere });
            documentation.clear();
            if let Some((_, comment)) = code.split_once("//") {
                cite(comment, Cited::InCode);
            }
        }
    }
    found
}

/// Returns whether an item or a variant, but not a field, begins with this line.
fn is_item(code: &str) -> bool {
    const KEYWORDS: [&str; 12] =
        ["fn", "struct", "enum", "trait", "impl", "type", "const", "static", "mod", "unsafe", "async", "macro_rules!"];
    let words = ["pub(crate) ", "pub(super) ", "pub "].iter().find_map(|word| code.strip_prefix(word)).unwrap_or(code);
    let first = words.split([' ', '<']).next().unwrap_or_default();
    KEYWORDS.contains(&first) || words.starts_with(char::is_uppercase)
}

/// Returns the numbers of the paper's equations that a text cites.
fn numbers(text: &str) -> BTreeSet<u32> {
    let mut found = BTreeSet::new();
    for (sign, several) in [("Eq. ", false), ("Eqs. ", true)] {
        for (place, _) in text.match_indices(sign) {
            if !belongs_to_other_source(&text[..place]) {
                found.extend(list(&text[place + sign.len()..], several));
            }
        }
    }
    found
}

/// Returns whether a DOI precedes in the same clause: the equation is then one of that source.
fn belongs_to_other_source(before: &str) -> bool {
    let clause = before.rfind("doi:").map(|place| &before[place..]);
    clause.is_some_and(|clause| !clause.contains([')', ';']) && !clause.contains(". "))
}

/// Reads "4", or if `several` "1, 2 and 3", "8–10", "8 to 10".
fn list(text: &str, several: bool) -> BTreeSet<u32> {
    let mut found = BTreeSet::new();
    let mut range = None;
    for word in text.replace(['–', '-'], " to ").replace(',', " ").split_whitespace() {
        let digits = word.trim_end_matches(|c: char| !c.is_ascii_digit());
        match (word, digits.parse::<u32>()) {
            ("and", _) => {}
            ("to", _) => range = found.last().copied(),
            (_, Ok(value)) => {
                found.extend(range.take().unwrap_or(value)..=value);
                if !several || digits != word {
                    break;
                }
            }
            _ => break,
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_in_all_notations() {
        for (text, expected) in [
            ("Eq. 4: x, 7", &[4][..]),
            ("Eqs. 1–3 and Eq. 11", &[1, 2, 3, 11]),
            ("(Eqs. 13, 14, Fig. 10)", &[13, 14]),
            ("Eqs. 8 to\n 10", &[8, 9, 10]),
            ("of Eqs. 13, 14 and 16: the", &[13, 14, 16]),
            ("Eqs. 6,\n7", &[6, 7]),
            ("an Eq. without a number", &[]),
            // Equations of other sources do not count.
            ("(Macklin 2016, doi:10.1145/2994258.2994272, Eq. 5)", &[]),
            ("as they do (doi:10.1145/2994258.2994272). Eq. 5 of the paper", &[5]),
        ] {
            assert_eq!(Vec::from_iter(numbers(text)), expected, "{text}");
        }
    }

    #[test]
    fn a_citation_is_found_at_its_item() {
        let text = "//! Eq. 1.\n\n/// Eq. 2.\n#[derive(\n    Debug\n)]\npub struct A {\n    /// c of Eq. 9.\n    pub c: f32,\n}\n\n\
                    impl<R: Rng> Trait<R> for A {\n    /// Eqs. 3, 4.\n    pub(crate) const fn go(&self) {\n        // Eq. 4: x = y\n        x(); // Eq. 3\n    }\n}\n\n\
                    /// One of them.\npub enum B {\n    /// Eq. 5.\n    Uniform {},\n}\n\n#[cfg(test)]\nmod tests {\n   
                    /// // Eq. 6\n}\n";
        let found: Vec<_> = citations(text).into_iter().map(|c| (c.equation, c.line, c.is)).collect();
        let expected = [
            (1, 1, Cited::Elsewhere),
            (2, 7, Cited::AtItem),
            (9, 9, Cited::Elsewhere),
            (3, 14, Cited::AtItem),
            (4, 14, Cited::AtItem),
            (4, 15, Cited::InCode),
            (3, 16, Cited::InCode),
            (5, 23, Cited::AtItem),
        ];
        assert_eq!(found, expected);
    }
}
