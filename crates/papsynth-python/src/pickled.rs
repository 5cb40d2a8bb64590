//! Frames as pickle keeps them: their arrays, and what is known of each object, its masks as counts of pixels.

use papsynth::scene::{Kind, Tint};
use papsynth::truth::{Group, ObjectTruth, Part, Truth, UnknownTrait};
use papsynth_dataset::{Problem, rle};
use pyo3::prelude::*;

use crate::error::wrong;

/// Changes with everything below.
pub(crate) const VERSION: u32 = 1;

/// Id, group, kind, class, Bethesda category, traits; cluster, place, depth, stain, tint, direction, area, whether it is truncated; its masks;
/// defocus and detectability.
pub(crate) type Object = (
    (u32, String, String, String, String, String),
    (u32, [f64; 2], f64, f64, String, f64, f64, bool),
    (String, String),
    (Vec<f64>, Vec<f64>),
);

pub(crate) fn objects(truth: &Truth) -> Vec<Object> {
    let Truth { width, height, objects } = truth;
    let object = |o: &ObjectTruth| {
        let kind = o.kind.name().to_owned();
        (
            (o.id, o.group().name().to_owned(), kind, o.class.clone(), o.bethesda.clone(), o.traits.to_string()),
            (
                o.cluster,
                o.centre_um,
                o.depth_um,
                o.stain,
                o.tint_name().to_owned(),
                o.rotation_deg,
                o.area_um2,
                o.truncated,
            ),
            (rle::encode(&o.amodal, *width, *height), rle::encode(&o.front, *width, *height)),
            (o.defocus_um.clone(), o.detectability.clone()),
        )
    };
    objects.iter().map(object).collect()
}

/// The truth of a frame of so many planes.
pub(crate) fn truth([width, height]: [usize; 2], planes: usize, objects: Vec<Object>) -> PyResult<Truth> {
    let objects = objects.into_iter().map(|object| restored(object, [width, height], planes));
    Ok(Truth { width, height, objects: objects.collect::<PyResult<_>>()? })
}

fn restored(object: Object, [width, height]: [usize; 2], planes: usize) -> PyResult<ObjectTruth> {
    let (
        (id, group, kind, class, bethesda, traits),
        (cluster, centre_um, depth_um, stain, tint, rotation_deg, area_um2, truncated),
        (amodal, front),
        (defocus_um, detectability),
    ) = object;
    let unknown = |what: &str, name: &str| damaged(&format!("object {id}: there is no {what} `{name}`"));
    let mask = |counts: &str| {
        rle::decode(counts, width, height).map_err(|error: Problem| damaged(&format!("object {id}: {error}")))
    };
    if [defocus_um.len(), detectability.len()] != [planes; 2] {
        return Err(damaged(&format!("object {id}: it is not seen in {planes} planes")));
    }
    let part = match Group::ALL.into_iter().find(|one| one.name() == group) {
        Some(Group::Cytoplasm) => Part::Cytoplasm,
        Some(Group::Nucleus) => Part::Nucleus,
        Some(Group::Debris) => Part::Whole,
        None => return Err(unknown("group", &group)),
    };
    let named = (!tint.is_empty()).then(|| Tint::by_name(&tint).ok_or_else(|| unknown("tint", &tint)));
    Ok(ObjectTruth {
        id,
        part,
        kind: Kind::ALL.into_iter().find(|one| one.name() == kind).ok_or_else(|| unknown("kind", &kind))?,
        class,
        bethesda,
        traits: traits.try_into().map_err(|error: UnknownTrait| damaged(&format!("object {id}: {error}")))?,
        cluster,
        centre_um,
        depth_um,
        stain,
        tint: named.transpose()?,
        rotation_deg,
        area_um2,
        truncated,
        amodal: mask(&amodal)?,
        front: mask(&front)?,
        defocus_um,
        detectability,
    })
}

pub(crate) fn damaged(what: &str) -> PyErr {
    wrong(format!("this is no frame that was pickled: {what}"))
}
