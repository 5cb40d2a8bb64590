//! Images of the workbench: one at a time, the most recent request first.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use papsynth::key::Key;
use papsynth::live::{Cancellation, Live, LiveImage};
use papsynth::model::Model;
use papsynth::recipe::{InvalidField, Recipe};
use papsynth::scene::Scene;
use papsynth::truth::{Group, Truth};
use papsynth::{ErrorKind, Plane, Threads};
use papsynth_dataset::Layout;
use papsynth_dataset::memory::MemoryEstimate;
use serde::Deserialize;
use serde_json::{Value, json};

use super::colouring::Colouring;
use super::{WorkbenchParams, recipes};
use crate::error::Error;
use crate::server::Reply;
use crate::view::grid::{Grid, Region};
use crate::view::labels::{Ids, colour, css};
use crate::view::objects::objects_at;
use crate::view::source::{check_pixel, png, png16};

/// A request for an image.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RenderRequest {
    recipe: Recipe,
    seed: u64,
    index: u64,
    view: ImageKind,
    /// Position of the stage, µm; `None` for that of the recipe, or of its middle plane.
    focus_um: Option<f64>,
    /// Whether to return expected grey levels instead of those with noise.
    noise_free: bool,
}

/// The resolution of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum ImageKind {
    /// The image.
    Full,
    /// Half the resolution.
    Reduced,
    /// A quarter of the resolution.
    Coarse,
    /// The same for a row of small images.
    Small,
}

impl ImageKind {
    const ALL: [Self; 4] = [Self::Full, Self::Reduced, Self::Coarse, Self::Small];

    /// Returns the size of its pixels relative to the image.
    fn factor(self) -> usize {
        match self {
            Self::Full => 1,
            Self::Reduced => 2,
            Self::Coarse | Self::Small => 4,
        }
    }
}

/// Fraction of the memory for the frame of a recipe; the rest is for its smaller images and kept light.
const FRAME_MEMORY: f64 = 0.5;

/// Fraction of the memory for kept light of images of full resolution; others have less by their pixels.
const LIGHT_MEMORY: f64 = 0.125;

/// Renders images.
pub(super) struct Renderer {
    model: Model,
    threads: Threads,
    max_memory: Option<u64>,
    clock: fn() -> Duration,
    /// The images in progress or waiting.
    pending: Mutex<Vec<Cancellation>>,
    sessions: Mutex<Sessions>,
    /// The last complete image.
    shown: Mutex<Option<Shown>>,
    /// Time of a pixel of the last image of full resolution of which nothing was kept, s.
    pace: Mutex<f64>,
}

/// A session for each kind of image, because each has its own pixels.
struct Sessions {
    lives: [Live; ImageKind::ALL.len()],
    /// Number of complete images; the id of the last one.
    count: usize,
}

/// A complete image.
struct Shown {
    id: usize,
    plane: Plane,
    scene: Scene,
    /// The ground truth, on first use.
    truth: Option<Truth>,
}

impl Renderer {
    pub(super) fn new(params: &WorkbenchParams) -> Result<Self, Error> {
        let live = |kind: ImageKind| {
            let mut live = Live::new(&params.model, &params.inputs)?;
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a fraction of a size")]
            if let Some(bytes) = params.max_memory {
                let light = (bytes as f64 * LIGHT_MEMORY) as usize / kind.factor().pow(2);
                live.set_max_light_bytes(Live::MAX_LIGHT_BYTES.min(light));
            }
            Ok::<_, papsynth::Error>(live)
        };
        let [full, reduced, coarse, small] = ImageKind::ALL.map(live);
        let lives = [full?, reduced?, coarse?, small?];
        Ok(Self {
            model: params.model.clone(),
            threads: params.threads,
            max_memory: params.max_memory,
            clock: params.clock,
            pending: Mutex::default(),
            sessions: Mutex::new(Sessions { lives, count: params.images_before }),
            shown: Mutex::default(),
            pace: Mutex::default(),
        })
    }

