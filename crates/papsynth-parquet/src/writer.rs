//! Rows in, a file out.

use std::io::Write;
use std::sync::Arc;

use parquet::basic::Compression;
use parquet::data_type::{BoolType, ByteArrayType, DataType, DoubleType, Int32Type, Int64Type};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties, WriterVersion};
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::SchemaDescriptor;

use crate::error::Error;
use crate::leaf::{Leaf, Values};
use crate::schema::{Column, to_parquet};
use crate::shape::{Node, trees};
use crate::value::Value;

/// A group of rows is written when it has so many bytes in memory, about, or so many rows.
const GROUP_BYTES: usize = 32 << 20;
const GROUP_ROWS: usize = 1 << 16;

/// What the file says that it was written by: the same whatever stands behind it.
const CREATED_BY: &str = concat!("papsynth-parquet version ", env!("CARGO_PKG_VERSION"));

/// Writes a table row by row. Dropped before it is finished, it leaves no Parquet file.
pub struct Writer<W: Write + Send> {
    file: SerializedFileWriter<W>,
    columns: Vec<Column>,
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
    rows: usize,
    bytes: usize,
}

impl<W: Write + Send> std::fmt::Debug for Writer<W> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Writer").field("columns", &self.columns).field("rows", &self.rows).finish_non_exhaustive()
    }
}

impl<W: Write + Send> Writer<W> {
    /// Begins a table with these columns and pairs of a name and a text that the footer keeps.
    ///
    /// # Errors
    /// If there is no column, a struct has no field, or the system refuses.
    pub fn new(out: W, columns: &[Column], metadata: &[(&str, &str)]) -> Result<Self, Error> {
        let root = to_parquet(columns)?;
        let pairs = metadata.iter().map(|&(key, value)| KeyValue::new(key.to_owned(), value.to_owned()));
        let mut properties = WriterProperties::builder()
            .set_writer_version(WriterVersion::PARQUET_1_0)
            .set_created_by(CREATED_BY.to_owned())
            .set_key_value_metadata(Some(pairs.collect()))
            .set_compression(Compression::SNAPPY)
            .set_dictionary_enabled(false)
            .set_statistics_enabled(EnabledStatistics::Chunk)
            .set_offset_index_disabled(true)
            .set_max_row_group_row_count(None);
        let (nodes, leaves) = trees(columns);
        for (column, leaf) in SchemaDescriptor::new(Arc::clone(&root)).columns().iter().zip(&leaves) {
            let path = column.path().clone();
            properties = match leaf.values {
                Values::Text(_) => properties.set_column_dictionary_enabled(path, true),
                Values::Bytes(_) => properties
                    .set_column_compression(path.clone(), Compression::UNCOMPRESSED)
                    .set_column_statistics_enabled(path, EnabledStatistics::None),
                _ => properties,
            };
        }
        let file = SerializedFileWriter::new(out, root, Arc::new(properties.build()))?;
        Ok(Self { file, columns: columns.to_vec(), nodes, leaves, rows: 0, bytes: 0 })
    }

    /// Adds a row: a value for each column.
    ///
    /// # Errors
    /// If the row does not fit the columns (then it is left out), or the system refuses.
    pub fn row(&mut self, row: Vec<Value>) -> Result<(), Error> {
        if row.len() != self.nodes.len() {
            return Error::table(format!("a row of {} values in a table of {} columns", row.len(), self.nodes.len()));
        }
        let Self { nodes, leaves, .. } = self;
        nodes.iter().zip(&row).try_for_each(|(node, value)| node.check(value, leaves))?;
        let sizes = nodes.iter().zip(row).map(|(node, value)| node.shred(value, 0, leaves));
        self.bytes += sizes.sum::<usize>();
        self.rows += 1;
        match self.rows >= GROUP_ROWS || self.bytes >= GROUP_BYTES {
            true => self.flush(),
            false => Ok(()),
        }
    }

    /// Writes the rows that are left, and the footer, and gives back what was written to.
    ///
    /// # Errors
    /// If the system refuses.
    pub fn finish(mut self) -> Result<W, Error> {
        self.flush()?;
        let mut out = self.file.into_inner()?;
        out.flush()?;
        Ok(out)
    }

    fn flush(&mut self) -> Result<(), Error> {
        if self.rows == 0 {
            return Ok(());
        }
        let (_, empty) = trees(&self.columns);
        let leaves = std::mem::replace(&mut self.leaves, empty);
        (self.rows, self.bytes) = (0, 0);
        let mut group = self.file.next_row_group()?;
        for leaf in leaves {
            let Some(mut column) = group.next_column()? else { return Error::table("a table lacks a column") };
            let Leaf { values, definitions, repetitions, .. } = leaf;
            match values {
                Values::Bool(values) => write::<BoolType>(&mut column, &values, &definitions, &repetitions)?,
                Values::U32(values) => write::<Int32Type>(&mut column, &values, &definitions, &repetitions)?,
                Values::I64(values) => write::<Int64Type>(&mut column, &values, &definitions, &repetitions)?,
                Values::F64(values) => write::<DoubleType>(&mut column, &values, &definitions, &repetitions)?,
                Values::Text(values) | Values::Bytes(values) => {
                    write::<ByteArrayType>(&mut column, &values, &definitions, &repetitions)?;
                }
            }
            column.close()?;
        }
        group.close()?;
        Ok(())
    }
}

fn write<T: DataType>(
    column: &mut SerializedColumnWriter<'_>,
    values: &[T::T],
    definitions: &[i16],
    repetitions: &[i16],
) -> Result<(), Error> {
    column.typed::<T>().write_batch(values, Some(definitions), Some(repetitions))?;
    Ok(())
}
