//! Errors as text, with the line of a file that they are about.

use std::fmt::{Display, Formatter};
use std::io::{IsTerminal, stderr};
use std::ops::Range;
use std::sync::Arc;

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};

/// Longest line of a file that is worth showing: a longer line would fill the screen.
const LONGEST_SHOWN_LINE: usize = 400;

/// A place in a text that the user wrote.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub(crate) struct Place {
    /// A file's path, or `--set`.
    file: String,
    /// From 1.
    line: usize,
    /// From 1, in characters.
    column: usize,
}

impl Display for Place {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}:{}:{}", self.file, self.line, self.column)
    }
}

#[derive(Debug)]
pub(crate) struct Excerpt {
    name: String,
    text: Arc<String>,
    span: Range<usize>,
}

/// The place where a part of a text begins, and what is shown of it; nothing of a text with a very long line.
pub(crate) fn cut(name: &str, text: &Arc<String>, span: Range<usize>) -> (Place, Option<Excerpt>) {
    let (start, end) = (text.floor_char_boundary(span.start), text.floor_char_boundary(span.end));
    let before = &text[..start];
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().unwrap_or_default().chars().count() + 1;
    let place = Place { file: name.to_owned(), line, column };
    let is_shown = text.lines().all(|line| line.len() <= LONGEST_SHOWN_LINE);
    // An underline does not reach beyond its first line.
    let end = text[start..end.max(start)].find('\n').map_or(end.max(start), |newline| start + newline);
    let excerpt = Excerpt { name: name.to_owned(), text: Arc::clone(text), span: start..end };
    (place, is_shown.then_some(excerpt))
}

/// An error as lines of text, in colour on a terminal unless `NO_COLOR` is set.
pub(crate) fn report(message: &str, excerpt: Option<&Excerpt>, help: Option<&str>) -> String {
    let in_colour = stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none();
    let renderer = if in_colour { Renderer::styled() } else { Renderer::plain() };
    let mut group = Group::with_title(Level::ERROR.primary_title(message));
    if let Some(Excerpt { name, text, span }) = excerpt {
        let marked = AnnotationKind::Primary.span(span.clone());
        group = group.element(Snippet::source(text.as_str()).path(name).annotation(marked));
    }
    if let Some(help) = help {
        group = group.element(Level::HELP.message(help));
    }
    renderer.term_width(2 * LONGEST_SHOWN_LINE).render(&[group])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_count_lines_and_characters_from_one() {
        let text = Arc::new("a = 1\nµ = 2\n".to_owned());
        let (place, excerpt) = cut("x.toml", &text, 9..12);
        assert_eq!(place, Place { file: "x.toml".to_owned(), line: 2, column: 3 });
        let told = report("no", excerpt.as_ref(), Some("try b"));
        assert!(told.contains("x.toml:2:3") && told.contains("µ = 2") && told.contains("try b"), "{told}");
        // In the middle of a character, and beyond the end.
        for span in [7..8, 90..100] {
            let (_, excerpt) = cut("x.toml", &text, span);
            assert!(report("no", excerpt.as_ref(), None).contains("no"));
        }
    }

    #[test]
    fn a_very_long_line_is_named_but_not_shown() {
        let text = Arc::new("[".repeat(10_000));
        let (place, excerpt) = cut("x.toml", &text, 80..81);
        assert!(excerpt.is_none());
        assert_eq!(place.to_string(), "x.toml:1:81");
    }
}
