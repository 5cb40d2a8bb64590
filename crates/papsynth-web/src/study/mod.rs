//! The page of the visual study. All patches are in memory; no request reads a file.

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

/// Path of patches, before their name.
const PATCH: &str = "/patch/";

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ShownRequest {
    patch: String,
    exposure: Exposure,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AnswerRequest {
    patch: String,
    answer: Answer,
    response_ms: f64,
}

/// Serves a study until `stop` is set. Calls `finished` once, when every trial has an answer.
///
/// # Errors
/// If the server fails, or the port cannot be saved with the study.
pub fn serve_study(
    server: Server,
    mut session: Session,
    stop: &AtomicBool,
    mut finished: impl FnMut(&Session),
) -> Result<(), Error> {
    session.set_port(server.port())?;
    let mut reported = false;
    server.run(session, stop, |session| {
        if !reported && session.is_finished() {
            reported = true;
            finished(session);
        }
    })
}

impl Site for Session {
    fn reply(&mut self, request: &Request) -> Reply {
        page::file(&PAGE, request).unwrap_or_else(|| answer(self, request).unwrap_or_else(|error| error))
    }
}

fn answer(session: &mut Session, request: &Request) -> Result<Reply, Reply> {
    match (request.method, request.target) {
        ("GET", "/state") => Ok(Reply::json(&session.state())),
        ("GET", "/result") if session.is_finished() => Ok(Reply::json(&session.summary())),
        ("GET", "/result") => Err(Reply::error(409, "the result is available after the last answer")),
        ("GET", target) if target.starts_with(PATCH) => Ok(Reply::png(session.patch(&target[PATCH.len()..])?.to_vec())),
        ("POST", "/shown") => {
            let ShownRequest { patch, exposure } = request.json()?;
            session.shown(&patch, exposure)?;
            Ok(Reply::json(&session.state()))
        }
        ("POST", "/answer") => {
            let AnswerRequest { patch, answer, response_ms } = request.json()?;
            session.answer(&patch, answer, response_ms)?;
            Ok(Reply::json(&session.state()))
        }
        (_, "/state" | "/result") => Err(Reply::wrong_method("GET")),
        (_, "/shown" | "/answer") => Err(Reply::wrong_method("POST")),
        (_, target) if target.starts_with(PATCH) => Err(Reply::wrong_method("GET")),
        _ => Err(Reply::error(404, "not found")),
    }
}

impl From<SessionError> for Reply {
    fn from(error: SessionError) -> Self {
        match error {
            SessionError::Stale => Self::error(409, "this trial is not the current one"),
            SessionError::Invalid => Self::error(400, "invalid answer"),
            SessionError::NotWritten(error) => Self::error(500, &format!("cannot save the study: {error}")),
        }
    }
}
