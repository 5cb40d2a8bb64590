//! A Parquet writer for rows: equal rows give equal bytes, and memory is needed for one row group.

use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::sync::Arc;

use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int32Type, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties, WriterVersion};
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::{SchemaDescriptor, Type, TypePtr};

use crate::error::{Error, InputError};
use crate::truth::{Cell, Head, Kind};

/// Size of a row group: approximate bytes in memory, and rows.
const GROUP_BYTES: usize = 32 << 20;
const GROUP_ROWS: usize = 1 << 16;

/// Size of the write buffer, bytes.
const BUFFER_BYTES: usize = 1 << 18;

/// The writer in the metadata of the file. It does not depend on the version of the Parquet library.
const CREATED_BY: &str = concat!("papsynth-parquet version ", env!("CARGO_PKG_VERSION"));

/// Returns the types of the leaf columns of a type.
fn leaves(kind: Kind) -> Vec<Kind> {
    match kind {
        Kind::List(kind) => leaves(*kind),
        Kind::Struct(fields) => leaves_of(fields).collect(),
        leaf => vec![leaf],
    }
}

fn leaves_of(columns: &[Head]) -> impl Iterator<Item = Kind> {
    columns.iter().flat_map(|column| leaves(column.kind))
}

fn in_file(column: &Head) -> Result<TypePtr, ParquetError> {
    node(column.name, column.kind, if column.nullable { Repetition::OPTIONAL } else { Repetition::REQUIRED })
}

fn node(name: &str, kind: Kind, repetition: Repetition) -> Result<TypePtr, ParquetError> {
    let leaf = |physical, logical: Option<LogicalType>| {
        let leaf = Type::primitive_type_builder(name, physical).with_repetition(repetition);
        leaf.with_logical_type(logical).build()
    };
    let group = |logical: Option<LogicalType>, fields: Vec<TypePtr>| {
        let group = Type::group_type_builder(name).with_repetition(repetition);
        group.with_logical_type(logical).with_fields(fields).build()
    };
    Ok(Arc::new(match kind {
        Kind::Flag => leaf(Physical::BOOLEAN, None)?,
        Kind::Id => leaf(Physical::INT32, Some(LogicalType::integer(32, false)))?,
        Kind::Whole => leaf(Physical::INT64, None)?,
        Kind::Number => leaf(Physical::DOUBLE, None)?,
        Kind::Text => leaf(Physical::BYTE_ARRAY, Some(LogicalType::String))?,
        Kind::Bytes => leaf(Physical::BYTE_ARRAY, None)?,
        Kind::List(kind) => {
            let element = node("element", *kind, Repetition::OPTIONAL)?;
            let list = Type::group_type_builder("list").with_repetition(Repetition::REPEATED);
            group(Some(LogicalType::List), vec![Arc::new(list.with_fields(vec![element]).build()?)])?
        }
        Kind::Struct(fields) => group(None, fields.iter().map(in_file).collect::<Result<_, _>>()?)?,
    }))
}

/// The values of a leaf column that are not null.
enum Values {
    Bool(Vec<bool>),
    U32(Vec<i32>),
    I64(Vec<i64>),
    F64(Vec<f64>),
    Bytes(Vec<ByteArray>),
}

/// A leaf column, with the levels that assign each value to its row and list.
struct Leaf {
    values: Values,
    /// For each value or null: number of optional and repeated ancestors that are defined.
    definitions: Vec<i16>,
    /// For each value or null: the list that continues; 0 starts a row.
    repetitions: Vec<i16>,
}

/// Levels of a value.
#[derive(Clone, Copy, Default)]
struct Level {
    /// Number of optional and repeated ancestors that are defined.
    definition: i16,
    /// Number of lists among the ancestors.
    depth: i16,
    /// The list that continues.
    repetition: i16,
}

