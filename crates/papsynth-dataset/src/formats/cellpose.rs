//! `cellpose`: `NAME.tif` beside `NAME_masks.tif`, in a folder for cytoplasm and one for nuclei.
//!
//! Cellpose takes every image of a folder that does not end in `_masks`, so the two groups cannot share one.

use papsynth::truth::Group;

use super::{Field, Files, Place, Sink, Written, flat};
use crate::error::Error;
use crate::flatten::Flatten;
use crate::record::FileRecord;

pub(super) struct Pairs<'a> {
    files: Files<'a>,
    policy: Flatten,
}

impl<'a> Pairs<'a> {
    pub(super) fn new(place: Place<'a>) -> Self {
        Self { files: Files::new(place.folder), policy: place.layout.flatten }
    }
}

pub(super) fn image(group: Group, index: u64) -> String {
    format!("cellpose/{}/{index:06}.tif", group.name())
}

fn masks(group: Group, index: u64) -> String {
    format!("cellpose/{}/{index:06}_masks.tif", group.name())
}

pub(super) fn check(written: &Written) -> Result<(), Error> {
    let index = written.field.index();
    flat::GROUPS.into_iter().try_for_each(|group| {
        written.file(&image(group, index), |bytes| written.picture(bytes))?;
        written.file(&masks(group, index), |bytes| written.labels(bytes, &written.flat(group)))
    })
}

impl Sink for Pairs<'_> {
    fn field(&mut self, field: &Field) -> Result<(), Error> {
        for group in flat::GROUPS {
            self.files.encode(&image(group, field.index()), flat::picture(field))?;
            self.files.encode(&masks(group, field.index()), flat::masks(field, group, self.policy))?;
        }
        Ok(())
    }

    fn close(self: Box<Self>) -> Result<Vec<FileRecord>, Error> {
        Ok(self.files.written)
    }
}
