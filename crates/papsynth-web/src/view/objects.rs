//! Objects as JSON for the pages.

use papsynth::truth::{Mask, ObjectTruth};
use serde_json::{Value, json};

use super::labels::colour_text;

/// Returns the objects at a pixel, the nearest to the objective first.
pub(crate) fn objects_at<'a>(objects: impl Iterator<Item = &'a ObjectTruth>, x: usize, y: usize) -> Vec<Value> {
    let holds = |mask: &Mask| {
        mask.runs().iter().any(|run| run.y as usize == y && (run.x0 as usize..run.x1 as usize).contains(&x))
    };
    let mut found: Vec<&ObjectTruth> = objects.filter(|truth| holds(&truth.amodal)).collect();
    found.sort_by(|a, b| b.depth_um.total_cmp(&a.depth_um).then(b.part.cmp(&a.part)));
    found.into_iter().map(|truth| object_json(truth, holds(&truth.visible))).collect()
}

/// Returns an object as JSON for the page.
fn object_json(truth: &ObjectTruth, is_visible: bool) -> Value {
    json!({
        "id": truth.id,
        "colour": colour_text(truth.id),
        "group": truth.group().name(),
        "part": truth.part,
        "kind": truth.kind.name(),
        "class": truth.class,
        "bethesda": truth.bethesda,
        "traits": truth.traits,
        "cluster": truth.cluster,
        "visible": is_visible,
        "centre_um": truth.centre_um,
        "depth_um": truth.depth_um,
        "area_um2": truth.area_um2,
        "mean_absorbance": truth.mean_absorbance,
        "tint": truth.tint_name(),
        "rotation_deg": truth.rotation_deg,
        "truncated": truth.truncated,
        "defocus_um": truth.defocus_um,
        "detectability": truth.detectability,
    })
}
