//! The visual study: what is answered to a request. No network and no files of the study's folders: everything that can be
//! sent lies in memory.

use std::sync::atomic::AtomicBool;

use papsynth_study::{Answer, Exposure, Session, SessionError};
use serde::Deserialize;

use crate::error::Error;
use crate::page::{self, CSS, File, HTML, JS};
use crate::server::{Reply, Request, Server, Site};

const PAGE: [File; 3] = [
    ("/", HTML, include_str!("page/index.html")),
    ("/study.css", CSS, include_str!("page/study.css")),
    ("/study.js", JS, include_str!("page/study.js")),
];

/// Where patches are asked for, before their name.
const PATCH: &str = "/patch/";

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Shown {
    patch: String,
    exposure: Exposure,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Said {
    patch: String,
    answer: Answer,
    response_ms: f64,
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
    server.run(session, stop, |session| {
        if !told && session.is_finished() {
            told = true;
            finished(session);
        }
    })
}

impl Site for Session {
    fn reply(&mut self, request: &Request) -> Reply {
        page::file(&PAGE, request).unwrap_or_else(|| answer(self, request).unwrap_or_else(|refusal| refusal))
    }
}

fn answer(session: &mut Session, request: &Request) -> Result<Reply, Reply> {
    match (request.method, request.target) {
        ("GET", "/state") => Ok(Reply::json(&session.state())),
        ("GET", "/result") if session.is_finished() => Ok(Reply::json(&session.summary())),
        ("GET", "/result") => Err(Reply::refusal(409, "there is no result before the last answer")),
        ("GET", target) if target.starts_with(PATCH) => Ok(Reply::png(session.patch(&target[PATCH.len()..])?.to_vec())),
        ("POST", "/shown") => {
            let Shown { patch, exposure } = request.json()?;
            session.shown(&patch, exposure)?;
            Ok(Reply::json(&session.state()))
        }
        ("POST", "/answer") => {
            let Said { patch, answer, response_ms } = request.json()?;
            session.answer(&patch, answer, response_ms)?;
            Ok(Reply::json(&session.state()))
        }
        (_, "/state" | "/result") => Err(Reply::method("GET")),
        (_, "/shown" | "/answer") => Err(Reply::method("POST")),
        (_, target) if target.starts_with(PATCH) => Err(Reply::method("GET")),
        _ => Err(Reply::refusal(404, "there is nothing here")),
    }
}

impl From<SessionError> for Reply {
    fn from(refusal: SessionError) -> Self {
        match refusal {
            SessionError::Stale => Self::refusal(409, "this is not what is asked now"),
            SessionError::Invalid => Self::refusal(400, "this is nothing that the page sends"),
            SessionError::NotWritten(error) => Self::refusal(500, &format!("it could not be kept: {error}")),
        }
    }
}
