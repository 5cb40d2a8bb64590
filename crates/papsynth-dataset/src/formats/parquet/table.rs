//! Tables of objects: columns with types.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::failed::failed;
use super::schema::{Column, Kind};
use super::writer::{Value, Writer};

use crate::error::Error;
use crate::truth::{Cell, Sort};

/// Writes a table row by row.
pub(crate) struct Table<'a> {
    path: PathBuf,
    writer: Writer<'a>,
}

impl<'a> Table<'a> {
    /// Begins a table with these columns; `path` is named in errors.
    pub(crate) fn begin(
        out: impl Write + Send + 'a,
        path: &Path,
        columns: impl IntoIterator<Item = (&'static str, Sort)>,
    ) -> Result<Self, Error> {
        let columns = columns.into_iter().map(|(name, sort)| column(name, sort)).collect();
        let writer = Writer::new(Box::new(out), columns, &[]).map_err(failed("write", path))?;
        Ok(Self { path: path.to_owned(), writer })
    }

    pub(crate) fn row(&mut self, cells: impl Iterator<Item = Cell>) -> Result<(), Error> {
        self.writer.row(cells.map(value).collect()).map_err(failed("write", &self.path))
    }

    pub(crate) fn end(self) -> Result<(), Error> {
        self.writer.finish().map_err(failed("write", &self.path))
    }
}

/// A column of such cells.
fn column(name: &str, sort: Sort) -> Column {
    let column = |kind| Column::new(name, kind);
    match sort {
        Sort::Id => column(Kind::U32),
        Sort::Whole => column(Kind::I64),
        Sort::WholeOrNone => column(Kind::I64).or_null(),
        Sort::Number => column(Kind::F64),
        Sort::NumberOrNone => column(Kind::F64).or_null(),
        Sort::Text => column(Kind::Text),
        Sort::Flag => column(Kind::Bool),
        Sort::Numbers => column(Kind::list(Kind::F64)),
    }
}

fn value(cell: Cell) -> Value {
    match cell {
        Cell::Nothing => Value::Null,
        Cell::Id(id) => id.into(),
        Cell::Whole(whole) => whole.into(),
        Cell::Number(number) => number.into(),
        Cell::Text(text) => text.into(),
        Cell::Flag(flag) => flag.into(),
        Cell::Numbers(numbers) => Value::List(numbers.into_iter().map(Value::F64).collect()),
    }
}
