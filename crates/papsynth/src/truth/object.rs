//! Rows of the ground truth: one for every object.

use super::mask::Mask;
use super::part::{Group, Part};
use super::traits::Traits;
use crate::debris::ObjectKind;
use crate::scene::cell::Tint;

/// Ground truth of one object, or of one part of a cell.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectTruth {
    /// Id within the image, from 1; nucleus and cytoplasm of a cell have the same id.
    pub id: u32,
    /// Part of the object that this row describes.
    pub part: Part,
    /// Kind of object.
    pub kind: ObjectKind,
    /// Class: for cells the class of the model, for other objects the name of their kind.
    pub class: String,
    /// Bethesda category of the class ("NILM", "HSIL", …); empty if it has none.
    pub bethesda: String,
    /// Variants of this object.
    pub traits: Traits,
    /// Number of its cluster, from 1; 0 for a single object.
    pub cluster: u32,
    /// Centre, µm from the upper left corner of the image.
    pub centre_um: [f64; 2],
    /// Depth, µm; positive towards the objective, 0 at the centre of the specimen.
    pub depth_um: f64,
    /// Mean decadic absorbance drawn for the object, at 0.57 µm and with dye amounts of the standard stain.
    pub mean_absorbance: f64,
    /// Tint of a cytoplasm.
    pub tint: Option<Tint>,
    /// Rotation, degrees.
    pub rotation_deg: f64,
    /// Area of the complete object, including the part outside the image, µm².
    pub area_um2: f64,
    /// Whether part of the object is outside the image.
    pub truncated: bool,
    /// Complete mask: pixels of which the in-focus outline covers at least half, including those behind other objects.
    pub amodal: Mask,
    /// Visible mask: the pixels where the object is nearest to the objective within its group.
    pub visible: Mask,
    /// Defocus in each plane, µm (`Scene::in_focus_um(plane) − depth`).
    pub defocus_um: Vec<f64>,
    /// Detectability in each plane: mean contrast over its mask, relative to the noise of one pixel.
    pub detectability: Vec<f64>,
}

impl ObjectTruth {
    /// Returns the name of the tint, or an empty string.
    #[must_use]
    pub fn tint_name(&self) -> &'static str {
        self.tint.map_or("", Tint::name)
    }

    /// Returns the plane with the largest detectability, the first of equal ones; `None` without planes.
    #[must_use]
    pub fn best_plane(&self) -> Option<usize> {
        let values = &self.detectability;
        (0..values.len()).reduce(|best, plane| if values[plane] > values[best] { plane } else { best })
    }

    /// Returns the largest detectability of all planes; `None` without planes.
    #[must_use]
    pub fn best_detectability(&self) -> Option<f64> {
        self.best_plane().map(|plane| self.detectability[plane])
    }

    /// Returns the group within which the visible mask is computed.
    #[must_use]
    pub fn group(&self) -> Group {
        match self.part {
            Part::Cytoplasm => Group::Cytoplasm,
            Part::Nucleus => Group::Nucleus,
            Part::Whole => Group::Debris,
        }
    }
}

/// Ground truth of one image.
///
/// [Label maps](Self::labels) and [overlap counts](Self::layers) are computed from the masks on demand.
#[derive(Debug, Clone, PartialEq)]
pub struct Truth {
    /// Columns of the image.
    pub width: usize,
    /// Rows of the image.
    pub height: usize,
    /// One row for every object and every part of a cell, sorted by id and part. Objects without a pixel in the image
    /// are omitted; all objects of a [layer](ObjectKind::is_layer) share one row.
    pub objects: Vec<ObjectTruth>,
}

/// Merges the rows of each kind that is a layer into one row.
///
/// The merged row has the union of the masks, the means of the numbers, and the id of the first object.
pub(crate) fn merge_layers(objects: Vec<ObjectTruth>) -> Vec<ObjectTruth> {
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
        mean_absorbance: mean(&|object| object.mean_absorbance),
        rotation_deg: 0.0,
        area_um2: objects.iter().map(|object| object.area_um2).sum(),
        truncated: objects.iter().any(|object| object.truncated),
        amodal: Mask::union(objects.iter().map(|object| &object.amodal)),
        defocus_um: means(&|object| &object.defocus_um),
        detectability: means(&|object| &object.detectability),
        ..first.clone()
    })
}
