//! What formats of one label a pixel share.

use std::io;

use papsynth::truth::Group;

use super::Field;
use crate::flatten::Flatten;
use crate::write::{label_tiff, picture_tiff};

/// The groups that segmenters are trained for, each in a folder of its own.
pub(super) const GROUPS: [Group; 2] = [Group::Cytoplasm, Group::Nucleus];

/// The picture as TIFF, for readers that expect no other.
pub(super) fn picture(field: &Field) -> io::Result<Vec<u8>> {
    picture_tiff(field.picture, field.geometry)
}

/// The labels of a group as TIFF: the ids of the truth, so that numbers have gaps.
pub(super) fn masks(field: &Field, group: Group, policy: Flatten) -> io::Result<Vec<u8>> {
    let ids = policy.labels(field.truth, group);
    label_tiff(&ids, field.geometry.view.width, field.geometry.view.pixel_um)
}
