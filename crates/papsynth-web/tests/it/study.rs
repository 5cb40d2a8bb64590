//! Tests of the replies of a study.

use papsynth_study::{Session, StudyParams, TrialDesign};
use papsynth_web::{JSON, MAX_BODY, Reply, Request, Site};

use crate::support::Scratch;

fn open(scratch: &Scratch, task: TrialDesign) -> Session {
    let params = StudyParams { trials: 4, training: 2, patch_px: 48, task, ..StudyParams::default() };
    let [real, synthetic, out] = ["real", "synthetic", "out"].map(|name| scratch.join(name));
    Session::open(&params, &real, &synthetic, &out).unwrap()
}

fn get(study: &mut Session, target: &str) -> Reply {
    study.reply(&Request { method: "GET", target, ..Request::default() })
}

fn post(study: &mut Session, target: &str, body: &str) -> Reply {
    let content_type = Some(JSON.as_bytes());
    study.reply(&Request { method: "POST", target, content_type, body: body.as_bytes() })
}

fn state(study: &mut Session) -> serde_json::Value {
    serde_json::from_slice(&get(study, "/state").body).unwrap()
}

fn shown(patch: &str) -> String {
    format!(
        r#"{{"patch":"{patch}","exposure":{{"exposure_ms":2000,"frames":120,"longest_frame_ms":17,"pixel_ratio":1}}}}"#
    )
}

fn said(patch: &str, answer: &str) -> String {
    format!(r#"{{"patch":"{patch}","answer":"{answer}","response_ms":400.5}}"#)
}

/// Runs a whole study and returns every reply.
fn transcript(study: &mut Session, answer: &str) -> Vec<(String, Reply)> {
    let mut seen = Vec::new();
    for target in ["/", "/base.css", "/base.js", "/study.css", "/study.js"] {
        seen.push((target.to_owned(), get(study, target)));
    }
    loop {
        let reply = get(study, "/state");
        let state: serde_json::Value = serde_json::from_slice(&reply.body).unwrap();
        seen.push(("/state".to_owned(), reply));
        if state["finished"] == true {
            return seen;
        }
        let names: Vec<String> = serde_json::from_value(state["patches"].clone()).unwrap();
        for name in &names {
            let target = format!("/patch/{name}");
            let reply = get(study, &target);
            assert_eq!(reply.status, 200);
            seen.push((target, reply));
        }
        for (target, body) in [("/shown", shown(&names[0])), ("/answer", said(&names[0], answer))] {
            let reply = post(study, target, &body);
            assert_eq!(reply.status, 200, "{reply:?}");
            seen.push((target.to_owned(), reply));
        }
    }
}

#[test]
fn only_pixels_depend_on_the_labels() {
    for (task, answer) in [(TrialDesign::YesNo, "real"), (TrialDesign::TwoAlternatives, "left")] {
        let scratch = Scratch::of_study(&format!("study-answers-{}", task.name()));
        let first = transcript(&mut open(&scratch, task), answer);
        // The same study with all labels swapped: replies other than pixels must be equal.
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
            if target.starts_with("/patch/") {
                assert_ne!(one.body, other.body, "the pixels are others");
                patches += 1;
            } else {
                assert_eq!(one, other, "{target}");
            }
        }
        assert_eq!(patches, if task == TrialDesign::YesNo { 6 } else { 12 });
    }
}

#[test]
fn the_page_names_no_files_and_no_labels() {
    let scratch = Scratch::of_study("study-words");
    let mut study = open(&scratch, TrialDesign::YesNo);
    let seen = transcript(&mut study, "synthetic");
    let lengths: std::collections::BTreeSet<usize> =
        seen.iter().filter(|(target, _)| target.starts_with("/patch/")).map(|(_, reply)| reply.body.len()).collect();
    assert_eq!(lengths.len(), 1, "all patches are files of one size");
    for (target, reply) in &seen {
        if target.starts_with("/patch/") {
            continue;
        }
        let text = String::from_utf8(reply.body.to_vec()).unwrap();
        for word in ["field-0.png", "field-1.png", "out/1", "truth", "side\"", "seed", "\"field"] {
            assert!(!text.contains(word), "{target} says {word}");
        }
        for word in ["http://", "https://", "//cdn", "@import", "url("] {
            assert!(!text.contains(word), "{target} leads elsewhere: {word}");
        }
    }
    // After the last answer the result is available.
    let result: serde_json::Value = serde_json::from_slice(&get(&mut study, "/result").body).unwrap();
    assert_eq!(result["row"]["counts"], serde_json::json!({ "tp": 0, "fp": 0, "tn": 2, "fn": 2 }));
}

#[test]
fn unknown_requests_are_rejected() {
    let scratch = Scratch::of_study("study-routes");
    let mut study = open(&scratch, TrialDesign::YesNo);
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
        let status = get(&mut study, target).status;
        assert!(status == 404 || (status == 409 && target.starts_with("/patch/")), "{target:?}: {status}");
    }
    let mut ask = |method: &str, target: &str| {
        let reply = study.reply(&Request { method, target, ..Request::default() });
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
fn invalid_answers_change_nothing() {
    let scratch = Scratch::of_study("study-nonsense");
    let mut study = open(&scratch, TrialDesign::YesNo);
    let before = state(&mut study);
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
        &" ".repeat(MAX_BODY + 1),
    ] {
        let status = post(&mut study, "/answer", body).status;
        assert!(matches!(status, 400 | 409 | 413), "{body:.60}: {status}");
    }
    assert_eq!(post(&mut study, "/answer", &said(&name, "real")).status, 409, "it has not been seen");
    assert_eq!(post(&mut study, "/shown", &shown("ffff")).status, 409);
    assert_eq!(post(&mut study, "/shown", &shown(&name).replace("2000", "-1")).status, 400);
    assert_eq!(state(&mut study), before);
    let garbage = [0xff_u8, 0xfe, 0];
    let content_type = Some(JSON.as_bytes());
    let request = Request { method: "POST", target: "/answer", content_type, body: &garbage };
    assert_eq!(study.reply(&request).status, 400);
}
