//! How the program ends: exit codes, error reports, and text on standard output.

use std::io::{self, Write};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use crate::excerpt::{self, Excerpt, Place};

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
#[derive(Debug)]
pub(crate) struct Complaint {
    message: String,
    help: Option<String>,
    excerpt: Option<Excerpt>,
    /// What the complaint sums up; each is reported on its own.
    related: Vec<Complaint>,
    place: Option<Place>,
}

impl Complaint {
    pub(crate) fn new(message: impl Into<String>) -> Self {
        Self { message: message.into(), help: None, excerpt: None, related: Vec::new(), place: None }
    }

    /// Adds what would help.
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

    /// What the user asked for is wrong, and what would help.
    pub(crate) fn wrong(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self::input(Complaint::new(message).help(help))
    }

    /// An error of a library; whether the system failed, so that trying again may help.
    pub(crate) fn of(error: &impl std::fmt::Display, is_io: bool) -> Self {
        let complaint = Complaint::new(error.to_string());
        if is_io { Self::io(complaint) } else { Self::input(complaint) }
    }

    /// The user stopped a run; running the same command again makes or writes the rest.
    pub(crate) fn stopped(message: String, does: &str) -> Self {
        let help = format!("run the same command again to {does} the rest");
        Self::interrupted(Complaint::new(message).help(help))
    }

    /// A subcommand of a feature that this program was built without.
    #[cfg(not(all(feature = "calibrate", feature = "completions", feature = "judge", feature = "web")))]
    pub(crate) fn left_out(feature: &str) -> Self {
        let message = format!("this subcommand needs a build of papsynth with `--features {feature}`");
        Self::wrong(message, "`cargo install papsynth-cli` builds all subcommands")
    }

    /// A file or folder that cannot be read or written: a wrong path is the user's, all else may pass.
    pub(crate) fn file(what: &str, path: &Path, error: &io::Error) -> Self {
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
    pub(crate) fn print(&self) {
        let complaint = &self.complaint;
        let mut err = io::stderr().lock();
        for Complaint { message, help, excerpt, .. } in std::iter::once(&**complaint).chain(&complaint.related) {
            let _ = writeln!(err, "{}", excerpt::report(message, excerpt.as_ref(), help.as_deref()));
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
        Self::of(&error, error.is_io())
    }
}

/// Says on standard error what is no failure and may surprise.
pub(crate) fn note(text: &str) {
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
        let failure = Failure::input(Complaint::all("two", vec![one, Complaint::new("second")]));
        let json = failure.json();
        assert_eq!(json["exit"], 2);
        assert_eq!(json["because"][0]["at"]["line"], 1);
        assert_eq!(json["because"][0]["help"], "try b");
        assert_eq!(json["because"][1]["message"], "second");
    }
}
