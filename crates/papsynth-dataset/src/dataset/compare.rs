//! Data sets beside each other.

use std::collections::BTreeMap;
use std::path::Path;

use papsynth::truth::{ObjectTruth, Truth};

use super::set::{Dataset, read_record, recorded_shards};
use crate::error::Error;

/// Indices of all recorded frames, in order.
///
/// # Errors
/// If a record cannot be read, or is missing of a shard that was merged.
pub fn frames_of(dataset: &Dataset) -> Result<Vec<u64>, Error> {
    Ok(images_of(dataset)?.into_keys().collect())
}

/// Of every recorded frame, by index, the slide and where its image lies.
///
/// # Errors
/// If a record cannot be read, or is missing of a shard that was merged.
pub fn images_of(dataset: &Dataset) -> Result<BTreeMap<u64, (u64, String)>, Error> {
    let mut images = BTreeMap::new();
    for shard in dataset.shards()? {
        for frame in read_record(&dataset.folder, shard)?.frames {
            let (image, _) = dataset.images_of(&frame, shard);
            images.insert(frame.index, (frame.slide, image));
        }
    }
    Ok(images)
}

/// The first difference between what lies where in two data sets: objects, classes, places, complete and visible masks. Stain,
/// defocus and detectability may differ.
///
/// # Errors
/// If one is no data set, or its truth cannot be read.
pub fn truth_differs(one: &Path, other: &Path) -> Result<Option<String>, Error> {
    let (one, other) = (Dataset::open(one)?, Dataset::open(other)?);
    let mut there = Vec::new();
    for shard in recorded_shards(&other.folder)? {
        there.extend(read_record(&other.folder, shard)?.frames.into_iter().map(|frame| (frame.index, shard)));
    }
    for shard in recorded_shards(&one.folder)? {
        let here = one.document(shard)?;
        for frame in read_record(&one.folder, shard)?.frames {
            let index = frame.index;
            let Ok(at) = there.binary_search_by_key(&index, |(index, _)| *index) else {
                return Ok(Some(format!("frame {index} is missing")));
            };
            let a = one.truth_in(&here, shard, index)?;
            let b = other.truth_in(&other.document(there[at].1)?, there[at].1, index)?;
            if let Some(difference) = difference(&a, &b) {
                return Ok(Some(format!("frame {index}: {difference}")));
            }
        }
    }
    Ok(None)
}

fn difference(one: &Truth, other: &Truth) -> Option<String> {
    if one.objects.len() != other.objects.len() {
        return Some(format!("{} objects and parts, not {}", other.objects.len(), one.objects.len()));
    }
    let what = |a: &ObjectTruth, b: &ObjectTruth| {
        let claims = [
            ("id", a.id == b.id && a.part == b.part && a.kind == b.kind),
            ("class", a.class == b.class),
            ("place", a.centre_um == b.centre_um && a.depth_um == b.depth_um && a.rotation_deg == b.rotation_deg),
            ("complete mask", a.amodal == b.amodal),
            ("visible mask", a.front == b.front),
        ];
        claims.into_iter().find(|(_, same)| !same).map(|(what, _)| format!("object {} has another {what}", a.id))
    };
    one.objects.iter().zip(&other.objects).find_map(|(a, b)| what(a, b))
}
