//! Rows in, a Parquet file out: the same bytes for the same rows, and memory for one group of them.

use std::io::{BufWriter, Write};
use std::sync::Arc;

use parquet::basic::Compression;
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int32Type, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties, WriterVersion};
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::SchemaDescriptor;

use super::schema::{Column, Kind, to_parquet};

/// A group of rows is written when it has so many bytes in memory, about, or so many rows.
const GROUP_BYTES: usize = 32 << 20;
const GROUP_ROWS: usize = 1 << 16;

/// Bytes that are put together before they go to the file.
const BUFFER_BYTES: usize = 1 << 18;

/// What the file says that it was written by: the same whatever stands behind it.
const CREATED_BY: &str = concat!("papsynth-parquet version ", env!("CARGO_PKG_VERSION"));

/// What stands in a cell of a table.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value {
    /// Nothing, where a column allows that.
    Null,
    Bool(bool),
    U32(u32),
    I64(i64),
    F64(f64),
    Text(String),
    Bytes(Vec<u8>),
    List(Vec<Value>),
    /// A value for each field.
    Struct(Vec<Value>),
}

macro_rules! from {
    ($($kind:ty => $variant:ident),*) => {$(
        impl From<$kind> for Value {
            fn from(value: $kind) -> Self {
                Self::$variant(value.into())
            }
        }
    )*};
}

from!(bool => Bool, u32 => U32, f64 => F64, &str => Text, String => Text, Vec<u8> => Bytes);

/// Tables have no unsigned numbers of 64 bits that everybody reads; none of ours is so large.
impl From<u64> for Value {
    fn from(whole: u64) -> Self {
        Self::I64(i64::try_from(whole).unwrap_or(i64::MAX))
    }
}

/// The values of a column of the file that are there.
enum Values {
    Bool(Vec<bool>),
    U32(Vec<i32>),
    I64(Vec<i64>),
    F64(Vec<f64>),
    Bytes(Vec<ByteArray>),
}

/// A column of the file, with the levels that say to which row and list each value belongs.
struct Leaf {
    values: Values,
    /// How many of the optional and repeated things on the way to it are there, for each value and each lack of one.
    definitions: Vec<i16>,
    /// At which list it goes on; 0 begins a row.
    repetitions: Vec<i16>,
}

/// Where a value lies among optional and repeated things.
#[derive(Clone, Copy, Default)]
struct Level {
    /// How many of those above it are there.
    definition: i16,
    /// How many lists there are above it.
    depth: i16,
    /// At which of them it goes on.
    repetition: i16,
}

impl Leaf {
    fn new(kind: &Kind) -> Self {
        let values = match kind {
            Kind::Bool => Values::Bool(Vec::new()),
            Kind::U32 => Values::U32(Vec::new()),
            Kind::I64 => Values::I64(Vec::new()),
            Kind::F64 => Values::F64(Vec::new()),
            Kind::Text | Kind::Bytes | Kind::List(_) | Kind::Struct(_) => Values::Bytes(Vec::new()),
        };
        Self { values, definitions: Vec::new(), repetitions: Vec::new() }
    }

    /// Adds a value, or the lack of one, and says how many bytes it takes, about.
    fn push(&mut self, value: Value, level: Level) -> usize {
        let length = match &value {
            Value::Text(text) => text.len(),
            Value::Bytes(bytes) => bytes.len(),
            _ => 0,
        };
        match (value, &mut self.values) {
            (Value::Null, _) => {}
            (Value::Bool(value), Values::Bool(values)) => values.push(value),
            // The same bits: the column says that they have no sign.
            (Value::U32(value), Values::U32(values)) => values.push(value.cast_signed()),
            (Value::I64(value), Values::I64(values)) => values.push(value),
            (Value::F64(value), Values::F64(values)) => values.push(value),
            (Value::Text(value), Values::Bytes(values)) => values.push(value.into_bytes().into()),
            (Value::Bytes(value), Values::Bytes(values)) => values.push(value.into()),
            (value, _) => unreachable!("{value:?} in a column of another kind"),
        }
        self.definitions.push(level.definition);
        self.repetitions.push(level.repetition);
        length + size_of::<ByteArray>()
    }

