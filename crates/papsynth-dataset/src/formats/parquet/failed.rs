//! Errors of the library.

use std::io;
use std::path::Path;

use parquet::errors::ParquetError;

use crate::error::{Error, Problem};

/// What an error of the library says of a file.
pub(super) fn failed(action: &'static str, path: &Path) -> impl Fn(ParquetError) -> Error {
    move |error| match error {
        ParquetError::External(inner) => match inner.downcast::<io::Error>() {
            Ok(error) => Error::io(action, path)(*error),
            Err(other) => Error::input(path)(Problem::broken("Parquet", other)),
        },
        other => Error::input(path)(Problem::broken("Parquet", other)),
    }
}
