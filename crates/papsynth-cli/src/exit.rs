//! How the program ends: exit codes, error reports, Ctrl-C, and text on standard output.

use std::borrow::Cow;
use std::fmt::{Display, Formatter};
use std::io::{self, IsTerminal, Write, stderr};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};

/// Exit code for wrong usage, recipe or input: the same command fails again. Shells use 2 for usage.
pub(crate) const INPUT: u8 = 2;

/// Exit code for input/output errors: the same command may succeed later. `EX_IOERR` of sysexits.h.
const IO: u8 = 74;

/// Exit code for an interrupted run: 128 + SIGINT.
const INTERRUPTED: u8 = 130;

/// An error message with its location, help and causes.
#[derive(Debug, serde::Serialize)]
pub(crate) struct ErrorReport {
    message: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    help: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    location: Option<Location>,
    /// Errors under this heading; each is printed as its own report.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    causes: Vec<ErrorReport>,
    #[serde(skip)]
    excerpt: Option<Excerpt>,
}

impl ErrorReport {
    pub(crate) fn new(message: impl Display) -> Self {
        Self { message: message.to_string(), help: None, excerpt: None, causes: Vec::new(), location: None }
    }

    pub(crate) fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// Adds the location of a byte range of a text, and an excerpt of its line.
    pub(crate) fn at(mut self, name: &str, text: &Arc<String>, span: Range<usize>) -> Self {
        let (location, excerpt) = locate(name, text, span);
        (self.location, self.excerpt) = (Some(location), Some(excerpt));
        self
    }

    /// Several reports under one heading; a single report is returned without a heading.
    pub(crate) fn all(heading: impl Display, mut reports: Vec<Self>) -> Self {
        match reports.len() {
            1 => reports.remove(0),
            _ => Self { causes: reports, ..Self::new(heading) },
        }
    }
}

/// An error that ends the program, with its exit code.
#[derive(Debug)]
pub(crate) struct ExitError {
    code: u8,
    report: Box<ErrorReport>,
}

impl ExitError {
    /// An error with this report: exit code 74 if `is_io`, else 2.
    pub(crate) fn new(is_io: bool, report: ErrorReport) -> Self {
        Self { code: if is_io { IO } else { INPUT }, report: Box::new(report) }
    }

    /// An error in usage, recipe or input.
    pub(crate) fn input(message: impl Display) -> Self {
        ErrorReport::new(message).into()
    }

    /// The same with a line of help.
    pub(crate) fn with_help(message: impl Display, help: impl Into<String>) -> Self {
        ErrorReport::new(message).help(help).into()
    }

    pub(crate) fn interrupted(report: ErrorReport) -> Self {
        Self { code: INTERRUPTED, report: Box::new(report) }
    }

    /// An interrupted run that the same command continues.
    pub(crate) fn stopped(message: String) -> Self {
        Self::interrupted(ErrorReport::new(message).help("run the same command again to continue"))
    }

    /// A subcommand whose feature is not in this build.
    #[allow(dead_code, reason = "a build with all features has all subcommands")]
    pub(crate) fn missing_feature(feature: &str) -> Self {
        let message = format!("this subcommand needs a build of papsynth with `--features {feature}`");
        Self::with_help(message, "`cargo install papsynth-cli` builds all subcommands")
    }

    /// A file or folder that cannot be read or written. Wrong paths have exit code 2, all other causes 74.
    pub(crate) fn file(action: &str, path: &Path, error: &io::Error) -> Self {
        use io::ErrorKind::{AlreadyExists, InvalidFilename, InvalidInput, IsADirectory, NotADirectory, NotFound};
        let is_wrong_path = matches!(
            error.kind(),
            NotFound | IsADirectory | NotADirectory | AlreadyExists | InvalidFilename | InvalidInput
        );
        Self::new(!is_wrong_path, ErrorReport::new(format!("cannot {action} {}: {error}", path.display())))
    }

    pub(crate) fn code(&self) -> u8 {
        self.code
    }

    /// Prints the error to standard error. Ignores a closed standard error.
    pub(crate) fn print(&self) {
        let mut err = io::stderr().lock();
        for report in std::iter::once(&*self.report).chain(&self.report.causes) {
            let _ = writeln!(err, "{}", rendered(report));
        }
    }

    /// The same as a JSON object.
    pub(crate) fn json(&self) -> serde_json::Value {
        let mut value = serde_json::json!(self.report);
        value["event"] = "error".into();
        value["exit"] = self.code.into();
        value
    }
}

impl From<ErrorReport> for ExitError {
    fn from(report: ErrorReport) -> Self {
        Self::new(false, report)
    }
}

impl From<papsynth_dataset::Error> for ExitError {
    fn from(error: papsynth_dataset::Error) -> Self {
        Self::new(error.is_io(), ErrorReport::new(error))
    }
}

