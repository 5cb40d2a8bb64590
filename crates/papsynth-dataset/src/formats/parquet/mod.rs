//! Parquet: tables of objects, and the format `huggingface`.

mod features;
mod frames;
mod writer;

use std::io::Write;
use std::path::{Path, PathBuf};

use crate::error::Error;
use crate::truth::{Named, Row};
pub(crate) use frames::{card, images, sink};
use writer::{Writer, failed};

pub(crate) struct Table<'a> {
    path: PathBuf,
    columns: Vec<Named>,
    writer: Writer<'a>,
}

impl<'a> Table<'a> {
    /// Begins a table with these columns. Errors give `path`.
    pub(crate) fn begin(out: impl Write + Send + 'a, path: &Path, columns: Vec<Named>) -> Result<Self, Error> {
        let heads = columns.iter().map(|(head, _)| *head).collect();
        let writer = Writer::new(Box::new(out), heads, &[]).map_err(failed("write", path))?;
        Ok(Self { path: path.to_owned(), columns, writer })
    }

    pub(crate) fn row(&mut self, row: &Row) -> Result<(), Error> {
        let cells = self.columns.iter().map(|(_, cell)| cell(row)).collect();
        self.writer.row(cells).map_err(failed("write", &self.path))
    }

    pub(crate) fn end(self) -> Result<(), Error> {
        self.writer.finish().map_err(failed("write", &self.path))
    }
}
