//! The workbench without a browser: its replies, and its pixels against those of an engine.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

use papsynth::key::Key;
use papsynth::live::Live;
use papsynth::model::Model;
use papsynth::recipe::{Preset, Recipe};
use papsynth::truth::Group;
use papsynth::{Engine, Inputs, Threads};
use papsynth_web::{JSON, MAX_BODY, Reply, Request, Site, Workbench, WorkbenchParams};
use serde_json::{Value, json};

use crate::support::view::{Pixels, recipe};

fn workbench(recipe: Recipe, max_memory: Option<u64>) -> Workbench {
    let (model, inputs) = (Model::builtin(), Inputs::default());
    let (preset, threads) = (Preset::Lbc, Threads::All);
    let params =
        WorkbenchParams { recipe, preset, model, inputs, seed: 5, threads, max_memory, clock, images_before: 0 };
    Workbench::new(params).unwrap()
}

/// A millisecond later at each call.
fn clock() -> Duration {
    static CALLS: AtomicU64 = AtomicU64::new(0);
    Duration::from_millis(CALLS.fetch_add(1, Ordering::Relaxed))
}

/// Replies as the server does.
fn ask(workbench: &mut Workbench, request: &Request) -> Reply {
    match workbench.slow_reply(request) {
        Some(work) => work(),
        None => workbench.reply(request),
    }
}

fn get(workbench: &mut Workbench, target: &str) -> Reply {
    ask(workbench, &Request { method: "GET", target, ..Request::default() })
}

fn post(workbench: &mut Workbench, target: &str, body: &Value) -> Reply {
    let body = body.to_string();
    let request = Request { method: "POST", target, content_type: Some(JSON.as_bytes()), body: body.as_bytes() };
    ask(workbench, &request)
}

fn json_of(reply: &Reply) -> Value {
    assert_eq!((reply.status, reply.content_type), (200, JSON), "{}", String::from_utf8_lossy(&reply.body));
    serde_json::from_slice(&reply.body).unwrap()
}

/// Returns the description and the samples of an image.
fn unframed(reply: &Reply) -> (Value, Vec<u8>) {
    assert_eq!(reply.status, 200, "{}", String::from_utf8_lossy(&reply.body));
    let (length, rest) = reply.body.split_first_chunk::<4>().unwrap();
    let (head, samples) = rest.split_at(usize::try_from(u32::from_le_bytes(*length)).unwrap());
    (serde_json::from_slice(head).unwrap(), samples.to_vec())
}

fn asked(recipe: &Recipe, view: &str) -> Value {
    json!({ "recipe": recipe, "seed": 5, "index": 1, "view": view, "focus_um": null, "noise_free": false })
}

