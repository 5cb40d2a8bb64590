//! A frame: its size and place, and what it holds in a few numbers.

use std::collections::BTreeMap;

use papsynth::key::Key;
use papsynth::scene::{Scene, View};
use papsynth::truth::{Group, Mask, Truth};
use papsynth::white_level;
use serde::{Deserialize, Serialize};

use super::category::category_name;
use super::flatten::Flatten;
use crate::error::Error;

/// Whether a frame is a single image or a focus stack.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Form {
    Single,
    Stack,
}

impl Form {
    pub(crate) fn of(planes: usize) -> Self {
        if planes > 1 { Self::Stack } else { Self::Single }
    }
}

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

/// What must be known of a frame before its first plane is written.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Geometry {
    pub(crate) key: Key,
    pub(crate) view: View,
    pub(crate) planes_um: Vec<f64>,
    pub(crate) bits: u32,
    pub(crate) channels: usize,
    pub(crate) slide: u64,
}

impl Geometry {
    pub(crate) fn of(scene: &Scene) -> Self {
        Self {
            key: scene.key,
            view: scene.view,
            planes_um: scene.planes_um.clone(),
            bits: scene.camera.bits,
            channels: scene.channels(),
            slide: scene.slide,
        }
    }

    /// That of a frame of a data set of this seed.
    pub(crate) fn of_summary(frame: &FrameSummary, seed: u64) -> Self {
        Self {
            key: Key { seed, index: frame.index },
            view: View { width: frame.width, height: frame.height, pixel_um: frame.pixel_um },
            planes_um: frame.planes_um.clone(),
            bits: frame.bits,
            channels: frame.channels,
            slide: frame.slide,
        }
    }

    pub(crate) fn pixels(&self) -> usize {
        self.view.width * self.view.height
    }

    /// What does not fit of what was handed over.
    pub(crate) fn wrong(&self, message: String) -> Error {
        Error::Frame { index: self.key.index, message }
    }

    /// Numbers of a plane: channels of pixels.
    pub(crate) fn values(&self) -> usize {
        self.pixels() * self.channels
    }
}

impl FrameSummary {
    /// The largest level that the camera gives.
    #[must_use]
    pub fn white(&self) -> u16 {
        white_level(self.bits)
    }

    /// That of a frame of these planes and objects.
    pub(crate) fn of(
        geometry: &Geometry,
        truth: &Truth,
        saturated: &[Mask],
        floored: Vec<usize>,
        flatten: Flatten,
    ) -> Self {
        let mut objects = BTreeMap::new();
        for object in &truth.objects {
            *objects.entry(category_name(&object.class, object.part)).or_insert(0) += 1;
        }
        Self {
            index: geometry.key.index,
            width: geometry.view.width,
            height: geometry.view.height,
            pixel_um: geometry.view.pixel_um,
            bits: geometry.bits,
            channels: geometry.channels,
            slide: geometry.slide,
            planes_um: geometry.planes_um.clone(),
            saturated: saturated.iter().map(|mask| usize::try_from(mask.area()).unwrap_or(usize::MAX)).collect(),
            floored,
            objects,
            truncated: truth.objects.iter().filter(|o| o.truncated).count() as u64,
            most_layers: truth.layers().into_iter().max().unwrap_or(0),
            lost_px: Group::ALL.map(|group| (group.name().to_owned(), flatten.lost(truth, group))).into(),
        }
    }
}
