//! The engine: recipe, model, seed and index in; planes and everything known about them out.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::error::Error;
use crate::frame::{Finished, Frame, Plane};
use crate::key::Key;
use crate::model::Model;
use crate::phantom::PhantomAssets;
use crate::profile::{Profile, Stage, StageTimer};
use crate::recipe::Recipe;
use crate::render::{FrameBuffers, Rendering};
use crate::scene::{self, Scene, WeightMap};
use crate::threads::Threads;
use crate::transmit::MicroscopeCache;

/// What a recipe names but does not hold.
#[derive(Debug, Clone, Default)]
pub struct Inputs {
    /// The image that `layout.path` names, for [`Layout::DensityMap`](crate::recipe::Layout::DensityMap): brightness 0 to 1;
    /// for [`Layout::Labels`](crate::recipe::Layout::Labels): 1 where a label lies, else 0.
    pub weight_map: Option<WeightMap>,
    /// What adds up how long the stages take.
    pub profile: Option<Arc<Profile>>,
}

/// Makes images of one recipe and one model.
#[derive(Debug)]
pub struct Engine {
    pub(crate) model: Model,
    weight_map: Option<WeightMap>,
    pub(crate) assets: PhantomAssets,
    pub(crate) microscopes: MicroscopeCache,
    /// Memory of finished images: as many as were ever made side by side.
    free_buffers: Mutex<Vec<FrameBuffers>>,
}

impl Engine {
    /// Checks the recipe against the model and prepares what all images share.
    ///
    /// # Errors
    /// If the recipe or the model cannot be used: which field, which value, what would be accepted.
    pub fn new(recipe: &Recipe, model: &Model, inputs: &Inputs) -> Result<Self, Error> {
        let problems = recipe.problems();
        if !problems.is_empty() {
            return Err(Error::Recipe(problems));
        }
        model.check()?;
        scene::check_layout(&recipe.layout, inputs.weight_map.as_ref()).map_err(Error::Layout)?;
        let timer = StageTimer(inputs.profile.clone());
        let assets = PhantomAssets::new(recipe, model, timer).map_err(Error::Model)?;
        Ok(Self {
            model: model.clone(),
            weight_map: inputs.weight_map.clone(),
            assets,
            microscopes: MicroscopeCache::default(),
            free_buffers: Mutex::default(),
        })
    }

    /// The recipe of this engine.
    #[must_use]
    pub fn recipe(&self) -> &Recipe {
        &self.assets.recipe
    }

    /// Draws what lies on the slide.
    ///
    /// # Errors
    /// If the layout has no room for what is asked.
    pub fn scene(&self, key: Key) -> Result<Scene, Error> {
        self.assets.timer.time(Stage::Scene, || scene::draw(self.recipe(), &self.model, self.weight_map.as_ref(), key))
    }

    /// Makes an image and its truth, showing each plane as soon as it is done. Its memory is that of the next.
    ///
    /// # Errors
    /// What `sink` returned, or why the scene cannot be drawn.
    pub fn stream<E: From<Error>>(
        &self,
        key: Key,
        threads: Threads,
        sink: impl FnMut(&Plane) -> Result<(), E>,
    ) -> Result<Finished, E> {
        let scene = self.scene(key)?;
        self.image(scene, threads, sink)
    }

    /// Images a scene, which may have been drawn for another microscope or changed by hand.
    ///
    /// # Errors
    /// What `sink` returned, or why the scene cannot be imaged.
    pub fn image<E: From<Error>>(
        &self,
        scene: Scene,
        threads: Threads,
        mut sink: impl FnMut(&Plane) -> Result<(), E>,
    ) -> Result<Finished, E> {
        let index = scene.key.index;
        let fail = |cause| E::from(Error::Image { index, cause });
        self.with_buffers(|buffers| {
            let mut rendering =
                Rendering::new(&self.assets, &self.microscopes, scene, threads, buffers).map_err(fail)?;
            for plane in 0..rendering.planes() {
                sink(rendering.plane(plane, buffers).map_err(fail)?)?;
            }
            rendering.finish(buffers).map_err(fail)
        })
    }

    /// Works in the memory of finished images, and leaves it to the next one.
    pub(crate) fn with_buffers<T>(&self, work: impl FnOnce(&mut FrameBuffers) -> T) -> T {
        let mut buffers = self.free_buffers().pop().unwrap_or_default();
        let made = work(&mut buffers);
        self.free_buffers().push(buffers);
        made
    }

    fn free_buffers(&self) -> MutexGuard<'_, Vec<FrameBuffers>> {
        self.free_buffers.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Makes an image and its truth, whole.
    ///
    /// # Errors
    /// If the scene cannot be drawn.
    pub fn frame(&self, key: Key) -> Result<Frame, Error> {
        let mut planes = Vec::new();
        let finished = self.stream::<Error>(key, Threads::All, |plane| {
            planes.push(plane.clone());
            Ok(())
        })?;
        Ok(Frame { planes, finished })
    }
}