    fn write(self, column: &mut SerializedColumnWriter<'_>) -> Result<usize, ParquetError> {
        fn write<T: DataType>(
            column: &mut SerializedColumnWriter<'_>,
            values: &[T::T],
            levels: [&[i16]; 2],
        ) -> Result<usize, ParquetError> {
            column.typed::<T>().write_batch(values, Some(levels[0]), Some(levels[1]))
        }
        let levels = [self.definitions.as_slice(), &self.repetitions];
        match &self.values {
            Values::Bool(values) => write::<BoolType>(column, values, levels),
            Values::U32(values) => write::<Int32Type>(column, values, levels),
            Values::I64(values) => write::<Int64Type>(column, values, levels),
            Values::F64(values) => write::<DoubleType>(column, values, levels),
            Values::Bytes(values) => write::<ByteArrayType>(column, values, levels),
        }
    }
}

/// Takes a value apart into its leaves, as Dremel does: Melnik et al., VLDB 3 (2010) 330-339. Says how many bytes it takes in memory, about.
fn shred(kind: &Kind, nullable: bool, value: Value, at: Level, leaves: &mut [Leaf]) -> usize {
    let lack = |level, leaves: &mut [Leaf]| leaves.iter_mut().map(|leaf| leaf.push(Value::Null, level)).sum();
    let there = Level { definition: at.definition + i16::from(nullable), ..at };
    match (value, kind) {
        (Value::Null, _) => lack(at, leaves),
        (Value::List(values), _) if values.is_empty() => lack(there, leaves),
        (Value::List(values), Kind::List(kind)) => {
            let first = Level { definition: there.definition + 1, depth: at.depth + 1, ..at };
            let next = Level { repetition: first.depth, ..first };
            let levels = std::iter::once(first).chain(std::iter::repeat(next));
            values.into_iter().zip(levels).map(|(value, level)| shred(kind, true, value, level, leaves)).sum()
        }
        (Value::Struct(values), Kind::Struct(fields)) => shred_all(fields, values, there, leaves),
        (value, _) => leaves[0].push(value, there),
    }
}

/// The same of a value for each column.
fn shred_all(columns: &[Column], values: Vec<Value>, at: Level, mut leaves: &mut [Leaf]) -> usize {
    let mut bytes = 0;
    for (column, value) in columns.iter().zip(values) {
        let (own, others) = leaves.split_at_mut(column.kind.leaves().len());
        bytes += shred(&column.kind, column.nullable, value, at, own);
        leaves = others;
    }
    bytes
}

/// Writes a table row by row. Dropped before it is finished, it leaves no Parquet file.
pub(super) struct Writer<'a> {
    file: SerializedFileWriter<BufWriter<Box<dyn Write + Send + 'a>>>,
    columns: Vec<Column>,
    leaves: Vec<Leaf>,
    rows: usize,
    bytes: usize,
}

impl<'a> Writer<'a> {
    /// Begins a table with these columns and pairs of a name and a text that the footer keeps.
    pub(super) fn new(
        out: Box<dyn Write + Send + 'a>,
        columns: Vec<Column>,
        metadata: &[(&str, &str)],
    ) -> Result<Self, ParquetError> {
        let root = to_parquet(&columns)?;
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
        let kinds = columns.iter().flat_map(|column| column.kind.leaves());
        for (column, kind) in SchemaDescriptor::new(Arc::clone(&root)).columns().iter().zip(kinds) {
            let path = column.path().clone();
            properties = match kind {
                Kind::Text => properties.set_column_dictionary_enabled(path, true),
                Kind::Bytes => properties
                    .set_column_compression(path.clone(), Compression::UNCOMPRESSED)
                    .set_column_statistics_enabled(path, EnabledStatistics::None),
                _ => properties,
            };
        }
        let out = BufWriter::with_capacity(BUFFER_BYTES, out);
        let file = SerializedFileWriter::new(out, root, Arc::new(properties.build()))?;
        let leaves = empty(&columns);
        Ok(Self { file, columns, leaves, rows: 0, bytes: 0 })
    }

    /// Adds a row, of a value for each column.
    pub(super) fn row(&mut self, row: Vec<Value>) -> Result<(), ParquetError> {
        self.bytes += shred_all(&self.columns, row, Level::default(), &mut self.leaves);
        self.rows += 1;
        if self.rows >= GROUP_ROWS || self.bytes >= GROUP_BYTES { self.flush() } else { Ok(()) }
    }

