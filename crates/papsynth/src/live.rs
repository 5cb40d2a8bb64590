//! Images of a recipe that changes, for interactive programs: only what a change affects is computed again.
//!
//! Every image has the same bytes as that of an [`Engine`](crate::Engine) with the same recipe, model and key.
//!
//! ```
//! use papsynth::live::{Cancellation, Live};
//! use papsynth::{Inputs, Threads, key::Key, model::Model, recipe::Recipe};
//!
//! let mut recipe = Recipe::default();
//! (recipe.field.width_px, recipe.field.height_px) = (64.0.into(), 48.0.into());
//! let mut live = Live::new(&Model::builtin(), &Inputs::default())?;
//! let key = Key { seed: 1, index: 0 };
//! let first = live.image(&recipe, live.scene(&recipe, key)?, Threads::All, &Cancellation::default())?;
//! recipe.camera.read_noise_e = 20.0.into();
//! let second = live.image(&recipe, live.scene(&recipe, key)?, Threads::All, &Cancellation::default())?;
//! assert_eq!((second.made.phantoms, second.made.planes), (0, 0));
//! assert_ne!(first.planes[0].grey, second.planes[0].grey);
//! # Ok::<(), papsynth::Error>(())
//! ```

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::engine::{Inputs, check};
use crate::error::{Error, ErrorKind};
use crate::frame::{Finished, Plane};
use crate::key::Key;
use crate::model::Model;
use crate::phantom::{Phantom, PhantomAssets, PhantomSettings};
use crate::profile::StageTimer;
use crate::recipe::Recipe;
use crate::render::{FrameBuffers, Parts, Rendering, Work, add_masks, phantoms};
use crate::scene::{self, Object, Scene, SceneBackground, View, WeightMap};
use crate::threads::Threads;
use crate::transmit::{MicroscopeCache, TransmissionStats, empty_light};

/// A flag that cancels an image. Clones share the flag.
#[derive(Debug, Clone, Default)]
pub struct Cancellation(Arc<AtomicBool>);

impl Cancellation {
    /// Cancels the images that use this flag. They stop after the current objects, or
    /// after the current transform of Abbe's integration.
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Returns whether the flag is set.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    pub(crate) fn check(&self) -> Result<(), ErrorKind> {
        if self.is_cancelled() { Err(ErrorKind::Cancelled) } else { Ok(()) }
    }
}

/// What was computed for an image. The rest was kept from earlier images.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Made {
    /// Objects drawn.
    pub phantoms: usize,
    /// Planes whose transmitted light was computed.
    pub planes: usize,
    /// Whether the light of the empty slide was computed.
    pub background: bool,
}

/// All planes of an image.
#[derive(Debug, Clone)]
pub struct LiveImage {
    /// The planes, in the order of [`Scene::planes_um`].
    pub planes: Vec<Plane>,
    /// What was computed.
    pub made: Made,
}

/// Generates images of a recipe that changes.
#[derive(Debug)]
pub struct Live {
    model: Model,
    weight_map: Option<WeightMap>,
    timer: StageTimer,
    max_light_bytes: usize,
    microscopes: MicroscopeCache,
    buffers: FrameBuffers,
    assets: Option<PhantomAssets>,
    empty: Option<EmptyLight>,
    lights: Vec<PlaneLight>,
    last: Last,
}

/// The last image.
#[derive(Default)]
enum Last {
    #[default]
    None,
    /// The image was not completed.
    Parts(Box<Parts>),
    Image(Box<Rendering>),
}

/// The logarithm of the light of the empty slide, and the part of the scene that it depends on.
#[derive(Debug)]
struct EmptyLight {
    of: (Key, View, SceneBackground),
    log10: Vec<f32>,
}

/// The transmitted fraction of a plane of the last scene.
#[derive(Debug)]
struct PlaneLight {
    stage_um: f64,
    channels: Vec<Vec<f32>>,
    stats: TransmissionStats,
}

impl PlaneLight {
    fn bytes(&self) -> usize {
        self.channels.iter().map(|channel| size_of_val(channel.as_slice())).sum()
    }
}

impl Live {
    /// Default of [`set_max_light_bytes`](Self::set_max_light_bytes): 256 MiB.
    pub const MAX_LIGHT_BYTES: usize = 1 << 28;

    /// Checks the model. `inputs` are those of all recipes.
    ///
    /// # Errors
    /// If the model is invalid: the field, its value, and what is accepted.
    pub fn new(model: &Model, inputs: &Inputs) -> Result<Self, Error> {
        model.check()?;
        Ok(Self {
            model: model.clone(),
            weight_map: inputs.weight_map.clone(),
            timer: StageTimer(inputs.profile.clone()),
            max_light_bytes: Self::MAX_LIGHT_BYTES,
            microscopes: MicroscopeCache::default(),
            buffers: FrameBuffers::default(),
            assets: None,
            empty: None,
            lights: Vec::new(),
            last: Last::None,
        })
    }