    /// Cancels all images in progress.
    pub(super) fn cancel(&self) {
        locked(&self.pending).drain(..).for_each(|earlier| earlier.cancel());
    }

    /// Cancels the images that a new image replaces, and returns the flag of the new one.
    pub(super) fn begin(&self, asked: &RenderRequest) -> Cancellation {
        // Small images wait for the others; a change cancels all.
        if asked.view != ImageKind::Small {
            self.cancel();
        }
        let cancellation = Cancellation::default();
        locked(&self.pending).push(cancellation.clone());
        cancellation
    }

    /// Returns an image: the length of the JSON that describes it (32 bits, least byte first), the JSON, and the
    /// samples, with 8 bits or with 16 bits, least byte first.
    ///
    /// A cancelled image is `{"cancelled": true}`, an invalid recipe
    /// `{"errors": …}`.
    pub(super) fn render(&self, asked: &RenderRequest, cancellation: &Cancellation) -> Reply {
        let errors = recipes::errors(&asked.recipe, &self.model);
        if !errors.is_empty() {
            return header(&json!({ "errors": errors }));
        }
        if let Some(message) = self.too_large(&asked.recipe) {
            return header(&json!({ "errors": [{ "path": ["field"], "message": message }] }));
        }
        let mut sessions = locked(&self.sessions);
        if cancellation.is_cancelled() {
            return header(&json!({ "cancelled": true }));
        }
        let start = (self.clock)();
        match image(&mut sessions.lives[asked.view as usize], asked, self.threads, cancellation) {
            Ok((scene, planes_um, LiveImage { mut planes, made })) => {
                let Some(plane) = planes.pop() else { return Reply::error(500, "the image has no plane") };
                let seconds = (self.clock)().saturating_sub(start).as_secs_f64();
                if asked.view == ImageKind::Full && made.phantoms == scene.objects.len() {
                    *locked(&self.pace) = seconds / (scene.view.width * scene.view.height) as f64;
                }
                sessions.count += 1;
                let (id, bits) = (sessions.count, scene.camera.bits);
                let head = json!({
                    "id": id,
                    "width": scene.view.width,
                    "height": scene.view.height,
                    "pixel_um": scene.view.pixel_um,
                    "factor": asked.view.factor(),
                    "channels": plane.channels,
                    "bits": bits,
                    "stage_um": plane.stage_um,
                    "planes_um": planes_um,
                    "fused": scene.fusion.is_some(),
                    "objects": scene.objects.len(),
                    "cells": scene.cells.values().map(|count| count.in_field).sum::<u64>(),
                    "unplaced": scene.unplaced(),
                    "saturated_px": plane.saturated.area(),
                    "ms": seconds * 1e3,
                    "sha256": (asked.view == ImageKind::Full).then(|| plane.sha256(bits)),
                    "made": { "phantoms": made.phantoms, "planes": made.planes, "background": made.background },
                });
                let reply = match asked.noise_free {
                    true => framed(&head, &rounded(&plane.noise_free, super::white(bits)), bits),
                    false => framed(&head, &plane.grey, bits),
                };
                if asked.view == ImageKind::Full {
                    *locked(&self.shown) = Some(Shown { id, plane, scene, truth: None });
                }
                reply
            }
            Err(papsynth::Error::Image { cause: ErrorKind::Cancelled, .. }) => header(&json!({ "cancelled": true })),
            Err(papsynth::Error::Recipe(problems)) => {
                let path = |problem: &InvalidField| problem.field.split('.').map(str::to_owned).collect::<Vec<_>>();
                let error = |problem: &InvalidField| json!({ "path": path(problem), "message": problem.to_string() });
                header(&json!({ "errors": problems.iter().map(error).collect::<Vec<_>>() }))
            }
            Err(error) => header(&json!({ "errors": [{ "path": [], "message": error.to_string() }] })),
        }
    }

