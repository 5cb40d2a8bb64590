//! The engine: recipe, model, seed and index in; planes and everything known about them out.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::error::Error;
use crate::frame::{Finished, Frame, Plane};
use crate::key::Key;
use crate::model::Model;
use crate::phantom::Studio;
use crate::profile::{Profile, Stage, Watch};
use crate::recipe::Recipe;
use crate::render::{Desk, Rendering};
use crate::scene::{self, Scene, WeightMap};
use crate::threads::Threads;
use crate::transmit::Lenses;

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
    pub(crate) studio: Studio,
    pub(crate) lenses: Lenses,
    /// Memory of finished images: as many as were ever made side by side.
    desks: Mutex<Vec<Desk>>,
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
        let watch = Watch(inputs.profile.clone());
        let studio = Studio::new(recipe, model, watch).map_err(Error::Model)?;
        Ok(Self {
            model: model.clone(),
            weight_map: inputs.weight_map.clone(),
            studio,
            lenses: Lenses::default(),
            desks: Mutex::default(),
        })
    }

    /// The recipe of this engine.
    #[must_use]
    pub fn recipe(&self) -> &Recipe {
        &self.studio.recipe
    }

    /// Draws what lies on the slide.
    ///
    /// # Errors
    /// If the layout has no room for what is asked.
    pub fn scene(&self, key: Key) -> Result<Scene, Error> {
        self.studio.watch.time(Stage::Scene, || scene::draw(self.recipe(), &self.model, self.weight_map.as_ref(), key))
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
        self.at_desk(|desk| {
            let mut rendering = Rendering::new(&self.studio, &self.lenses, scene, threads, desk).map_err(fail)?;
            for plane in 0..rendering.planes() {
                sink(rendering.plane(plane, desk).map_err(fail)?)?;
            }
            rendering.finish(desk).map_err(fail)
        })
    }

    /// Works in the memory of finished images, and leaves it to the next one.
    pub(crate) fn at_desk<T>(&self, work: impl FnOnce(&mut Desk) -> T) -> T {
        let mut desk = self.desks().pop().unwrap_or_default();
        let made = work(&mut desk);
        self.desks().push(desk);
        made
    }

    fn desks(&self) -> MutexGuard<'_, Vec<Desk>> {
        self.desks.lock().unwrap_or_else(PoisonError::into_inner)
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
