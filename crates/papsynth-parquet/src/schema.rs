//! Columns, and how a file names them.

use std::sync::Arc;

use parquet::basic::{ConvertedType, LogicalType, Repetition, Type as Physical};
use parquet::schema::types::{Type, TypePtr};

use crate::error::Error;

/// A column of a table, or a field of a struct.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Its name.
    pub name: String,
    /// What stands in it.
    pub kind: Kind,
    /// Whether there may be nothing in it.
    pub nullable: bool,
}

/// What stands in a column.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Kind {
    /// True or false.
    Bool,
    /// Integers from 0 to 2³² − 1.
    U32,
    /// Integers of 64 bits with a sign.
    I64,
    /// Numbers of double precision.
    F64,
    /// Text.
    Text,
    /// Bytes, which are not compressed again.
    Bytes,
    /// Any number of values of one kind, any of which may be missing, as Arrow has it.
    List(Box<Kind>),
    /// Fields, at least one.
    Struct(Vec<Column>),
}

impl Kind {
    /// Lists of a kind.
    #[must_use]
    pub fn list(kind: Self) -> Self {
        Self::List(Box::new(kind))
    }
}

impl Column {
    /// A column in which something stands in every row.
    #[must_use]
    pub fn new(name: &str, kind: Kind) -> Self {
        Self { name: name.to_owned(), kind, nullable: false }
    }

    /// The same in which there may be nothing.
    #[must_use]
    pub fn or_null(self) -> Self {
        Self { nullable: true, ..self }
    }
}

/// Columns within columns; a bound on what a hostile file can ask for.
const MAX_DEPTH: usize = 16;

/// The columns as a file has them.
pub(crate) fn to_parquet(columns: &[Column]) -> Result<TypePtr, Error> {
    if columns.is_empty() {
        return Error::table("a table wants at least one column");
    }
    let fields = columns.iter().map(column_type).collect::<Result<_, _>>()?;
    Ok(Arc::new(Type::group_type_builder("schema").with_fields(fields).build()?))
}

fn column_type(column: &Column) -> Result<TypePtr, Error> {
    node_type(&column.name, &column.kind, if column.nullable { Repetition::OPTIONAL } else { Repetition::REQUIRED })
}

fn node_type(name: &str, kind: &Kind, repetition: Repetition) -> Result<TypePtr, Error> {
    let leaf = |physical, logical: Option<LogicalType>| {
        Type::primitive_type_builder(name, physical)
            .with_repetition(repetition)
            .with_logical_type(logical)
            .build()
            .map_err(Error::from)
    };
    let group = |logical: Option<LogicalType>, fields: Vec<TypePtr>| {
        Type::group_type_builder(name)
            .with_repetition(repetition)
            .with_logical_type(logical)
            .with_fields(fields)
            .build()
            .map_err(Error::from)
    };
    Ok(Arc::new(match kind {
        Kind::Bool => leaf(Physical::BOOLEAN, None)?,
        Kind::U32 => leaf(Physical::INT32, Some(LogicalType::integer(32, false)))?,
        Kind::I64 => leaf(Physical::INT64, None)?,
        Kind::F64 => leaf(Physical::DOUBLE, None)?,
        Kind::Text => leaf(Physical::BYTE_ARRAY, Some(LogicalType::String))?,
        Kind::Bytes => leaf(Physical::BYTE_ARRAY, None)?,
        Kind::List(kind) => {
            let element = node_type("element", kind, Repetition::OPTIONAL)?;
            let list = Type::group_type_builder("list").with_repetition(Repetition::REPEATED);
            group(Some(LogicalType::List), vec![Arc::new(list.with_fields(vec![element]).build()?)])?
        }
        Kind::Struct(fields) if fields.is_empty() => return Error::table(format!("the struct `{name}` has no field")),
        Kind::Struct(fields) => group(None, fields.iter().map(column_type).collect::<Result<_, _>>()?)?,
    }))
}

/// The columns of a file.
pub(crate) fn from_parquet(root: &Type) -> Result<Vec<Column>, Error> {
    root.get_fields().iter().map(|field| column_of(field, 0)).collect()
}

fn column_of(node: &Type, depth: usize) -> Result<Column, Error> {
    let name = node.name().to_owned();
    let unknown = |what: &str| Error::broken(format!("column `{}` {what}", name.escape_default()));
    if depth > MAX_DEPTH {
        return unknown("is nested too deeply");
    }
    let info = node.get_basic_info();
    let nullable = match info.has_repetition().then(|| info.repetition()) {
        Some(Repetition::OPTIONAL) => true,
        Some(Repetition::REQUIRED) => false,
        _ => return unknown("is repeated, but no list"),
    };
    let logical = info.logical_type_ref();
    let converted = info.converted_type();
    let kind = if node.is_group() {
        let is_list = matches!(logical, Some(LogicalType::List)) || converted == ConvertedType::LIST;
        match (is_list, node.get_fields()) {
            (true, [list]) => match list.is_group().then(|| list.get_fields()) {
                Some([element]) if list.get_basic_info().repetition() == Repetition::REPEATED => {
                    let element = column_of(element, depth + 1)?;
                    if !element.nullable {
                        return unknown("is a list in which no value may be missing; such lists are not read here");
                    }
                    Kind::list(element.kind)
                }
                _ => return unknown("is a list of another form than is read here"),
            },
            (true, _) => return unknown("is a list of another form than is read here"),
            (false, []) => return unknown("is a struct without fields"),
            (false, fields) => {
                Kind::Struct(fields.iter().map(|field| column_of(field, depth + 1)).collect::<Result<_, _>>()?)
            }
        }
    } else {
        let is_text = matches!(logical, Some(LogicalType::String)) || converted == ConvertedType::UTF8;
        match (node.get_physical_type(), converted) {
            (Physical::BOOLEAN, _) => Kind::Bool,
            (Physical::INT32, ConvertedType::UINT_32) => Kind::U32,
            (Physical::INT64, ConvertedType::NONE | ConvertedType::INT_64) => Kind::I64,
            (Physical::DOUBLE, _) => Kind::F64,
            (Physical::BYTE_ARRAY, _) if is_text => Kind::Text,
            (Physical::BYTE_ARRAY, ConvertedType::NONE) => Kind::Bytes,
            (physical, _) => return unknown(&format!("is of the type {physical}, which is not read here")),
        }
    };
    Ok(Column { name, kind, nullable })
}
