//! What is known of an image: a row for every object.

use super::mask::Mask;
use super::part::{Group, Part};
use super::traits::Traits;
use crate::debris::Kind;
use crate::scene::cell::Tint;

/// What is known of one object, or of one part of a cell.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectTruth {
    /// Id within the image, from 1; nucleus and cytoplasm of a cell share it.
    pub id: u32,
    /// Which part of the object this row is about.
    pub part: Part,
    /// What kind of object it is.
    pub kind: Kind,
    /// Class: of cells the class in the model, of all others the name of their kind.
    pub class: String,
    /// Bethesda category of that class, where it has one ("NILM", "HSIL", …).
    pub bethesda: String,
    /// Variants drawn for this object.
    pub traits: Traits,
    /// The cluster it was placed with (from 1), or 0 if it was placed alone.
    pub cluster: u32,
    /// Place of its middle, µm from the image's upper left corner.
    pub centre_um: [f64; 2],
    /// Depth, µm; positive towards the objective, 0 in the middle of the slide.
    pub depth_um: f64,
    /// Strength of its stain: the mean decadic absorbance it was given, at 0.57 µm where its dyes have the amounts of a
    /// usual stain.
    pub stain: f64,
    /// The tint of a cytoplasm.
    pub tint: Option<Tint>,
    /// Direction it was turned to, degrees.
    pub rotation_deg: f64,
    /// Area of the whole object, also of what lies outside the image, µm².
    pub area_um2: f64,
    /// Whether part of it lies outside the image.
    pub truncated: bool,
    /// Its complete mask: coverage of its in-focus outline of at least one half, whatever lies over it.
    pub amodal: Mask,
    /// Its front-most mask: the pixels where it is nearest to the objective within its group.
    pub front: Mask,
    /// Distance from what is in focus in each plane, µm (`Scene::in_focus_um(plane) − depth`).
    pub defocus_um: Vec<f64>,
    /// How detectable it is in each plane: mean contrast over its mask, in units of the noise of one pixel there.
    pub detectability: Vec<f64>,
}

impl ObjectTruth {
    /// The name of its tint, or an empty text.
    #[must_use]
    pub fn tint_name(&self) -> &'static str {
        self.tint.map_or("", Tint::name)
    }

    /// The group within which its front-most mask counts.
    #[must_use]
    pub fn group(&self) -> Group {
        match self.part {
            Part::Cytoplasm => Group::Cytoplasm,
            Part::Nucleus => Group::Nucleus,
            Part::Whole => Group::Debris,
        }
    }
}

/// What is known of one image.
///
/// [Label maps](Self::labels) and [layers](Self::layers) follow from the masks and are made when asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct Truth {
    /// Columns of the image.
    pub width: usize,
    /// Rows of the image.
    pub height: usize,
    /// One row for every object and every part of a cell, by id and part; objects without a pixel in the image are left out,
    /// and all objects of a [layer](Kind::is_layer) share one.
    pub objects: Vec<ObjectTruth>,
}

/// The same rows, but one for all objects of each kind that is a layer: its mask is that of all of them, its numbers
/// are their means, its id that of the first.
pub(crate) fn with_layers(objects: Vec<ObjectTruth>) -> Vec<ObjectTruth> {
    let (layers, mut rows): (Vec<_>, Vec<_>) = objects.into_iter().partition(|object| object.kind.is_layer());
    for of_kind in layers.chunk_by(|a, b| a.kind == b.kind) {
        rows.extend(layer(of_kind));
    }
    rows.sort_by_key(|object| (object.id, object.part));
    rows
}

fn layer(objects: &[ObjectTruth]) -> Option<ObjectTruth> {
    let first = objects.first()?;
    let mean = |value: &dyn Fn(&ObjectTruth) -> f64| objects.iter().map(value).sum::<f64>() / objects.len() as f64;
    let means = |values: &dyn Fn(&ObjectTruth) -> &[f64]| -> Vec<f64> {
        (0..values(first).len()).map(|plane| mean(&|object| values(object)[plane])).collect()
    };
    Some(ObjectTruth {
        cluster: 0,
        centre_um: [0, 1].map(|axis| mean(&|object| object.centre_um[axis])),
        depth_um: mean(&|object| object.depth_um),
        stain: mean(&|object| object.stain),
        rotation_deg: 0.0,
        area_um2: objects.iter().map(|object| object.area_um2).sum(),
        truncated: objects.iter().any(|object| object.truncated),
        amodal: Mask::union(objects.iter().map(|object| &object.amodal)),
        defocus_um: means(&|object| &object.defocus_um),
        detectability: means(&|object| &object.detectability),
        ..first.clone()
    })
}
