//! The frame of a page: navigation, search and content.

use anyhow::Result;

use crate::page::{Group, Page, escape};

/// Returns a whole page.
pub(crate) fn html(page: &Page, pages: &[Page]) -> String {
    let title = if page.path == "index.html" { "papsynth".to_owned() } else { format!("{} – papsynth", page.title) };
    let at = pages.iter().position(|other| other.path == page.path).unwrap_or_default();
    let turn = |other: Option<&Page>, class: &str| {
        other.map_or_else(String::new, |other| {
            let address = page.address_of(&other.path);
            format!("<a rel=\"{class}\" class=\"{class}\" href=\"{address}\">{}</a>\n", escape(&other.title))
        })
    };
    let before = turn(at.checked_sub(1).and_then(|at| pages.get(at)), "prev");
    let after = turn(pages.get(at + 1), "next");
    let root = page.address_of("");
    format!(
        r##"<!doctype html>
<html lang="en" data-root="{root}">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{title}</title>
<link rel="icon" href="data:,">
<link rel="stylesheet" href="{root}style.css">
<script src="{root}site.js" defer></script>
</head>
<body>
<a class="skip" href="#content">Skip to the content</a>
<header>
<a class="name" href="{root}index.html">papsynth</a>
<a href="{root}workbench/index.html">Workbench</a>
<div class="search" role="search" hidden>
<input type="search" id="search" aria-label="Search" placeholder="Search ( / )" autocomplete="off" spellcheck="false">
<ol id="found" aria-label="Results" aria-live="polite" hidden></ol>
</div>
</header>
<div class="columns-page">
<details class="menu">
<summary>Contents</summary>
<nav aria-label="Contents">
{navigation}</nav>
</details>
<main id="content" tabindex="-1">
{body}<footer>
{before}{after}</footer>
</main>
</div>
</body>
</html>
"##,
        title = escape(&title),
        navigation = navigation(page, pages),
        body = page.body,
    )
}

fn navigation(page: &Page, pages: &[Page]) -> String {
    let mut html = String::new();
    for group in Group::ALL {
        let open = if group == page.group || matches!(group, Group::Start | Group::HowTo) { " open" } else { "" };
        html += &format!("<details{open}><summary>{}</summary>\n<ul>\n", group.name());
        for other in pages.iter().filter(|other| other.group == group) {
            let current = if other.path == page.path { " aria-current=\"page\"" } else { "" };
            let address = page.address_of(&other.path);
            html += &format!("<li><a href=\"{address}\"{current}>{}</a></li>\n", escape(&other.title));
        }
        html += "</ul>\n</details>\n";
    }
    html
}

/// Returns the script with the titles, headings and fields of all pages, which the search reads.
pub(crate) fn search(pages: &[Page]) -> Result<String> {
    let mut entries = Vec::new();
    for page in pages {
        entries.push([page.title.clone(), page.path.clone(), page.group.name().to_owned(), String::new()]);
        for heading in &page.headings {
            let address = format!("{}#{}", page.path, heading.anchor);
            entries.push([heading.text.clone(), address, page.title.clone(), heading.meaning.clone()]);
        }
    }
    Ok(format!("window.papsynthPages = {};\n", serde_json::to_string(&entries)?))
}
