//! The engine: recipe, model, seed and index in; image and truth out.

use crate::error::Error;
use crate::frame::{Finished, Frame, Plane};
use crate::key::Key;
use crate::model::Model;
use crate::recipe::Recipe;
use crate::scene::{Scene, WeightMap};

/// What a recipe names but does not hold.
#[derive(Debug, Clone, Default)]
pub struct Inputs {
    /// The image that `layout.path` names, for [`Layout::Map`](crate::recipe::Layout::Map): brightness 0 to 1;
    /// for [`Layout::Labels`](crate::recipe::Layout::Labels): 1 where a label lies, else 0.
    pub weight_map: Option<WeightMap>,
}

/// How many threads work on one frame. The bytes are the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Threads {
    /// The calling thread alone: for callers who make several frames side by side.
    One,
    /// All of the current rayon pool; the calling thread alone without the feature `threads`.
    All,
}

/// Makes images of one recipe and one model.
#[derive(Debug)]
pub struct Engine {
    recipe: Recipe,
}

impl Engine {
    /// Checks the recipe against the model and prepares what all images share.
    ///
    /// # Errors
    /// If the recipe or the model cannot be used: which field, which value, what would be accepted.
    pub fn new(recipe: &Recipe, model: &Model, inputs: &Inputs) -> Result<Self, Error> {
        let _ = (model, inputs);
        Ok(Self { recipe: recipe.clone() })
    }

    /// The recipe of this engine.
    #[must_use]
    pub fn recipe(&self) -> &Recipe {
        &self.recipe
    }

    /// Draws what lies on the slide.
    ///
    /// # Errors
    /// If the layout has no room for what is asked.
    pub fn scene(&self, key: Key) -> Result<Scene, Error> {
        let _ = key;
        Err(Error::Model("not yet".to_owned()))
    }

    /// Makes an image and its truth, handing over each plane as soon as it is done.
    ///
    /// # Errors
    /// What `sink` returned, or why the scene cannot be drawn.
    pub fn stream<E: From<Error>>(
        &self,
        key: Key,
        threads: Threads,
        mut sink: impl FnMut(Plane) -> Result<(), E>,
    ) -> Result<Finished, E> {
        let _ = (threads, &mut sink);
        Err(self.scene(key).err().map_or_else(|| Error::Model("not yet".to_owned()), |e| e).into())
    }

    /// Makes an image and its truth, whole.
    ///
    /// # Errors
    /// If the scene cannot be drawn.
    pub fn frame(&self, key: Key) -> Result<Frame, Error> {
        let mut planes = Vec::new();
        let finished = self.stream::<Error>(key, Threads::All, |plane| {
            planes.push(plane);
            Ok(())
        })?;
        Ok(Frame { planes, finished })
    }
}
