//! The engine: generates images with ground truth from a recipe, a model, a seed and an index.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::error::Error;
use crate::frame::{Finished, Frame, Plane};
use crate::key::Key;
use crate::model::Model;
use crate::phantom::{PhantomAssets, PhantomSettings};
use crate::profile::{Profile, Stage, StageTimer};
use crate::recipe::Recipe;
use crate::render::{FrameBuffers, Rendering, Work, phantoms};
use crate::scene::{self, Scene, WeightMap};
use crate::threads::Threads;
use crate::transmit::MicroscopeCache;

/// Inputs that a recipe refers to.
#[derive(Debug, Clone, Default)]
pub struct Inputs {
    /// The image at `layout.path`. For [`Layout::DensityMap`](crate::recipe::Layout::DensityMap) grey levels from 0 to
    /// 1; for [`Layout::Labels`](crate::recipe::Layout::Labels) 1 where there is a label, else 0.
    pub weight_map: Option<WeightMap>,
    /// Accumulates the durations of the stages.
    pub profile: Option<Arc<Profile>>,
}

/// Generates images of a recipe and a model.
#[derive(Debug)]
pub struct Engine {
    recipe: Recipe,
    pub(crate) model: Model,
    weight_map: Option<WeightMap>,
    pub(crate) assets: PhantomAssets,
    pub(crate) microscopes: MicroscopeCache,
    /// Reusable memory: one element per image generated at the same time.
    spare_buffers: Mutex<Vec<FrameBuffers>>,
}

impl Engine {
    /// Checks the recipe and the model, and prepares the data that all images share.
    ///
    /// # Errors
    /// If the recipe or the model is invalid: the field, its value, and what is accepted.
    pub fn new(recipe: &Recipe, model: &Model, inputs: &Inputs) -> Result<Self, Error> {
        check(recipe, inputs.weight_map.as_ref())?;
        model.check()?;
        let timer = StageTimer(inputs.profile.clone());
        let assets = PhantomAssets::new(PhantomSettings::of(recipe), model, timer).map_err(Error::Model)?;
        Ok(Self {
            recipe: recipe.clone(),
            model: model.clone(),
            weight_map: inputs.weight_map.clone(),
            assets,
            microscopes: MicroscopeCache::default(),
            spare_buffers: Mutex::default(),
        })
    }

    /// Returns the recipe.
    #[must_use]
    pub fn recipe(&self) -> &Recipe {
        &self.recipe
    }

    /// Returns the weight map of the layout, if the inputs have one.
    #[must_use]
    pub fn weight_map(&self) -> Option<&WeightMap> {
        self.weight_map.as_ref()
    }

    /// Draws the objects of a field and how it is imaged.
    ///
    /// # Errors
    /// If no draw can succeed, as when the layout is too uneven. Cells that do not fit are no error: see
    /// [`Scene::cells`].
    pub fn scene(&self, key: Key) -> Result<Scene, Error> {
        self.assets.timer.time(Stage::Scene, || scene::draw(self.recipe(), &self.model, self.weight_map.as_ref(), key))
    }

    /// As [`scene`](Self::scene), under a given condition of the recipe.
    ///
    /// # Errors
    /// As `scene`.
    ///
    /// # Panics
    /// If there is no such condition.
    pub fn scene_under(&self, condition: usize, key: Key) -> Result<Scene, Error> {
        let draw = || scene::draw_under(Some(condition), self.recipe(), &self.model, self.weight_map.as_ref(), key);
        self.assets.timer.time(Stage::Scene, draw)
    }

    /// Generates an image with ground truth, and passes each plane to `sink` when it is finished. The memory of a plane
    /// is reused.
    ///
    /// # Errors
    /// The error of `sink`, or of the scene.
    pub fn stream<E: From<Error>>(
        &self,
        key: Key,
        threads: Threads,
        sink: impl FnMut(&Plane) -> Result<(), E>,
    ) -> Result<Finished, E> {
        let scene = self.scene(key)?;
        self.image(scene, threads, sink)
    }

    /// Images a scene. The scene may be drawn for another microscope or edited.
    ///
    /// # Errors
    /// The error of `sink`, or of the scene.
    pub fn image<E: From<Error>>(
        &self,
        scene: Scene,
        threads: Threads,
        mut sink: impl FnMut(&Plane) -> Result<(), E>,
    ) -> Result<Finished, E> {
        let index = scene.key.index;
        let fail = |cause| E::from(Error::Image { index, cause });
        self.with_buffers(|buffers| {
            let noise_fields = self.assets.noise_fields.fields(scene.key);
            let objects: Vec<_> = scene.objects.iter().collect();
            let work = Work::on(threads);
            let phantoms = phantoms(&self.assets, &noise_fields, &scene, &objects, &work).map_err(fail)?;
            let mut rendering =
                Rendering::new(&self.assets, &self.microscopes, scene, phantoms, work, buffers).map_err(fail)?;
            for plane in 0..rendering.planes() {
                sink(rendering.plane(plane, buffers).map_err(fail)?)?;
            }
            rendering.finish(buffers).map_err(fail)
        })
    }

    /// Runs `work` with reusable memory.
    pub(crate) fn with_buffers<T>(&self, work: impl FnOnce(&mut FrameBuffers) -> T) -> T {
        let mut buffers = self.spare_buffers().pop().unwrap_or_default();
        let made = work(&mut buffers);
        self.spare_buffers().push(buffers);
        made
    }

    fn spare_buffers(&self) -> MutexGuard<'_, Vec<FrameBuffers>> {
        self.spare_buffers.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Generates an image with ground truth.
    ///
    /// # Errors
    /// The error of the scene.
    pub fn frame(&self, key: Key) -> Result<Frame, Error> {
        let mut planes = Vec::new();
        let finished = self.stream::<Error>(key, Threads::All, |plane| {
            planes.push(plane.clone());
            Ok(())
        })?;
        Ok(Frame { planes, finished })
    }
}

/// Checks a recipe, and the weight map for its layout.
pub(crate) fn check(recipe: &Recipe, weight_map: Option<&WeightMap>) -> Result<(), Error> {
    let problems = recipe.problems();
    if !problems.is_empty() {
        return Err(Error::Recipe(problems));
    }
    scene::check_layout(&recipe.layout, weight_map).map_err(Error::Layout)
}
