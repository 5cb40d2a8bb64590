//! Columns of a table, and how a Parquet file names them.

use std::sync::Arc;

use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::errors::ParquetError;
use parquet::schema::types::{Type, TypePtr};

/// A column of a table, or a field of a struct.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Column {
    pub(super) name: String,
    pub(super) kind: Kind,
    /// Whether there may be nothing in it.
    pub(super) nullable: bool,
}

/// What stands in a column.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Kind {
    Bool,
    U32,
    I64,
    F64,
    Text,
    /// Bytes, which are not compressed again.
    Bytes,
    /// Any number of values of one kind, any of which may be missing, as Arrow has it.
    List(Box<Kind>),
    /// Fields, at least one.
    Struct(Vec<Column>),
}

impl Kind {
    pub(super) fn list(kind: Self) -> Self {
        Self::List(Box::new(kind))
    }

    /// The kinds of the columns of the file that hold its values.
    pub(super) fn leaves(&self) -> Vec<&Self> {
        match self {
            Self::List(kind) => kind.leaves(),
            Self::Struct(fields) => fields.iter().flat_map(|field| field.kind.leaves()).collect(),
            leaf => vec![leaf],
        }
    }
}

impl Column {
    /// A column in which something stands in every row.
    pub(super) fn new(name: &str, kind: Kind) -> Self {
        Self { name: name.to_owned(), kind, nullable: false }
    }

    /// The same in which there may be nothing.
    pub(super) fn or_null(self) -> Self {
        Self { nullable: true, ..self }
    }

    fn to_parquet(&self) -> Result<TypePtr, ParquetError> {
        node(&self.name, &self.kind, if self.nullable { Repetition::OPTIONAL } else { Repetition::REQUIRED })
    }
}

/// The columns as a file has them.
pub(super) fn to_parquet(columns: &[Column]) -> Result<TypePtr, ParquetError> {
    let fields = columns.iter().map(Column::to_parquet).collect::<Result<_, _>>()?;
    Ok(Arc::new(Type::group_type_builder("schema").with_fields(fields).build()?))
}

fn node(name: &str, kind: &Kind, repetition: Repetition) -> Result<TypePtr, ParquetError> {
    let leaf = |physical, logical: Option<LogicalType>| {
        let leaf = Type::primitive_type_builder(name, physical).with_repetition(repetition);
        leaf.with_logical_type(logical).build()
    };
    let group = |logical: Option<LogicalType>, fields: Vec<TypePtr>| {
        let group = Type::group_type_builder(name).with_repetition(repetition);
        group.with_logical_type(logical).with_fields(fields).build()
    };
    Ok(Arc::new(match kind {
        Kind::Bool => leaf(Physical::BOOLEAN, None)?,
        Kind::U32 => leaf(Physical::INT32, Some(LogicalType::integer(32, false)))?,
        Kind::I64 => leaf(Physical::INT64, None)?,
        Kind::F64 => leaf(Physical::DOUBLE, None)?,
        Kind::Text => leaf(Physical::BYTE_ARRAY, Some(LogicalType::String))?,
        Kind::Bytes => leaf(Physical::BYTE_ARRAY, None)?,
        Kind::List(kind) => {
            let element = node("element", kind, Repetition::OPTIONAL)?;
            let list = Type::group_type_builder("list").with_repetition(Repetition::REPEATED);
            group(Some(LogicalType::List), vec![Arc::new(list.with_fields(vec![element]).build()?)])?
        }
        Kind::Struct(fields) => group(None, fields.iter().map(Column::to_parquet).collect::<Result<_, _>>()?)?,
    }))
}
