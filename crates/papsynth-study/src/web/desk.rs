//! What is answered to a request. No network and no files of the study's folders: everything that can be sent lies in memory.

use std::borrow::Cow;

use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::saved::{Answer, Exposure};
use crate::session::{Refusal, Session};

/// Longest body of a request, bytes; what the page sends is a tenth of it.
pub(crate) const LONGEST_BODY: usize = 4096;

const PAGE: &str = include_str!("page/index.html");
const STYLE: &str = include_str!("page/study.css");
const SCRIPT: &str = include_str!("page/study.js");

/// Where patches are asked for, before their name.
const PATCH: &str = "/patch/";

const JSON: &str = "application/json";

/// A request, without what does not matter.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Request<'a> {
    pub(crate) method: &'a str,
    /// The target as it stands in the request line.
    pub(crate) target: &'a str,
    /// Every header of that name.
    pub(crate) hosts: &'a [&'a [u8]],
    /// The origin of the page that asks, if the browser names one.
    pub(crate) origin: Option<&'a [u8]>,
    pub(crate) content_type: Option<&'a [u8]>,
    pub(crate) body: &'a [u8],
}

/// A reply. All carry the same headers but for the type and length of their body.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Reply {
    pub(crate) status: u16,
    pub(crate) content_type: &'static str,
    pub(crate) body: Cow<'static, [u8]>,
    /// What is allowed, where something else was asked.
    pub(crate) allow: Option<&'static str>,
}

impl Reply {
    fn page(content_type: &'static str, text: &'static str) -> Self {
        Self { status: 200, content_type, body: text.as_bytes().into(), allow: None }
    }

    fn json(value: &impl serde::Serialize) -> Self {
        match serde_json::to_vec(value) {
            Ok(body) => Self { status: 200, content_type: JSON, body: body.into(), allow: None },
            Err(error) => Self::refusal(500, &error.to_string()),
        }
    }

    pub(crate) fn refusal(status: u16, message: &str) -> Self {
        let body = serde_json::json!({ "error": message }).to_string().into_bytes();
        Self { status, content_type: JSON, body: body.into(), allow: None }
    }

    fn method(allow: &'static str) -> Self {
        Self { allow: Some(allow), ..Self::refusal(405, "this is asked for otherwise") }
    }
}

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

/// A study and who may ask for it.
#[derive(Debug)]
pub(crate) struct Desk {
    pub(crate) session: Session,
    /// What a browser of this machine calls this server.
    hosts: Vec<String>,
}

impl Desk {
    pub(crate) fn new(session: Session, port: u16) -> Self {
        /// The port that browsers leave out.
        const UNSAID: u16 = 80;
        let names = ["127.0.0.1", "localhost"];
        let mut hosts: Vec<String> = names.iter().map(|name| format!("{name}:{port}")).collect();
        if port == UNSAID {
            hosts.extend(names.map(str::to_owned));
        }
        Self { session, hosts }
    }

    pub(crate) fn reply(&mut self, request: &Request) -> Reply {
        // A page from elsewhere whose name was made to lead here calls this server by that name (DNS rebinding).
        let [host] = request.hosts else { return Reply::refusal(400, "one Host is expected") };
        if !self.hosts.iter().any(|own| own.as_bytes() == *host) {
            return Reply::refusal(421, "this server answers to 127.0.0.1 and localhost alone");
        }
        // A page from elsewhere that calls this server by its own name says where it comes from.
        let own = |origin: &[u8]| {
            let origin = origin.strip_prefix(b"http://").unwrap_or_default();
            self.hosts.iter().any(|own| own.as_bytes() == origin)
        };
        if request.origin.is_some_and(|origin| !own(origin)) {
            return Reply::refusal(403, "pages from elsewhere get no answer");
        }
        match (request.method, request.target) {
            ("GET", "/") => Reply::page("text/html; charset=utf-8", PAGE),
            ("GET", "/study.css") => Reply::page("text/css; charset=utf-8", STYLE),
            ("GET", "/study.js") => Reply::page("text/javascript; charset=utf-8", SCRIPT),
            ("GET", "/state") => Reply::json(&self.session.state()),
            ("GET", "/result") if self.session.is_finished() => Reply::json(&self.session.summary()),
            ("GET", "/result") => Reply::refusal(409, "there is no result before the last answer"),
            ("GET", target) if target.starts_with(PATCH) => self.patch(&target[PATCH.len()..]),
            ("POST", "/shown") => match posted::<Shown>(request) {
                Ok(Shown { patch, exposure }) => {
                    let outcome = self.session.shown(&patch, exposure);
                    self.after(outcome)
                }
                Err(refusal) => refusal,
            },
            ("POST", "/answer") => match posted::<Said>(request) {
                Ok(Said { patch, answer, response_ms }) => {
                    let outcome = self.session.answer(&patch, answer, response_ms);
                    self.after(outcome)
                }
                Err(refusal) => refusal,
            },
            (_, "/" | "/study.css" | "/study.js" | "/state" | "/result") => Reply::method("GET"),
            (_, "/shown" | "/answer") => Reply::method("POST"),
            (_, target) if target.starts_with(PATCH) => Reply::method("GET"),
            _ => Reply::refusal(404, "there is nothing here"),
        }
    }

