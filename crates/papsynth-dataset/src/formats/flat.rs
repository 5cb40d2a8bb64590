//! Formats with one label per pixel, with a folder for cytoplasm and one for nuclei: `cellpose` and `stardist`.
//!
//! `cellpose` has `NAME.tif` and `NAME_masks.tif` in one folder. Cellpose trains on every image that does not end in
//! `_masks`, so the two groups need separate folders. `stardist` has `images/NAME.tif` and `masks/NAME.tif`.

use papsynth::truth::Group;

use super::depth::Depth;
use super::format::Format;
use super::ome::{image_tiff, label_tiff};
use super::sink::{Field, Files};
use super::written::Written;
use crate::error::Error;

/// The groups that segmenters are trained for, each in a folder.
pub(super) const GROUPS: [Group; 2] = [Group::Cytoplasm, Group::Nucleus];

pub(super) fn names(format: Format, group: Group, index: u64) -> [String; 2] {
    let group = group.name();
    match format {
        Format::Stardist => ["images", "masks"].map(|what| format!("stardist/{group}/{what}/{index:06}.tif")),
        _ => ["", "_masks"].map(|ending| format!("cellpose/{group}/{index:06}{ending}.tif")),
    }
}

/// Writes 8-bit images and labels. Labels are the ids of the objects, so their numbers may have gaps.
pub(super) fn write(format: Format, field: &Field, files: &mut Files) -> Result<(), Error> {
    for group in GROUPS {
        let [image, masks] = names(format, group, field.frame.index);
        files.encode(&image, image_tiff(&field.training_image(), &field.frame.for_training(), None))?;
        let labels = files.layout.flatten.labels(field.truth, group);
        files.encode(&masks, label_tiff(labels, field.frame))?;
    }
    Ok(())
}

pub(super) fn check(format: Format, written: &Written) -> Result<(), Error> {
    GROUPS.into_iter().try_for_each(|group| {
        let [image, masks] = names(format, group, written.field.frame.index);
        written.file(&image, |bytes| written.image(bytes, Depth::Training))?;
        written.file(&masks, |bytes| written.labels(bytes, written.flat(group)))
    })
}