    /// Returns the time of a pixel of the last image of full resolution of which nothing was kept, s.
    #[cfg(feature = "match")]
    pub(super) fn pace(&self) -> f64 {
        *locked(&self.pace)
    }

    /// Returns a message if the image of a recipe needs too much memory.
    fn too_large(&self, recipe: &Recipe) -> Option<String> {
        let max_memory = self.max_memory?;
        let estimate = MemoryEstimate::of(recipe, &self.model, &Layout::default());
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a fraction of a size")]
        let budget = (max_memory as f64 * FRAME_MEMORY) as u64;
        (estimate.of_one_frame() > budget as f64).then(|| estimate.too_large(recipe, budget))
    }

    /// Returns the last complete image with its ground truth, if it has this number.
    fn with_truth<T>(&self, id: usize, work: impl FnOnce(&Shown, &Truth) -> T) -> Result<T, Reply> {
        let is_known = |shown: &Option<Shown>| shown.as_ref().is_some_and(|s| s.id == id && s.truth.is_some());
        if !is_known(&locked(&self.shown)) {
            let mut sessions = locked(&self.sessions);
            if locked(&self.shown).as_ref().is_none_or(|shown| shown.id != id) {
                return Err(gone());
            }
            let finished = sessions.lives[ImageKind::Full as usize].finish();
            let finished = finished.map_err(|error| Reply::error(500, &error.to_string()))?.ok_or_else(gone)?;
            if let Some(shown) =
                locked(&self.shown).as_mut().filter(|shown| shown.id == id && shown.scene == finished.scene)
            {
                shown.truth = Some(finished.truth);
            }
        }
        match &*locked(&self.shown) {
            Some(shown @ Shown { truth: Some(truth), .. }) if shown.id == id => Ok(work(shown, truth)),
            _ => Err(gone()),
        }
    }

