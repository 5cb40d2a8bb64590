//! What stands for `parquet.rs` in a build without the feature of that name. Nothing is written that needs it; what is read is left to hashes, but for
//! images, without which there is nothing to go on with.

use std::path::Path;

use papsynth::truth::Truth;

use crate::error::Error;
use crate::files::{Folder, Pending};
use crate::formats::{Place, Sink, Written};
use crate::record::FileRecord;
use crate::splits::Split;

pub(crate) const IS_HERE: bool = false;

fn lacks<T>(path: &Path) -> Result<T, Error> {
    let message = "it is a Parquet file; that needs a build with `--features parquet`".to_owned();
    Err(Error::Folder { path: path.to_owned(), message })
}

pub(crate) fn sink(place: Place<'_>) -> Result<Box<dyn Sink + '_>, Error> {
    lacks(place.folder.root())
}

pub(crate) fn images(path: &Path, _: &str) -> Result<Vec<Vec<u8>>, Error> {
    lacks(path)
}

pub(crate) fn merge(folder: &Folder, _: &[u64]) -> Result<FileRecord, Error> {
    lacks(folder.root())
}

pub(crate) fn card(_: &[String], _: &[Split]) -> Result<(String, Vec<u8>), Error> {
    lacks(Path::new(crate::formats::huggingface::CARD))
}

/// A table that is not written.
pub(crate) enum ObjectTable {}

impl ObjectTable {
    pub(crate) fn begin(pending: Pending) -> Result<Self, Error> {
        lacks(pending.path())
    }

    pub(crate) fn add(&mut self, _: &Truth, _: u64) -> Result<(), Error> {
        match *self {}
    }

    pub(crate) fn end(self) -> Result<Pending, Error> {
        match self {}
    }
}

/// A table that is not looked into.
pub(crate) struct ObjectRows;

impl ObjectRows {
    #[expect(clippy::unnecessary_wraps, reason = "with the feature it fails")]
    pub(crate) fn open(_: &Path) -> Result<Self, Error> {
        Ok(Self)
    }

    #[expect(clippy::unnecessary_wraps, clippy::unused_self, reason = "with the feature it fails")]
    pub(crate) fn check(&mut self, _: &Truth, _: u64) -> Result<(), Error> {
        Ok(())
    }

    #[expect(clippy::unnecessary_wraps, reason = "with the feature it fails")]
    pub(crate) fn end(self) -> Result<(), Error> {
        Ok(())
    }
}

/// Frames that are not looked into.
pub(crate) struct Frames;

impl Frames {
    pub(crate) fn new(_: &Folder, _: u64) -> Self {
        Self
    }

    #[expect(clippy::unnecessary_wraps, clippy::unused_self, reason = "with the feature it fails")]
    pub(crate) fn check(&mut self, _: &Written) -> Result<(), Error> {
        Ok(())
    }

    #[expect(clippy::unnecessary_wraps, reason = "with the feature it fails")]
    pub(crate) fn end(self) -> Result<(), Error> {
        Ok(())
    }
}
