//! Pages of the site, and addresses of one page relative to another.

/// A part of the navigation.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Group {
    Start,
    HowTo,
    Gallery,
    Recipe,
    Physics,
    Measured,
    Formats,
    More,
    Crates,
}

impl Group {
    pub(crate) const ALL: [Self; 9] = [
        Self::Start,
        Self::HowTo,
        Self::Gallery,
        Self::Recipe,
        Self::Physics,
        Self::Measured,
        Self::Formats,
        Self::More,
        Self::Crates,
    ];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Start => "Start",
            Self::HowTo => "How to",
            Self::Gallery => "Gallery",
            Self::Recipe => "Recipe",
            Self::Physics => "Physics",
            Self::Measured => "What was measured",
            Self::Formats => "Formats",
            Self::More => "More",
            Self::Crates => "Crates",
        }
    }
}

/// One page.
pub(crate) struct Page {
    /// Path within the site, such as `how-to/class.html`.
    pub(crate) path: String,
    pub(crate) group: Group,
    /// Title in the navigation.
    pub(crate) title: String,
    /// Markdown.
    pub(crate) text: String,
    /// Path of the Markdown file in the repository; relative links start at its folder.
    pub(crate) source: String,
    /// HTML of the content, empty until [`set_body`](Self::set_body).
    pub(crate) body: String,
    /// Headings below the title.
    pub(crate) headings: Vec<Heading>,
}

/// A place of a page that the search finds.
pub(crate) struct Heading {
    pub(crate) anchor: String,
    pub(crate) text: String,
    /// Further text, such as the meaning of a field; may be empty.
    pub(crate) meaning: String,
}

/// HTML of a page and its headings.
pub(crate) struct Body {
    pub(crate) html: String,
    pub(crate) headings: Vec<Heading>,
}

impl Page {
    pub(crate) fn new(path: impl Into<String>, group: Group, title: impl Into<String>, text: String) -> Self {
        let (path, title) = (path.into(), title.into());
        Self { path, group, title, text, source: String::new(), body: String::new(), headings: Vec::new() }
    }

    pub(crate) fn set_body(&mut self, body: Body) {
        self.body = body.html;
        self.headings.extend(body.headings);
    }

    /// Returns the address of another file of the site, relative to this page.
    pub(crate) fn address_of(&self, path: &str) -> String {
        "../".repeat(self.path.matches('/').count()) + path
    }
}

/// Joins a relative path to a folder, without `.` and `..`. Returns `None` for a path outside the root.
pub(crate) fn join(folder: &str, path: &str) -> Option<String> {
    let mut parts: Vec<&str> = folder.split('/').filter(|part| !part.is_empty()).collect();
    for part in path.split('/') {
        match part {
            "" | "." => (),
            ".." => drop(parts.pop()?),
            _ => parts.push(part),
        }
    }
    Some(parts.join("/"))
}

/// Returns the folder of a path, or "".
pub(crate) fn folder(path: &str) -> &str {
    path.rsplit_once('/').map_or("", |(folder, _)| folder)
}

/// Escapes text for HTML.
pub(crate) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_joined() {
        assert_eq!(join("crates/papsynth", "../../README.md").as_deref(), Some("README.md"));
        assert_eq!(join("", "./docs/a.md").as_deref(), Some("docs/a.md"));
        assert_eq!(join("docs", "../../outside"), None);
    }

    #[test]
    fn addresses_are_relative() {
        let page = Page::new("how-to/class.html", Group::HowTo, "A new class", String::new());
        assert_eq!(page.address_of("style.css"), "../style.css");
    }
}
