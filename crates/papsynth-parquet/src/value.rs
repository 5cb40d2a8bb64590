//! What stands in a cell of a table.

/// A value, or several.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// Nothing, where a column allows that.
    Null,
    /// True or false.
    Bool(bool),
    /// An integer from 0 to 2³² − 1.
    U32(u32),
    /// An integer from −2⁶³ to 2⁶³ − 1.
    I64(i64),
    /// A number of double precision; every bit is kept, also of what is no number.
    F64(f64),
    /// Text.
    Text(String),
    /// Bytes.
    Bytes(Vec<u8>),
    /// Any number of values of one kind.
    List(Vec<Value>),
    /// A value for each field.
    Struct(Vec<Value>),
}

impl Value {
    /// What it is, for messages.
    pub(crate) fn name(&self) -> &'static str {
        match self {
            Self::Null => "nothing",
            Self::Bool(_) => "a boolean",
            Self::U32(_) => "an integer of 32 bits",
            Self::I64(_) => "an integer of 64 bits",
            Self::F64(_) => "a number",
            Self::Text(_) => "text",
            Self::Bytes(_) => "bytes",
            Self::List(_) => "a list",
            Self::Struct(_) => "a struct",
        }
    }
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

from!(bool => Bool, u32 => U32, i64 => I64, f64 => F64, &str => Text, String => Text, Vec<u8> => Bytes, Vec<Value> => List);

impl<T: Into<Self>> From<Option<T>> for Value {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::Null, Into::into)
    }
}