#[cfg(feature = "web")]
impl From<papsynth_web::Error> for ExitError {
    fn from(error: papsynth_web::Error) -> Self {
        Self::new(error.is_io(), ErrorReport::new(error))
    }
}

/// Returns a flag that Ctrl-C, SIGTERM and SIGHUP set. A second signal ends the program at once; unfinished files then
/// have temporary names.
pub(crate) fn stop_flag() -> Result<&'static AtomicBool, ExitError> {
    static STOP: AtomicBool = AtomicBool::new(false);
    let stop = || {
        if STOP.swap(true, Ordering::SeqCst) {
            std::process::exit(INTERRUPTED.into());
        }
    };
    match ctrlc::set_handler(stop) {
        Ok(()) => Ok(&STOP),
        Err(error) => Err(ExitError::input(format!("cannot handle Ctrl-C: {error}"))),
    }
}

/// Runs work that writes no files, and ends the program soon after a stop, even if the work does not notice it.
#[cfg(feature = "judge")]
pub(crate) fn until_stopped<T>(stop: &AtomicBool, work: impl FnOnce() -> T) -> T {
    use std::sync::mpsc;
    use std::time::Duration;

    /// Time that the work has to end by itself.
    const GRACE: Duration = Duration::from_millis(500);
    let (end, ended) = mpsc::channel::<()>();
    std::thread::scope(|scope| {
        let watch = move || {
            while ended.recv_timeout(Duration::from_millis(50)) == Err(mpsc::RecvTimeoutError::Timeout) {
                if stop.load(Ordering::SeqCst) && ended.recv_timeout(GRACE) == Err(mpsc::RecvTimeoutError::Timeout) {
                    ExitError::interrupted(ErrorReport::new("stopped; no file was written")).print();
                    std::process::exit(INTERRUPTED.into());
                }
            }
        };
        // If the system does not start the thread, a stop takes effect when the work notices it.
        let _ = std::thread::Builder::new().spawn_scoped(scope, watch);
        // Ends the watching thread on return, and after a panic.
        let _end = end;
        work()
    })
}

/// Set by `--quiet`: notes are not printed.
static QUIET: AtomicBool = AtomicBool::new(false);

pub(crate) fn set_quiet(quiet: bool) {
    QUIET.store(quiet, Ordering::Relaxed);
}

/// Prints a note to standard error, unless `--quiet` is given.
pub(crate) fn note(text: impl Display) {
    if !QUIET.load(Ordering::Relaxed) {
        // Ignores a closed standard error.
        let _ = writeln!(io::stderr().lock(), "note: {}", escaped(&text.to_string()));
    }
}

/// Prints to standard output. A closed pipe is not an error.
pub(crate) fn print(text: &str) -> Result<(), ExitError> {
    let mut out = io::stdout().lock();
    match out.write_all(escaped(text).as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(ExitError::file("write", Path::new("standard output"), &error))
        }
        _ => Ok(()),
    }
}

/// Escapes control and bidirectional formatting characters of file names and recipes, which a terminal would execute.
/// Line feeds and tabs stay.
pub(crate) fn escaped(text: &str) -> Cow<'_, str> {
    let is_escaped = |c: char| {
        let is_bidirectional = matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
        is_bidirectional || (c.is_control() && c != '\n' && c != '\t')
    };
    if !text.contains(is_escaped) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        if is_escaped(c) { out.extend(c.escape_unicode()) } else { out.push(c) }
    }
    Cow::Owned(out)
}

/// Characters of a line that an excerpt shows at most.
const EXCERPT_CHARS: usize = 160;

/// Characters of a line of a message that are printed at most.
const MESSAGE_CHARS: usize = 1000;

/// A place in a text of the user.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
struct Location {
    /// Path of the file, or `--set`.
    file: String,
    /// From 1.
    line: usize,
    /// From 1, in characters.
    column: usize,
}

impl Display for Location {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}:{}:{}", self.file, self.line, self.column)
    }
}

/// A part of one line.
#[derive(Debug)]
struct Excerpt {
    text: String,
    /// Bytes of the text to underline.
    span: Range<usize>,
}

/// Returns the location of a byte range, and an excerpt of the line in which it begins.
fn locate(name: &str, text: &str, span: Range<usize>) -> (Location, Excerpt) {
    let (start, end) = (text.floor_char_boundary(span.start), text.floor_char_boundary(span.end));
    let line_start = text[..start].rfind('\n').map_or(0, |newline| newline + 1);
    let line_end = text[start..].find('\n').map_or(text.len(), |newline| start + newline);
    let line = text[..start].matches('\n').count() + 1;
    let column = text[line_start..start].chars().count() + 1;
    let location = Location { file: name.to_owned(), line, column };
    // Half of the characters before the place, and half from it on.
    let half = EXCERPT_CHARS / 2;
    let from = text[line_start..start].char_indices().rev().nth(half - 1).map_or(line_start, |(at, _)| line_start + at);
    let room = EXCERPT_CHARS - text[from..start].chars().count();
    let to = text[start..line_end].char_indices().nth(room).map_or(line_end, |(at, _)| start + at);
    let mut shown = String::new();
    if from > line_start {
        shown.push('…');
    }
    shown.push_str(&escaped(&text[from..start]));
    let begin = shown.len();
    let end = end.clamp(start, to);
    shown.push_str(&escaped(&text[start..end]));
    let marked = begin..shown.len();
    shown.push_str(&escaped(&text[end..to]));
    if to < line_end {
        shown.push('…');
    }
    (location, Excerpt { text: shown, span: marked })
}

