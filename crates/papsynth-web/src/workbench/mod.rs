//! The workbench: a recipe and its image, for experiments with every number. It writes nothing.

mod colouring;
#[cfg(feature = "judge")]
mod compare;
#[cfg(feature = "match")]
mod matching;
mod real;
mod recipes;
mod rendering;

use std::sync::{Arc, Mutex};
use std::time::Duration;

use papsynth::key::STREAM_VERSION;
use papsynth::model::Model;
use papsynth::recipe::{CameraPreset, Preset, Recipe};
use papsynth::truth::Group;
use papsynth::{Inputs, Threads, white_level};
use serde::Deserialize;
use serde_json::json;

use crate::error::Error;
use crate::page::{self, CSS, File, HTML, JS};
use crate::server::{Reply, Request, Site, SlowReply};
use crate::view::{excerpt, number};
use colouring::Colouring;
use real::{RealImage, RealImages};
use rendering::{RenderRequest, Renderer, locked};

const PAGE: [File; 10] = [
    ("/", HTML, include_str!("page/index.html")),
    ("/workbench.css", CSS, include_str!("page/workbench.css")),
    ("/recipe.js", JS, include_str!("page/recipe.js")),
    ("/numbers.js", JS, include_str!("page/numbers.js")),
    ("/form.js", JS, include_str!("page/form.js")),
    ("/picture.js", JS, include_str!("page/picture.js")),
    ("/real.js", JS, include_str!("page/real.js")),
    ("/match.js", JS, include_str!("page/match.js")),
    ("/output.js", JS, include_str!("page/output.js")),
    ("/workbench.js", JS, include_str!("page/workbench.js")),
];

/// Maximum length of a recipe in a request, bytes.
const MAX_RECIPE: usize = 1 << 20;

/// Maximum length of an image in a request, bytes.
const MAX_IMAGE: usize = 1 << 27;

/// Fraction of the memory for the images of the user.
const REAL_MEMORY: f64 = 0.1;

/// Fraction of the memory for the fields of a match.
#[cfg(feature = "match")]
const MATCH_MEMORY: f64 = 0.25;

/// What a workbench starts with.
#[derive(Debug, Clone)]
pub struct WorkbenchParams {
    /// The recipe.
    pub recipe: Recipe,
    /// The preset with which the recipe is compared.
    pub preset: Preset,
    /// The model of all recipes.
    pub model: Model,
    /// The weight map of the recipe, if its layout has one.
    pub inputs: Inputs,
    /// Seed of the first image.
    pub seed: u64,
    /// Threads that render an image.
    pub threads: Threads,
    /// Memory for images, bytes; `None` for no limit.
    pub max_memory: Option<u64>,
    /// Time since any start, for the times that the page shows; no pixel depends on it.
    pub clock: fn() -> Duration,
    /// Images that the page already has from an earlier workbench: the numbers of images continue.
    pub images_before: usize,
}

/// The workbench: replies to the requests of its page.
pub struct Workbench {
    params: WorkbenchParams,
    renderer: Arc<Renderer>,
    /// The images of the user.
    real: Arc<Mutex<RealImages>>,
    #[cfg(feature = "match")]
    matching: Arc<matching::Matching>,
}

/// An image of the user.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RemoveRequest {
    id: usize,
}

/// The text of a recipe.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TextRequest {
    text: String,
}

/// A recipe.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PrintRequest {
    recipe: Recipe,
    /// Whether to explain each field in a comment.
    commented: bool,
}

impl Workbench {
    /// Creates a workbench.
    ///
    /// # Errors
    /// If the model is invalid.
    pub fn new(params: WorkbenchParams) -> Result<Self, Error> {
        let part = |fraction: f64| {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a fraction of a size")]
            params.max_memory.map(|bytes| (bytes as f64 * fraction) as u64)
        };
        let renderer = Arc::new(Renderer::new(&params)?);
        let real = Arc::new(Mutex::new(RealImages::within(part(REAL_MEMORY))));
        #[cfg(feature = "match")]
        let matching = Arc::new(matching::Matching::new(&params, part(MATCH_MEMORY)));
        Ok(Self {
            #[cfg(feature = "match")]
            matching,
            params,
            renderer,
            real,
        })
    }

    /// Returns all that the page needs before the first image.
    fn info(&self) -> Reply {
        let preset =
            |preset: Preset| json!({ "name": preset.name(), "summary": preset.summary(), "recipe": preset.recipe() });
        let camera = |camera: CameraPreset| json!({ "name": camera.name(), "summary": camera.summary(), "camera": camera.camera() });
        Reply::json(&json!({
            "version": env!("CARGO_PKG_VERSION"),
            "stream_version": STREAM_VERSION,
            "schema": Recipe::schema(),
            "presets": Preset::ALL.map(preset),
            "cameras": CameraPreset::ALL.map(camera),
            "classes": self.params.model.classes.keys().collect::<Vec<_>>(),
            "compares": cfg!(feature = "judge"),
            "matches": cfg!(feature = "match"),
            "groups": Group::ALL.map(Group::name),
            "preset": self.params.preset.name(),
            "recipe": self.params.recipe,
            "seed": self.params.seed,
        }))
    }

