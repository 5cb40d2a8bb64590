//! A frame: its size and place, what it holds in a few numbers, and the categories of what it may hold.

use std::collections::BTreeMap;

use papsynth::recipe::Recipe;
use papsynth::scene::{ClassCount, ObjectKind, Scene};
use papsynth::truth::{Group, Mask, Part, Truth};
use papsynth::white_level;
use serde::{Deserialize, Serialize};

use super::labels::Flatten;
use crate::error::Error;

/// A frame in a few numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrameSummary {
    /// Index of the frame.
    pub index: u64,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Size of a pixel, µm.
    pub pixel_um: f64,
    /// Bits of a grey level.
    pub bits: u32,
    /// Channels of a pixel: 1, or 3 for red, green and blue.
    pub channels: usize,
    /// Number of the slide that the frame shows a field of.
    pub slide: u64,
    /// Travel of the stage to the focal planes, µm, in the order of the stack.
    pub planes_um: Vec<f64>,
    /// Number of saturated pixels of each plane.
    pub saturated: Vec<usize>,
    /// Number of places in each plane, in pixels, where the model of the optics would have given less light than there can
    /// be and a least one was put in its place: beside very dark things.
    pub floored: Vec<usize>,
    /// Number of times that the objects were drawn: more than 1 if the cells of the first draws did not fit.
    pub attempts: u32,
    /// Number of cells requested and placed, by class.
    pub cells: BTreeMap<String, ClassCount>,
    /// Number of objects and parts of cells by category, as `coco.json` names it.
    pub objects: BTreeMap<String, u64>,
    /// How many of them lie partly outside the image.
    pub truncated: u64,
    /// The largest number of cytoplasms that lie over each other.
    pub most_layers: u16,
    /// Pixels of the complete masks of each group that are not shown where there is room for one object a pixel
    /// ([`Layout::flatten`](crate::Layout::flatten)).
    pub lost_px: BTreeMap<String, u64>,
}

impl FrameSummary {
    /// The largest level that the camera gives.
    #[must_use]
    pub fn white(&self) -> u16 {
        white_level(self.bits)
    }

    /// What is known of the frame of a scene before its first plane: nothing is counted yet.
    pub(crate) fn of_scene(scene: &Scene) -> Self {
        Self {
            index: scene.key.index,
            width: scene.view.width,
            height: scene.view.height,
            pixel_um: scene.view.pixel_um,
            bits: scene.camera.bits,
            channels: scene.channels(),
            slide: scene.slide,
            planes_um: scene.planes_um.clone(),
            saturated: Vec::new(),
            floored: Vec::new(),
            attempts: scene.attempts,
            cells: scene.cells.clone(),
            objects: BTreeMap::new(),
            truncated: 0,
            most_layers: 0,
            lost_px: BTreeMap::new(),
        }
    }

    /// The same with the counts of these planes and objects.
    pub(crate) fn counted(self, truth: &Truth, saturated: &[Mask], floored: Vec<usize>, flatten: Flatten) -> Self {
        let mut objects = BTreeMap::new();
        for object in &truth.objects {
            *objects.entry(category_name(&object.class, object.part)).or_insert(0) += 1;
        }
        Self {
            saturated: saturated.iter().map(|mask| usize::try_from(mask.area()).unwrap_or(usize::MAX)).collect(),
            floored,
            objects,
            truncated: truth.objects.iter().filter(|o| o.truncated).count() as u64,
            most_layers: truth.layers().into_iter().max().unwrap_or(0),
            lost_px: Group::ALL.map(|group| (group.name().to_owned(), flatten.lost(truth, group))).into(),
            ..self
        }
    }

    /// Whether it is the frame of a scene, whatever is counted in it.
    pub(crate) fn is_of(&self, scene: &Scene) -> bool {
        let view =
            |f: &Self| (f.index, f.width, f.height, f.pixel_um, f.bits, f.channels, f.slide, f.planes_um.clone());
        view(self) == view(&Self::of_scene(scene))
    }

    pub(crate) fn is_stack(&self) -> bool {
        self.planes_um.len() > 1
    }

    /// Numbers of a plane: channels of pixels.
    pub(crate) fn values(&self) -> usize {
        self.width * self.height * self.channels
    }

    /// What was handed over must fit.
    pub(crate) fn due(&self, fits: bool, message: String) -> Result<(), Error> {
        if fits { Ok(()) } else { Err(self.wrong(message)) }
    }

    /// What does not fit of what was handed over.
    pub(crate) fn wrong(&self, message: impl Into<String>) -> Error {
        Error::Frame { index: self.index, message: message.into() }
    }
}

/// A kind of annotation: of cells one for each class and part, of everything else one for each kind.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Category {
    /// From 1.
    pub id: u32,
    /// Such as "superficial nucleus" or "bacillus".
    pub name: String,
    /// "cytoplasm", "nucleus" or "debris".
    pub supercategory: String,
}

/// The categories of a recipe, the same whatever frames are made of it.
pub(crate) fn categories(recipe: &Recipe) -> Vec<Category> {
    let cells = recipe.cells.keys().flat_map(|class| [(class.as_str(), Part::Cytoplasm), (class, Part::Nucleus)]);
    let others =
        ObjectKind::ALL.into_iter().filter(|&kind| kind != ObjectKind::Cell).map(|kind| (kind.name(), Part::Whole));
    (1..)
        .zip(cells.chain(others))
        .map(|(id, (class, part))| Category {
            id,
            name: category_name(class, part),
            supercategory: group(part).name().to_owned(),
        })
        .collect()
}

pub(crate) fn category_name(class: &str, part: Part) -> String {
    match part {
        Part::Whole => class.to_owned(),
        Part::Cytoplasm | Part::Nucleus => format!("{class} {}", group(part).name()),
    }
}

pub(super) fn group(part: Part) -> Group {
    match part {
        Part::Cytoplasm => Group::Cytoplasm,
        Part::Nucleus => Group::Nucleus,
        Part::Whole => Group::Debris,
    }
}
