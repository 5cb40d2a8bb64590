//! A column of a file: values, and the levels that say to which row and list each belongs.

use std::ops::Range;

use parquet::basic::Type as Physical;
use parquet::data_type::ByteArray;

use crate::error::Error;
use crate::schema::Kind;
use crate::value::Value;

/// The values of a leaf that are there.
#[derive(Debug)]
pub(crate) enum Values {
    Bool(Vec<bool>),
    U32(Vec<i32>),
    I64(Vec<i64>),
    F64(Vec<f64>),
    Text(Vec<ByteArray>),
    Bytes(Vec<ByteArray>),
}

impl Values {
    fn new(kind: &Kind) -> Self {
        match kind {
            Kind::Bool => Self::Bool(Vec::new()),
            Kind::U32 => Self::U32(Vec::new()),
            Kind::I64 => Self::I64(Vec::new()),
            Kind::F64 => Self::F64(Vec::new()),
            Kind::Text => Self::Text(Vec::new()),
            // Lists and structs are no leaves.
            Kind::Bytes | Kind::List(_) | Kind::Struct(_) => Self::Bytes(Vec::new()),
        }
    }

    /// Adds some of the values of another of the same kind.
    pub(crate) fn extend(&mut self, other: Self, range: Range<usize>) {
        fn part<T>(to: &mut Vec<T>, from: Vec<T>, range: Range<usize>) {
            to.extend(from.into_iter().take(range.end).skip(range.start));
        }
        match (self, other) {
            (Self::Bool(to), Self::Bool(from)) => part(to, from, range),
            (Self::U32(to), Self::U32(from)) => part(to, from, range),
            (Self::I64(to), Self::I64(from)) => part(to, from, range),
            (Self::F64(to), Self::F64(from)) => part(to, from, range),
            (Self::Text(to), Self::Text(from)) | (Self::Bytes(to), Self::Bytes(from)) => part(to, from, range),
            _ => {}
        }
    }

    pub(crate) fn physical(&self) -> Physical {
        match self {
            Self::Bool(_) => Physical::BOOLEAN,
            Self::U32(_) => Physical::INT32,
            Self::I64(_) => Physical::INT64,
            Self::F64(_) => Physical::DOUBLE,
            Self::Text(_) | Self::Bytes(_) => Physical::BYTE_ARRAY,
        }
    }
}

/// A leaf of some rows: taken apart value by value, or put together again from the front.
#[derive(Debug)]
pub(crate) struct Leaf {
    pub(crate) values: Values,
    /// How many of the optional and repeated things on the way to it are there, for each value and each lack of one.
    pub(crate) definitions: Vec<i16>,
    /// At which list it goes on; 0 begins a row.
    pub(crate) repetitions: Vec<i16>,
    /// The definition of a value that is there.
    pub(crate) defined: i16,
    /// Levels and values that were taken from the front.
    taken: [usize; 2],
}

impl Leaf {
    pub(crate) fn new(kind: &Kind, defined: i16) -> Self {
        Self { values: Values::new(kind), definitions: Vec::new(), repetitions: Vec::new(), defined, taken: [0; 2] }
    }

    /// Its values, if it had none.
    pub(crate) fn empty(&self) -> Values {
        match self.values {
            Values::Bool(_) => Values::Bool(Vec::new()),
            Values::U32(_) => Values::U32(Vec::new()),
            Values::I64(_) => Values::I64(Vec::new()),
            Values::F64(_) => Values::F64(Vec::new()),
            Values::Text(_) => Values::Text(Vec::new()),
            Values::Bytes(_) => Values::Bytes(Vec::new()),
        }
    }

    /// Adds a value of the right kind, or the lack of one, and says how many bytes it takes, about.
    pub(crate) fn push(&mut self, value: Value, definition: i16, repetition: i16) -> usize {
        let length = match &value {
            Value::Text(text) => text.len(),
            Value::Bytes(bytes) => bytes.len(),
            _ => 0,
        };
        match (value, &mut self.values) {
            (Value::Bool(value), Values::Bool(values)) => values.push(value),
            // The same bits: the column says that they have no sign.
            (Value::U32(value), Values::U32(values)) => values.push(value.cast_signed()),
            (Value::I64(value), Values::I64(values)) => values.push(value),
            (Value::F64(value), Values::F64(values)) => values.push(value),
            (Value::Text(value), Values::Text(values)) => values.push(value.into_bytes().into()),
            (Value::Bytes(value), Values::Bytes(values)) => values.push(value.into()),
            _ => {}
        }
        self.definitions.push(definition);
        self.repetitions.push(repetition);
        length + size_of::<ByteArray>()
    }

    /// The level that comes next: definition and repetition.
    pub(crate) fn next(&self) -> Option<[i16; 2]> {
        let at = self.taken[0];
        Some([*self.definitions.get(at)?, *self.repetitions.get(at)?])
    }

    /// Takes the lack of a value.
    pub(crate) fn take_lack(&mut self) {
        self.taken[0] += 1;
    }

    /// Takes a value of at most `room` bytes.
    pub(crate) fn take(&mut self, room: &mut usize) -> Result<Value, Error> {
        let at = self.taken[1];
        let mut bytes = |values: &[ByteArray]| -> Result<Vec<u8>, Error> {
            let Some(bytes) = values.get(at) else { return Error::broken("a column has too few values") };
            match room.checked_sub(bytes.len()) {
                Some(left) => *room = left,
                None => return Error::broken("a row has more bytes than are read"),
            }
            Ok(bytes.data().to_vec())
        };
        let value = match &self.values {
            Values::Bool(values) => values.get(at).copied().map(Value::Bool),
            Values::U32(values) => values.get(at).map(|value| Value::U32(value.cast_unsigned())),
            Values::I64(values) => values.get(at).copied().map(Value::I64),
            Values::F64(values) => values.get(at).copied().map(Value::F64),
            Values::Text(values) => match String::from_utf8(bytes(values)?) {
                Ok(text) => Some(Value::Text(text)),
                Err(_) => return Error::broken("text is not UTF-8"),
            },
            Values::Bytes(values) => Some(Value::Bytes(bytes(values)?)),
        };
        self.taken = self.taken.map(|taken| taken + 1);
        value.map_or_else(|| Error::broken("a column has too few values"), Ok)
    }
}