    /// Sets the largest size of the kept light of planes, bytes. The light of one plane is always kept.
    pub fn set_max_light_bytes(&mut self, bytes: usize) {
        self.max_light_bytes = bytes;
    }

    /// Draws the objects of a field and how it is imaged, as [`Engine::scene`](crate::Engine::scene).
    ///
    /// # Errors
    /// If the recipe is invalid, or no draw can succeed.
    pub fn scene(&self, recipe: &Recipe, key: Key) -> Result<Scene, Error> {
        check(recipe, self.weight_map.as_ref())?;
        scene::draw(recipe, &self.model, self.weight_map.as_ref(), key)
    }

    /// Images a scene of a recipe, as [`Engine::image`](crate::Engine::image). What the last scene has in common with
    /// it is kept.
    ///
    /// # Errors
    /// If the recipe or the scene is invalid, or with [`ErrorKind::Cancelled`] if `cancellation` is set. After an
    /// error, what was completed is kept.
    pub fn image(
        &mut self,
        recipe: &Recipe,
        scene: Scene,
        threads: Threads,
        cancellation: &Cancellation,
    ) -> Result<LiveImage, Error> {
        check(recipe, self.weight_map.as_ref())?;
        let settings = PhantomSettings::of(recipe);
        if self.assets.as_ref().is_none_or(|assets| assets.settings != settings) {
            // Phantoms of other settings differ.
            (self.last, self.assets) = (Last::None, None);
            self.lights.clear();
            let assets = PhantomAssets::new(settings, &self.model, self.timer.clone()).map_err(Error::Model)?;
            self.assets = Some(assets);
        }
        let index = scene.key.index;
        let work = Work { threads, cancellation: cancellation.clone() };
        self.render(scene, &work).map_err(|cause| Error::Image { index, cause })
    }

    /// Returns the ground truth of the last image, and the all-in-focus image if it is a focus stack; `None` if the
    /// last image was not completed.
    ///
    /// # Errors
    /// As [`image`](Self::image).
    pub fn finish(&mut self) -> Result<Option<Finished>, Error> {
        let Last::Image(rendering) = &self.last else { return Ok(None) };
        let scene = rendering.scene();
        let (key, empty) = (scene.key, self.empty.as_ref().map_or(&[][..], |empty| &empty.log10));
        self.buffers.light.prepare_from(scene, empty);
        let fail = |cause| Error::Image { index: key.index, cause };
        let (all_in_focus, truth) = rendering.results(&mut self.buffers).map_err(fail)?;
        Ok(Some(Finished { scene: scene.clone(), truth, all_in_focus }))
    }

    fn render(&mut self, scene: Scene, work: &Work) -> Result<LiveImage, ErrorKind> {
        let mut made = Made::default();
        let parts = self.parts(scene, work, &mut made)?;
        // Of this scene, also if it is cancelled.
        let parts = match self.prepare_empty(&parts.scene, &mut made) {
            Ok(()) => parts,
            Err(error) => {
                self.last = Last::Parts(Box::new(parts));
                return Err(error);
            }
        };
        let mut rendering = Rendering::of(parts, work.clone(), self.timer.clone())?;
        let mut planes = Vec::new();
        for index in 0..rendering.planes() {
            match self.plane(index, &mut rendering, &mut made) {
                Ok(plane) => planes.push(plane),
                Err(error) => {
                    self.last = Last::Parts(Box::new(rendering.into_parts()));
                    return Err(error);
                }
            }
        }
        // The flag no longer cancels anything: the image is complete.
        rendering.work_mut().cancellation = Cancellation::default();
        self.last = Last::Image(Box::new(rendering));
        Ok(LiveImage { planes, made })
    }