#[test]
fn images_have_the_pixels_of_an_engine() {
    let mut recipe = recipe("");
    let mut workbench = workbench(recipe.clone(), None);
    let key = Key { seed: 5, index: 1 };
    let frame =
        |recipe: &Recipe| Engine::new(recipe, &Model::builtin(), &Inputs::default()).unwrap().frame(key).unwrap();
    let expected = frame(&recipe);
    let (reduced, samples) = unframed(&post(&mut workbench, "/render", &asked(&recipe, "reduced")));
    assert_eq!((&reduced["width"], &reduced["height"], samples.len()), (&json!(150), &json!(135), 150 * 135));
    let (head, samples) = unframed(&post(&mut workbench, "/render", &asked(&recipe, "full")));
    assert!(expected.planes[0].grey.iter().eq(&samples.iter().map(|&s| u16::from(s)).collect::<Vec<_>>()));
    assert_eq!(head["objects"], expected.finished.scene.objects.len());
    assert_eq!(head["sha256"], expected.planes[0].sha256(8));
    // Ground truth of the same image.
    let id = head["id"].as_u64().unwrap();
    let truth = &expected.finished.truth;
    for group in Group::ALL {
        let labels = truth.labels(group);
        let map = get(&mut workbench, &format!("/mask/{id}/{}.png", group.name()));
        let mut reader = png::Decoder::new(std::io::Cursor::new(&map.body[..])).read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut bytes).unwrap();
        assert!(
            bytes.as_chunks().0.iter().map(|&two| u32::from(u16::from_be_bytes(two))).eq(labels.ids.iter().copied())
        );
        let colours = Pixels::decode(&get(&mut workbench, &format!("/labels/{id}/object/{}.png", group.name())).body);
        assert_eq!([colours.width, colours.height, colours.channels], [300, 270, 4]);
        let is_label = |k: usize| colours.bytes[4 * k + 3] > 0;
        assert!((0..300 * 270).all(|k| is_label(k) == (labels.ids[k] != 0)));
    }
    let by_class = Pixels::decode(&get(&mut workbench, &format!("/labels/{id}/class/cytoplasm.png")).body);
    let classes: BTreeSet<&[u8]> = by_class.bytes.chunks_exact(4).filter(|p| p[3] > 0).map(|p| &p[..3]).collect();
    let legend = json_of(&get(&mut workbench, &format!("/legend/{id}/class/cytoplasm")));
    let known: Vec<&str> = legend.as_array().unwrap().iter().map(|entry| entry["colour"].as_str().unwrap()).collect();
    let css = |p: &[u8]| format!("#{:02x}{:02x}{:02x}", p[0], p[1], p[2]);
    assert!(!classes.is_empty() && classes.iter().all(|colour| known.contains(&css(colour).as_str())), "{legend}");
    assert_eq!(
        json_of(&get(&mut workbench, &format!("/legend/{id}/detectability/debris"))).as_array().unwrap().len(),
        2
    );
    let object = truth.objects.iter().find(|object| object.visible.area() > 0).unwrap();
    let run = object.visible.runs()[0];
    let here = json_of(&get(&mut workbench, &format!("/at/{id}/{}/{}", run.x0, run.y)));
    assert!(here["objects"].as_array().unwrap().iter().any(|found| found["id"] == object.id), "{here}");
    let image = Pixels::decode(&get(&mut workbench, &format!("/image.png/{id}")).body);
    assert_eq!(image.bytes, samples);
    // More than 8 bits, colour, another focus, without noise.
    recipe.camera.bits = 12.0.into();
    recipe.light = papsynth::recipe::LightSection::Colour(papsynth::recipe::Colour::default());
    recipe.focus.centre_um = 1.5.into();
    let expected = frame(&recipe);
    recipe.focus.centre_um = 0.0.into();
    let mut request = asked(&recipe, "full");
    request["focus_um"] = 1.5.into();
    let (head, samples) = unframed(&post(&mut workbench, "/render", &request));
    assert_eq!((&head["channels"], &head["bits"], &head["stage_um"]), (&json!(3), &json!(12), &json!(1.5)));
    let levels = |samples: &[u8]| samples.as_chunks().0.iter().map(|&two| u16::from_le_bytes(two)).collect::<Vec<_>>();
    assert!(levels(&samples) == expected.planes[0].grey);
    request["noise_free"] = true.into();
    let (head, samples) = unframed(&post(&mut workbench, "/render", &request));
    let is_near = |(&level, &mean): (&u16, &f32)| (f32::from(level) - mean).abs() <= 0.5;
    assert!(levels(&samples).iter().zip(&expected.planes[0].noise_free).all(is_near));
    assert_eq!(head["made"], json!({ "phantoms": 0, "planes": 0, "background": false }));
    // The earlier image is gone.
    assert_eq!(get(&mut workbench, &format!("/at/{id}/1/1")).status, 404);
    assert_eq!(get(&mut workbench, &format!("/image.png/{id}")).status, 404);
}

#[test]
fn a_new_image_cancels_the_earlier_ones() {
    let recipe = recipe("");
    let mut workbench = workbench(recipe.clone(), None);
    let mut begin = |view: &str| {
        let body = asked(&recipe, view).to_string();
        let content_type = Some(JSON.as_bytes());
        let request = Request { method: "POST", target: "/render", content_type, body: body.as_bytes() };
        workbench.slow_reply(&request).unwrap()
    };
    let works = [begin("full"), begin("small"), begin("small"), begin("reduced"), begin("small")];
    let threads = works.map(|work| thread::spawn(move || unframed(&work()).0["cancelled"] == true));
    let cancelled = threads.map(|thread| thread.join().unwrap());
    assert_eq!(cancelled, [true, true, true, false, false]);
    let work = begin("full");
    post(&mut workbench, "/cancel", &json!({}));
    assert_eq!(unframed(&work()).0["cancelled"], true);
}

