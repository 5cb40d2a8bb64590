//! The table of objects: the columns of the CSV with their types, and the masks.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use papsynth::truth::{ObjectTruth, Truth};
use papsynth_parquet::{Column, Kind, Reader, Rows, Value};

use super::{Writer, begin, failed, open};
use crate::error::{Error, Problem};
use crate::files::{Folder, Pending};
use crate::layout;
use crate::merge::Sink;
use crate::rle;
use crate::table::{COLUMNS, Cell, Sort, cells};

/// The columns of the CSV, size of the image, and the complete and the visible mask as COCO's run lengths.
fn columns() -> Vec<Column> {
    let sizes = ["image_width_px", "image_height_px"].map(|name| Column::new(name, Kind::I64));
    let masks = ["rle", "front_rle"].map(|name| Column::new(name, Kind::Text));
    COLUMNS.into_iter().map(|(name, sort, _)| column(name, sort)).chain(sizes).chain(masks).collect()
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
        Cell::Whole(whole) => signed(whole),
        Cell::Number(number) => number.into(),
        Cell::Text(text) => text.into(),
        Cell::Flag(flag) => flag.into(),
        Cell::Numbers(numbers) => Value::List(numbers.into_iter().map(Value::F64).collect()),
    }
}

fn row(truth: &Truth, object: &ObjectTruth, image: u64) -> Vec<Value> {
    let (width, height) = (truth.width, truth.height);
    let sizes = [width, height].map(|side| signed(side as u64));
    let masks = [&object.amodal, &object.front].map(|mask| rle::encode(mask, width, height).into());
    cells(object, image).map(value).chain(sizes).chain(masks).collect()
}

/// Writes a table of such columns.
#[cfg(feature = "zarr")]
pub(crate) fn write_cells<R: Iterator<Item = Cell>>(
    pending: &Pending,
    columns: &[(&'static str, Sort)],
    rows: impl Iterator<Item = R>,
) -> Result<(), Error> {
    let columns: Vec<Column> = columns.iter().map(|&(name, sort)| column(name, sort)).collect();
    let mut writer = begin(pending, &columns, &[])?;
    for row in rows {
        writer.row(row.map(value).collect()).map_err(failed("write", pending.path()))?;
    }
    writer.finish().map(drop).map_err(failed("write", pending.path()))
}

/// Tables have no unsigned numbers of 64 bits that everybody reads; none of ours is so large.
pub(super) fn signed(whole: u64) -> Value {
    Value::I64(i64::try_from(whole).unwrap_or(i64::MAX))
}

/// The table of a shard as it grows.
pub(crate) struct ObjectTable {
    pending: Pending,
    writer: Writer,
}

impl ObjectTable {
    pub(crate) fn begin(pending: Pending) -> Result<Self, Error> {
        let writer = begin(&pending, &columns(), &[])?;
        Ok(Self { pending, writer })
    }

    pub(crate) fn add(&mut self, truth: &Truth, image: u64) -> Result<(), Error> {
        let mut rows = truth.objects.iter().map(|object| row(truth, object, image));
        rows.try_for_each(|row| self.writer.row(row)).map_err(failed("write", self.pending.path()))
    }

    pub(crate) fn end(self) -> Result<Pending, Error> {
        self.writer.finish().map_err(failed("write", self.pending.path()))?;
        Ok(self.pending)
    }
}

/// The tables of these shards in one.
pub(crate) fn merge(folder: &Folder, shards: &[u64], out: &mut Sink) -> Result<(), Error> {
    let mut pieces = Pieces { out, failure: None };
    let merged = write_merged(folder, shards, &mut pieces);
    pieces.failure.map_or(merged, Err)
}

fn write_merged(folder: &Folder, shards: &[u64], pieces: &mut Pieces) -> Result<(), Error> {
    let path = folder.path(layout::OBJECTS);
    let mut writer = papsynth_parquet::Writer::new(pieces, &columns(), &[]).map_err(failed("write", &path))?;
    for &shard in shards {
        let from = folder.inside(&layout::objects(shard))?;
        for row in rows(open(&from)?, &from)? {
            writer.row(row.map_err(failed("read", &from))?).map_err(failed("write", &path))?;
        }
    }
    writer.finish().map(|_| ()).map_err(failed("write", &path))
}

/// Hands on what is written piece by piece, and keeps the first error, of which the writer knows only that there is one.
struct Pieces<'a, 's> {
    out: &'a mut Sink<'s>,
    failure: Option<Error>,
}

impl Write for Pieces<'_, '_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match (self.out)(bytes) {
            Ok(()) => Ok(bytes.len()),
            Err(error) => {
                self.failure.get_or_insert(error);
                Err(io::Error::other("what was written is not taken"))
            }
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn rows(reader: Reader, path: &Path) -> Result<Rows<Reader>, Error> {
    if reader.columns() != columns() {
        let what = "it has other columns than a table of objects".to_owned();
        return Err(Error::input(path)(Problem::Differs { what }));
    }
    let columns = columns();
    let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
    reader.into_rows(&names, 0..u64::MAX).map_err(failed("read", path))
}

/// The table of a shard, read again beside its truth.
pub(crate) struct ObjectRows {
    path: PathBuf,
    rows: Rows<Reader>,
}

impl ObjectRows {
    pub(crate) fn open(path: &Path) -> Result<Self, Error> {
        Ok(Self { path: path.to_owned(), rows: rows(open(path)?, path)? })
    }

    /// The next rows are those of a frame.
    pub(crate) fn check(&mut self, truth: &Truth, image: u64) -> Result<(), Error> {
        truth.objects.iter().try_for_each(|object| match self.next()? {
            Some(found) if found == row(truth, object, image) => Ok(()),
            _ => self.differs(),
        })
    }

    /// No further row follows.
    pub(crate) fn end(mut self) -> Result<(), Error> {
        if self.next()?.is_some() { self.differs() } else { Ok(()) }
    }

    fn next(&mut self) -> Result<Option<Vec<Value>>, Error> {
        self.rows.next().transpose().map_err(failed("read", &self.path))
    }

    fn differs(&self) -> Result<(), Error> {
        let what = "it is not the table of the masks in coco.json".to_owned();
        Err(Error::input(&self.path)(Problem::Differs { what }))
    }
}
