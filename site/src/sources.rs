//! The Markdown files of the repository that are pages of the site.

use std::collections::BTreeMap;
use std::fs;

use anyhow::{Context, Result};

use crate::Input;
use crate::page::{Group, Page};

/// Pages in the order of the navigation: path, part of the navigation, title and source. Formats, crates and sections
/// of recipes follow in their parts.
const PAGES: [(&str, Group, &str, &str); 28] = [
    ("index.html", Group::Start, "papsynth", "site/pages/index.md"),
    ("start.html", Group::Start, "Start in five minutes", "site/pages/start.md"),
    ("overview.html", Group::Start, "Overview", "README.md"),
    ("how-to/microscope.html", Group::HowTo, "My microscope", "site/pages/how-to/microscope.md"),
    ("how-to/stain.html", Group::HowTo, "My stain", "site/pages/how-to/stain.md"),
    ("how-to/segmenter.html", Group::HowTo, "Train a segmenter", "site/pages/how-to/segmenter.md"),
    ("how-to/millions.html", Group::HowTo, "Ten million images", "site/pages/how-to/millions.md"),
    ("how-to/class.html", Group::HowTo, "A new class", "site/pages/how-to/class.md"),
    ("how-to/debris.html", Group::HowTo, "A new kind of debris", "site/pages/how-to/debris.md"),
    ("how-to/slides.html", Group::HowTo, "Whole slides", "site/pages/how-to/slides.md"),
    ("gallery/cells.html", Group::Gallery, "Classes of cells", "site/pages/gallery/cells.md"),
    ("gallery/debris.html", Group::Gallery, "Kinds of debris", "site/pages/gallery/debris.md"),
    ("physics/index.html", Group::Physics, "From a scene to grey levels", "site/pages/physics/index.md"),
    ("physics/cells.html", Group::Physics, "Cells", "site/pages/physics/cells.md"),
    ("physics/stain.html", Group::Physics, "Stain and colour", "site/pages/physics/stain.md"),
    ("physics/optics.html", Group::Physics, "Image formation", "site/pages/physics/optics.md"),
    ("physics/camera.html", Group::Physics, "Camera", "site/pages/physics/camera.md"),
    ("properties/measured.html", Group::Measured, "Overview", "site/pages/measured.md"),
    ("properties/limits.html", Group::Measured, "Limits", "site/pages/limits.md"),
    ("properties/performance.html", Group::Measured, "Performance", "docs/PERFORMANCE.md"),
    ("properties/worth.html", Group::Measured, "Worth for training", "docs/WORTH.md"),
    ("properties/reproducibility.html", Group::Measured, "Reproducibility", "docs/REPRODUCIBILITY.md"),
    ("properties/slides.html", Group::More, "Files of whole slides", "docs/SLIDES.md"),
    ("properties/clusters.html", Group::More, "Clusters", "docs/CLUSTERS.md"),
    ("properties/glossary.html", Group::More, "Glossary", "docs/GLOSSARY.md"),
    ("properties/architecture.html", Group::More, "Architecture", "ARCHITECTURE.md"),
    ("properties/decisions.html", Group::More, "Decisions", "docs/decisions.md"),
    ("properties/changes.html", Group::More, "Changes", "CHANGELOG.md"),
];

/// Begins a line that stands for a section of another file: `<!-- section README.md Limits -->`.
const SECTION: &str = "<!-- section ";

/// Begins a line that stands for a source file: `<!-- file crates/papsynth/src/key.rs -->`.
const FILE: &str = "<!-- file ";