    /// Writes the rows that are left, and the footer.
    pub(super) fn finish(mut self) -> Result<(), ParquetError> {
        self.flush()?;
        Ok(self.file.into_inner()?.flush()?)
    }

    fn flush(&mut self) -> Result<(), ParquetError> {
        if self.rows == 0 {
            return Ok(());
        }
        let leaves = std::mem::replace(&mut self.leaves, empty(&self.columns));
        (self.rows, self.bytes) = (0, 0);
        let mut group = self.file.next_row_group()?;
        for leaf in leaves {
            let Some(mut column) = group.next_column()? else { break };
            leaf.write(&mut column)?;
            column.close()?;
        }
        group.close().map(drop)
    }
}

/// The leaves of a table without rows.
fn empty(columns: &[Column]) -> Vec<Leaf> {
    columns.iter().flat_map(|column| column.kind.leaves()).map(Leaf::new).collect()
}

#[cfg(test)]
mod tests {
    use std::fs::File;

    use parquet::file::reader::{FileReader, SerializedFileReader};

    use super::*;
    use crate::support::Scratch;

    fn begin(scratch: &Scratch, columns: Vec<Column>) -> Writer<'static> {
        let file = File::create(scratch.join("table.parquet")).unwrap();
        Writer::new(Box::new(file), columns, &[("a", "1")]).unwrap()
    }

    fn reader(scratch: &Scratch) -> SerializedFileReader<File> {
        SerializedFileReader::new(File::open(scratch.join("table.parquet")).unwrap()).unwrap()
    }

    #[test]
    fn nested_rows_are_read_back_as_they_were_written() {
        let fields = vec![
            Column::new("id", Kind::U32).or_null(),
            Column::new("name", Kind::Text),
            Column::new("sides", Kind::list(Kind::F64)),
        ];
        let columns = vec![
            Column::new("n", Kind::I64),
            Column::new("flag", Kind::Bool).or_null(),
            Column::new("objects", Kind::list(Kind::Struct(fields))).or_null(),
        ];
        let object = |id: Value, sides: &[f64]| {
            Value::Struct(vec![id, "x".into(), Value::List(sides.iter().copied().map(Value::F64).collect())])
        };
        let rows = vec![
            vec![
                Value::I64(1),
                true.into(),
                Value::List(vec![object(7_u32.into(), &[0.5, 2.0]), object(Value::Null, &[])]),
            ],
            vec![Value::I64(-2), Value::Null, Value::List(Vec::new())],
            vec![Value::I64(3), false.into(), Value::Null],
            vec![Value::I64(4), false.into(), Value::List(vec![object(u32::MAX.into(), &[1.0])])],
        ];
        let scratch = Scratch::new("nested-rows");
        let mut writer = begin(&scratch, columns);
        rows.into_iter().for_each(|row| writer.row(row).unwrap());
        writer.finish().unwrap();
        let found =
            reader(&scratch).get_row_iter(None).unwrap().map(|row| row.unwrap().to_string()).collect::<Vec<_>>();
        let expected = [
            "{n: 1, flag: true, objects: [{id: 7, name: \"x\", sides: [0.5, 2.0]}, {id: null, name: \"x\", sides: []}]}",
            "{n: -2, flag: null, objects: []}",
            "{n: 3, flag: false, objects: null}",
            "{n: 4, flag: false, objects: [{id: 4294967295, name: \"x\", sides: [1.0]}]}",
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn memory_is_bounded_by_a_group() {
        let scratch = Scratch::new("bounded-rows");
        let mut writer = begin(&scratch, vec![Column::new("data", Kind::Bytes)]);
        for n in 1..=70_u64 {
            writer.row(vec![vec![7_u8; 1 << 20].into()]).unwrap();
            let written = scratch.join("table.parquet").metadata().unwrap().len();
            assert!(
                (n << 20) <= written + (GROUP_BYTES + BUFFER_BYTES) as u64,
                "{written} bytes are written after {n} rows"
            );
        }
        writer.finish().unwrap();
        assert_eq!(reader(&scratch).num_row_groups(), 3);
    }
}
