//! Summaries of frames, and the categories of objects.

use std::collections::BTreeMap;

use papsynth::recipe::Recipe;
use papsynth::scene::{ClassCount, ObjectKind, Scene};
use papsynth::truth::{Group, Mask, Part, Truth};
use papsynth::white_level;
use serde::{Deserialize, Serialize};

use super::labels::{Flatten, overlaps};
use crate::error::Error;
use crate::formats::TRAINING_BITS;

/// Summary of a frame.
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
    /// Bits of a grey level of the camera.
    pub bits: u32,
    /// Bits of a grey level in formats for training, at most 8. Levels of deeper cameras are scaled:
    /// round(level × 255 / (2^bits − 1)).
    pub training_bits: u32,
    /// Channels of a pixel: 1, or 3 for red, green and blue.
    pub channels: usize,
    /// Number of the slide.
    pub slide: u64,
    /// Stage positions of the focal planes, µm, in the order of the stack.
    pub planes_um: Vec<f64>,
    /// Number of saturated pixels of each plane.
    pub saturated_px: Vec<usize>,
    /// Number of pixels of each plane that the model of the optics made too dark, next to very dark objects, and that
    /// were set to the least light.
    pub clipped_px: Vec<usize>,
    /// Number of times that the objects were drawn: more than 1 if the cells of the first draws did not fit.
    pub attempts: u32,
    /// Number of cells requested and placed, by class.
    pub cells: BTreeMap<String, ClassCount>,
    /// Number of objects and parts of cells by category, as `coco.json` names it.
    pub objects: BTreeMap<String, u64>,
    /// Number of objects that are partly outside the image.
    pub truncated: u64,
    /// Largest number of cytoplasms that overlap in a pixel.
    pub max_overlap: u16,
    /// Number of pixels of the complete masks of each group that label images with one label per pixel do not show
    /// ([`Layout::flatten`](crate::Layout::flatten)).
    pub occluded_px: BTreeMap<String, u64>,
}

impl FrameSummary {
    /// Returns the number of requested cells for which there was no room.
    #[must_use]
    pub fn unplaced(&self) -> u64 {
        self.cells.values().map(|count| count.requested.saturating_sub(count.placed)).sum()
    }

    /// Returns the largest level of the camera.
    #[must_use]
    pub fn white(&self) -> u16 {
        white_level(self.bits)
    }

    /// Returns the summary of a scene before its first plane; all counts are 0.
    pub(crate) fn of_scene(scene: &Scene) -> Self {
        Self {
            index: scene.key.index,
            width: scene.view.width,
            height: scene.view.height,
            pixel_um: scene.view.pixel_um,
            bits: scene.camera.bits,
            training_bits: scene.camera.bits.min(TRAINING_BITS),
            channels: scene.channels(),
            slide: scene.slide,
            planes_um: scene.planes_um.clone(),
            saturated_px: Vec::new(),
            clipped_px: Vec::new(),
            attempts: scene.attempts,
            cells: scene.cells.clone(),
            objects: BTreeMap::new(),
            truncated: 0,
            max_overlap: 0,
            occluded_px: BTreeMap::new(),
        }
    }

    /// Returns the summary with the counts of these planes and objects.
    pub(crate) fn counted(self, truth: &Truth, saturated: &[Mask], clipped_px: Vec<usize>, flatten: Flatten) -> Self {
        let mut objects = BTreeMap::new();
        for object in &truth.objects {
            *objects.entry(category_name(&object.class, object.part)).or_insert(0) += 1;
        }
        Self {
            training_bits: self.bits.min(TRAINING_BITS),
            saturated_px: saturated.iter().map(|mask| usize::try_from(mask.area()).unwrap_or(usize::MAX)).collect(),
            clipped_px,
            objects,
            truncated: truth.objects.iter().filter(|o| o.truncated).count() as u64,
            max_overlap: u16::try_from(overlaps(truth).largest()).unwrap_or(u16::MAX),
            occluded_px: Group::ALL.map(|group| (group.name().to_owned(), flatten.occluded(truth, group))).into(),
            ..self
        }
    }

    /// Returns the summary of the frame in formats for training.
    pub(crate) fn for_training(&self) -> Self {
        Self { bits: self.training_bits, ..self.clone() }
    }

    /// Whether this is the frame of a scene. Counts are not compared.
    pub(crate) fn is_of(&self, scene: &Scene) -> bool {
        let view =
            |f: &Self| (f.index, f.width, f.height, f.pixel_um, f.bits, f.channels, f.slide, f.planes_um.clone());
        view(self) == view(&Self::of_scene(scene))
    }

    pub(crate) fn is_stack(&self) -> bool {
        self.planes_um.len() > 1
    }

    /// Number of values of a plane: pixels times channels.
    pub(crate) fn values(&self) -> usize {
        self.width * self.height * self.channels
    }

    /// Returns an error unless the input `fits`.
    pub(crate) fn due(&self, fits: bool, message: String) -> Result<(), Error> {
        if fits { Ok(()) } else { Err(self.wrong(message)) }
    }

    /// Returns an error about the input for this frame.
    pub(crate) fn wrong(&self, message: impl Into<String>) -> Error {
        Error::Frame { index: self.index, message: message.into() }
    }
}

/// A category of annotations: one for each class and part of cells, and one for each kind of other objects.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Category {
    /// Number from 1.
    pub id: u32,
    /// Name, for example "superficial nucleus" or "bacillus".
    pub name: String,
    /// "cytoplasm", "nucleus" or "debris".
    pub supercategory: String,
}

/// Returns the categories of a recipe. They are the same for all of its frames.
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