    fn answer(&self, request: &Request) -> Result<Reply, Reply> {
        let words: Vec<&str> = request.target.split('/').skip(1).take(5).collect();
        match (request.method, &words[..]) {
            ("GET", ["info"]) => Ok(self.info()),
            ("POST", ["check"]) => {
                let TextRequest { text } = request.json_within(MAX_RECIPE)?;
                Ok(Reply::json(&recipes::checked(&text, &self.params.model)))
            }
            ("POST", ["print"]) => {
                let PrintRequest { recipe, commented } = request.json_within(MAX_RECIPE)?;
                let text = if commented { recipe.to_commented_toml() } else { recipe.to_toml() };
                Ok(Reply::json(&json!({ "text": text })))
            }
            ("POST", ["cancel"]) => {
                self.renderer.cancel();
                Ok(Reply::json(&json!({})))
            }
            ("POST", ["real", "remove"]) => {
                let RemoveRequest { id } = request.json()?;
                locked(&self.real).remove(id);
                Ok(Reply::json(&json!({})))
            }
            #[cfg(feature = "match")]
            ("GET", ["match"]) => Ok(self.matching.state()),
            #[cfg(feature = "match")]
            ("POST", ["match"]) => self.matching.start(&request.json_within(MAX_RECIPE)?, &self.real),
            #[cfg(feature = "match")]
            ("POST", ["match", "cancel"]) => Ok(self.matching.stop()),
            #[cfg(feature = "match")]
            ("POST", ["match", "estimate"]) => {
                let asked = request.json_within(MAX_RECIPE)?;
                Ok(Reply::json(&self.matching.estimate(&asked, &self.real, self.renderer.pace())?))
            }
            (_, ["info" | "at" | "labels" | "legend" | "image.png" | "mask", ..]) => Err(Reply::wrong_method("GET")),
            (_, ["cancel" | "check" | "compare" | "match" | "print" | "real" | "render", ..]) => {
                Err(Reply::wrong_method("POST"))
            }
            _ => Err(Reply::error(404, "not found")),
        }
    }

    /// Returns the work of a request that needs an image or its ground truth.
    fn work(&self, request: &Request) -> Result<Option<SlowReply>, Reply> {
        let renderer = Arc::clone(&self.renderer);
        let words: Vec<&str> = request.target.split('/').skip(1).take(5).collect();
        Ok(match (request.method, &words[..]) {
            ("POST", ["render"]) => {
                let asked: RenderRequest = request.json_within(MAX_RECIPE)?;
                // Cancels earlier images before this one waits for them.
                let cancellation = renderer.begin(&asked);
                Some(Box::new(move || renderer.render(&asked, &cancellation)))
            }
            #[cfg(feature = "judge")]
            ("POST", ["compare"]) => {
                let asked: compare::CompareRequest = request.json()?;
                let real = locked(&self.real).get(asked.real)?;
                Some(Box::new(move || compare::compared(&asked, &renderer, &real).unwrap_or_else(|error| error)))
            }
            ("GET", ["at", id, x, y]) => {
                let (id, x, y) = (number(id)?, number(x)?, number(y)?);
                Some(Box::new(move || renderer.objects_at(id, x, y).unwrap_or_else(|error| error)))
            }
            ("GET", ["labels", id, by, group]) => {
                let (id, by, group) = (number(id)?, colouring(by)?, group_of(group)?);
                Some(Box::new(move || renderer.label_colours(id, group, by).unwrap_or_else(|error| error)))
            }
            ("GET", ["legend", id, by, group]) => {
                let (id, by, group) = (number(id)?, colouring(by)?, group_of(group)?);
                Some(Box::new(move || renderer.legend(id, by, group).unwrap_or_else(|error| error)))
            }
            ("POST", ["real"]) => {
                let (file, real) = (RealImage::encoded(request)?, Arc::clone(&self.real));
                Some(Box::new(move || {
                    let limits = locked(&real).limits();
                    let image = RealImage::decode(&file, &limits);
                    image.and_then(|image| locked(&real).add(image)).unwrap_or_else(|error| error)
                }))
            }
            ("GET", ["mask", id, group]) => {
                let (id, group) = (number(id)?, group_of(group)?);
                Some(Box::new(move || renderer.label_map(id, group).unwrap_or_else(|error| error)))
            }
            ("GET", ["image.png", id]) => {
                let id = number(id)?;
                Some(Box::new(move || renderer.image(id).unwrap_or_else(|error| error)))
            }
            _ => None,
        })
    }
}

impl Site for Workbench {
    fn reply(&mut self, request: &Request) -> Reply {
        page::file(&PAGE, request).unwrap_or_else(|| self.answer(request).unwrap_or_else(|error| error))
    }

    fn max_body(&self) -> usize {
        MAX_IMAGE
    }

    fn slow_reply(&mut self, request: &Request) -> Option<SlowReply> {
        self.work(request).unwrap_or_else(|error| Some(Box::new(move || error)))
    }
}

fn colouring(name: &str) -> Result<Colouring, Reply> {
    Colouring::by_name(name).ok_or_else(|| {
        let message = format!("unknown colours `{}`; expected object, class or detectability", excerpt(name));
        Reply::error(404, &message)
    })
}

fn group_of(name: &str) -> Result<Group, Reply> {
    let name = name.strip_suffix(".png").unwrap_or(name);
    Group::ALL.into_iter().find(|group| group.name() == name).ok_or_else(|| {
        let name = excerpt(name);
        Reply::error(404, &format!("unknown label group `{name}`; expected cytoplasm, nucleus or debris"))
    })
}

/// Returns the highest grey level of samples with this number of bits.
fn white(bits: u32) -> u16 {
    white_level(bits)
}
