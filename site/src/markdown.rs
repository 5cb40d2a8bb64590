//! Markdown to HTML, with anchors of headings and addresses of the site instead of paths of the repository.

use std::collections::BTreeMap;
use std::fs;

use anyhow::{Context, Result, bail, ensure};
use pulldown_cmark::{BrokenLink, CodeBlockKind, CowStr, Event, Options, Parser, Tag, TagEnd, html::push_html};

use crate::figures::Figures;
use crate::page::{Body, Heading, Page, folder, join};
use crate::{Input, equations, write};

/// Address of a link to an item of Rust, which the site does not have.
const ITEM: &str = "item:";

/// Returns the HTML of a page. `sources` gives the page of each Markdown file.
pub(crate) fn html(input: &Input, page: &Page, sources: &BTreeMap<String, String>) -> Result<Body> {
    let mut items = |link: BrokenLink<'_>| {
        let is_item = link.reference.starts_with('`');
        is_item.then(|| (CowStr::from(ITEM), CowStr::from("")))
    };
    let parser = Parser::new_with_broken_link_callback(
        &page.text,
        Options::ENABLE_TABLES | Options::ENABLE_STRIKETHROUGH | Options::ENABLE_MATH,
        Some(&mut items),
    );
    let mut events: Vec<Event<'_>> = parser.collect();
    equations::typeset(&mut events).with_context(|| shown(page).to_owned())?;
    if let Some(figures) = Figures::make(input, page, &events).with_context(|| shown(page).to_owned())? {
        events = figures.placed(events).with_context(|| shown(page).to_owned())?;
        figures.remove()?;
    }
    let mut headings = Vec::new();
    let mut used: BTreeMap<String, usize> = BTreeMap::new();
    for at in 0..events.len() {
        if matches!(events[at], Event::Start(Tag::Heading { .. })) {
            let text = text_of(&events[at..]);
            let anchor = unique(slug(&text), &mut used);
            let Event::Start(Tag::Heading { level, id, .. }) = &mut events[at] else { continue };
            if *level as usize > 1 {
                headings.push(Heading { anchor: anchor.clone(), text, meaning: String::new() });
            }
            *id = Some(anchor.into());
        }
        if let Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) = &mut events[at] {
            let new = address(input, page, sources, dest_url)
                .with_context(|| format!("{}: the link to {dest_url}", shown(page)))?;
            *dest_url = new.into();
        }
    }
    let mut html = String::new();
    push_html(&mut html, adapted(events).into_iter());
    Ok(Body { html, headings })
}

fn shown(page: &Page) -> &str {
    if page.source.is_empty() { &page.path } else { &page.source }
}

/// Returns the address of a link of a page within the site, and copies the file if it is not a page.
fn address(input: &Input, page: &Page, sources: &BTreeMap<String, String>, link: &str) -> Result<String> {
    let is_outside = ["https://", "http://", "mailto:", ITEM].iter().any(|start| link.starts_with(start));
    // Pages without a source use addresses of the site.
    if is_outside || link.starts_with('#') || page.source.is_empty() {
        return Ok(link.to_owned());
    }
    let (path, anchor) = match link.split_once('#') {
        Some((path, anchor)) => (path, format!("#{anchor}")),
        None => (link, String::new()),
    };
    // Pages of the site itself: `site:gallery.html`.
    if let Some(path) = path.strip_prefix("site:") {
        return Ok(page.address_of(path) + &anchor);
    }
    let path = join(folder(&page.source), path).context("outside the repository")?;
    if let Some(target) = sources.get(&path).or_else(|| sources.get(&format!("{path}/README.md"))) {
        return Ok(page.address_of(target) + &anchor);
    }
    let file = input.root.join(&path);
    ensure!(file.exists(), "there is no such file");
    if file.is_dir() {
        bail!("a folder that is not a page");
    }
    let is_picture = [".png", ".svg"].iter().any(|ending| path.ends_with(ending));
    // Servers send unknown endings as downloads.
    let target = if is_picture { format!("media/{path}") } else { format!("files/{path}.txt") };
    let copy = input.out.join(&target);
    if !copy.exists() {
        write(&copy, fs::read(&file).with_context(|| format!("cannot read {}", file.display()))?)?;
    }
    Ok(page.address_of(&target) + &anchor)
}

/// Returns the text of the heading with which these events begin.
fn text_of(events: &[Event<'_>]) -> String {
    let inside = events.iter().take_while(|event| !matches!(event, Event::End(TagEnd::Heading(_))));
    let words = inside.filter_map(|event| match event {
        Event::Text(text) | Event::Code(text) => Some(text.as_ref()),
        Event::SoftBreak => Some(" "),
        _ => None,
    });
    words.collect()
}

/// Returns the anchor of a heading, as GitHub forms it.
fn slug(text: &str) -> String {
    let kept = text.chars().filter(|letter| letter.is_alphanumeric() || matches!(letter, ' ' | '-' | '_'));
    kept.collect::<String>().to_lowercase().replace(' ', "-")
}

fn unique(slug: String, used: &mut BTreeMap<String, usize>) -> String {
    let count = used.entry(slug.clone()).or_default();
    *count += 1;
    if *count == 1 { slug } else { format!("{slug}-{}", *count - 1) }
}

/// Removes links to items of Rust and hidden lines of examples, and puts tables into containers that scroll.
fn adapted(events: Vec<Event<'_>>) -> Vec<Event<'_>> {
    let (mut kept, mut in_item, mut in_rust) = (Vec::with_capacity(events.len()), false, false);
    for event in events {
        match event {
            Event::Start(Tag::Link { ref dest_url, .. }) if &**dest_url == ITEM => in_item = true,
            Event::End(TagEnd::Link) if in_item => in_item = false,
            Event::Start(Tag::Table(_)) => kept.extend([Event::Html("<div class=\"wide\">".into()), event]),
            Event::End(TagEnd::Table) => kept.extend([event, Event::Html("</div>".into())]),
            Event::Start(Tag::CodeBlock(CodeBlockKind::Fenced(ref language))) => {
                in_rust = language.starts_with("rust") || language.is_empty();
                // Further words are for tests.
                let language = language.split([' ', ',']).next().unwrap_or_default().to_owned();
                kept.push(Event::Start(Tag::CodeBlock(CodeBlockKind::Fenced(language.into()))));
            }
            Event::End(TagEnd::CodeBlock) => {
                in_rust = false;
                kept.push(event);
            }
            Event::Text(text) if in_rust => {
                let lines = text.split_inclusive('\n').filter(|line| !line.starts_with("# ") && line.trim() != "#");
                kept.push(Event::Text(lines.collect::<String>().into()));
            }
            _ => kept.push(event),
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn anchors_are_those_of_github() {
        assert_eq!(slug("`croissant.json`: metadata, twice"), "croissantjson-metadata-twice");
        let mut used = BTreeMap::new();
        assert_eq!(["a", "a"].map(|text| unique(slug(text), &mut used)), ["a", "a-1"]);
    }

    #[test]
    fn hidden_lines_of_examples_are_removed() {
        let events: Vec<Event<'_>> = Parser::new("```rust\n# use a::B;\nlet b = B;\n```\n").collect();
        let mut html = String::new();
        push_html(&mut html, adapted(events).into_iter());
        assert!(html.contains("let b") && !html.contains("use a"), "{html}");
    }
}
