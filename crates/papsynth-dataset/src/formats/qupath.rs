//! `qupath`: GeoJSON in pixels of the image, whose upper left corner is the origin, beside the image.

use papsynth::truth::ObjectTruth;
use serde_json::{Value, json};

use super::ome::{of_picture, ome_picture};
use super::sink::{Field, Files};
use super::written::{Written, is_described};
use crate::bytes;
use crate::error::{Error, Problem};
use crate::truth;

pub(super) fn image(index: u64) -> String {
    format!("qupath/{index:06}.ome.tif")
}

fn objects(index: u64) -> String {
    format!("qupath/{index:06}.geojson")
}

fn collection(field: &Field) -> Value {
    // What no pixel shows has no outline.
    let objects: Vec<&ObjectTruth> = field.truth.objects.iter().filter(|o| !o.amodal.is_empty()).collect();
    let (seed, index) = (field.seed, field.frame.index);
    let name = |o: &ObjectTruth| format!("papsynth {seed} {index} {} {:?}", o.id, o.part);
    let measure = |object: &ObjectTruth, nucleus: Option<&ObjectTruth>| {
        let mut all =
            json!({ "Area µm^2": object.area_um2, "Depth µm": object.depth_um, "Stain": object.mean_absorbance });
        if let Some(nucleus) = nucleus {
            all["Nucleus: Area µm^2"] = nucleus.area_um2.into();
            all["Nucleus: Stain"] = nucleus.mean_absorbance.into();
        }
        all
    };
    truth::collection(&objects, name, measure)
}

pub(super) fn check(written: &Written) -> Result<(), Error> {
    let field = written.field;
    written.file(&image(field.frame.index), |bytes| {
        written.picture(bytes)?;
        is_described(bytes, &of_picture(field.frame))
    })?;
    written.file(&objects(field.frame.index), |bytes| {
        let found: Value = serde_json::from_slice(bytes)?;
        Problem::unless(found == collection(field), "its features are not those of the masks of coco.json")
    })
}

pub(super) fn write(field: &Field, files: &mut Files) -> Result<(), Error> {
    files.encode(&image(field.frame.index), ome_picture(field.picture, field.frame))?;
    files.write(&objects(field.frame.index), &bytes::json(&collection(field)))
}
