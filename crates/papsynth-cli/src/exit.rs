//! How the program ends: exit codes, error reports, and text on standard output.

use std::io::{self, Write};
use std::sync::Arc;

use miette::{Diagnostic, LabeledSpan, NamedSource, Report};

/// Longest line of a file that is worth showing: beyond it an excerpt helps nobody.
const LONGEST_SHOWN_LINE: usize = 400;

/// Why the program ends before it is done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Exit {
    /// Usage, recipe or input: trying again will not help.
    Input,
    /// Input/output: trying again may help.
    Io,
    /// Stopped by the user.
    Interrupted,
}

impl Exit {
    /// The exit code: 2 as shells use it for usage, 74 as `EX_IOERR` of sysexits.h, 130 as 128 + SIGINT.
    pub(crate) fn code(self) -> u8 {
        match self {
            Self::Input => 2,
            Self::Io => 74,
            Self::Interrupted => 130,
        }
    }
}

/// What is wrong, and where.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("{message}")]
pub(crate) struct Complaint {
    message: String,
    #[help]
    help: Option<String>,
    #[source_code]
    text: Option<NamedSource<Arc<String>>>,
    #[label(collection)]
    labels: Vec<LabeledSpan>,
    /// What the complaint sums up; each is reported on its own.
    related: Vec<Complaint>,
    place: Option<Place>,
}

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

impl Complaint {
    pub(crate) fn new(message: impl Into<String>) -> Self {
        Self { message: message.into(), help: None, text: None, labels: Vec::new(), related: Vec::new(), place: None }
    }

    /// Adds what would help.
    pub(crate) fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// Points at a part of a text.
    pub(crate) fn at(mut self, name: &str, text: &Arc<String>, span: std::ops::Range<usize>) -> Self {
        let start = floor_char(text, span.start);
        let end = floor_char(text, span.end).max(start);
        let place = Place::of(name, text, start);
        if text.lines().all(|line| line.len() <= LONGEST_SHOWN_LINE) {
            // An underline does not reach beyond its first line.
            let end = text[start..end].find('\n').map_or(end, |newline| start + newline);
            self.labels = vec![LabeledSpan::new(None, start, end - start)];
            self.text = Some(NamedSource::new(name, Arc::clone(text)));
        } else {
            self.message = format!("{}:{}:{}: {}", place.file, place.line, place.column, self.message);
        }
        self.place = Some(place);
        self
    }

    /// Several complaints under one heading; one alone stands for itself.
    pub(crate) fn all(heading: impl Into<String>, mut complaints: Vec<Self>) -> Self {
        match complaints.len() {
            1 => complaints.remove(0),
            _ => Self { related: complaints, ..Self::new(heading) },
        }
    }

    fn json(&self) -> serde_json::Value {
        let mut value = serde_json::json!({ "message": self.message });
        if let Some(help) = &self.help {
            value["help"] = help.as_str().into();
        }
        if let Some(place) = &self.place {
            value["at"] = serde_json::json!(place);
        }
        if !self.related.is_empty() {
            value["because"] = self.related.iter().map(Self::json).collect();
        }
        value
    }
}

impl Place {
    fn of(file: &str, text: &str, start: usize) -> Self {
        let before = &text[..start];
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().unwrap_or_default().chars().count() + 1;
        Self { file: file.to_owned(), line, column }
    }
}

/// The nearest boundary of a character at or before a byte.
fn floor_char(text: &str, byte: usize) -> usize {
    let mut byte = byte.min(text.len());
    while !text.is_char_boundary(byte) {
        byte -= 1;
    }
    byte
}

/// A complaint and the exit code it ends the program with.
#[derive(Debug)]
pub(crate) struct Failure {
    exit: Exit,
    complaint: Box<Complaint>,
}

impl Failure {
    pub(crate) fn input(complaint: Complaint) -> Self {
        Self { exit: Exit::Input, complaint: Box::new(complaint) }
    }

    pub(crate) fn io(complaint: Complaint) -> Self {
        Self { exit: Exit::Io, complaint: Box::new(complaint) }
    }

    pub(crate) fn interrupted(complaint: Complaint) -> Self {
        Self { exit: Exit::Interrupted, complaint: Box::new(complaint) }
    }

