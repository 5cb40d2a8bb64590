//! A file in, rows out.

use std::borrow::Borrow;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Range;

use bytes::{Buf, Bytes};
use parquet::basic::Compression;
use parquet::errors::ParquetError;
use parquet::file::metadata::{ColumnChunkMetaData, ParquetMetaData, RowGroupMetaData};
use parquet::file::reader::{ChunkReader, FileReader, Length};
use parquet::file::serialized_reader::SerializedFileReader;
use parquet::schema::types::SchemaDescriptor;

use crate::error::Error;
use crate::guard;
use crate::leaf::Leaf;
use crate::pages::{Chunk, decode};
use crate::schema::{Column, from_parquet, to_parquet};
use crate::shape::{Node, trees};
use crate::value::Value;

/// How much is read of a file that nobody vouches for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Largest footer, bytes.
    pub footer_bytes: u64,
    /// Most values of a column in a group of rows.
    pub group_values: u64,
    /// Largest column of a group of rows, bytes as they are stored; what Snappy makes of them is at most 22 times as much.
    pub column_bytes: u64,
    /// Largest row, bytes in memory.
    pub row_bytes: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self { footer_bytes: 1 << 24, group_values: 1 << 24, column_bytes: 1 << 32, row_bytes: 1 << 32 }
    }
}

/// Where the bytes lie.
#[derive(Debug)]
enum Source {
    File(File),
    Memory(Bytes),
}

impl Source {
    fn bytes(&self, from: u64, length: u64) -> Result<Bytes, Error> {
        let length = usize::try_from(length).map_err(|_| Error::Broken("a part of it is too long".to_owned()))?;
        Ok(self.get_bytes(from, length)?)
    }
}

impl Length for Source {
    fn len(&self) -> u64 {
        match self {
            Self::File(file) => Length::len(file),
            Self::Memory(bytes) => bytes.len() as u64,
        }
    }
}

impl ChunkReader for Source {
    type T = Box<dyn Read>;

    fn get_read(&self, start: u64) -> Result<Self::T, ParquetError> {
        match self {
            Self::File(file) => {
                let mut reader = file.try_clone()?;
                reader.seek(SeekFrom::Start(start))?;
                Ok(Box::new(io::BufReader::new(reader)))
            }
            Self::Memory(bytes) => match usize::try_from(start).ok().filter(|start| *start <= bytes.len()) {
                Some(start) => Ok(Box::new(bytes.slice(start..).reader())),
                None => Err(ParquetError::EOF("it ends before a part of it".to_owned())),
            },
        }
    }

    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes, ParquetError> {
        let end = start.checked_add(length as u64).filter(|end| *end <= Length::len(self));
        if end.is_none() {
            return Err(ParquetError::EOF("it ends before a part of it".to_owned()));
        }
        match self {
            Self::File(file) => ChunkReader::get_bytes(file, start, length),
            Self::Memory(bytes) => ChunkReader::get_bytes(bytes, start, length),
        }
    }
}

/// A table whose footer was read.
pub struct Reader {
    file: SerializedFileReader<Source>,
    /// The same bytes, to look at before they are decoded.
    source: Source,
    limits: Limits,
    columns: Vec<Column>,
}

impl std::fmt::Debug for Reader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Reader")
            .field("columns", &self.columns)
            .field("rows", &self.row_count())
            .finish_non_exhaustive()
    }
}

impl Reader {
    /// Opens a file, which nothing may change while it is read.
    ///
    /// # Errors
    /// If it is no Parquet file, has columns of other kinds than are known here, keeps not within the limits, or the system refuses.
    pub fn open(file: File, limits: &Limits) -> Result<Self, Error> {
        Self::new(Source::File(file.try_clone()?), Source::File(file), limits)
    }

    /// The same of a file in memory.
    ///
    /// # Errors
    /// As those of [`open`](Self::open).
    pub fn from_bytes(bytes: impl Into<Vec<u8>>, limits: &Limits) -> Result<Self, Error> {
        let bytes = Bytes::from(bytes.into());
        Self::new(Source::Memory(bytes.clone()), Source::Memory(bytes), limits)
    }

