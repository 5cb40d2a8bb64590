//! Outlines of objects as GeoJSON. A cell is one feature with its nucleus within (`nucleusGeometry`); everything else is a detection.

use papsynth::truth::{Mask, ObjectTruth, Part};
use serde_json::{Value, json};

use super::category::category_name;
use super::polygon::polygons;
use crate::bytes::sha256;

/// The features of these objects. `name` gives each a name that no other has, `measure` what is measured of it and of the nucleus of a cell.
pub(crate) fn collection(
    objects: &[&ObjectTruth],
    name: impl Fn(&ObjectTruth) -> String,
    measure: impl Fn(&ObjectTruth, Option<&ObjectTruth>) -> Value,
) -> Value {
    let find = |id: u32, part: Part| objects.iter().copied().find(|o| o.id == id && o.part == part);
    // A nucleus goes with its cell, if that is there.
    let own = objects.iter().filter(|o| o.part != Part::Nucleus || find(o.id, Part::Cytoplasm).is_none());
    let features = own.map(|object| {
        let is_cell = object.part == Part::Cytoplasm;
        let nucleus = find(object.id, Part::Nucleus).filter(|_| is_cell);
        let class = if is_cell { object.class.clone() } else { category_name(&object.class, object.part) };
        let mut feature = json!({
            "type": "Feature",
            "id": uuid(&name(object)),
            "geometry": shape(&object.amodal),
            "properties": {
                "objectType": if is_cell { "cell" } else { "detection" },
                "name": object.id.to_string(),
                "classification": { "name": class },
                "measurements": measure(object, nucleus),
            },
        });
        if let (Some(nucleus), Some(feature)) = (nucleus, feature.as_object_mut()) {
            feature.insert("nucleusGeometry".to_owned(), shape(&nucleus.amodal));
        }
        feature
    });
    json!({ "type": "FeatureCollection", "features": features.collect::<Vec<_>>() })
}

/// A polygon, or several where the mask falls apart.
fn shape(mask: &Mask) -> Value {
    let mut parts = polygons(mask);
    // A ring ends where it begins.
    for ring in parts.iter_mut().flatten() {
        ring.extend(ring.first().copied());
    }
    match parts.as_slice() {
        [one] => json!({ "type": "Polygon", "coordinates": one }),
        _ => json!({ "type": "MultiPolygon", "coordinates": parts }),
    }
}

/// The UUID of a name, the same whenever it is made.
fn uuid(name: &str) -> String {
    let hex = sha256(name.as_bytes());
    // Version 8: made as the maker likes; variant 8: RFC 9562.
    format!("{}-{}-8{}-8{}-{}", &hex[..8], &hex[8..12], &hex[13..16], &hex[17..20], &hex[20..32])
}
