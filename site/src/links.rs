//! Checks the finished site: links, anchors, and that no page loads anything from elsewhere.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Result, ensure};

use crate::Input;
use crate::page::{Page, folder, join};

/// Checks all pages as they are written, and returns the number of links within the site.
pub(crate) fn check(input: &Input, pages: &[Page]) -> Result<usize> {
    let mut texts = BTreeMap::new();
    for page in pages {
        let text = std::fs::read_to_string(input.out.join(&page.path))?;
        texts.insert(page.path.as_str(), text);
    }
    let anchors: BTreeMap<&str, BTreeSet<&str>> =
        texts.iter().map(|(path, text)| (*path, values(text, "id").collect())).collect();
    let (mut problems, mut count) = (Vec::new(), 0);
    for (path, text) in &texts {
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
            let Some(target) = target.filter(|target| input.out.join(target).is_file()) else {
                problems.push(format!("{path}: {link}: there is no such file"));
                continue;
            };
            let is_known = anchors.get(target.as_str()).is_none_or(|known| known.contains(anchor));
            if !anchor.is_empty() && !is_known {
                problems.push(format!("{path}: {link}: there is no such anchor"));
            }
        }
    }
    ensure!(problems.is_empty(), "{} problems in links of the site:\n{}", problems.len(), problems.join("\n"));
    Ok(count)
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
    fn attributes_are_found_in_tags_only() {
        let text = "<a class=\"x\" href=\"a.html#b\">href=\"c\"</a><img src=\"d.png\">";
        assert_eq!(Vec::from_iter(values(text, "href")), ["a.html#b"]);
        assert_eq!(Vec::from_iter(values(text, "src")), ["d.png"]);
    }
}