    /// A file or folder that cannot be read or written: a wrong path is the user's, all else may pass.
    pub(crate) fn file(what: &str, path: &std::path::Path, error: &io::Error) -> Self {
        let exit = match error.kind() {
            io::ErrorKind::NotFound
            | io::ErrorKind::IsADirectory
            | io::ErrorKind::NotADirectory
            | io::ErrorKind::AlreadyExists
            | io::ErrorKind::InvalidFilename
            | io::ErrorKind::InvalidInput => Exit::Input,
            _ => Exit::Io,
        };
        Self { exit, complaint: Box::new(Complaint::new(format!("cannot {what} {}: {error}", path.display()))) }
    }

    /// What the files of a data set, or files that were read, have against it.
    pub(crate) fn dataset(error: &papsynth_dataset::Error, complaint: Complaint) -> Self {
        let exit = if error.is_io() { Exit::Io } else { Exit::Input };
        Self { exit, complaint: Box::new(complaint) }
    }

    pub(crate) fn exit(&self) -> Exit {
        self.exit
    }

    /// Says on standard error what went wrong; a closed standard error changes nothing.
    pub(crate) fn print(self) {
        let mut complaint = *self.complaint;
        let parts = std::mem::take(&mut complaint.related);
        let mut err = io::stderr().lock();
        for complaint in std::iter::once(complaint).chain(parts) {
            let _ = writeln!(err, "{:?}", Report::new(complaint));
        }
    }

    /// The same as a JSON object.
    pub(crate) fn json(&self) -> serde_json::Value {
        let mut value = self.complaint.json();
        value["event"] = "error".into();
        value["exit"] = self.exit.code().into();
        value
    }
}

impl From<papsynth_dataset::Error> for Failure {
    fn from(error: papsynth_dataset::Error) -> Self {
        Self::dataset(&error, Complaint::new(error.to_string()))
    }
}

/// Reports look alike everywhere; on a terminal they are wrapped to its width, elsewhere lines stay whole.
pub(crate) fn install_reports() {
    use io::IsTerminal;
    let on_terminal = io::stderr().is_terminal();
    // It fails only if it was installed before, which is then what is wanted.
    let _ = miette::set_hook(Box::new(move |_| {
        let options = miette::MietteHandlerOpts::new().wrap_lines(on_terminal).break_words(false).context_lines(1);
        Box::new(if on_terminal { options } else { options.color(false).unicode(false) }.build())
    }));
}

/// Says on standard error what is no failure and may surprise.
pub(crate) fn note(text: &str) {
    // Whoever has closed it does not want to know.
    let _ = writeln!(io::stderr().lock(), "note: {text}");
}

/// A number and what is counted.
pub(crate) fn counted(count: u64, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

/// Writes to standard output. Whoever closed the pipe has seen enough: that is no failure.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(Failure::file("write", std::path::Path::new("standard output"), &error))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_count_lines_and_characters_from_one() {
        let text = Arc::new("a = 1\nµ = 2\n".to_owned());
        let complaint = Complaint::new("no").at("x.toml", &text, 9..12);
        assert_eq!(complaint.place, Some(Place { file: "x.toml".to_owned(), line: 2, column: 3 }));
        // In the middle of a character, and beyond the end.
        let _ = Complaint::new("no").at("x.toml", &text, 7..8);
        let _ = Complaint::new("no").at("x.toml", &text, 90..100);
    }

    #[test]
    fn a_very_long_line_is_named_but_not_shown() {
        let text = Arc::new("[".repeat(10_000));
        let complaint = Complaint::new("too deep").at("x.toml", &text, 80..81);
        assert!(complaint.text.is_none());
        assert_eq!(complaint.message, "x.toml:1:81: too deep");
    }

    #[test]
    fn json_holds_the_place_and_the_exit_code() {
        let text = Arc::new("a = 1".to_owned());
        let one = Complaint::new("first").at("x.toml", &text, 0..1).help("try b");
        let failure = Failure::input(Complaint::all("two", vec![one, Complaint::new("second")]));
        let json = failure.json();
        assert_eq!(json["exit"], 2);
        assert_eq!(json["because"][0]["at"]["line"], 1);
        assert_eq!(json["because"][0]["help"], "try b");
        assert_eq!(json["because"][1]["message"], "second");
    }
}
