#![doc = include_str!("../README.md")]
#![expect(unsafe_code, reason = "exports names and imports a clock; it accesses no pointers")]

use std::cell::RefCell;
use std::time::Duration;

use papsynth::model::Model;
use papsynth::recipe::Preset;
use papsynth::{Inputs, Threads};
use papsynth_web::{Reply, Request, Site, Workbench, WorkbenchParams};
use serde::{Deserialize, Serialize};

/// Memory for images, bytes; an instance has at most 4 GiB.
const MAX_MEMORY: u64 = 2 << 30;

/// A workbench with its last request and reply.
#[derive(Default)]
struct Instance {
    workbench: Option<Workbench>,
    request: Vec<u8>,
    reply: Vec<u8>,
}

thread_local! {
    static INSTANCE: RefCell<Instance> = RefCell::default();
}

/// What precedes the body of a request.
#[derive(Deserialize)]
struct RequestHead<'a> {
    #[serde(borrow)]
    method: &'a str,
    #[serde(borrow)]
    target: &'a str,
    content_type: Option<&'a str>,
}

/// What precedes the body of a reply.
#[derive(Serialize)]
struct ReplyHead {
    status: u16,
    content_type: &'static str,
}

/// Creates the workbench. `images_before` is the largest number of images that an earlier instance may have made.
#[unsafe(no_mangle)]
pub extern "C" fn start(images_before: usize) {
    INSTANCE.with_borrow_mut(|instance| instance.workbench = workbench(images_before));
}

/// Returns the address of the next request, of this length in bytes.
#[unsafe(no_mangle)]
pub extern "C" fn request(length: usize) -> *mut u8 {
    INSTANCE.with_borrow_mut(|instance| {
        instance.request = vec![0; length];
        instance.request.as_mut_ptr()
    })
}

/// Replies to the request, and returns the address of the reply.
#[unsafe(no_mangle)]
pub extern "C" fn reply() -> *const u8 {
    INSTANCE.with_borrow_mut(|instance| {
        let request = std::mem::take(&mut instance.request);
        instance.reply = Vec::new();
        instance.reply = framed(&match &mut instance.workbench {
            Some(workbench) => answered(workbench, &request),
            None => Reply::error(500, "the built-in model is invalid"),
        });
        instance.reply.as_ptr()
    })
}

/// Returns the length of the reply, bytes.
#[unsafe(no_mangle)]
pub extern "C" fn reply_length() -> usize {
    INSTANCE.with_borrow(|instance| instance.reply.len())
}

fn workbench(images_before: usize) -> Option<Workbench> {
    let preset = Preset::Lbc;
    let params = WorkbenchParams {
        recipe: preset.recipe(),
        preset,
        model: Model::builtin(),
        inputs: Inputs::default(),
        seed: 0,
        threads: Threads::One,
        max_memory: Some(MAX_MEMORY),
        clock: now,
        images_before,
    };
    Workbench::new(params).ok()
}

/// Replies to a request: the length of its head, the head as JSON, and the body.
fn answered(workbench: &mut Workbench, message: &[u8]) -> Reply {
    let Some((head, body)) = unframed(message) else { return Reply::error(400, "the request has no head") };
    let RequestHead { method, target, content_type } = match serde_json::from_slice(head) {
        Ok(head) => head,
        Err(error) => return Reply::error(400, &error.to_string()),
    };
    let request = Request { method, target, content_type: content_type.map(str::as_bytes), body };
    match workbench.slow_reply(&request) {
        Some(work) => work(),
        None => workbench.reply(&request),
    }
}

/// Returns head and body of a message.
fn unframed(message: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = message.split_first_chunk::<4>()?;
    rest.split_at_checked(u32::from_le_bytes(*length).try_into().ok()?)
}

fn framed(reply: &Reply) -> Vec<u8> {
    let head = ReplyHead { status: reply.status, content_type: reply.content_type };
    let head = serde_json::to_vec(&head).unwrap_or_default();
    let length = u32::try_from(head.len()).unwrap_or_default();
    [&length.to_le_bytes()[..], &head, &reply.body].concat()
}

#[cfg(target_arch = "wasm32")]
fn now() -> Duration {
    #[link(wasm_import_module = "page")]
    unsafe extern "C" {
        /// Milliseconds since any start.
        #[link_name = "now"]
        safe fn now_ms() -> f64;
    }
    Duration::from_secs_f64(now_ms().max(0.0) / 1e3)
}

#[cfg(not(target_arch = "wasm32"))]
fn now() -> Duration {
    Duration::ZERO
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    fn message(method: &str, target: &str, body: &Value) -> Vec<u8> {
        let head = json!({ "method": method, "target": target, "content_type": "application/json" }).to_string();
        let length = u32::try_from(head.len()).unwrap();
        [&length.to_le_bytes()[..], head.as_bytes(), body.to_string().as_bytes()].concat()
    }

    #[test]
    fn messages_have_the_replies_of_the_workbench() {
        let mut recipe = Preset::Lbc.recipe();
        (recipe.field.width_px, recipe.field.height_px) = (96.0.into(), 80.0.into());
        let body = json!({
            "recipe": recipe, "seed": 3, "index": 1, "view": "full", "focus_um": null, "noise_free": false,
        });
        let (mut ours, mut theirs) = (workbench(0).unwrap(), workbench(0).unwrap());
        for (method, target) in [("GET", "/info"), ("POST", "/render"), ("GET", "/at/1/5/5"), ("GET", "/at/2/5/5")] {
            let text = body.to_string();
            let content_type = Some(&b"application/json"[..]);
            let request = Request { method, target, content_type, body: text.as_bytes() };
            let expected = match theirs.slow_reply(&request) {
                Some(work) => work(),
                None => theirs.reply(&request),
            };
            let found = framed(&answered(&mut ours, &message(method, target, &body)));
            let (head, body) = unframed(&found).unwrap();
            let head: Value = serde_json::from_slice(head).unwrap();
            assert_eq!(head, json!({ "status": expected.status, "content_type": expected.content_type }));
            assert!(*body == *expected.body, "{target}");
        }
    }

    #[test]
    fn images_of_a_later_instance_have_other_numbers() {
        let mut recipe = Preset::Lbc.recipe();
        (recipe.field.width_px, recipe.field.height_px) = (64.0.into(), 64.0.into());
        let body = json!({
            "recipe": recipe, "seed": 3, "index": 1, "view": "full", "focus_um": null, "noise_free": true,
        });
        let reply = answered(&mut workbench(7).unwrap(), &message("POST", "/render", &body));
        let (head, _) = unframed(&reply.body).unwrap();
        assert_eq!(serde_json::from_slice::<Value>(head).unwrap()["id"], 8);
    }

    #[test]
    fn damaged_messages_are_errors() {
        let mut workbench = workbench(0).unwrap();
        for message in [&[][..], &[9, 0, 0, 0, b'{'], &[1, 0, 0, 0, b'{']] {
            assert_eq!(answered(&mut workbench, message).status, 400);
        }
    }
}