    fn new(source: Source, again: Source, limits: &Limits) -> Result<Self, Error> {
        let length = Length::len(&source);
        let Some(tail) = length.checked_sub(guard::TAIL) else {
            return Error::broken("it is too short for a Parquet file");
        };
        let footer = guard::footer_length(&source.bytes(tail, guard::TAIL)?, length, limits)?;
        guard::footer(&source.bytes(tail - footer, footer)?)?;
        let file = SerializedFileReader::new(again)?;
        let columns = from_parquet(file.metadata().file_metadata().schema())?;
        // The leaves must be those of the columns as they are written here: lists by other names have other paths, and no more.
        let own = SchemaDescriptor::new(to_parquet(&columns)?);
        let found = file.metadata().file_metadata().schema_descr();
        let levels = |schema: &SchemaDescriptor| -> Vec<_> {
            let columns = schema.columns().iter();
            columns.map(|leaf| (leaf.physical_type(), leaf.max_def_level(), leaf.max_rep_level())).collect()
        };
        if levels(&own) != levels(found) {
            return Error::broken("its columns are nested in another way than is read here");
        }
        let reader = Self { file, source, limits: *limits, columns };
        reader.meta().row_groups().iter().try_for_each(|group| reader.check(group))?;
        Ok(reader)
    }

    fn meta(&self) -> &ParquetMetaData {
        self.file.metadata()
    }

    /// Whether what the footer says of a group of rows keeps within the file and the limits.
    fn check(&self, group: &RowGroupMetaData) -> Result<(), Error> {
        let rows = u64::try_from(group.num_rows()).unwrap_or(u64::MAX);
        if group.num_columns() != self.meta().file_metadata().schema_descr().num_columns()
            || rows > self.limits.group_values
        {
            return Error::broken("a group of rows has more rows than are read, or other columns than the table");
        }
        for column in group.columns() {
            let range = Self::range(column)?;
            let values = u64::try_from(column.num_values()).unwrap_or(u64::MAX);
            if range.end > Length::len(&self.source) || range.end - range.start > self.limits.column_bytes {
                return Error::broken("a column is longer than the file, or than is read");
            }
            if values > self.limits.group_values || values < rows {
                return Error::broken("a column has more values than are read, or less than rows");
            }
            if !matches!(column.compression(), Compression::UNCOMPRESSED | Compression::SNAPPY) {
                return Error::broken(format!(
                    "a column is compressed by {}, which is not read here",
                    column.compression()
                ));
            }
        }
        Ok(())
    }

    /// Where a column of a group lies.
    fn range(column: &ColumnChunkMetaData) -> Result<Range<u64>, Error> {
        let from = column.dictionary_page_offset().unwrap_or(column.data_page_offset());
        let (from, length) = (u64::try_from(from), u64::try_from(column.compressed_size()));
        match (from, length) {
            (Ok(from), Ok(length)) if from.checked_add(length).is_some() => Ok(from..from + length),
            _ => Error::broken("a column lies nowhere"),
        }
    }

    /// The columns.
    #[must_use]
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// Number of rows, as the footer says.
    #[must_use]
    pub fn row_count(&self) -> u64 {
        self.meta().row_groups().iter().map(rows_of).sum()
    }

    /// A text that the footer keeps.
    #[must_use]
    pub fn metadata(&self, name: &str) -> Option<&str> {
        let pairs = self.meta().file_metadata().key_value_metadata()?;
        pairs.iter().find(|pair| pair.key == name)?.value.as_deref()
    }

    /// The values of these columns, in this order, in a range of the rows, which ends where the table does. What is not asked for
    /// is not decoded; a group of rows is in memory at a time.
    ///
    /// # Errors
    /// If there is no column of a name.
    pub fn rows(&self, columns: &[&str], range: Range<u64>) -> Result<Rows<&Self>, Error> {
        Rows::new(self, columns, range)
    }

