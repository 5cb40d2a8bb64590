//! `qupath`: GeoJSON in pixels of the image, whose upper left corner is the origin, beside the image.
//!
//! A cell is one feature with its nucleus within (`nucleusGeometry`); everything else is a detection.

use papsynth::truth::{Mask, ObjectTruth, Part};
use serde_json::{Map, Value, json};

use super::written::{differs, is_described};
use super::{Field, Files, Place, Sink, Written};
use crate::coco::category_name;
use crate::error::Error;
use crate::polygon::polygons;
use crate::record::{FileRecord, Geometry, broken};
use crate::write::{of_picture, ome_picture};

pub(super) struct Objects<'a> {
    files: Files<'a>,
}

impl<'a> Objects<'a> {
    pub(super) fn new(place: Place<'a>) -> Self {
        Self { files: Files::new(place.folder) }
    }
}

pub(super) fn image(index: u64) -> String {
    format!("qupath/{index:06}.ome.tif")
}

fn objects(index: u64) -> String {
    format!("qupath/{index:06}.geojson")
}

/// The objects of a frame as GeoJSON.
fn collection(field: &Field) -> Value {
    // What no pixel shows has no outline.
    let objects: Vec<&ObjectTruth> = field.truth.objects.iter().filter(|o| !o.amodal.is_empty()).collect();
    let nucleus = |id: u32| objects.iter().find(|o| o.part == Part::Nucleus && o.id == id);
    let cytoplasm = |id: u32| objects.iter().any(|o| o.part == Part::Cytoplasm && o.id == id);
    let features: Vec<Value> = objects
        .iter()
        // A nucleus goes with its cell, if that is in the image.
        .filter(|object| object.part != Part::Nucleus || !cytoplasm(object.id))
        .map(|object| feature(object, nucleus(object.id).copied(), field.geometry))
        .collect();
    json!({ "type": "FeatureCollection", "features": features })
}

pub(super) fn check(written: &Written) -> Result<(), Error> {
    let field = written.field;
    written.file(&image(field.index()), |bytes| {
        written.picture(bytes)?;
        is_described(bytes, &of_picture(field.geometry))
    })?;
    written.file(&objects(field.index()), |bytes| match serde_json::from_slice::<Value>(bytes) {
        Ok(found) if collection(field) == found => Ok(()),
        Ok(_) => differs("its features are not those of the masks of coco.json"),
        Err(error) => Err(broken(error)),
    })
}

impl Sink for Objects<'_> {
    fn field(&mut self, field: &Field) -> Result<(), Error> {
        self.files.encode(&image(field.index()), ome_picture(field.picture, field.geometry))?;
        let name = objects(field.index());
        self.files.encode(&name, serde_json::to_vec(&collection(field)).map_err(Into::into))
    }

    fn close(self: Box<Self>) -> Result<Vec<FileRecord>, Error> {
        Ok(self.files.written)
    }
}

fn feature(object: &ObjectTruth, nucleus: Option<&ObjectTruth>, geometry: &Geometry) -> Value {
    let name = match object.part {
        Part::Cytoplasm => object.class.clone(),
        part => category_name(&object.class, part),
    };
    let mut measurements = Map::new();
    measurements.insert("Area µm^2".to_owned(), json!(object.area_um2));
    measurements.insert("Depth µm".to_owned(), json!(object.depth_um));
    measurements.insert("Stain".to_owned(), json!(object.stain));
    let nucleus = nucleus.filter(|_| object.part == Part::Cytoplasm);
    if let Some(nucleus) = nucleus {
        measurements.insert("Nucleus: Area µm^2".to_owned(), json!(nucleus.area_um2));
        measurements.insert("Nucleus: Stain".to_owned(), json!(nucleus.stain));
    }
    let mut feature = json!({
        "type": "Feature",
        "id": uuid(geometry, object),
        "geometry": shape(&object.amodal),
        "properties": {
            "objectType": if object.part == Part::Cytoplasm { "cell" } else { "detection" },
            "name": object.id.to_string(),
            "classification": { "name": name },
            "measurements": measurements,
        },
    });
    if let (Some(nucleus), Some(feature)) = (nucleus, feature.as_object_mut()) {
        feature.insert("nucleusGeometry".to_owned(), shape(&nucleus.amodal));
    }
    feature
}

/// A polygon, or several where the mask falls apart.
pub(crate) fn shape(mask: &Mask) -> Value {
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

/// A name that no other object of any data set has, the same whenever it is made.
fn uuid(geometry: &Geometry, object: &ObjectTruth) -> String {
    let key = geometry.key;
    uuid_of(&format!("papsynth {} {} {} {:?}", key.seed, key.index, object.id, object.part))
}

/// The same of any name.
pub(crate) fn uuid_of(name: &str) -> String {
    let hex = crate::files::sha256(name.as_bytes());
    // Version 8: made as the maker likes; variant 8: RFC 9562.
    format!("{}-{}-8{}-8{}-{}", &hex[..8], &hex[8..12], &hex[13..16], &hex[17..20], &hex[20..32])
}
