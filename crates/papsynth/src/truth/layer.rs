//! Layers: objects of a kind that nobody counts are one row of the truth.

use super::mask::Mask;
use super::object::ObjectTruth;

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