    /// The same of a table that is kept no longer.
    ///
    /// # Errors
    /// As those of [`rows`](Self::rows).
    pub fn into_rows(self, columns: &[&str], range: Range<u64>) -> Result<Rows<Self>, Error> {
        Rows::new(self, columns, range)
    }

    /// The levels and values of a leaf in some rows of a group.
    fn read(&self, number: usize, leaf: &mut Leaf, group: usize, rows: Range<u64>) -> Result<(), Error> {
        let group = self.meta().row_group(group);
        let column = group.column(number);
        if leaf.values.physical() != column.column_type() {
            return Error::broken("a column is of another type than the table says");
        }
        let chunk = Chunk {
            range: Self::range(column)?,
            is_snappy: column.compression() == Compression::SNAPPY,
            values: u64::try_from(column.num_values()).unwrap_or(u64::MAX),
            rows: rows_of(group),
            max_repetition: column.column_descr().max_rep_level(),
        };
        decode(&chunk, leaf, rows, |at, length| self.source.bytes(at, length))
    }
}

fn rows_of(group: &RowGroupMetaData) -> u64 {
    u64::try_from(group.num_rows()).unwrap_or(0)
}

/// The rows of a table, one after the other.
#[derive(Debug)]
pub struct Rows<R> {
    reader: R,
    /// The columns that are wanted.
    places: Vec<usize>,
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
    /// The group that comes next, and the number of its first row.
    group: usize,
    first: u64,
    range: Range<u64>,
    /// Rows of the group in memory that were not taken yet.
    left: usize,
}

impl<R: Borrow<Reader>> Rows<R> {
    fn new(reader: R, columns: &[&str], range: Range<u64>) -> Result<Self, Error> {
        let there = &reader.borrow().columns;
        let place = |name: &&str| match there.iter().position(|column| column.name == **name) {
            Some(place) => Ok(place),
            None => Error::table(format!("the table has no column `{}`", name.escape_default())),
        };
        let places = columns.iter().map(place).collect::<Result<_, _>>()?;
        let (nodes, leaves) = trees(there);
        Ok(Self { reader, places, nodes, leaves, group: 0, first: 0, range, left: 0 })
    }

    /// Decodes the next group that has rows of the range, if there is one.
    fn fill(&mut self) -> Result<bool, Error> {
        while self.left == 0 {
            if self.first >= self.range.end || self.group >= self.reader.borrow().meta().num_row_groups() {
                return Ok(false);
            }
            let (group, from) = (self.group, self.first);
            let to = from.saturating_add(rows_of(self.reader.borrow().meta().row_group(group)));
            (self.group, self.first) = (group + 1, to);
            let rows = from.max(self.range.start)..to.min(self.range.end);
            if rows.is_empty() {
                continue;
            }
            let rows = rows.start - from..rows.end - from;
            (_, self.leaves) = trees(&self.reader.borrow().columns);
            for place in &self.places {
                for number in self.nodes[*place].leaves() {
                    self.reader.borrow().read(number, &mut self.leaves[number], group, rows.clone())?;
                }
            }
            self.left = usize::try_from(rows.end - rows.start).unwrap_or(usize::MAX);
        }
        Ok(true)
    }

    fn row(&mut self) -> Result<Option<Vec<Value>>, Error> {
        if !self.fill()? {
            return Ok(None);
        }
        self.left -= 1;
        let mut room = self.reader.borrow().limits.row_bytes;
        let mut row = Vec::with_capacity(self.places.len());
        for place in &self.places {
            let node = &self.nodes[*place];
            node.is_at(&self.leaves, Some(0))?;
            row.push(node.assemble(&mut self.leaves, &mut room)?);
            if self.left == 0 {
                node.is_at(&self.leaves, None)?;
            }
        }
        Ok(Some(row))
    }
}

impl<R: Borrow<Reader>> Iterator for Rows<R> {
    type Item = Result<Vec<Value>, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        let row = self.row().transpose();
        if let Some(Err(_)) = row {
            // Nothing after a failure.
            (self.left, self.range) = (0, 0..0);
        }
        row
    }
}
