//! How the program ends: exit codes, error reports, Ctrl-C, and text on standard output.

use std::fmt::{Display, Formatter};
use std::io::{self, IsTerminal, Write, stderr};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};

/// Usage, recipe or input: trying again will not help. Shells use 2 for usage.
pub(crate) const INPUT: u8 = 2;

/// Input/output: trying again may help. `EX_IOERR` of sysexits.h.
const IO: u8 = 74;

/// Stopped by the user: 128 + SIGINT.
const INTERRUPTED: u8 = 130;

/// What is wrong, and where.
#[derive(Debug, serde::Serialize)]
pub(crate) struct Complaint {
    message: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    help: Option<String>,
    #[serde(rename = "at", skip_serializing_if = "Option::is_none")]
    place: Option<Place>,
    /// What the complaint sums up; each is reported on its own.
    #[serde(rename = "because", skip_serializing_if = "Vec::is_empty")]
    related: Vec<Complaint>,
    #[serde(skip)]
    excerpt: Option<Excerpt>,
}

impl Complaint {
    pub(crate) fn new(message: impl Display) -> Self {
        Self { message: message.to_string(), help: None, excerpt: None, related: Vec::new(), place: None }
    }

    pub(crate) fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// Points at a part of a text.
    pub(crate) fn at(mut self, name: &str, text: &Arc<String>, span: Range<usize>) -> Self {
        let (place, excerpt) = cut(name, text, span);
        if excerpt.is_none() {
            self.message = format!("{place}: {}", self.message);
        }
        (self.place, self.excerpt) = (Some(place), excerpt);
        self
    }

    /// Several complaints under one heading; one alone stands for itself.
    pub(crate) fn all(heading: &str, mut complaints: Vec<Self>) -> Self {
        match complaints.len() {
            1 => complaints.remove(0),
            _ => Self { related: complaints, ..Self::new(heading) },
        }
    }
}

#[derive(Debug)]
pub(crate) struct Failure {
    code: u8,
    complaint: Box<Complaint>,
}

impl Failure {
    /// A failure with this complaint; `is_io` if the system failed, so that trying again may help.
    pub(crate) fn new(is_io: bool, complaint: Complaint) -> Self {
        Self { code: if is_io { IO } else { INPUT }, complaint: Box::new(complaint) }
    }

    /// What the user asked for is wrong.
    pub(crate) fn input(message: impl Display) -> Self {
        Complaint::new(message).into()
    }

    /// The same, and what would help.
    pub(crate) fn wrong(message: impl Display, help: impl Into<String>) -> Self {
        Complaint::new(message).help(help).into()
    }

    pub(crate) fn interrupted(complaint: Complaint) -> Self {
        Self { code: INTERRUPTED, complaint: Box::new(complaint) }
    }

    /// The user stopped a run; running the same command again makes or writes the rest.
    pub(crate) fn stopped(message: String, does: &str) -> Self {
        let help = format!("run the same command again to {does} the rest");
        Self::interrupted(Complaint::new(message).help(help))
    }

    /// A subcommand of a feature that this program was built without.
    #[allow(dead_code, reason = "a program with all features lacks none")]
    pub(crate) fn left_out(feature: &str) -> Self {
        let message = format!("this subcommand needs a build of papsynth with `--features {feature}`");
        Self::wrong(message, "`cargo install papsynth-cli` builds all subcommands")
    }

    /// A file or folder that cannot be read or written: a wrong path is the user's, all else may pass.
    pub(crate) fn file(what: &str, path: &Path, error: &io::Error) -> Self {
        use io::ErrorKind::{AlreadyExists, InvalidFilename, InvalidInput, IsADirectory, NotADirectory, NotFound};
        let is_wrong_path = matches!(
            error.kind(),
            NotFound | IsADirectory | NotADirectory | AlreadyExists | InvalidFilename | InvalidInput
        );
        Self::new(!is_wrong_path, Complaint::new(format!("cannot {what} {}: {error}", path.display())))
    }

    pub(crate) fn code(&self) -> u8 {
        self.code
    }

    /// Says on standard error what went wrong; a closed standard error changes nothing.
    pub(crate) fn print(&self) {
        let complaint = &self.complaint;
        let mut err = io::stderr().lock();
        for Complaint { message, help, excerpt, .. } in std::iter::once(&**complaint).chain(&complaint.related) {
            let _ = writeln!(err, "{}", report(message, excerpt.as_ref(), help.as_deref()));
        }
    }

    /// The same as a JSON object.
    pub(crate) fn json(&self) -> serde_json::Value {
        let mut value = serde_json::json!(self.complaint);
        value["event"] = "error".into();
        value["exit"] = self.code.into();
        value
    }
}

impl From<Complaint> for Failure {
    fn from(complaint: Complaint) -> Self {
        Self::new(false, complaint)
    }
}

impl From<papsynth_dataset::Error> for Failure {
    fn from(error: papsynth_dataset::Error) -> Self {
        Self::new(error.is_io(), Complaint::new(error))
    }
}

#[cfg(feature = "web")]
impl From<papsynth_web::Error> for Failure {
    fn from(error: papsynth_web::Error) -> Self {
        Self::new(error.is_io(), Complaint::new(error))
    }
}

/// Watches for Ctrl-C and what else asks a program to end: set once the user asked to stop. A second one ends the program at
/// once: unfinished files bear no final name.
pub(crate) fn watch() -> Result<&'static AtomicBool, Failure> {
    static ASKED: AtomicBool = AtomicBool::new(false);
    let stop = || {
        if ASKED.swap(true, Ordering::SeqCst) {
            std::process::exit(INTERRUPTED.into());
        }
    };
    match ctrlc::set_handler(stop) {
        Ok(()) => Ok(&ASKED),
        Err(error) => Err(Failure::input(format!("cannot watch for Ctrl-C: {error}"))),
    }
}

/// Says on standard error what is no failure and may surprise.
pub(crate) fn note(text: impl Display) {
    // Whoever has closed it does not want to know.
    let _ = writeln!(io::stderr().lock(), "note: {text}");
}

/// Writes to standard output. Whoever closed the pipe has seen enough: that is no failure.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(Failure::file("write", Path::new("standard output"), &error))
        }
        _ => Ok(()),
    }
}

/// Longest line of a file that is worth showing: a longer line would fill the screen.
const LONGEST_SHOWN_LINE: usize = 400;

/// A place in a text that the user wrote.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
struct Place {
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
struct Excerpt {
    name: String,
    text: Arc<String>,
    span: Range<usize>,
}

/// The place where a part of a text begins, and what is shown of it; nothing of a text with a very long line.
fn cut(name: &str, text: &Arc<String>, span: Range<usize>) -> (Place, Option<Excerpt>) {
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
fn report(message: &str, excerpt: Option<&Excerpt>, help: Option<&str>) -> String {
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
    fn json_holds_the_place_and_the_exit_code() {
        let text = Arc::new("a = 1".to_owned());
        let one = Complaint::new("first").at("x.toml", &text, 0..1).help("try b");
        let failure = Failure::from(Complaint::all("two", vec![one, Complaint::new("second")]));
        let json = failure.json();
        assert_eq!(json["exit"], 2);
        assert_eq!(json["because"][0]["at"]["line"], 1);
        assert_eq!(json["because"][0]["help"], "try b");
        assert_eq!(json["because"][1]["message"], "second");
    }

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