/// Shortens each line of a message to its beginning and end.
fn shortened(message: &str) -> String {
    let one = |line: &str| {
        let count = line.chars().count();
        if count <= MESSAGE_CHARS {
            return line.to_owned();
        }
        let half = MESSAGE_CHARS / 2;
        line.chars().take(half).chain(" … ".chars()).chain(line.chars().skip(count - half)).collect()
    };
    message.lines().map(one).collect::<Vec<_>>().join("\n")
}

/// An error as lines of text, in colour on a terminal unless `NO_COLOR` is set.
fn rendered(report: &ErrorReport) -> String {
    let in_colour = stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none();
    let renderer = if in_colour { Renderer::styled() } else { Renderer::plain() };
    let message = shortened(&escaped(&report.message));
    let mut group = Group::with_title(Level::ERROR.primary_title(message));
    let mut location = None;
    if let (Some(place), Some(excerpt)) = (&report.location, &report.excerpt) {
        let file = escaped(&place.file);
        let marked = AnnotationKind::Primary.span(excerpt.span.clone());
        let snippet = Snippet::source(excerpt.text.as_str()).path(file.clone()).line_start(place.line);
        group = group.element(snippet.annotation(marked));
        // The renderer counts the column in the excerpt.
        let column = excerpt.text[..excerpt.span.start].chars().count() + 1;
        location = Some([column, place.column].map(|column| format!("{file}:{}:{column}", place.line)));
    }
    if let Some(help) = &report.help {
        group = group.element(Level::HELP.message(shortened(&escaped(help))));
    }
    let text = renderer.term_width(4 * EXCERPT_CHARS).render(&[group]);
    match location {
        Some([in_excerpt, in_file]) => text.replacen(&in_excerpt, &in_file, 1),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_holds_the_location_and_the_exit_code() {
        let text = Arc::new("a = 1".to_owned());
        let one = ErrorReport::new("first").at("x.toml", &text, 0..1).help("try b");
        let error = ExitError::from(ErrorReport::all("two", vec![one, ErrorReport::new("second")]));
        let json = error.json();
        assert_eq!(json["exit"], 2);
        assert_eq!(json["causes"][0]["location"]["line"], 1);
        assert_eq!(json["causes"][0]["help"], "try b");
        assert_eq!(json["causes"][1]["message"], "second");
    }

    #[test]
    fn locations_count_lines_and_characters_from_one() {
        let text = Arc::new("a = 1\nµ = 2\n".to_owned());
        let report = ErrorReport::new("no").at("x.toml", &text, 9..12).help("try b");
        assert_eq!(report.location, Some(Location { file: "x.toml".to_owned(), line: 2, column: 3 }));
        let text_of = rendered(&report);
        assert!(text_of.contains("x.toml:2:3") && text_of.contains("2 | µ = 2"), "{text_of}");
        assert!(text_of.contains("try b"), "{text_of}");
        // Inside a character, and beyond the end.
        for span in [7..8, 90..100] {
            assert!(rendered(&ErrorReport::new("no").at("x.toml", &text, span)).contains("no"));
        }
    }

    #[test]
    fn a_long_line_is_shown_around_the_column() {
        let text = Arc::new(format!("{}here{}", "[".repeat(10_000), "]".repeat(1_000_000)));
        let report = ErrorReport::new("wrong").at("x.toml", &text, 10_000..10_004);
        let shown = rendered(&report);
        assert!(shown.contains("x.toml:1:10001\n") && shown.contains("[here]") && shown.len() < 1000, "{shown}");
        assert!(rendered(&ErrorReport::new("y".repeat(1_000_000))).len() < 2000);
    }

    #[test]
    fn control_characters_are_escaped() {
        assert_eq!(escaped("a\u{1b}[31m\nb\u{7}\u{202e}"), "a\\u{1b}[31m\nb\\u{7}\\u{202e}");
        let text = Arc::new("\"\u{1b}]0;x\" = 1".to_owned());
        let shown = rendered(&ErrorReport::new("key \u{1b}[2J").at("\u{1b}.toml", &text, 0..3).help("\u{9b}"));
        assert!(!shown.contains(|c: char| c.is_control() && c != '\n'), "{shown:?}");
    }
}
