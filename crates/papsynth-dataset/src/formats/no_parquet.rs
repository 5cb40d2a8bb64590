//! Replaces `parquet` in a build without this feature. Every function returns an error.

use std::convert::Infallible;
use std::io::Write;
use std::marker::PhantomData;
use std::path::Path;

use super::format::Format;
use super::names;
use super::sink::{Files, Sink};
use crate::error::Error;
use crate::truth::{Named, Row, Split};

pub(crate) fn sink(files: &Files) -> Result<Box<dyn Sink>, Error> {
    Err(Format::Huggingface.missing(files.folder.root()))
}

pub(crate) fn images(path: &Path, _: &str) -> Result<Vec<Vec<u8>>, Error> {
    Err(Format::Huggingface.missing(path))
}

pub(crate) fn card(_: &[String], _: &[Split]) -> Result<(String, Vec<u8>), Error> {
    Err(Format::Huggingface.missing(Path::new(names::HUGGINGFACE_CARD)))
}

/// A table that cannot exist.
pub(crate) struct Table<'a>(Infallible, PhantomData<&'a ()>);

impl Table<'_> {
    pub(crate) fn begin(_: impl Write + Send, path: &Path, _: Vec<Named>) -> Result<Self, Error> {
        Err(Error::missing_feature("the table of objects as Parquet", "parquet", path))
    }

    pub(crate) fn row(&mut self, _: &Row) -> Result<(), Error> {
        match self.0 {}
    }

    pub(crate) fn end(self) -> Result<(), Error> {
        match self.0 {}
    }
}
