//! The match of a recipe to the images of the user, as `papsynth match`, on threads of its own.

use std::panic::{self, AssertUnwindSafe};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use papsynth::model::Model;
use papsynth::recipe::Recipe;
use papsynth::{Engine, Inputs, Threads};
use papsynth_dataset::Layout;
use papsynth_dataset::memory::MemoryEstimate;
use papsynth_judge::{Control, FieldImage, Progress};
use papsynth_match::{Error, Fit, Match, MatchParams, PixelSize, Sampler};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::WorkbenchParams;
use super::compare::{Grey, channel, field_image};
use super::real::{RealImage, RealImages};
use super::rendering::locked;
use crate::server::Reply;

/// A request for a match.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MatchRequest {
    /// The initial recipe.
    recipe: Recipe,
    images: Vec<NamedImage>,
    /// Pixel size of the images, µm.
    pixel_um: f64,
    /// Whether to simulate fewer fields.
    quick: bool,
}

/// An image of the user.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct NamedImage {
    /// Its number.
    id: usize,
    /// Its name in messages.
    name: String,
}

/// The state of the last match, as a reply.
#[derive(Debug, Default, Serialize)]
#[serde(tag = "state", rename_all = "kebab-case")]
enum State {
    #[default]
    None,
    Running {
        phase: String,
        done: usize,
        total: usize,
        seconds: f64,
    },
    Done {
        fit: Box<Fit>,
        recipe: Box<Recipe>,
    },
    Failed {
        error: String,
    },
}

/// A match that runs or has ended.
#[derive(Default)]
struct Run {
    stop: AtomicBool,
    state: Mutex<State>,
}

/// The matches of a workbench: one at a time.
pub(super) struct Matching {
    model: Model,
    inputs: Inputs,
    threads: Threads,
    clock: fn() -> Duration,
    /// Memory for simulated fields, bytes; `None` for no limit.
    max_memory: Option<u64>,
    last: Mutex<Arc<Run>>,
}

/// The parts of a match that a request gives.
struct Task {
    matching: Match,
    images: Vec<(String, Arc<RealImage>)>,
    /// Threads that fit into the memory, each with one simulated field.
    workers: usize,
}

impl Matching {
    pub(super) fn new(params: &WorkbenchParams, max_memory: Option<u64>) -> Self {
        let WorkbenchParams { threads, clock, .. } = *params;
        let (model, inputs) = (params.model.clone(), params.inputs.clone());
        Self { model, inputs, threads, clock, max_memory, last: Mutex::default() }
    }

    /// Begins a match, and stops the last one.
    pub(super) fn start(self: &Arc<Self>, asked: &MatchRequest, real: &Mutex<RealImages>) -> Result<Reply, Reply> {
        let task = self.task(asked, real)?;
        let phase = "reading images".to_owned();
        let state = Mutex::new(State::Running { phase, done: 0, total: 1, seconds: 0.0 });
        let run = Arc::new(Run { state, ..Run::default() });
        let last = std::mem::replace(&mut *locked(&self.last), Arc::clone(&run));
        last.stop.store(true, Ordering::Relaxed);
        let (own, matching) = (Arc::clone(&run), Arc::clone(self));
        let work = move || {
            let state = match panic::catch_unwind(AssertUnwindSafe(|| matching.run(&task, &own))) {
                Ok(Ok(fit)) => State::Done { recipe: Box::new(fit.recipe.clone()), fit: Box::new(fit) },
                Ok(Err(Error::Stopped)) => State::None,
                Ok(Err(error)) => State::Failed { error: error.to_string() },
                Err(_) => State::Failed { error: "the program failed at this match".to_owned() },
            };
            *locked(&own.state) = state;
        };
        thread::Builder::new()
            .name("match".to_owned())
            .spawn(work)
            .map_err(|error| Reply::error(500, &format!("cannot start a thread: {error}")))?;
        Ok(Self::reply(&run))
    }

    /// Returns the progress or the result of the last match.
    pub(super) fn state(&self) -> Reply {
        Self::reply(&locked(&self.last))
    }