    /// Passes the grey levels and the pixel size (µm) of the last complete image to `work`, if it has this number.
    #[cfg(feature = "judge")]
    pub(super) fn with_grey<T>(
        &self,
        id: usize,
        work: impl FnOnce(&super::compare::Grey<'_>, f64) -> T,
    ) -> Result<T, Reply> {
        let shown = locked(&self.shown);
        let shown = shown.as_ref().filter(|shown| shown.id == id);
        let Shown { plane, scene, .. } = shown.ok_or_else(gone)?;
        let (channels, width, bits) = (plane.channels, scene.view.width, scene.camera.bits);
        let grey = super::compare::Grey { levels: &plane.grey, channels, width, bits };
        Ok(work(&grey, scene.view.pixel_um))
    }

    /// Returns the objects at a pixel, the nearest to the objective first.
    pub(super) fn objects_at(&self, id: usize, x: usize, y: usize) -> Result<Reply, Reply> {
        self.with_truth(id, |_, truth| {
            check_pixel(x, y, truth.width, truth.height)?;
            Ok(Reply::json(&json!({ "x": x, "y": y, "objects": objects_at(truth.objects.iter(), x, y) })))
        })?
    }

    /// Returns the labels of a group in colours, as PNG.
    pub(super) fn label_colours(&self, id: usize, group: Group, by: Colouring) -> Result<Reply, Reply> {
        let (ids, region, colours) = self.with_truth(id, |_, truth| {
            let Grid { width, height, .. } = Grid::new(truth.width, truth.height, 1);
            let region = Region { rows: 0..height, columns: 0..width };
            (Ids::new(&region, &region, &truth.labels(group).ids), region, by.colours(truth, group))
        })?;
        let colour_of = |id: u32| colours.get(&id).copied().unwrap_or_else(|| colour(id));
        png(&ids.rgba_with(OUTLINE_FILL, colour_of), region.width(), 4)
    }

    /// Returns the meaning of the colours of a group: pairs of colour and text.
    pub(super) fn legend(&self, id: usize, by: Colouring, group: Group) -> Result<Reply, Reply> {
        let entries = self.with_truth(id, |_, truth| by.legend(truth, group))?;
        let entry = |(colour, text): &([u8; 3], String)| json!({ "colour": css(*colour), "text": text });
        Ok(Reply::json(&entries.iter().map(entry).collect::<Vec<_>>()))
    }

    /// Returns the ids of a group as PNG with 16 bits, as in data sets.
    pub(super) fn label_map(&self, id: usize, group: Group) -> Result<Reply, Reply> {
        let map = self.with_truth(id, |_, truth| truth.labels(group))?;
        let ids: Result<Vec<u16>, _> = map.ids.iter().map(|&id| u16::try_from(id)).collect();
        let ids = ids.map_err(|_| Reply::error(500, "more than 65535 objects"))?;
        png16(&ids, map.width, 1)
    }

    /// Returns the grey levels of an image as PNG.
    pub(super) fn image(&self, id: usize) -> Result<Reply, Reply> {
        let shown = locked(&self.shown);
        let shown = shown.as_ref().filter(|shown| shown.id == id);
        let Shown { plane, scene, .. } = shown.ok_or_else(gone)?;
        match scene.camera.bits {
            ..=8 => png(&narrow(&plane.grey), scene.view.width, plane.channels),
            _ => png16(&plane.grey, scene.view.width, plane.channels),
        }
    }
}

fn gone() -> Reply {
    Reply::error(404, "another image has replaced this one")
}

/// Returns one plane of the image of a request, its scene, and the positions of all planes of the recipe.
fn image(
    live: &mut Live,
    asked: &RenderRequest,
    threads: Threads,
    cancellation: &Cancellation,
) -> Result<(Scene, Vec<f64>, LiveImage), papsynth::Error> {
    let mut scene = live.scene(&asked.recipe, Key { seed: asked.seed, index: asked.index })?;
    if asked.view != ImageKind::Full {
        scene = scene.reduced(asked.view.factor());
    }
    let all_um = scene.planes_um.clone();
    let middle = all_um.get(all_um.len() / 2).copied().unwrap_or_default();
    // The sharpest plane of each object does not depend on the position of an EDF image.
    let focus_um = asked.focus_um.filter(|um| um.is_finite() && scene.fusion.is_none());
    scene.planes_um = vec![focus_um.map_or(middle, |um| um.clamp(-MAX_FOCUS_UM, MAX_FOCUS_UM))];
    let image = live.image(&asked.recipe, scene.clone(), threads, cancellation)?;
    Ok((scene, all_um, image))
}

/// Opacity of the fill of outlines: the image stays visible.
const OUTLINE_FILL: u8 = 30;

/// Largest distance of the stage from its zero, µm.
const MAX_FOCUS_UM: f64 = 200.0;

fn rounded(levels: &[f32], white: u16) -> Vec<u16> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the range of grey levels")]
    levels.iter().map(|level| (level + 0.5).clamp(0.0, white.into()) as u16).collect()
}

#[expect(clippy::cast_possible_truncation, reason = "samples of 8 bits")]
fn narrow(samples: &[u16]) -> Vec<u8> {
    samples.iter().map(|&sample| sample as u8).collect()
}

fn header(head: &Value) -> Reply {
    framed(head, &[], u8::BITS)
}

/// Returns JSON followed by samples of up to `bits` bits; see [`Renderer::render`].
pub(super) fn framed(head: &Value, samples: &[u16], bits: u32) -> Reply {
    let text = head.to_string();
    let mut body = u32::try_from(text.len()).unwrap_or(u32::MAX).to_le_bytes().to_vec();
    body.extend_from_slice(text.as_bytes());
    match bits {
        ..=8 => body.extend(narrow(samples)),
        _ => body.extend(samples.iter().flat_map(|sample| sample.to_le_bytes())),
    }
    Reply::binary(body)
}

/// Locks a mutex, also after a panic in another request: one request must not stop the server.
pub(super) fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