    /// Returns the phantoms and the optics of a scene, and removes the light of other scenes.
    fn parts(&mut self, scene: Scene, work: &Work, made: &mut Made) -> Result<Parts, ErrorKind> {
        let Some(assets) = &self.assets else { return Err(ErrorKind::Cancelled) };
        let same = self.last.scene().is_some_and(|last| last.of_phantoms() == scene.of_phantoms());
        // The phantom of the last scene for each object.
        let mut numbers = HashMap::new();
        if let (true, Some(last)) = (same, self.last.scene()) {
            numbers.extend(last.objects.iter().enumerate().map(|(number, object)| (identity(object), number)));
        }
        let mut phantom_of = |object: &Object| {
            let last = &self.last.scene()?.objects;
            numbers.remove(&identity(object)).filter(|number| has_same_phantom(&last[*number], object))
        };
        let kept: Vec<Option<usize>> = scene.objects.iter().map(&mut phantom_of).collect();
        let missing: Vec<&Object> =
            scene.objects.iter().zip(&kept).filter(|(_, kept)| kept.is_none()).map(|(object, _)| object).collect();
        made.phantoms = missing.len();
        // The last scene is kept until this succeeds.
        let mut drawn = if missing.is_empty() {
            Vec::new()
        } else {
            let noise_fields = assets.noise_fields.fields(scene.key);
            phantoms(assets, &noise_fields, &scene, &missing, work)?
        };
        add_masks(&mut drawn, &scene, work.threads);
        let last = std::mem::take(&mut self.last).into_parts();
        let all_kept = kept.iter().copied().eq((0..kept.len()).map(Some));
        match last {
            Some(last) if all_kept && has_same_light(&last.scene, &scene) => Ok(Parts { scene, ..last }),
            last => {
                self.lights.clear();
                let mut last: Vec<Option<Phantom>> =
                    last.map_or(Vec::new(), |last| last.phantoms.into_iter().map(Some).collect());
                let mut drawn = drawn.into_iter();
                let phantom = |kept: &Option<usize>| match kept {
                    Some(number) => last.get_mut(*number).and_then(Option::take),
                    None => drawn.next(),
                };
                let phantoms: Vec<Phantom> = kept.iter().filter_map(phantom).collect();
                let parts = Parts::new(scene, phantoms, &self.microscopes, work);
                self.microscopes.forget_unused();
                parts
            }
        }
    }

    /// Prepares the light of the empty slide.
    fn prepare_empty(&mut self, scene: &Scene, made: &mut Made) -> Result<(), ErrorKind> {
        let of = (scene.key, scene.view, scene.background);
        if self.empty.as_ref().is_none_or(|empty| empty.of != of) {
            let mut log10 = self.empty.take().map_or(Vec::new(), |empty| empty.log10);
            empty_light(scene, &mut log10)?;
            (self.empty, made.background) = (Some(EmptyLight { of, log10 }), true);
        }
        let log10 = self.empty.as_ref().map_or(&[][..], |empty| &empty.log10);
        self.buffers.light.prepare_from(scene, log10);
        Ok(())
    }

    /// Images a plane.
    fn plane(&mut self, index: usize, rendering: &mut Rendering, made: &mut Made) -> Result<Plane, ErrorKind> {
        rendering.work().cancellation.check()?;
        let stage_um = rendering.scene().planes_um[index];
        let found = self.lights.iter().position(|light| light.stage_um.to_bits() == stage_um.to_bits());
        let light = match found {
            Some(at) => {
                let light = self.lights.remove(at);
                self.buffers.light.set_transmitted(&light.channels);
                light
            }
            None => {
                let stats = rendering.transmit(index, &mut self.buffers)?;
                made.planes += 1;
                PlaneLight { stage_um, channels: self.buffers.light.transmitted().to_vec(), stats }
            }
        };
        let plane = rendering.detect(index, &light.stats, &mut self.buffers).clone();
        // The most recent light last.
        self.lights.push(light);
        let mut bytes: usize = self.lights.iter().map(PlaneLight::bytes).sum();
        while bytes > self.max_light_bytes && self.lights.len() > 1 {
            bytes -= self.lights.remove(0).bytes();
        }
        Ok(plane)
    }
}

impl std::fmt::Debug for Last {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Last").field("key", &self.scene().map(|scene| scene.key)).finish_non_exhaustive()
    }
}

impl Last {
    fn scene(&self) -> Option<&Scene> {
        match self {
            Self::None => None,
            Self::Parts(parts) => Some(&parts.scene),
            Self::Image(rendering) => Some(rendering.scene()),
        }
    }

    fn into_parts(self) -> Option<Parts> {
        match self {
            Self::None => None,
            Self::Parts(parts) => Some(*parts),
            Self::Image(rendering) => Some(rendering.into_parts()),
        }
    }
}

/// Returns what identifies an object in scenes of one key.
fn identity(object: &Object) -> (&'static str, u64) {
    (object.body.kind().name(), object.number)
}

/// Returns whether two objects have the same phantom in one [`PhantomScene`](crate::phantom::PhantomScene). It does not
/// depend on depth, id and group.
fn has_same_phantom(last: &Object, object: &Object) -> bool {
    let Object { id, cluster, depth_um, .. } = *last;
    *last == Object { id, cluster, depth_um, ..object.clone() }
}

/// Returns whether objects with the same phantoms transmit the same light in a plane of both scenes. It does not depend
/// on background and camera.
fn has_same_light(last: &Scene, scene: &Scene) -> bool {
    let Scene { camera, background, attempts, slide, condition, .. } = *last;
    let (planes_um, cells) = (last.planes_um.clone(), last.cells.clone());
    *last == Scene { camera, background, attempts, slide, condition, planes_um, cells, ..scene.clone() }
}