    fn reply(run: &Run) -> Reply {
        Reply::json(&*locked(&run.state))
    }

    /// Stops the match.
    pub(super) fn stop(&self) -> Reply {
        let run = std::mem::take(&mut *locked(&self.last));
        run.stop.store(true, Ordering::Relaxed);
        Reply::json(&State::None)
    }

    /// Returns the number of simulated fields and the estimated duration. `pace` is the time that a pixel of an image
    /// takes, s; a simulated field takes about as long, because each is made by one thread and also measured.
    pub(super) fn estimate(&self, asked: &MatchRequest, real: &Mutex<RealImages>, pace: f64) -> Result<Value, Reply> {
        let Task { matching, images, workers } = self.task(asked, real)?;
        let colour = images.iter().all(|(_, real)| real.image.channels == 3);
        let simulated = matching.simulated(images.len(), colour);
        let pixels = images.first().map_or(0, |(_, real)| Sampler::size_of(real.size()).iter().product::<usize>());
        let slower = self.threads() as f64 / workers as f64;
        let seconds = pace * slower * (pixels * simulated) as f64;
        Ok(json!({ "simulated": simulated, "seconds": seconds }))
    }

    /// Checks a request.
    fn task(&self, asked: &MatchRequest, real: &Mutex<RealImages>) -> Result<Task, Reply> {
        let default = if asked.quick { MatchParams::quick() } else { MatchParams::default() };
        let params = MatchParams { pixel: PixelSize::Known(asked.pixel_um), ..default };
        let matching = Match::new(&params, &asked.recipe).map_err(|error| Reply::error(422, &error.to_string()))?;
        let real = locked(real);
        let image = |NamedImage { id, name }: &NamedImage| Ok((name.clone(), real.get(*id)?));
        let images: Vec<(String, Arc<RealImage>)> = asked.images.iter().map(image).collect::<Result<_, Reply>>()?;
        let mut recipe = asked.recipe.without_conditions();
        if let Some((_, first)) = images.first() {
            let [width, height] = Sampler::size_of(first.size()).map(|side| side as f64);
            (recipe.field.width_px, recipe.field.height_px) = (width.into(), height.into());
            recipe.field.pixel_um = asked.pixel_um.into();
        }
        // The fields as real numbers, and their samples.
        let fields = images.iter().map(|(_, real)| 8 * real.image.levels.len() as u64).sum();
        let left = self.max_memory.map(|most| most.saturating_sub(fields));
        let estimate = MemoryEstimate::of(&recipe, &self.model, &Layout::default());
        let plan = estimate.plan(self.threads(), false, left);
        let too_large = || Reply::error(422, &estimate.too_large(&recipe, left.unwrap_or_default()));
        Ok(Task { matching, images, workers: plan.ok_or_else(too_large)?.workers })
    }

    fn threads(&self) -> usize {
        match self.threads {
            Threads::One => 1,
            Threads::All => rayon::current_num_threads(),
        }
    }

    fn run(&self, task: &Task, run: &Run) -> Result<Fit, Error> {
        let start = (self.clock)();
        let report = |Progress { phase, done, total }: Progress| {
            let seconds = (self.clock)().saturating_sub(start).as_secs_f64();
            *locked(&run.state) = State::Running { phase: phase.to_owned(), done, total, seconds };
        };
        let control = Control { stop: &run.stop, report: &report };
        let make = |recipe: &Recipe| Engine::new(recipe, &self.model, &self.inputs);
        let fields: Vec<FieldImage> = task.images.iter().map(|(name, real)| field(name, real)).collect();
        // Images of the workbench do not wait for the fields of the match.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(task.workers).build();
        let pool = pool.map_err(|error| Error::Engine(format!("cannot start threads: {error}")))?;
        pool.install(|| task.matching.run(&fields, &make, &control))
    }
}

/// Returns an image as a field of a match.
fn field(name: &str, real: &RealImage) -> FieldImage {
    let grey = Grey::of(real);
    let red_blue = (grey.channels == 3).then(|| [0, 2].map(|number| channel(&grey, number)));
    FieldImage { name: name.to_owned(), red_blue, ..field_image(&grey) }
}
