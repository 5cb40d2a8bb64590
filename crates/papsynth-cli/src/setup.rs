//! The engine of a command line.

use std::error::Error as _;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use papsynth::model::Model;
use papsynth::profile::Profile;
use papsynth::recipe::diagnose;
use papsynth::{Engine, Threads};
use papsynth_dataset::read::{InputFile, Limits, read_inputs};
use papsynth_dataset::{Check, DatasetInfo, Layout, Run, Task};

use crate::args::{EngineArgs, threads};
use crate::exit::{self, ErrorReport, ExitError};
use crate::recipe_file::RecipeFile;
use crate::{input_file, memory};

/// Size limit of models, bytes: they may hold the textures of thousands of nuclei.
const MAX_MODEL_BYTES: u64 = 1 << 28;

#[derive(Debug)]
pub(crate) struct Setup {
    pub(crate) recipe: RecipeFile,
    pub(crate) model: Model,
    /// The density map of the recipe.
    pub(crate) map: Option<InputFile>,
    pub(crate) engine: Engine,
    pub(crate) threads: usize,
}

impl Setup {
    /// Reads and checks recipe and model. `profile` collects the time of each stage.
    pub(crate) fn load(args: &EngineArgs, profile: Option<Arc<Profile>>) -> Result<Self, ExitError> {
        memory::check_addresses()?;
        let mut recipe = RecipeFile::load(&args.recipe)?;
        let model = read_model(args.model.as_deref())?;
        recipe.check_classes(&model)?;
        let folder = recipe.folder.clone();
        let (mut inputs, map) = read_inputs(&mut recipe.recipe, &folder, &Limits::default())
            .map_err(|error| ExitError::new(error.is_io(), recipe.report("layout.path", error.to_string())))?;
        inputs.profile = profile;
        let engine = Engine::new(&recipe.recipe, &model, &inputs).map_err(|error| recipe.error(&error))?;
        recipe.recipe.notes().iter().for_each(exit::note);
        Ok(Self { recipe, model, map, engine, threads: threads(args.threads) })
    }

    /// The identity of a data set with this seed.
    pub(crate) fn info<'a>(&'a self, seed: u64, layout: &'a Layout) -> DatasetInfo<'a> {
        let (recipe, map) = (&self.recipe.recipe, self.map.as_ref());
        DatasetInfo { recipe, model: &self.model, seed, map, layout }
    }

    pub(crate) fn slide(&self, seed: u64, number: u64) -> Result<papsynth::Slide<'_>, ExitError> {
        self.engine.slide(seed, number).map_err(|error| self.recipe.error(&error))
    }

    /// An error while frames are written. Errors of the engine point at the recipe.
    pub(crate) fn error(&self, error: papsynth_dataset::Error) -> ExitError {
        match error {
            papsynth_dataset::Error::Engine(error) => self.recipe.error(&error),
            other => other.into(),
        }
    }

    /// All threads, for one frame.
    pub(crate) fn threads_of_a_frame(&self) -> Threads {
        if self.threads == 1 {
            return Threads::One;
        }
        // The output does not depend on the number of threads: an existing pool may be used instead or, if the system
        // starts no threads, only the current one.
        match rayon::ThreadPoolBuilder::new().num_threads(self.threads).build_global() {
            Err(error) if error.source().is_some() => Threads::One,
            _ => Threads::All,
        }
    }
}

/// A run of all these frames with this many frames at the same time, each on one thread.
pub(crate) fn run_of(frames: Range<u64>, workers: usize, stop: &AtomicBool) -> Run<'_> {
    let (task, threads, check) = (Task::ALL, Threads::One, Check::Sizes);
    Run { frames, task, workers, threads, check, stop, profile: None }
}

/// A thread pool of the size given by `--threads`.
#[cfg(feature = "judge")]
pub(crate) fn pool(asked: Option<u16>) -> Result<rayon::ThreadPool, ExitError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads(asked)).build();
    pool.map_err(|error| ExitError::input(format!("cannot start threads: {error}")))
}

/// The built-in model, with the classes of a file.
pub(crate) fn read_model(path: Option<&Path>) -> Result<Model, ExitError> {
    let Some(path) = path else { return Ok(Model::builtin()) };
    let (name, text) = input_file::read(path, MAX_MODEL_BYTES, "a model or a class file")?;
    if !text.trim_start().starts_with('{')
        && let Err(error) = toml::from_str::<toml::Table>(&text)
    {
        let span = error.span().unwrap_or_default();
        return Err(ErrorReport::new(diagnose::plain(error.message()))
            .at(&name, &std::sync::Arc::new(text), span)
            .into());
    }
    Model::builtin().with(&text).map_err(|error| ExitError::input(format!("{name}: {error}")))
}
