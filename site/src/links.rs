//! Checks the finished site: links, anchors, and that no page loads anything from elsewhere.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use anyhow::{Context, Result, ensure};

use crate::Input;
use crate::page::{Page, folder, join};

/// Checks all pages as they are written, and returns the number of links within the site.
pub(crate) fn check(input: &Input, pages: &[Page]) -> Result<usize> {
    let mut texts = BTreeMap::new();
    for page in pages {
        let path = input.out.join(&page.path);
        let text = fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
        texts.insert(page.path.as_str(), text);
    }
    let (problems, count) = problems(&texts, |path| input.out.join(path).is_file());
    ensure!(problems.is_empty(), "{} problems in links of the site:\n{}", problems.len(), problems.join("\n"));
    Ok(count)
}

/// Returns the problems of pages, given by their paths, and the number of links.
fn problems(texts: &BTreeMap<&str, String>, exists: impl Fn(&str) -> bool) -> (Vec<String>, usize) {
    let anchors: BTreeMap<&str, BTreeSet<&str>> =
        texts.iter().map(|(path, text)| (*path, values(text, "id").collect())).collect();
    let (mut problems, mut count) = (Vec::new(), 0);
    for (path, text) in texts {
        let doubled = values(text, "id").count() - anchors[path].len();
        if doubled > 0 {
            problems.push(format!("{path}: {doubled} anchors occur twice"));
        }
        for link in values(text, "src").filter(|link| link.contains(':')) {
            problems.push(format!("{path}: loads {link} from elsewhere"));
        }
        for link in values(text, "href").chain(values(text, "src")).filter(|link| !link.contains(':')) {
            count += 1;
            let (target, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = if target.is_empty() { Some((*path).to_owned()) } else { join(folder(path), target) };
            let Some(target) = target.filter(|target| exists(target)) else {
                problems.push(format!("{path}: {link}: there is no such file"));
                continue;
            };
            let is_known = anchors.get(target.as_str()).is_none_or(|known| known.contains(anchor));
            if !anchor.is_empty() && !is_known {
                problems.push(format!("{path}: {link}: there is no such anchor"));
            }
        }
    }
    (problems, count)
}

/// Returns the values of an attribute in a page of our own making, which quotes all of them.
fn values<'a>(text: &'a str, name: &'a str) -> impl Iterator<Item = &'a str> {
    let tags = text.split('<').skip(1).filter_map(|part| part.split('>').next());
    tags.filter_map(move |tag| {
        let (_, value) = tag.split_once(&format!(" {name}=\""))?;
        value.split('"').next()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn broken_links_are_found() {
        let good = "<p id=\"x\"></p><a href=\"b/c.html#y\"></a><a href=\"https://example.org\"></a>".to_owned();
        let texts = BTreeMap::from([("a.html", good), ("b/c.html", "<p id=\"y\"></p>".to_owned())]);
        let exists = |path: &str| ["a.html", "b/c.html"].contains(&path);
        assert_eq!(problems(&texts, exists), (Vec::new(), 1));
        for bad in [
            "<a href=\"d.html\"></a>",
            "<a href=\"../a.html#z\"></a>",
            "<a href=\"../../a.html\"></a>",
            "<img src=\"https://example.org/a.png\">",
            "<p id=\"y\"></p>",
        ] {
            let mut texts = texts.clone();
            texts.insert("b/c.html", format!("<p id=\"y\"></p>{bad}"));
            assert_eq!(problems(&texts, exists).0.len(), 1, "{bad}");
        }
    }

    #[test]
    fn attributes_are_found_in_tags_only() {
        let text = "<a class=\"x\" href=\"a.html#b\">href=\"c\"</a><img src=\"d.png\">";
        assert_eq!(Vec::from_iter(values(text, "href")), ["a.html#b"]);
        assert_eq!(Vec::from_iter(values(text, "src")), ["d.png"]);
    }
}