#[test]
fn invalid_recipes_are_reported_and_the_last_image_stays() {
    let recipe = recipe("");
    let mut workbench = workbench(recipe.clone(), None);
    let (head, _) = unframed(&post(&mut workbench, "/render", &asked(&recipe, "full")));
    let mut wrong = recipe.clone();
    wrong.camera.read_noise_e = (-4.0).into();
    wrong.cells.insert("unknown".to_owned(), recipe.cells.values().next().unwrap().clone());
    let (errors, samples) = unframed(&post(&mut workbench, "/render", &asked(&wrong, "full")));
    let paths: Vec<&Value> = errors["errors"].as_array().unwrap().iter().map(|error| &error["path"]).collect();
    assert_eq!(paths, [&json!(["camera", "read_noise_e"]), &json!(["cells", "unknown"])]);
    assert!(samples.is_empty());
    assert_eq!(get(&mut workbench, &format!("/image.png/{}", head["id"])).status, 200);
    let text = "version = 1\n[camera]\nread_noise_e = -4\n";
    let checked = json_of(&post(&mut workbench, "/check", &json!({ "text": text })));
    assert_eq!(checked["errors"][0]["line"], 3);
    let printed = json_of(&post(&mut workbench, "/print", &json!({ "recipe": recipe, "commented": true })));
    let again =
        json_of(&post(&mut workbench, "/check", &printed.as_object().map(|p| json!({ "text": p["text"] })).unwrap()));
    assert_eq!(again["recipe"], serde_json::to_value(&recipe).unwrap());
}

#[test]
fn images_beyond_the_memory_are_rejected() {
    let recipe = recipe("");
    let mut workbench = workbench(recipe.clone(), Some(1 << 20));
    let (head, _) = unframed(&post(&mut workbench, "/render", &asked(&recipe, "full")));
    assert!(head["errors"][0]["message"].as_str().unwrap().contains("MiB"), "{head}");
    const { assert!(Live::MAX_LIGHT_BYTES >= 1 << 20) };
}

#[test]
fn images_of_the_user_are_decoded_in_memory() {
    let recipe = recipe("");
    let mut workbench = workbench(recipe.clone(), None);
    let (head, samples) = unframed(&post(&mut workbench, "/render", &asked(&recipe, "full")));
    let file = get(&mut workbench, &format!("/image.png/{}", head["id"])).body;
    let content_type = Some(&b"application/octet-stream"[..]);
    let reply = ask(&mut workbench, &Request { method: "POST", target: "/real", content_type, body: &file });
    let (real, pixels) = unframed(&reply);
    assert_eq!(real["id"], 1);
    assert_eq!((&real["width"], &real["channels"], &real["bits"]), (&json!(300), &json!(1), &json!(8)));
    assert_eq!(pixels, samples);
    #[cfg(feature = "judge")]
    {
        // An image does not differ from itself.
        let found =
            json_of(&post(&mut workbench, "/compare", &json!({ "id": head["id"], "real": 1, "pixel_um": 0.25 })));
        let scalars = found["scalars"].as_array().unwrap();
        assert!(scalars.len() > 5 && scalars.iter().all(|scalar| scalar["difference"] == 0.0), "{found}");
        assert_eq!(found["spectrum"]["ours"], found["spectrum"]["theirs"]);
        let gone = post(&mut workbench, "/compare", &json!({ "id": 99, "real": 1, "pixel_um": 0.25 }));
        assert_eq!(gone.status, 404);
        let wrong = post(&mut workbench, "/compare", &json!({ "id": head["id"], "real": 1, "pixel_um": 99.0 }));
        assert_eq!(wrong.status, 422);
        assert_eq!(post(&mut workbench, "/real/remove", &json!({ "id": 1 })).status, 200);
        let gone = post(&mut workbench, "/compare", &json!({ "id": head["id"], "real": 1, "pixel_um": 0.25 }));
        assert_eq!(gone.status, 404);
    }
    // A page of another site can send text without asking.
    let content_type = Some(&b"text/plain"[..]);
    let reply = ask(&mut workbench, &Request { method: "POST", target: "/real", content_type, body: &file });
    assert_eq!(reply.status, 415);
    let content_type = Some(&b"application/octet-stream"[..]);
    let reply = ask(&mut workbench, &Request { method: "POST", target: "/real", content_type, body: b"no image" });
    assert_eq!(reply.status, 422);
}

/// Waits for the end of the match, and returns the last reply.
#[cfg(feature = "match")]
fn ended(workbench: &mut Workbench) -> Value {
    loop {
        let state = json_of(&get(workbench, "/match"));
        if state["state"] != "running" {
            return state;
        }
        assert!(state["done"].as_u64() <= state["total"].as_u64(), "{state}");
        thread::sleep(Duration::from_millis(20));
    }
}

