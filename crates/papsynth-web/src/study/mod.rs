//! What is answered to a request. No network and no files of the study's folders: everything that can be sent lies in memory.

use std::sync::atomic::AtomicBool;

use papsynth_study::{Answer, Exposure, Refusal, Session};
use serde::Deserialize;

use crate::error::Error;
use crate::page::{self, CSS, File, HTML, JS};
use crate::server::{Reply, Request, Server, Site};

/// The files of the page.
const PAGE: [File; 3] = [
    ("/", HTML, include_str!("page/index.html")),
    ("/study.css", CSS, include_str!("page/study.css")),
    ("/study.js", JS, include_str!("page/study.js")),
];

/// Where patches are asked for, before their name.
const PATCH: &str = "/patch/";

/// A report that patches were seen.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Shown {
    patch: String,
    exposure: Exposure,
}

/// An answer.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Said {
    patch: String,
    answer: Answer,
    response_ms: f64,
}

/// A study, as a page shows it.
#[derive(Debug)]
pub struct Study {
    session: Session,
}

/// Serves a study until `stop` is set. `finished` is called once when everything has been answered, at once if it has been
/// before.
///
/// # Errors
/// If the system refuses what serving takes, or the port cannot be kept with the study.
pub fn serve_study(
    server: Server,
    mut session: Session,
    stop: &AtomicBool,
    mut finished: impl FnMut(&Session),
) -> Result<(), Error> {
    session.set_port(server.port())?;
    let mut told = false;
    server.run(Study::new(session), stop, |study| {
        if !told && study.session.is_finished() {
            told = true;
            finished(&study.session);
        }
    })
}

impl Site for Study {
    fn reply(&mut self, request: &Request) -> Reply {
        if let Some(file) = page::file(&PAGE, request.target) {
            return if request.method == "GET" { file } else { Reply::method("GET") };
        }
        match (request.method, request.target) {
            ("GET", "/state") => Reply::json(&self.session.state()),
            ("GET", "/result") if self.session.is_finished() => Reply::json(&self.session.summary()),
            ("GET", "/result") => Reply::refusal(409, "there is no result before the last answer"),
            ("GET", target) if target.starts_with(PATCH) => self.patch(&target[PATCH.len()..]),
            ("POST", "/shown") => match request.json::<Shown>() {
                Ok(Shown { patch, exposure }) => {
                    let outcome = self.session.shown(&patch, exposure);
                    self.after(outcome)
                }
                Err(refusal) => refusal,
            },
            ("POST", "/answer") => match request.json::<Said>() {
                Ok(Said { patch, answer, response_ms }) => {
                    let outcome = self.session.answer(&patch, answer, response_ms);
                    self.after(outcome)
                }
                Err(refusal) => refusal,
            },
            (_, "/state" | "/result") => Reply::method("GET"),
            (_, "/shown" | "/answer") => Reply::method("POST"),
            (_, target) if target.starts_with(PATCH) => Reply::method("GET"),
            _ => Reply::refusal(404, "there is nothing here"),
        }
    }
}

impl Study {
    /// The study of a session.
    #[must_use]
    pub fn new(session: Session) -> Self {
        Self { session }
    }

    fn patch(&mut self, name: &str) -> Reply {
        match self.session.patch(name) {
            Ok(png) => Reply::png(png.to_vec()),
            Err(refusal) => refused(refusal),
        }
    }

    /// What is asked next, or why what came was not taken.
    fn after(&self, outcome: Result<(), Refusal>) -> Reply {
        match outcome {
            Ok(()) => Reply::json(&self.session.state()),
            Err(refusal) => refused(refusal),
        }
    }
}

fn refused(refusal: Refusal) -> Reply {
    match refusal {
        Refusal::Stale => Reply::refusal(409, "this is not what is asked now"),
        Refusal::Nonsense => Reply::refusal(400, "this is nothing that the page sends"),
        Refusal::NotWritten(error) => Reply::refusal(500, &format!("it could not be kept: {error}")),
    }
}