impl Leaf {
    fn new(kind: Kind) -> Self {
        let values = match kind {
            Kind::Flag => Values::Bool(Vec::new()),
            Kind::Id => Values::U32(Vec::new()),
            Kind::Whole => Values::I64(Vec::new()),
            Kind::Number => Values::F64(Vec::new()),
            Kind::Text | Kind::Bytes | Kind::List(_) | Kind::Struct(_) => Values::Bytes(Vec::new()),
        };
        Self { values, definitions: Vec::new(), repetitions: Vec::new() }
    }

    /// Adds a value or null. Returns the approximate number of bytes.
    fn push(&mut self, value: Cell, level: Level) -> usize {
        let length = match &value {
            Cell::Text(text) => text.len(),
            Cell::Bytes(bytes) => bytes.len(),
            _ => 0,
        };
        match (value, &mut self.values) {
            (Cell::Nothing, _) => {}
            (Cell::Flag(value), Values::Bool(values)) => values.push(value),
            // Parquet stores unsigned integers as signed ones with the same bits.
            (Cell::Id(value), Values::U32(values)) => values.push(value.cast_signed()),
            // Signed, because some readers do not support unsigned 64-bit integers. Values are small enough.
            (Cell::Whole(value), Values::I64(values)) => values.push(i64::try_from(value).unwrap_or(i64::MAX)),
            (Cell::Number(value), Values::F64(values)) => values.push(value),
            (Cell::Text(value), Values::Bytes(values)) => values.push(value.into_bytes().into()),
            (Cell::Bytes(value), Values::Bytes(values)) => values.push(value.into()),
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

/// Shreds a value into its leaf columns, as Dremel does: Melnik et al., VLDB 3 (2010) 330-339. Returns the approximate
/// number of bytes in memory.
fn shred(kind: Kind, nullable: bool, value: Cell, at: Level, leaves: &mut [Leaf]) -> usize {
    let lack = |level, leaves: &mut [Leaf]| leaves.iter_mut().map(|leaf| leaf.push(Cell::Nothing, level)).sum();
    let there = Level { definition: at.definition + i16::from(nullable), ..at };
    match (value, kind) {
        (Cell::Nothing, _) => lack(at, leaves),
        (Cell::List(values), _) if values.is_empty() => lack(there, leaves),
        (Cell::List(values), Kind::List(kind)) => {
            let first = Level { definition: there.definition + 1, depth: at.depth + 1, ..at };
            let next = Level { repetition: first.depth, ..first };
            let levels = std::iter::once(first).chain(std::iter::repeat(next));
            values.into_iter().zip(levels).map(|(value, level)| shred(*kind, true, value, level, leaves)).sum()
        }
        (Cell::Struct(values), Kind::Struct(fields)) => shred_all(fields, values, there, leaves),
        (value, _) => leaves[0].push(value, there),
    }
}

fn shred_all(columns: &[Head], values: Vec<Cell>, at: Level, mut leaves: &mut [Leaf]) -> usize {
    let mut bytes = 0;
    for (column, value) in columns.iter().zip(values) {
        let (own, others) = leaves.split_at_mut(self::leaves(column.kind).len());
        bytes += shred(column.kind, column.nullable, value, at, own);
        leaves = others;
    }
    bytes
}

/// Writes a table row by row. The file is valid only after [`finish`](Self::finish).
pub(super) struct Writer<'a> {
    file: SerializedFileWriter<BufWriter<Box<dyn Write + Send + 'a>>>,
    columns: Vec<Head>,
    leaves: Vec<Leaf>,
    rows: usize,
    bytes: usize,
}

impl<'a> Writer<'a> {
    /// Begins a table with these columns and key-value metadata.
    pub(super) fn new(
        out: Box<dyn Write + Send + 'a>,
        columns: Vec<Head>,
        metadata: &[(&str, &str)],
    ) -> Result<Self, ParquetError> {
        let fields = columns.iter().map(in_file).collect::<Result<_, _>>()?;
        let root = Arc::new(Type::group_type_builder("schema").with_fields(fields).build()?);
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
        for (column, kind) in SchemaDescriptor::new(Arc::clone(&root)).columns().iter().zip(leaves_of(&columns)) {
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

    pub(super) fn row(&mut self, row: Vec<Cell>) -> Result<(), ParquetError> {
        self.bytes += shred_all(&self.columns, row, Level::default(), &mut self.leaves);
        self.rows += 1;
        if self.rows >= GROUP_ROWS || self.bytes >= GROUP_BYTES { self.flush() } else { Ok(()) }
    }

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

fn empty(columns: &[Head]) -> Vec<Leaf> {
    leaves_of(columns).map(Leaf::new).collect()
}

pub(super) fn failed(action: &'static str, path: &Path) -> impl Fn(ParquetError) -> Error {
    move |error| match error {
        ParquetError::External(inner) => match inner.downcast::<io::Error>() {
            Ok(error) => Error::io(action, path)(*error),
            Err(other) => Error::input(path)(InputError::broken("Parquet", other)),
        },
        other => Error::input(path)(InputError::broken("Parquet", other)),
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;

    use parquet::file::reader::{FileReader, SerializedFileReader};

    use super::*;
    use crate::support::Scratch;

    fn begin(scratch: &Scratch, columns: Vec<Head>) -> Writer<'static> {
        let file = File::create(scratch.join("table.parquet")).unwrap();
        Writer::new(Box::new(file), columns, &[("a", "1")]).unwrap()
    }

    fn reader(scratch: &Scratch) -> SerializedFileReader<File> {
        SerializedFileReader::new(File::open(scratch.join("table.parquet")).unwrap()).unwrap()
    }

    #[test]
    fn nested_rows_are_read_back() {
        const FIELDS: &[Head] = &[
            Head::new("id", Kind::Id).or_null(),
            Head::new("name", Kind::Text),
            Head::new("sides", Kind::List(&Kind::Number)),
        ];
        let columns = vec![
            Head::new("n", Kind::Whole),
            Head::new("flag", Kind::Flag).or_null(),
            Head::new("objects", Kind::List(&Kind::Struct(FIELDS))).or_null(),
        ];
        let object = |id: Cell, sides: &[f64]| Cell::Struct(vec![id, Cell::text("x"), Cell::numbers(sides)]);
        let both = Cell::List(vec![object(Cell::Id(7), &[0.5, 2.0]), object(Cell::Nothing, &[])]);
        let rows = vec![
            vec![Cell::Whole(1), Cell::Flag(true), both],
            vec![Cell::Whole(2), Cell::Nothing, Cell::List(Vec::new())],
            vec![Cell::Whole(3), Cell::Flag(false), Cell::Nothing],
            vec![Cell::Whole(4), Cell::Flag(false), Cell::List(vec![object(Cell::Id(u32::MAX), &[1.0])])],
        ];
        let scratch = Scratch::new("nested-rows");
        let mut writer = begin(&scratch, columns);
        rows.into_iter().for_each(|row| writer.row(row).unwrap());
        writer.finish().unwrap();
        let found =
            reader(&scratch).get_row_iter(None).unwrap().map(|row| row.unwrap().to_string()).collect::<Vec<_>>();
        let expected = [
            "{n: 1, flag: true, objects: [{id: 7, name: \"x\", sides: [0.5, 2.0]}, {id: null, name: \"x\", sides: []}]}",
            "{n: 2, flag: null, objects: []}",
            "{n: 3, flag: false, objects: null}",
            "{n: 4, flag: false, objects: [{id: 4294967295, name: \"x\", sides: [1.0]}]}",
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn memory_is_bounded_by_a_row_group() {
        let scratch = Scratch::new("bounded-rows");
        let mut writer = begin(&scratch, vec![Head::new("data", Kind::Bytes)]);
        for n in 1..=70_u64 {
            writer.row(vec![Cell::Bytes(vec![7_u8; 1 << 20])]).unwrap();
            let written = scratch.join("table.parquet").metadata().unwrap().len();
            assert!(
                (n << 20) <= written + (GROUP_BYTES + BUFFER_BYTES) as u64,
                "{written} bytes written after {n} rows"
            );
        }
        writer.finish().unwrap();
        assert_eq!(reader(&scratch).num_row_groups(), 3);
    }
}