#[cfg(feature = "match")]
#[test]
fn a_match_finds_a_recipe_for_the_images_of_the_user() {
    let mut recipe = recipe("[slide]\nfields_per_slide = 1\n[background]\nlevel = 0.8\ntexture = 0.004\n");
    recipe.field.pixel_um = 0.5.into();
    for (name, count) in [("intermediate", 5.0), ("superficial", 2.0)] {
        recipe.cells.get_mut(name).unwrap().count = count.into();
    }
    let mut workbench = workbench(recipe.clone(), Some(1 << 30));
    let request = |images: &[u64], quick: bool| {
        let images: Vec<Value> = images.iter().map(|id| json!({ "id": id, "name": format!("field {id}") })).collect();
        json!({ "recipe": Preset::Lbc.recipe(), "images": images, "pixel_um": 0.5, "quick": quick })
    };
    for index in 0..3 {
        let mut asked = asked(&recipe, "full");
        asked["index"] = index.into();
        let (head, _) = unframed(&post(&mut workbench, "/render", &asked));
        let file = get(&mut workbench, &format!("/image.png/{}", head["id"])).body;
        let content_type = Some(&b"application/octet-stream"[..]);
        ask(&mut workbench, &Request { method: "POST", target: "/real", content_type, body: &file });
    }
    assert_eq!(json_of(&get(&mut workbench, "/match"))["state"], "none");
    let [quick, whole] =
        [true, false].map(|quick| json_of(&post(&mut workbench, "/match/estimate", &request(&[1, 2, 3], quick))));
    assert!(quick["seconds"].as_f64() > Some(0.0) && quick["seconds"].as_f64() < whole["seconds"].as_f64(), "{whole}");
    // Errors of the match are those of the library.
    post(&mut workbench, "/match", &request(&[2], true));
    let failed = ended(&mut workbench);
    assert_eq!(
        (&failed["state"], failed["error"].as_str().unwrap().starts_with("1 field for a match")),
        (&json!("failed"), true)
    );
    assert_eq!(post(&mut workbench, "/match", &request(&[9], true)).status, 404);
    let mut wrong = request(&[1, 2], true);
    wrong["pixel_um"] = 99.0.into();
    assert_eq!(post(&mut workbench, "/match", &wrong).status, 422);
    // A match that is cancelled.
    assert_eq!(json_of(&post(&mut workbench, "/match", &request(&[1, 2, 3], false)))["state"], "running");
    assert_eq!(json_of(&post(&mut workbench, "/match/cancel", &json!({})))["state"], "none");
    assert_eq!(json_of(&get(&mut workbench, "/match"))["state"], "none");
    post(&mut workbench, "/match", &request(&[1, 2, 3], true));
    let done = ended(&mut workbench);
    assert_eq!(done["state"], "done", "{done}");
    let level = done["fit"]["parameters"].as_array().unwrap().iter().find(|p| p["parameter"] == "level").unwrap();
    assert!((level["value"].as_f64().unwrap() - 0.8).abs() < 0.03, "{level}");
    assert_eq!(done["fit"]["simulated"], quick["simulated"]);
    let found: Recipe = serde_json::from_value(done["recipe"].clone()).unwrap();
    assert_eq!(found.conditions.len(), 3);
    let (head, _) = unframed(&post(&mut workbench, "/render", &asked(&found, "full")));
    assert_eq!((&head["width"], &head["pixel_um"]), (&json!(300), &json!(0.5)));
}

#[test]
fn the_page_and_unknown_requests() {
    let mut workbench = workbench(recipe(""), None);
    let info = json_of(&get(&mut workbench, "/info"));
    assert_eq!(info["presets"].as_array().unwrap().len(), Preset::ALL.len());
    assert_eq!((&info["seed"], &info["preset"]), (&json!(5), &json!("lbc")));
    assert!(info["schema"]["properties"]["camera"].is_object());
    let page = get(&mut workbench, "/");
    let html = String::from_utf8(page.body.to_vec()).unwrap();
    for name in html.split("src=\"").skip(1).chain(html.split("stylesheet\" href=\"").skip(1)) {
        let name = name.split('"').next().unwrap();
        assert_eq!(get(&mut workbench, &format!("/{name}")).status, 200, "{name}");
    }
    for (method, target, status) in [
        ("GET", "/nothing", 404),
        ("POST", "/info", 405),
        ("GET", "/render", 405),
        ("GET", "/at/1/2/3", 404),
        ("GET", "/at/x/2/3", 400),
        ("GET", "/labels/1/object/nuclei.png", 404),
        ("GET", "/labels/1/object/nucleus.png", 404),
        ("GET", "/labels/1/size/nucleus.png", 404),
        ("GET", "/legend/1/class/nucleus", 404),
        ("POST", "/legend/1/class", 405),
        ("GET", "/image.png/7", 404),
        ("POST", "/render", 415),
        ("POST", "/check", 415),
        ("POST", "/real/remove", 415),
    ] {
        assert_eq!(ask(&mut workbench, &Request { method, target, ..Request::default() }).status, status, "{target}");
    }
    assert!(workbench.max_body() > MAX_BODY);
    let wrong = post(&mut workbench, "/render", &json!({ "recipe": {}, "seed": -1 }));
    assert_eq!(wrong.status, 400);
}
