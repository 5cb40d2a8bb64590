//! `qupath`: an OME-TIFF image, and GeoJSON in pixels from its upper left corner.

use papsynth::truth::ObjectTruth;
use serde_json::{Value, json};

use super::depth::Depth;
use super::ome::{image_description, ome_image};
use super::sink::{Field, Files};
use super::written::{Written, is_described};
use crate::bytes;
use crate::error::{Error, InputError};
use crate::truth::{self, Collection};

pub(super) fn image(index: u64) -> String {
    format!("qupath/{index:06}.ome.tif")
}

fn objects(index: u64) -> String {
    format!("qupath/{index:06}.geojson")
}

fn collection(field: &Field) -> Collection {
    // An empty mask has no outline.
    let objects: Vec<&ObjectTruth> = field.truth.objects.iter().filter(|o| !o.amodal.is_empty()).collect();
    let (seed, index) = (field.seed, field.frame.index);
    let name = |o: &ObjectTruth| format!("papsynth {seed} {index} {} {:?}", o.id, o.part);
    let measure = |object: &ObjectTruth, nucleus: Option<&ObjectTruth>| {
        let mut all = json!({ "Area µm^2": object.area_um2, "Depth µm": object.depth_um, "Mean absorbance": object.mean_absorbance });
        if let Some(best) = object.best_detectability() {
            all["Detectability"] = best.into();
        }
        if let Some(nucleus) = nucleus {
            if let Some(best) = nucleus.best_detectability() {
                all["Nucleus: Detectability"] = best.into();
            }
            all["Nucleus: Area µm^2"] = nucleus.area_um2.into();
            all["Nucleus: Mean absorbance"] = nucleus.mean_absorbance.into();
        }
        all
    };
    truth::collection(&objects, name, measure)
}

pub(super) fn check(written: &Written) -> Result<(), Error> {
    let field = written.field;
    written.file(&image(field.frame.index), |bytes| {
        written.image(bytes, Depth::Camera)?;
        is_described(bytes, &image_description(field.frame))
    })?;
    written.file(&objects(field.frame.index), |bytes| {
        let found: Value = serde_json::from_slice(bytes)?;
        InputError::unless(
            found == serde_json::to_value(collection(field))?,
            "the features differ from the masks in coco.json",
        )
    })
}

pub(super) fn write(field: &Field, files: &mut Files) -> Result<(), Error> {
    files.encode(&image(field.frame.index), ome_image(field.image, field.frame))?;
    files.write(&objects(field.frame.index), &bytes::json(&collection(field)))
}