/// Returns the pages that are Markdown files, and the lists of formats and crates.
pub(crate) fn pages(input: &Input) -> Result<Vec<Page>> {
    let mut pages = Vec::new();
    for (path, group, title, source) in PAGES {
        pages.push(page(input, path, group, title, source)?);
    }
    let mut formats = String::from("# Formats\n\nEach page describes one format and reads it with Python.\n\n");
    let (mut of_formats, mut of_crates) = (Vec::new(), Vec::new());
    for name in names(input, "docs/formats")? {
        let source = format!("docs/formats/{name}");
        let stem = name.trim_end_matches(".md");
        let page = page(input, &format!("formats/{stem}.html"), Group::Formats, stem, &source)?;
        let title = page.text.lines().next().unwrap_or_default().trim_start_matches("# ").to_owned();
        formats += &format!("- [{}]({stem}.html): {title}\n", stem);
        of_formats.push(page);
    }
    let mut crates = String::from("# Crates\n\nEach technique is a crate that can be used alone.\n\n");
    crates += "| crate | what it does |\n|---|---|\n";
    for name in names(input, "crates")? {
        let source = format!("crates/{name}/README.md");
        if !input.root.join(&source).is_file() {
            continue;
        }
        let page = page(input, &format!("crates/{name}.html"), Group::Crates, &name, &source)?;
        crates += &format!("| [{name}]({name}.html) | {} |\n", description(input, &name)?);
        of_crates.push(page);
    }
    pages.push(Page::new("formats/index.html", Group::Formats, "All formats", formats));
    pages.append(&mut of_formats);
    pages.push(Page::new("crates/index.html", Group::Crates, "All crates", crates));
    pages.append(&mut of_crates);
    Ok(pages)
}

fn page(input: &Input, path: &str, group: Group, title: &str, source: &str) -> Result<Page> {
    let mut text = String::new();
    let inside = |line: &'_ str, start: &str| Some(line.strip_prefix(start)?.strip_suffix(" -->")?.to_owned());
    for line in input.read(source)?.lines() {
        if let Some(words) = inside(line, SECTION) {
            let (file, heading) = words.split_once(' ').with_context(|| format!("{source}: {line}"))?;
            let section = section(&input.read(file)?, heading);
            text += &section.with_context(|| format!("{source}: {file} has no section `{heading}`"))?;
        } else if let Some(file) = inside(line, FILE) {
            text += &format!("```rust\n{}```", input.read(&file)?);
        } else {
            text += line;
        }
        text.push('\n');
    }
    let mut page = Page::new(path, group, title, text);
    page.source = source.to_owned();
    Ok(page)
}

/// Returns the text below a heading of the second level.
fn section(text: &str, heading: &str) -> Option<String> {
    let mut lines = text.lines().skip_while(|line| line.strip_prefix("## ") != Some(heading));
    lines.next()?;
    Some(lines.take_while(|line| !line.starts_with("## ")).collect::<Vec<_>>().join("\n"))
}

/// Returns the description of a crate in its manifest.
fn description(input: &Input, name: &str) -> Result<String> {
    let path = format!("crates/{name}/Cargo.toml");
    let manifest: toml::Table = input.read(&path)?.parse().with_context(|| path.clone())?;
    let description = manifest.get("package").and_then(|package| package.get("description")?.as_str());
    Ok(description.with_context(|| format!("{path} has no description"))?.to_owned())
}

/// Returns the sorted names of the entries of a folder.
fn names(input: &Input, folder: &str) -> Result<Vec<String>> {
    let path = input.root.join(folder);
    let entries = fs::read_dir(&path).with_context(|| format!("cannot read {}", path.display()))?;
    let names = entries.map(|entry| Ok(entry?.file_name().to_string_lossy().into_owned()));
    let mut names = names.collect::<Result<Vec<String>>>()?;
    names.sort();
    Ok(names)
}

/// Puts pages into the order of the parts of the navigation; the overview is the last page of the first part.
pub(crate) fn sort(pages: &mut [Page]) {
    pages.sort_by_key(|page| (page.group, page.path == "overview.html"));
}

/// Returns the path of the page of each Markdown file, and of the folder of formats.
pub(crate) fn by_path(pages: &[Page]) -> BTreeMap<String, String> {
    let pages = pages.iter().filter(|page| !page.source.is_empty());
    let mut found: BTreeMap<String, String> = pages.map(|page| (page.source.clone(), page.path.clone())).collect();
    found.insert("docs/formats".to_owned(), "formats/index.html".to_owned());
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_section_ends_at_the_next_heading() {
        let text = "# A\n## Limits\n\n- one\n### two\n## B\nthree";
        assert_eq!(section(text, "Limits").as_deref(), Some("\n- one\n### two"));
        assert_eq!(section(text, "C"), None);
    }
}