    fn patch(&mut self, name: &str) -> Reply {
        match self.session.patch(name) {
            Ok(png) => Reply { status: 200, content_type: "image/png", body: png.to_vec().into(), allow: None },
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

/// The body of a request. It has to say that it is JSON, which browsers let no page from elsewhere say unasked.
fn posted<T: DeserializeOwned>(request: &Request) -> Result<T, Reply> {
    if request.content_type != Some(JSON.as_bytes()) {
        return Err(Reply::refusal(415, "application/json is expected"));
    }
    if request.body.len() > LONGEST_BODY {
        return Err(Reply::refusal(413, "that is too long"));
    }
    serde_json::from_slice(request.body).map_err(|error| Reply::refusal(400, &error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::{StudyParams, Task};
    use crate::support::{Scratch, study_folders};

    const PORT: u16 = 8123;
    const HOST: &[&[u8]] = &[b"127.0.0.1:8123"];

    fn bench(name: &str) -> Scratch {
        let scratch = Scratch::new(name);
        study_folders(&scratch, 3, 3);
        scratch
    }

    fn open(scratch: &Scratch, task: Task) -> Desk {
        let params = StudyParams { trials: 4, training: 2, patch_px: 48, task, ..StudyParams::default() };
        let [real, synthetic, out] = ["real", "synthetic", "out"].map(|name| scratch.join(name));
        Desk::new(Session::open(&params, &real, &synthetic, &out).unwrap(), PORT)
    }

    fn get(desk: &mut Desk, target: &str) -> Reply {
        desk.reply(&Request { method: "GET", target, hosts: HOST, ..Request::default() })
    }

    fn post(desk: &mut Desk, target: &str, body: &str) -> Reply {
        let content_type = Some(JSON.as_bytes());
        desk.reply(&Request {
            method: "POST",
            target,
            hosts: HOST,
            content_type,
            body: body.as_bytes(),
            ..Request::default()
        })
    }

    fn state(desk: &mut Desk) -> serde_json::Value {
        serde_json::from_slice(&get(desk, "/state").body).unwrap()
    }

    fn shown(patch: &str) -> String {
        format!(
            r#"{{"patch":"{patch}","exposure":{{"exposure_ms":2000,"frames":120,"longest_frame_ms":17,"pixel_ratio":1}}}}"#
        )
    }

    fn said(patch: &str, answer: &str) -> String {
        format!(r#"{{"patch":"{patch}","answer":"{answer}","response_ms":400.5}}"#)
    }

    /// Goes through a whole study and keeps every reply.
    fn transcript(desk: &mut Desk, answer: &str) -> Vec<(String, Reply)> {
        let mut seen = Vec::new();
        for target in ["/", "/study.css", "/study.js"] {
            seen.push((target.to_owned(), get(desk, target)));
        }
        loop {
            let reply = get(desk, "/state");
            let state: serde_json::Value = serde_json::from_slice(&reply.body).unwrap();
            seen.push(("/state".to_owned(), reply));
            if state["finished"] == true {
                return seen;
            }
            let names: Vec<String> = serde_json::from_value(state["patches"].clone()).unwrap();
            for name in &names {
                let target = format!("/patch/{name}");
                let reply = get(desk, &target);
                assert_eq!(reply.status, 200);
                seen.push((target, reply));
            }
            for (target, body) in [("/shown", shown(&names[0])), ("/answer", said(&names[0], answer))] {
                let reply = post(desk, target, &body);
                assert_eq!(reply.status, 200, "{reply:?}");
                seen.push((target.to_owned(), reply));
            }
        }
    }

    #[test]
    fn nothing_that_is_sent_depends_on_what_is_real_but_the_pixels() {
        for (task, answer) in [(Task::YesNo, "real"), (Task::TwoAlternatives, "left")] {
            let scratch = bench(&format!("desk-answers-{}", task.name()));
            let first = transcript(&mut open(&scratch, task), answer);
            // The same study, of which every truth is turned round: who reads all but pixels cannot know.
            let path = scratch.join("out/1/session.json");
            let mut saved: serde_json::Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
            saved["answers"] = serde_json::json!([]);
            let fields = saved["plan"]["fields"].as_array().unwrap().clone();
            let twin = |field: u64| (field + 3) % 6;
            for trial in saved["plan"]["trials"].as_array_mut().unwrap() {
                for patch in trial["patches"].as_array_mut().unwrap() {
                    let field = twin(patch["field"].as_u64().unwrap());
                    patch["field"] = field.into();
                    patch["side"] = fields[usize::try_from(field).unwrap()]["side"].clone();
                }
            }
            std::fs::write(&path, saved.to_string()).unwrap();
            let second = transcript(&mut open(&scratch, task), answer);
            assert_eq!(first.len(), second.len());
            let mut patches = 0;
            for ((target, one), (other_target, other)) in first.iter().zip(&second) {
                assert_eq!((target, one.status, one.content_type), (other_target, other.status, other.content_type));
                assert_eq!(one.body.len(), other.body.len(), "{target}");
                if target.starts_with(PATCH) {
                    assert_ne!(one.body, other.body, "the pixels are others");
                    patches += 1;
                } else {
                    assert_eq!(one, other, "{target}");
                }
            }
            assert_eq!(patches, if task == Task::YesNo { 6 } else { 12 });
        }
    }

    #[test]
    fn the_page_and_its_messages_name_no_file_and_no_truth() {
        let scratch = bench("desk-words");
        let mut desk = open(&scratch, Task::YesNo);
        let seen = transcript(&mut desk, "synthetic");
        let lengths: std::collections::BTreeSet<usize> =
            seen.iter().filter(|(target, _)| target.starts_with(PATCH)).map(|(_, reply)| reply.body.len()).collect();
        assert_eq!(lengths.len(), 1, "all patches are files of one size");
        for (target, reply) in &seen {
            if target.starts_with(PATCH) {
                continue;
            }
            let text = String::from_utf8(reply.body.to_vec()).unwrap();
            for word in ["f0.png", "f1.png", "out/1", "truth", "side\"", "seed", "\"field"] {
                assert!(!text.contains(word), "{target} says {word}");
            }
            for word in ["http://", "https://", "//cdn", "@import", "url("] {
                assert!(!text.contains(word), "{target} leads elsewhere: {word}");
            }
        }
        // Now it may.
        let result: serde_json::Value = serde_json::from_slice(&get(&mut desk, "/result").body).unwrap();
        assert_eq!(result["row"]["counts"], serde_json::json!({ "tp": 0, "fp": 0, "tn": 2, "fn": 2 }));
    }

    #[test]
    fn hosts_and_origins_from_elsewhere_get_nothing() {
        let scratch = bench("desk-hosts");
        let mut desk = open(&scratch, Task::YesNo);
        let mut ask = |hosts: &[&[u8]], origin: Option<&[u8]>| {
            desk.reply(&Request { method: "GET", target: "/state", hosts, origin, ..Request::default() }).status
        };
        assert_eq!(ask(&[b"localhost:8123"], None), 200);
        assert_eq!(ask(HOST, Some(b"http://127.0.0.1:8123")), 200);
        for host in [
            "evil.example:8123",
            "127.0.0.1",
            "127.0.0.1:8124",
            "localhost",
            "",
            "127.0.0.1:8123.evil.example",
            "[::1]:8123",
        ] {
            assert_eq!(ask(&[host.as_bytes()], None), 421, "{host}");
        }
        assert_eq!(ask(&[], None), 400);
        assert_eq!(ask(&[HOST[0], HOST[0]], None), 400);
        for origin in
            ["http://evil.example", "null", "https://127.0.0.1:8123", "http://127.0.0.1:81", "", "http://localhost"]
        {
            assert_eq!(ask(HOST, Some(origin.as_bytes())), 403, "{origin}");
        }
        let session = desk.session;
        let mut eighty = Desk::new(session, 80);
        let ask = Request { method: "GET", target: "/state", hosts: &[b"localhost"], ..Request::default() };
        assert_eq!(eighty.reply(&ask).status, 200);
    }

    #[test]
    fn only_known_things_are_answered() {
        let scratch = bench("desk-routes");
        let mut desk = open(&scratch, Task::YesNo);
        for target in [
            "/index.html",
            "//",
            "/../real/f0.png",
            "/patch/../../real/f0.png",
            "/patch/",
            "/patch/%2e%2e/session.json",
            "/study.js?x",
            "/session.json",
            "/out/1/session.json",
            "",
            "*",
            "/STATE",
            "/state/",
            "/patch/..%5c..%5c",
            "http://127.0.0.1:8123/state",
            "/\u{e9}\u{20ac}",
            "/patch/\0",
        ] {
            let status = get(&mut desk, target).status;
            assert!(status == 404 || (status == 409 && target.starts_with(PATCH)), "{target:?}: {status}");
        }
        let mut ask = |method: &str, target: &str| {
            let reply = desk.reply(&Request { method, target, hosts: HOST, ..Request::default() });
            (reply.status, reply.allow)
        };
        for method in ["POST", "PUT", "DELETE", "HEAD", "OPTIONS", "TRACE", "", "get"] {
            assert_eq!(ask(method, "/state"), (405, Some("GET")), "{method}");
        }
        for method in ["GET", "PUT", "OPTIONS"] {
            assert_eq!(ask(method, "/answer"), (405, Some("POST")), "{method}");
        }
        assert_eq!(ask("GET", "/result").0, 409);
        assert_eq!(ask("POST", "/answer").0, 415);
    }

    #[test]
    fn nonsense_is_refused_without_a_change() {
        let scratch = bench("desk-nonsense");
        let mut desk = open(&scratch, Task::YesNo);
        let before = state(&mut desk);
        let name = before["patches"][0].as_str().unwrap().to_owned();
        for body in [
            "",
            "{}",
            "null",
            "[]",
            "\u{feff}{}",
            "{\"patch\":1}",
            &said(&name, "left"),
            &said(&name, "maybe"),
            &said(&name, "real").replace("400.5", "-1"),
            &said(&name, "real").replace("400.5", "1e999"),
            &said(&name, "real").replace('}', ",\"more\":1}"),
            &"[".repeat(4000),
            &" ".repeat(LONGEST_BODY + 1),
        ] {
            let status = post(&mut desk, "/answer", body).status;
            assert!(matches!(status, 400 | 409 | 413), "{body:.60}: {status}");
        }
        assert_eq!(post(&mut desk, "/answer", &said(&name, "real")).status, 409, "it has not been seen");
        assert_eq!(post(&mut desk, "/shown", &shown("ffff")).status, 409);
        assert_eq!(post(&mut desk, "/shown", &shown(&name).replace("2000", "-1")).status, 400);
        assert_eq!(state(&mut desk), before);
        let garbage = [0xff_u8, 0xfe, 0];
        let content_type = Some(JSON.as_bytes());
        let request = Request {
            method: "POST",
            target: "/answer",
            hosts: HOST,
            content_type,
            body: &garbage,
            ..Request::default()
        };
        assert_eq!(desk.reply(&request).status, 400);
    }
}
