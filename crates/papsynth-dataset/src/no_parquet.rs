//! What stands for `parquet.rs` in a build without the feature of that name. What wants it says so, so that nothing counts as whole that
//! nobody has looked into.

use std::path::Path;

use papsynth::truth::Truth;

use crate::error::Error;
use crate::files::{Folder, Pending};
use crate::formats::{Format, Place, Sink, Written, huggingface, missing};
use crate::merge;
use crate::splits::Split;
#[cfg(feature = "zarr")]
use crate::table::{Cell, Sort};

pub(crate) const IS_HERE: bool = false;

fn table<T>(path: &Path) -> Result<T, Error> {
    Err(missing("the table of objects as Parquet", "parquet", path))
}

pub(crate) fn sink(place: Place<'_>) -> Result<Box<dyn Sink + '_>, Error> {
    Err(Format::Huggingface.missing(place.folder.root()))
}

pub(crate) fn images(path: &Path, _: &str) -> Result<Vec<Vec<u8>>, Error> {
    Err(Format::Huggingface.missing(path))
}

pub(crate) fn merge(folder: &Folder, _: &[u64], _: &mut merge::Sink) -> Result<(), Error> {
    table(folder.root())
}

pub(crate) fn card(_: &[String], _: &[Split]) -> Result<(String, Vec<u8>), Error> {
    Err(Format::Huggingface.missing(Path::new(huggingface::CARD)))
}

#[cfg(feature = "zarr")]
pub(crate) fn write_cells<R: Iterator<Item = Cell>>(
    pending: &Pending,
    _: &[(&'static str, Sort)],
    _: impl Iterator<Item = R>,
) -> Result<(), Error> {
    table(pending.path())
}

/// A table that is not written.
pub(crate) enum ObjectTable {}

impl ObjectTable {
    pub(crate) fn begin(pending: Pending) -> Result<Self, Error> {
        table(pending.path())
    }

    pub(crate) fn add(&mut self, _: &Truth, _: u64) -> Result<(), Error> {
        match *self {}
    }

    pub(crate) fn end(self) -> Result<Pending, Error> {
        match self {}
    }
}

/// A table that is not read.
pub(crate) enum ObjectRows {}

impl ObjectRows {
    pub(crate) fn open(path: &Path) -> Result<Self, Error> {
        table(path)
    }

    pub(crate) fn check(&mut self, _: &Truth, _: u64) -> Result<(), Error> {
        match *self {}
    }

    pub(crate) fn end(self) -> Result<(), Error> {
        match self {}
    }
}

/// Frames that are not read.
pub(crate) enum Frames {}

impl Frames {
    pub(crate) fn new(folder: &Folder, _: u64) -> Result<Self, Error> {
        Err(Format::Huggingface.missing(folder.root()))
    }

    pub(crate) fn check(&mut self, _: &Written) -> Result<(), Error> {
        match *self {}
    }

    pub(crate) fn end(self) -> Result<(), Error> {
        match self {}
    }
}
