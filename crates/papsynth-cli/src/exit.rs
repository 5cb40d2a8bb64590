//! How the program ends: exit codes, error reports, Ctrl-C, and text on standard output.

use std::fmt::Display;
use std::io::{self, Write};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::excerpt::{self, Excerpt, Place};

/// Usage, recipe or input: trying again will not help. As shells use it for usage.
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
        let (place, excerpt) = excerpt::cut(name, text, span);
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
    /// Whether the system failed, so that trying again may help.
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
            let _ = writeln!(err, "{}", excerpt::report(message, excerpt.as_ref(), help.as_deref()));
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
}
