//! From the command line to an engine.

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use papsynth::model::Model;
use papsynth::profile::Profile;
use papsynth::{Engine, Threads};
use papsynth_dataset::read::{InputFile, Limits, read_inputs};
use papsynth_dataset::{Check, DatasetInfo, Layout, Run, Task};

use crate::args::{EngineArgs, threads};
use crate::exit::{self, Failure};
use crate::recipe_file::RecipeFile;
use crate::text_file;

/// Largest model that is read: it may hold the textures of thousands of nuclei.
const LARGEST_MODEL: u64 = 1 << 28;

#[derive(Debug)]
pub(crate) struct Setup {
    pub(crate) recipe: RecipeFile,
    pub(crate) model: Model,
    /// The map that the recipe names.
    pub(crate) map: Option<InputFile>,
    pub(crate) engine: Engine,
    pub(crate) threads: usize,
}

impl Setup {
    /// `profile` adds up how long the stages take.
    pub(crate) fn load(args: &EngineArgs, profile: Option<Arc<Profile>>) -> Result<Self, Failure> {
        let mut recipe = RecipeFile::load(&args.recipe)?;
        let model = read_model(args.model.as_deref())?;
        recipe.check_classes(&model)?;
        let folder = recipe.folder.clone();
        let (mut inputs, map) = read_inputs(&mut recipe.recipe, &folder, &Limits::default())
            .map_err(|error| Failure::new(error.is_io(), recipe.complaint("layout.path", error.to_string())))?;
        inputs.profile = profile;
        let engine = Engine::new(&recipe.recipe, &model, &inputs).map_err(|error| recipe.refuse(&error))?;
        recipe.recipe.notes().iter().for_each(exit::note);
        Ok(Self { recipe, model, map, engine, threads: threads(args.threads) })
    }

    /// What a data set of a seed is made of.
    pub(crate) fn info<'a>(&'a self, seed: u64, layout: &'a Layout) -> DatasetInfo<'a> {
        let (recipe, map) = (&self.recipe.recipe, self.map.as_ref());
        DatasetInfo { recipe, model: &self.model, seed, map, layout }
    }

    pub(crate) fn slide(&self, seed: u64, number: u64) -> Result<papsynth::Slide<'_>, Failure> {
        self.engine.slide(seed, number).map_err(|error| self.recipe.refuse(&error))
    }

    /// What goes wrong while frames are written; what the engine says points at the recipe.
    pub(crate) fn failure(&self, error: papsynth_dataset::Error) -> Failure {
        match error {
            papsynth_dataset::Error::Engine(error) => self.recipe.refuse(&error),
            other => other.into(),
        }
    }

    /// All threads for one frame.
    pub(crate) fn threads_of_a_frame(&self) -> Threads {
        if self.threads == 1 {
            return Threads::One;
        }
        // It fails only if there is a pool already, and then that one is used: the bytes are the same.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(self.threads).build_global();
        Threads::All
    }
}

/// A run of all these frames, `workers` of them side by side, each made by one thread.
pub(crate) fn run_of(frames: Range<u64>, workers: usize, stop: &AtomicBool) -> Run<'_> {
    let (share, threads, check) = (Task::ALL, Threads::One, Check::Sizes);
    Run { frames, task: share, workers, threads, check, stop, profile: None }
}

/// Threads of their own, as many as asked for, or one a core.
#[cfg(feature = "judge")]
pub(crate) fn pool(asked: Option<u16>) -> Result<rayon::ThreadPool, Failure> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads(asked)).build();
    pool.map_err(|error| Failure::input(format!("cannot start threads: {error}")))
}

/// The model that ships, with the classes of a file.
pub(crate) fn read_model(path: Option<&Path>) -> Result<Model, Failure> {
    let Some(path) = path else { return Ok(Model::builtin()) };
    let (name, text) = text_file::read(path, LARGEST_MODEL, "a model or a class file")?;
    Model::builtin().with(&text).map_err(|error| Failure::input(format!("{name}: {error}")))
}
